#include "pipeline/jobs/job.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "formats/base/file_io.h"
#include "formats/base/strict_json.h"
#include "formats/layered/layered_file.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/job_aims.h"
#include "pipeline/jobs/svbrdf_job.h"

namespace patina {
namespace {

using Json = nlohmann::json;

constexpr uint64_t kMaxLod = 31;

std::string Shown(const Json& value) {
  constexpr size_t kLongest = 60;
  std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text;
}

Result<Json> ParseJson(std::string_view text, const std::string& source) {
  constexpr int kDeepest = 16;
  auto json = ParseStrictJson(text, kDeepest);
  if (!json) return Fail(json.error(), source);
  return json;
}

// Walks one object, noting everything that is wrong with it.
class ObjectReader {
 public:
  ObjectReader(const Json& object, std::string pointer, std::vector<std::string>* problems)
      : object_(object), pointer_(std::move(pointer)), problems_(problems) {}

  void Complain(const std::string& key, const std::string& what) {
    problems_->push_back(pointer_ + "/" + EscapePointer(key) + ": " + what);
  }

  // The member, noted as known; null if absent.
  const Json* Find(const std::string& key, bool required = false) {
    known_.insert(key);
    const auto it = object_.find(key);
    if (it != object_.end()) return &*it;
    if (required) Complain(key, "is missing");
    return nullptr;
  }

  void Text(const std::string& key, bool required, size_t longest, std::string* out) {
    const Json* value = Find(key, required);
    if (value == nullptr) return;
    if (!value->is_string()) return Complain(key, "must be a string; is " + Shown(*value));
    const std::string& text = value->get_ref<const std::string&>();
    if (text.empty()) return Complain(key, "must not be empty");
    // The schema counts characters; a limit for bytes would refuse text that the schema accepts.
    const auto characters =
        std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; });
    if (static_cast<size_t>(characters) > longest) {
      return Complain(key, "is longer than " + std::to_string(longest) + " characters");
    }
    if (text.find('\0') != std::string::npos) return Complain(key, "contains a NUL character");
    *out = text;
  }

  void Choice(const std::string& key, std::initializer_list<const char*> choices,
              std::string* out) {
    const Json* value = Find(key);
    if (value == nullptr) return;
    std::string list;
    for (const char* choice : choices) {
      if (*value == choice) {
        *out = choice;
        return;
      }
      list += (list.empty() ? "" : ", ") + std::string(choice);
    }
    Complain(key, "must be one of " + list + "; is " + Shown(*value));
  }

  void Number(const std::string& key, double most, double* out) {
    const Json* value = Find(key);
    if (value == nullptr) return;
    if (!value->is_number()) return Complain(key, "must be a number; is " + Shown(*value));
    const double number = value->get<double>();
    if (!(number >= 0 && number <= most)) {
      return Complain(key, "must be between 0 and " + Shown(Json(most)) + "; is " + Shown(*value));
    }
    *out = number;
  }

  void Integer(const std::string& key, uint64_t least, uint64_t most, uint64_t* out) {
    const Json* value = Find(key);
    if (value == nullptr) return;
    // JSON and its Schema know no difference between 1 and 1.0.
    uint64_t number = 0;
    bool good = false;
    if (value->is_number_unsigned()) {
      number = value->get<uint64_t>();
      good = number >= least && number <= most;
    } else if (value->is_number_integer()) {
      good = least == 0 && value->get<int64_t>() == 0;  // "-0"
    } else if (value->is_number_float()) {
      const double real = value->get<double>();
      good = real >= static_cast<double>(least) && real <= static_cast<double>(most) &&
             real == std::floor(real);
      if (good) number = static_cast<uint64_t>(real);
    }
    if (!good) {
      return Complain(key, "must be a whole number between " + std::to_string(least) + " and " +
                               std::to_string(most) + "; is " + Shown(*value));
    }
    *out = number;
  }

  void Flag(const std::string& key, bool* out) {
    const Json* value = Find(key);
    if (value == nullptr) return;
    if (!value->is_boolean()) return Complain(key, "must be true or false; is " + Shown(*value));
    *out = value->get<bool>();
  }

  void Refuse(const std::string& key, const std::string& why) {
    refused_.insert(key);
    if (object_.contains(key)) Complain(key, why);
  }

  void RefuseUnknown() {
    for (const auto& [key, value] : object_.items()) {
      if (known_.count(key) == 0 && refused_.count(key) == 0)
        Complain(key, "is not a field of this object; fields: " + Known());
    }
  }

 private:
  std::string Known() const {
    std::string list;
    for (const std::string& key : known_) list += (list.empty() ? "" : ", ") + key;
    return list;
  }

  const Json& object_;
  std::string pointer_;
  std::vector<std::string>* problems_;
  std::set<std::string> known_, refused_;
};

std::string Join(const std::string& folder, const std::string& path) {
  if (folder.empty() || path.empty() || path.front() == '/') return path;
  return folder.back() == '/' ? folder + path : folder + "/" + path;
}

std::vector<JobMap> ReadMaps(const Json& list, const std::string& pointer,
                             std::vector<std::string>* problems) {
  std::vector<JobMap> maps;
  if (!list.is_array() || list.empty() || list.size() > kMaxJobMaps) {
    problems->push_back((pointer.empty() ? "/" : pointer) + ": must be an array of 1 to " +
                        std::to_string(kMaxJobMaps) + " maps; is " + Shown(list));
    return maps;
  }
  for (size_t i = 0; i < list.size(); ++i) {
    const std::string here = pointer + "/" + std::to_string(i);
    if (!list[i].is_object()) {
      problems->push_back(here + ": must be an object; is " + Shown(list[i]));
      continue;
    }
    ObjectReader reader(list[i], here, problems);
    JobMap map;
    reader.Text("role", true, 64, &map.role);
    reader.Text("file", true, 4096, &map.file);
    if (const Json* channels = reader.Find("channels")) {
      const std::string text = channels->is_string() ? channels->get<std::string>() : "";
      if (text.empty() || text.size() > 4 || text.find_first_not_of("rgba") != std::string::npos) {
        reader.Complain("channels",
                        "must be 1 to 4 of the letters r, g, b and a; is " + Shown(*channels));
      } else {
        map.channels = text;
      }
    }
    reader.Text("color_space", false, kMaxColorSpaceName, &map.color_space);
    reader.Choice("convention", {"auto", "opengl", "directx"}, &map.convention);
    reader.Flag("invert", &map.invert);
    reader.RefuseUnknown();
    maps.push_back(std::move(map));
  }
  return maps;
}

void ReadInt(ObjectReader* reader, const char* key, int least, int most, std::optional<int>* out) {
  uint64_t value = 0;
  const Json* member = reader->Find(key);
  if (member == nullptr) return;
  reader->Integer(key, static_cast<uint64_t>(least), static_cast<uint64_t>(most), &value);
  *out = static_cast<int>(value);
}

void ReadFlag(ObjectReader* reader, const char* key, std::optional<bool>* out) {
  if (reader->Find(key) == nullptr) return;
  bool value = false;
  reader->Flag(key, &value);
  *out = value;
}

void ReadChoice(ObjectReader* reader, const char* key, std::initializer_list<const char*> choices,
                std::optional<std::string>* out) {
  std::string value;
  reader->Choice(key, choices, &value);
  if (!value.empty()) *out = value;
}

JobModel ReadModel(const Json& object, std::vector<std::string>* problems) {
  JobModel model;
  if (!object.is_object()) {
    problems->push_back("/model: must be an object; is " + Shown(object));
    return model;
  }
  ObjectReader reader(object, "/model", problems);
  ReadInt(&reader, "nside", 1, kMaxJobNside, &model.nside);
  ReadInt(&reader, "primitive_size", 1, kMaxJobPrimitiveSize, &model.primitive_size);
  ReadInt(&reader, "index_bits", 1, kMaxJobIndexBits, &model.index_bits);
  ReadInt(&reader, "hidden", kMinJobHidden, kMaxJobHidden, &model.hidden);
  ReadInt(&reader, "hidden_layers", 1, kMaxJobHiddenLayers, &model.hidden_layers);
  ReadInt(&reader, "textures", 1, kFeatureTextures, &model.textures);
  ReadChoice(&reader, "texture_format", {"bc6h", "fp16"}, &model.texture_format);
  ReadChoice(&reader, "interpolation", {"bilinear", "inverse_distance", "uniform"},
             &model.interpolation);
  ReadFlag(&reader, "angle_inputs", &model.angle_inputs);
  ReadFlag(&reader, "canonical_order", &model.canonical_order);
  ReadChoice(&reader, "index_training", {"clusters", "softmax", "clusters_then_softmax"},
             &model.index_training);
  reader.RefuseUnknown();
  return model;
}

tl::unexpected<Error> FailWithProblems(const std::string& source,
                                       const std::vector<std::string>& problems) {
  std::string message = source + ": " + std::to_string(problems.size()) +
                        (problems.size() == 1 ? " problem" : " problems") +
                        " (see schemas/job.schema.json)";
  for (const std::string& problem : problems) message += "\n  " + problem;
  return Fail(ErrorCode::kInvalidArgument, std::move(message));
}

std::string LastComponent(const std::string& path) {
  const size_t slash = path.find_last_of('/');
  return slash == std::string::npos ? path : path.substr(slash + 1);
}

template <class Enum, class Parse>
void AssignEnum(const std::string& name, Parse parse, Enum* out) {
  if (name.empty()) return;
  if (auto value = parse(name)) *out = *value;
}

// What is baked: a folder, a list of maps, or a material of a scene.
void ReadSceneFields(ObjectReader* reader, Job* job) {
  const bool folder = reader->Find("folder") != nullptr, maps = reader->Find("maps") != nullptr;
  const bool material = reader->Find("material") != nullptr;
  if (reader->Find("scene") == nullptr) {
    if (!folder && !maps)
      reader->Complain("folder", "is missing: give \"folder\", \"maps\" or \"scene\"");
    if (material) reader->Complain("material", "belongs to \"scene\", which is missing");
    return;
  }
  if (!material) reader->Complain("material", "is missing: name the material of the scene");
  if (folder || maps || !job->set.empty()) {
    reader->Complain("scene",
                     "says which maps there are: leave out \"folder\", \"maps\" and \"set\"");
  }
}

void ReadEffects(ObjectReader* reader, std::vector<std::string>* problems, Job* job) {
  if (const Json* effects = reader->Find("effects")) {
    if (!effects->is_object()) {
      reader->Complain("effects", "must be an object; is " + Shown(*effects));
    } else {
      ObjectReader inner(*effects, "/effects", problems);
      for (const char* name : EffectNames()) inner.Flag(name, EffectSwitch(&job->effects, name));
      inner.RefuseUnknown();
    }
  }
  reader->Number("constant_tolerance", 1, &job->effects.constant_tolerance);
  const Json* range = reader->Find("lod_range");
  if (range == nullptr) return;
  const auto mip = [&](size_t i) {
    return range->is_array() && range->size() == 2 && (*range)[i].is_number_unsigned()
               ? (*range)[i].get<uint64_t>()
               : kMaxLod + 1;
  };
  if (mip(0) > kMaxLod || mip(1) > kMaxLod || mip(0) > mip(1)) {
    return reader->Complain("lod_range", "must be two mips, 0 to " + std::to_string(kMaxLod) +
                                             ", the smaller one first; is " + Shown(*range));
  }
  job->lod_range = {static_cast<int>(mip(0)), static_cast<int>(mip(1))};
}

// Which maps a job reads, and how; but for the scene.
void ReadMapFields(ObjectReader* reader, std::vector<std::string>* problems, Job* job) {
  reader->Text("folder", false, 4096, &job->folder);
  reader->Text("set", false, 255, &job->set);
  const Json* maps = reader->Find("maps");
  if (maps != nullptr) job->maps = ReadMaps(*maps, "/maps", problems);
  std::string address;
  reader->Choice("address", {"wrap", "clamp"}, &address);
  reader->Choice("normal_convention", {"auto", "opengl", "directx"}, &job->normal_convention);
  reader->Text("color_space", false, kMaxColorSpaceName, &job->color_space);
  reader->Text("ocio", false, 4096, &job->ocio);
  job->address_given = !address.empty();
  if (address == "clamp") job->address = AddressMode::kClamp;
}

// Maps, or the material of a scene that has them.
void ReadSourceFields(ObjectReader* reader, std::vector<std::string>* problems, Job* job) {
  ReadMapFields(reader, problems, job);
  reader->Text("scene", false, 4096, &job->scene);
  reader->Text("material", false, 255, &job->scene_material);
  ReadSceneFields(reader, job);
}

void ReadMaterialFields(ObjectReader* reader, std::vector<std::string>* problems, Job* job) {
  ReadSourceFields(reader, problems, job);
  std::string profile;
  reader->Choice("profile", {"auto", "bcf-0.5k", "bcf-1k", "bcf-2k", "bcf-2k++"}, &profile);
  reader->Number("target_psnr_db", 100, &job->target_psnr_db);
  reader->Number("target_bpp", 1024, &job->target_bpp);
  reader->Integer("size_budget_bytes", 0, kMaxSizeBudget, &job->size_budget_bytes);
  reader->Number("time_budget_s", 1e6, &job->time_budget_s);
  reader->Number("samples", 1e12, &job->samples);
  reader->Number("min_psnr_db", 100, &job->min_psnr_db);
  reader->Flag("repair_nonfinite", &job->repair_nonfinite);
  reader->Flag("toksvig", &job->toksvig);
  std::string working_space;
  reader->Choice("working_space", {"lin_rec709", "acescg"}, &working_space);
  ReadEffects(reader, problems, job);
  for (const char* key : {"file", "model"})
    reader->Refuse(key, "is a field of jobs of kind \"brdf\"; this job's kind is \"material\"");
  AssignEnum(profile, ParseProfile, &job->profile);
  job->choose_profile = profile == "auto" || (profile.empty() && HasAims(*job));
  AssignEnum(working_space, ParseWorkingSpace, &job->working_space);
}

// A file, or a texture set or a material of a scene in its place.
void ReadSvbrdfInput(ObjectReader* reader, std::vector<std::string>* problems, Job* job) {
  const bool file = reader->Find("file") != nullptr;
  const bool set = reader->Find("folder") != nullptr || reader->Find("maps") != nullptr ||
                   reader->Find("scene") != nullptr;
  if (!file && !set) {
    reader->Complain("file",
                     "is missing: give it, or \"folder\", \"maps\" or \"scene\" of textures");
    return ReadMapFields(reader, problems, job);
  }
  if (!file) return ReadSourceFields(reader, problems, job);
  if (set)
    reader->Complain("file", "says what is read: leave out \"folder\", \"maps\" and \"scene\"");
  for (const char* key : {"set", "material", "address", "normal_convention"})
    reader->Refuse(key, "belongs to a texture set, and this job has a \"file\"; leave it out");
  if (layered::IsLayersFileName(job->file)) {
    reader->Text("color_space", false, kMaxColorSpaceName, &job->color_space);
    reader->Text("ocio", false, 4096, &job->ocio);
    return;
  }
  for (const char* key : {"color_space", "ocio"})
    reader->Refuse(key, "belongs to maps, and this job has none; leave it out");
}

void ReadBrdfFields(ObjectReader* reader, std::vector<std::string>* problems, Job* job) {
  const bool varies = job->kind == JobKind::kSvbrdf;
  reader->Text("file", !varies, 4096, &job->file);
  if (const Json* model = reader->Find("model")) job->model = ReadModel(*model, problems);
  const auto refuse = [&](std::initializer_list<const char*> keys) {
    for (const char* key : keys) {
      reader->Refuse(key, "is a field of jobs of kind \"material\"; this job's kind is \"" +
                              std::string(JobKindName(job->kind)) + "\"");
    }
  };
  refuse({"effects", "constant_tolerance", "lod_range", "profile", "target_psnr_db", "target_bpp",
          "size_budget_bytes", "time_budget_s", "samples", "min_psnr_db", "repair_nonfinite",
          "toksvig", "working_space"});
  if (varies) {
    ReadSvbrdfInput(reader, problems, job);
  } else {
    refuse({"folder", "set", "maps", "scene", "material", "address", "normal_convention",
            "color_space", "ocio"});
  }
  if (!varies && job->model.textures)
    reader->Complain("model", "\"textures\" belongs to jobs of kind \"svbrdf\"; leave it out");
  if (!varies && job->model.texture_format)
    reader->Complain("model", "\"texture_format\" belongs to jobs of kind \"svbrdf\"; leave it out");
  if (varies && job->model.index_training)
    reader->Complain("model", "\"index_training\" belongs to jobs of kind \"brdf\"; leave it out");
}

}  // namespace

const char* JobKindName(JobKind kind) {
  switch (kind) {
    case JobKind::kBrdf:
      return "brdf";
    case JobKind::kSvbrdf:
      return "svbrdf";
    case JobKind::kMaterial:
      break;
  }
  return "material";
}

const char* AddressModeName(AddressMode mode) {
  return mode == AddressMode::kWrap ? "wrap" : "clamp";
}

bool IsAssetName(std::string_view name) {
  if (name.empty() || name.size() > 100 || name[0] == '-' || name[0] == '.') return false;
  return std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  });
}

std::string AssetNameFromPath(const std::string& path) {
  std::string trimmed = std::filesystem::path(path).lexically_normal().string();
  while (trimmed.size() > 1 && trimmed.back() == '/') trimmed.pop_back();
  std::string name = LastComponent(trimmed);
  if (name == "." || name == ".." || name.empty()) {
    std::error_code ignored;
    name = LastComponent(std::filesystem::weakly_canonical(trimmed, ignored).string());
  }
  for (char& c : name) {
    if (!IsAssetName(std::string_view(&c, 1)) && c != '-' && c != '.') c = '_';
  }
  if (name.size() > 100) name.resize(100);
  while (!name.empty() && (name[0] == '-' || name[0] == '.')) name.erase(0, 1);
  return name.empty() ? "asset" : name;
}

std::string FolderOfFile(const std::string& path) {
  const size_t slash = path.find_last_of('/');
  if (slash == std::string::npos) return "";
  return slash == 0 ? "/" : path.substr(0, slash);
}

Result<Job> ParseJob(std::string_view text, const std::string& base_folder,
                     const std::string& source) {
  PATINA_ASSIGN(const Json json, ParseJson(text, source));
  if (!json.is_object()) {
    return Fail(ErrorCode::kInvalidArgument,
                source + ": a job is a JSON object; this is " + Shown(json));
  }
  std::vector<std::string> problems;
  ObjectReader reader(json, "", &problems);
  if (const Json* version = reader.Find("version", true)) {
    if (version->is_number_integer() && version->get<int64_t>() > kJobVersion) {
      return Fail(ErrorCode::kUnsupported,
                  source + ": /version: this program knows jobs up to version " +
                      std::to_string(kJobVersion) + "; this one is version " + Shown(*version) +
                      "; use a newer patina");
    }
    if (*version != kJobVersion) reader.Complain("version", "must be 1; is " + Shown(*version));
  }
  Job job;
  if (const Json* kind = reader.Find("kind", true)) {
    if (*kind == "brdf") {
      job.kind = JobKind::kBrdf;
    } else if (*kind == "svbrdf") {
      job.kind = JobKind::kSvbrdf;
    } else if (*kind != "material") {
      reader.Complain("kind", "must be \"material\", \"brdf\" or \"svbrdf\"; is " + Shown(*kind));
    }
  }
  reader.Text("asset", true, 100, &job.asset);
  if (!job.asset.empty() && !IsAssetName(job.asset)) {
    reader.Complain("asset", "must be made of A-Z a-z 0-9 _ - . and not start with - or '.'; is " +
                                 Shown(Json(job.asset)));
  }
  reader.Text("out", true, 4096, &job.out);
  std::string quality, recipe;
  reader.Choice("quality", {"preview", "standard", "reference"}, &quality);
  reader.Choice("recipe", {"patina", "paper"}, &recipe);
  reader.Integer("seed", 0, kMaxSeed, &job.seed);
  uint64_t threads = 0;
  reader.Integer("threads", 0, kMaxThreads, &threads);
  reader.Flag("report", &job.report);
  if (job.kind != JobKind::kMaterial) {
    ReadBrdfFields(&reader, &problems, &job);
  } else {
    ReadMaterialFields(&reader, &problems, &job);
  }
  reader.RefuseUnknown();
  if (!problems.empty()) return FailWithProblems(source, problems);

  job.threads = static_cast<int>(threads);
  AssignEnum(quality, ParseQuality, &job.quality);
  AssignEnum(recipe, ParseRecipe, &job.recipe);
  job.file = Join(base_folder, job.file);
  job.folder = Join(base_folder, job.folder);
  job.scene = Join(base_folder, job.scene);
  job.out = Join(base_folder, job.out);
  job.ocio = Join(base_folder, job.ocio);
  job.maps_folder = job.folder.empty() ? base_folder : job.folder;
  return job;
}

Result<Job> ReadJobFile(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxJobBytes));
  return ParseJob(text, FolderOfFile(path), path);
}

Result<std::vector<JobMap>> ReadMapListFile(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxJobBytes));
  PATINA_ASSIGN(const Json json, ParseJson(text, path));
  std::vector<std::string> problems;
  std::vector<JobMap> maps = ReadMaps(json, "", &problems);
  if (!problems.empty()) return FailWithProblems(path, problems);
  return maps;
}

}  // namespace patina
