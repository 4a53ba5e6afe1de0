// A corpus of broken containers: every field of the manifest removed, of another type and of
// another value, every region of the payloads flipped, every truncation. What validation cannot
// find stands in a table with the reason, and the table is checked for being true.
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "formats/base/little_endian.h"
#include "formats/base/names.h"
#include "formats/weights.h"
#include "tests/formats/sample_brdf.h"
#include "tests/formats/sample_container.h"
#include "tests/pipeline/validate/memory_files.h"

namespace patina {
namespace {

using nlohmann::ordered_json;
using test::Bytes;
using test::MemoryFiles;
using validate::Finding;
using Pointer = ordered_json::json_pointer;

ordered_json ManifestOf(const MemoryFiles& files) {
  const Bytes& bytes = files.files.at("manifest.json");
  return ordered_json::parse(bytes.begin(), bytes.end());
}

void SetManifest(const ordered_json& manifest, MemoryFiles* files) {
  const std::string text = manifest.dump(2);
  files->files["manifest.json"] = Bytes(text.begin(), text.end());
}

// A material with all that a manifest can hold and validation can cross-check.
MemoryFiles MaterialCorpus() {
  const test::TemporaryDirectory out;
  auto staging = test::StageSample(out.path(), "wall", 7);
  EXPECT_TRUE(staging.has_value()) << test::MessageOf(staging);
  MemoryFiles files(staging->directory());
  ordered_json manifest = ManifestOf(files);
  manifest["effects"] = ordered_json::array();
  for (auto& channel : manifest["channels"]) {
    const std::string component = channel["component"];
    const std::string map = channel["map"];
    if (channel.contains("constant")) channel["range"] = {0.0, 1.0};
    manifest["effects"].push_back({{"what", component.empty() ? map : map + "." + component},
                                   {"state", channel.contains("constant") ? "constant" : "learned"},
                                   {"reason", ""}});
  }
  manifest["quality"]["maps"] = ordered_json::array();
  for (const char* map : {"albedo", "normal", "roughness"}) {
    manifest["quality"]["maps"].push_back(
        {{"map", map}, {"overall", {{"psnr_db", 31.5}}}, {"mips", ordered_json::array()}});
  }
  // What no channel has.
  manifest["source"]["files"][1]["roles"] = {"roughness"};
  SetManifest(manifest, &files);
  return files;
}

MemoryFiles BrdfCorpus(bool shared_codebook) {
  const test::TemporaryDirectory out;
  test::BrdfSampleOptions options;
  options.shared_codebook = shared_codebook;
  auto staging = test::StageBrdfSample(out.path(), "chrome", 3, options);
  EXPECT_TRUE(staging.has_value()) << test::MessageOf(staging);
  MemoryFiles files(staging->directory());
  if (shared_codebook) files.files["shared.hpc"] = *ReadFile(out / "shared.hpc", 1 << 20);
  return files;
}

// A spatially varying BRDF with an uncompressed texture.
MemoryFiles VaryingCorpus() {
  const test::TemporaryDirectory out;
  test::BrdfSampleOptions options;
  options.textures = 2;
  options.halves = true;
  options.with_sampler = false;
  auto staging = test::StageBrdfSample(out.path(), "cloth", 4, options);
  EXPECT_TRUE(staging.has_value()) << test::MessageOf(staging);
  return MemoryFiles(staging->directory());
}

// Size and hash of a payload, as whoever forges a container would set them.
void FixHash(const std::string& name, MemoryFiles* files) {
  ordered_json manifest = ManifestOf(*files);
  for (auto& payload : manifest["payloads"]) {
    if (payload["name"] != name) continue;
    payload["bytes"] = files->files[name].size();
    payload["sha256"] = Sha256Hex(files->files[name]);
  }
  SetManifest(manifest, files);
}

// The checksum within weights, packs (at byte 24) and samplers (at byte 12).
void FixCrc(const std::string& name, Bytes* bytes) {
  const size_t at = name == "sampler.bin" ? 12 : 24;
  if (name == "decoder.weights" || name == "grid.hpx" || name == "sampler.bin") {
    if (bytes->size() < at + 4) return;
    StoreLittle32(bytes->data() + at, 0);
    StoreLittle32(bytes->data() + at, Crc32(*bytes));
  }
}

// Whether the manifest alone, or with its payloads, gives a finding.
bool Found(const MemoryFiles& files) {
  const Bytes& bytes = files.files.at("manifest.json");
  validate::FindingList list;
  validate::CheckManifestText({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, "",
                              &list);
  return !test::NumbersOf(list.findings()).empty() ||
         !test::NumbersOf(test::FindingsOf(files)).empty();
}

TEST(ValidateCorpus, IsValidBeforeItIsBroken) {
  for (const MemoryFiles& files :
       {MaterialCorpus(), BrdfCorpus(false), BrdfCorpus(true), VaryingCorpus()}) {
    for (const Finding& finding : test::FindingsOf(files))
      ADD_FAILURE() << finding.number << " " << finding.pointer << " " << finding.message;
  }
}

// ---- the manifest

struct Mutation {
  std::string pointer;
  std::string kind;  // "removed", "type", "value"
  ordered_json manifest;
};

void Collect(const ordered_json& value, const std::string& pointer,
             std::vector<std::string>* pointers) {
  if (!pointer.empty()) pointers->push_back(pointer);
  if (value.is_object()) {
    for (const auto& [key, child] : value.items()) Collect(child, pointer + "/" + key, pointers);
  } else if (value.is_array()) {
    for (size_t i = 0; i < value.size(); ++i)
      Collect(value[i], pointer + "/" + std::to_string(i), pointers);
  }
}

std::vector<ordered_json> OtherTypes(const ordered_json& value) {
  std::vector<ordered_json> all = {
      "text", 7, 7.5, true, ordered_json::array(), ordered_json::object()};
  std::vector<ordered_json> others;
  for (ordered_json& other : all) {
    const bool both_numbers = other.is_number() && value.is_number();
    if (other.type() != value.type() && !both_numbers) others.push_back(std::move(other));
  }
  if (!value.is_null()) others.push_back(nullptr);
  return others;
}

// For words of closed sets another legal one: harder to find than a word that does not exist.
constexpr const char* kOtherWords[][2] = {
    {"wrap", "clamp"},     {"directx", "opengl"},      {"srgb", "linear"},
    {"linear", "srgb"},    {"uint8", "uint16"},        {"half", "float"},
    {"material", "brdf"},  {"brdf", "material"},       {"tag", "list"},
    {"file", "builtin"},   {"bilinear", "uniform"},    {"lin_rec709", "acescg"},
    {"patina", "paper"},   {"bcf-1k", "bcf-2k"},       {"standard", "preview"},
    {"slope", "budget"},   {"BC6H_UF16", "BC6H_SF16"}, {"features", "preview"},
    {"weights", "report"}, {"constant", "learned"},    {"learned", "derived"}};

std::vector<ordered_json> OtherValues(const ordered_json& value) {
  if (value.is_boolean()) return {!value.get<bool>()};
  for (const auto& [word, other] : kOtherWords) {
    if (value == word) return {other, std::string(word) + "x", ""};
  }
  if (value.is_string()) {
    std::string flipped = value.get<std::string>();
    if (!flipped.empty()) flipped[0] = flipped[0] == '0' ? '1' : flipped[0] == '1' ? '2' : '0';
    return {flipped, value.get<std::string>() + "x", ""};
  }
  if (value.is_number_float()) {
    const double number = value.get<double>();
    return {number + 0.25, -number - 1, 1e300};
  }
  if (value.is_number()) {
    const auto number = value.get<int64_t>();
    return {number == INT64_MAX ? number - 1 : number + 1, -1, 1000000000};
  }
  if (value.is_array() && !value.empty()) {
    ordered_json shorter = value, longer = value;
    shorter.erase(shorter.size() - 1);
    longer.push_back(value[0]);
    return {shorter, longer};
  }
  return {};
}

std::vector<Mutation> Mutations(const ordered_json& manifest) {
  std::vector<std::string> pointers;
  Collect(manifest, "", &pointers);
  std::vector<Mutation> mutations;
  for (const std::string& text : pointers) {
    const Pointer pointer(text);
    ordered_json removed = manifest;
    ordered_json& parent = removed[pointer.parent_pointer()];
    if (parent.is_array()) {
      parent.erase(static_cast<size_t>(std::stoul(pointer.back())));
    } else {
      parent.erase(pointer.back());
    }
    mutations.push_back({text, "removed", std::move(removed)});
    const auto replace = [&](const char* kind, const ordered_json& other) {
      ordered_json changed = manifest;
      changed[pointer] = other;
      mutations.push_back({text, kind, std::move(changed)});
    };
    for (const ordered_json& other : OtherTypes(manifest[pointer])) replace("type", other);
    for (const ordered_json& other : OtherValues(manifest[pointer])) replace("value", other);
  }
  return mutations;
}

// What a change of one field of the manifest may be without being found. A pointer with '*' for any
// index; kinds as above.
struct Undetectable {
  const char* pointer;
  const char* kinds;
  const char* reason;
};

constexpr const char* kFree = "any text is legal, and nothing else holds it";
constexpr const char* kMeasured = "a measured number; --against measures again";
constexpr const char* kAbsent = "may be absent";
constexpr const char* kSource = "of the source, which a container does not hold; --inputs compares";
constexpr const char* kDecoded = "any value in range is a legal decoding; --against finds it";

// The longest list of reasons is the shortest description of what a hash of the manifest would add.
constexpr Undetectable kUndetectable[] = {
    {"/asset", "value", "found where the folder has the asset's name (PAT-1205)"},
    {"/tool/name", "value", kFree},
    {"/tool/version", "value", kFree},
    {"/tool/recipe_version", "value", kFree},
    {"/fingerprint", "value", "a hash of the job, which the container does not hold"},
    {"/seed", "value", kFree},
    {"/source/address", "value", kDecoded},
    {"/source/normal_convention", "value", kSource},
    {"/source/width", "value", "sides that halve to the same textures"},
    {"/source/height", "value", "sides that halve to the same textures"},
    {"/tool/recipe", "value", kFree},
    {"/profile", "value", "only its textures decide"},
    {"/quality_setting", "value", kFree},
    {"/training/stopped_by", "value", kFree},
    {"/source/files", "removed value", kSource},
    {"/source/files/*", "removed", kSource},
    {"/source/files/*/path", "value", kSource},
    {"/source/files/*/roles", "value", kSource},
    {"/source/files/*/roles/*", "removed value", kSource},
    {"/source/files/*/sha256", "value", kSource},
    {"/source/files/*/width", "value", kSource},
    {"/source/files/*/height", "value", kSource},
    {"/source/files/*/channels", "value", kSource},
    {"/source/files/*/type", "value", kSource},
    {"/source/files/*/file_format", "value", kSource},
    {"/source/format", "value", kSource},
    {"/source/cells", "value", kSource},
    {"/source/invalid_cells", "value", kSource},
    {"/channels/*/component", "value", "a map may have any components"},
    {"/channels/*/encoding", "value", kDecoded},
    {"/channels/*/scale", "removed value", kDecoded},
    {"/channels/*/range/*", "value", kDecoded},
    {"/channels/*/constant", "value", kDecoded},
    {"/maps/*/file", "value", kSource},
    {"/source/images/count", "value", kSource},
    {"/source/images/address", "value", "either mode decodes"},
    {"/source/images/sha256", "value", kSource},
    {"/maps/*/type", "value", kSource},
    {"/maps/*/file_channels", "value", kSource},
    {"/maps/*/file_channels/*", "removed value", kSource},
    {"/maps/*/inverted", "value", kSource},
    {"/maps/*/transfer", "value", kSource},
    {"/maps/*/color_space", "value", kSource},
    {"/maps/*/color_rule", "value", kSource},
    {"/color/config", "removed", kAbsent},
    {"/color/config/source", "value", kSource},
    {"/color/config/file", "removed value", kSource},
    {"/color/config/sha256", "value", kSource},
    {"/quality/psnr_db/overall", "type value", kMeasured},
    {"/quality/psnr_db/mip0", "type value", kMeasured},
    {"/quality/psnr_db/mean_mips", "type value", kMeasured},
    {"/quality/ssim", "removed value", kMeasured},
    {"/quality/flip", "removed value", kMeasured},
    {"/quality/maps/*/overall/psnr_db", "removed type value", kMeasured},
    {"/quality/gate", "removed", "gates are optional (PAT-6002 is a note)"},
    {"/quality/gate/min_psnr_db", "value", "any gate below the quality is met"},
    {"/quality/image_mae", "removed value", kMeasured},
    {"/quality/image_rmse", "removed value", kMeasured},
    {"/quality/image_ssim", "removed value", kMeasured},
    {"/quality/log1p_mse", "removed value", kMeasured},
    {"/quality/reciprocity_error", "removed value", kMeasured},
    {"/quality/albedo", "value", kMeasured},
    {"/quality/albedo/*", "removed", kMeasured},
    {"/quality/albedo/*/theta_deg", "value", kMeasured},
    {"/quality/albedo/*/rgb/*", "value", kMeasured},
    {"/training/samples", "value", kFree},
    {"/training/float_psnr_db/mip0", "type value", kMeasured},
    {"/training/float_psnr_db/mean_mips", "type value", kMeasured},
    {"/training/rollbacks", "value", kFree},
    {"/training/choice", "removed", kAbsent},
    {"/training/choice/candidates", "value", kMeasured},
    {"/training/choice/candidates/*", "removed", kMeasured},
    {"/training/choice/candidates/*/bytes", "value", kMeasured},
    {"/training/choice/candidates/*/given_up", "removed", kAbsent},
    {"/training/choice/candidates/*/given_up", "value", kMeasured},
    {"/training/choice/candidates/*/profile", "value", kFree},
    {"/training/choice/candidates/*/reached_psnr_db", "removed", kAbsent},
    {"/training/choice/candidates/*/reached_psnr_db", "value", kMeasured},
    {"/training/choice/in_reach", "value", kMeasured},
    {"/training/choice/met", "value", kMeasured},
    {"/training/choice/most_bytes", "removed", kAbsent},
    {"/training/choice/most_bytes", "value", kFree},
    {"/training/choice/reason", "value", kFree},
    {"/training/choice/target_psnr_db", "removed", kAbsent},
    {"/training/choice/target_psnr_db", "value", kFree},
    {"/training/curve/*/psnr_maps_db", "removed", kAbsent},
    {"/training/curve/*/psnr_maps_db/albedo", "removed type value", kMeasured},
    {"/training/curve/*/psnr_maps_db/normal", "removed type value", kMeasured},
    {"/training/curve", "value", kMeasured},
    {"/training/curve/*", "removed", kMeasured},
    {"/training/curve/*/samples", "value", kMeasured},
    {"/training/curve/*/psnr_mip0_db", "type value", kMeasured},
    {"/training/curve/*/psnr_mean_mips_db", "type value", kMeasured},
    {"/effects", "removed value", "older containers have none, and an effect may stand twice"},
    {"/effects/*/reason", "value", kFree},
    {"/warnings", "value", kFree},
    {"/warnings/*", "removed value", kFree},
};

bool Matches(const std::string& pattern, const std::string& pointer) {
  std::string with_stars;
  for (size_t begin = 1; begin <= pointer.size();) {
    const size_t end = std::min(pointer.find('/', begin), pointer.size());
    const std::string part = pointer.substr(begin, end - begin);
    const bool index = part.find_first_not_of("0123456789") == std::string::npos;
    with_stars += "/" + (index ? std::string("*") : part);
    begin = end + 1;
  }
  return with_stars == pattern;
}

const Undetectable* Explained(const Mutation& mutation) {
  for (const Undetectable& entry : kUndetectable) {
    if (Matches(entry.pointer, mutation.pointer) &&
        std::string(entry.kinds).find(mutation.kind) != std::string::npos)
      return &entry;
  }
  return nullptr;
}

TEST(ValidateCorpus, EveryChangeOfOneFieldIsFoundOrExplained) {
  size_t total = 0, found = 0;
  std::set<const Undetectable*> needed;
  for (MemoryFiles files :
       {MaterialCorpus(), BrdfCorpus(false), BrdfCorpus(true), VaryingCorpus()}) {
    const ordered_json manifest = ManifestOf(files);
    for (const Mutation& mutation : Mutations(manifest)) {
      if (mutation.manifest == manifest) continue;
      ++total;
      SetManifest(mutation.manifest, &files);
      if (Found(files)) {
        ++found;
        continue;
      }
      const Undetectable* reason = Explained(mutation);
      EXPECT_NE(reason, nullptr) << mutation.pointer << " " << mutation.kind << ": "
                                 << mutation.manifest.contains(Pointer(mutation.pointer));
      needed.insert(reason);
    }
  }
  // A row that explains nothing is not true any more.
  for (const Undetectable& entry : kUndetectable)
    EXPECT_EQ(needed.count(&entry), 1u) << entry.pointer << " is always found; remove its row";
  RecordProperty("mutations", static_cast<int>(total));
  RecordProperty("found", static_cast<int>(found));
  EXPECT_GT(total, 1500u);
  EXPECT_GT(found * 10, total * 8);
}

TEST(ValidateCorpus, ARepeatedKeyIsFound) {
  MemoryFiles files = MaterialCorpus();
  Bytes& bytes = files.files["manifest.json"];
  const std::string extra = "\"seed\": 1,";
  bytes.insert(bytes.begin() + 1, extra.begin(), extra.end());
  EXPECT_EQ(test::NumbersOf(test::FindingsOf(files)), std::vector<int>{1008});
}

// ---- payloads

// Bytes of a payload that any value is legal for, so that a flip with all checksums set right is
// another legal payload.
bool IsFree(const std::string& name, const Bytes& bytes, size_t at) {
  if (name == "report.json") return true;                 // for people
  if (name.rfind("features_", 0) == 0) {
    // Other blocks, but for reserved modes; other halves, but for alpha.
    return at >= 148 && (LoadLittle32(&bytes[128]) != 10 || (at - 148) % 8 < 6);
  }
  if (name == "decoder.weights") return at >= 64 + 64 * LoadLittle32(&bytes[12]);
  if (name == "grid.hpx") return at >= 64;  // codebook and indices, but not all of them
  return name == "sampler.bin" && (at >= 32 || at == 22);  // 22: one of two meanings of an angle
}

// What the structure of one payload gives away, its size and SHA-256 being right.
class StructureCheck {
 public:
  explicit StructureCheck(const MemoryFiles& files) : files_(files) {
    const Bytes& bytes = files.files.at("manifest.json");
    const auto manifest =
        ParseManifest({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    EXPECT_TRUE(manifest.has_value()) << test::MessageOf(manifest);
    manifest_ = *manifest;
  }
  const std::vector<ManifestPayload>& payloads() const { return manifest_.payloads; }
  bool Finds(const ManifestPayload& payload, const Bytes& bytes) const {
    validate::FindingList list;
    validate::CheckPayloadBytes(manifest_, payload, bytes, files_, payload.name, &list);
    return !test::NumbersOf(list.findings()).empty();
  }

 private:
  const MemoryFiles& files_;
  Manifest manifest_;
};

TEST(ValidateCorpus, EveryFlippedByteIsFoundByItsHash) {
  for (const MemoryFiles& files : {MaterialCorpus(), BrdfCorpus(true), VaryingCorpus()}) {
    for (const auto& [name, bytes] : files.files) {
      if (name == "manifest.json" || name == "run.json") continue;
      const size_t stride = std::max<size_t>(1, bytes.size() / 25);
      for (size_t at = 0; at < bytes.size(); at += stride) {
        MemoryFiles broken = files;
        broken.files[name][at] ^= 0x55;
        const auto numbers = test::NumbersOf(test::FindingsOf(broken));
        const int wanted = name == "shared.hpc" ? 1108 : 1103;
        EXPECT_NE(std::count(numbers.begin(), numbers.end(), wanted), 0) << name << " " << at;
      }
    }
  }
}

TEST(ValidateCorpus, FlippedBytesOfStructureAreFoundWithoutHashes) {
  for (const MemoryFiles& files : {MaterialCorpus(), BrdfCorpus(false), VaryingCorpus()}) {
    const StructureCheck check(files);
    for (const ManifestPayload& payload : check.payloads()) {
      const Bytes& bytes = files.files.at(payload.name);
      EXPECT_FALSE(check.Finds(payload, bytes)) << payload.name;
      for (size_t at = 0; at < bytes.size(); ++at) {
        if (IsFree(payload.name, bytes, at)) continue;
        const bool crc = payload.name == "sampler.bin" ? at / 4 == 3 : at / 4 == 6;
        for (const uint8_t flip : std::initializer_list<uint8_t>{0x01, 0x80, 0xFF}) {
          Bytes broken = bytes;
          broken[at] ^= flip;
          if (!crc) FixCrc(payload.name, &broken);
          EXPECT_TRUE(check.Finds(payload, broken))
              << payload.name << " byte " << at << " ^ " << int{flip};
        }
      }
    }
  }
}

TEST(ValidateCorpus, EveryTruncationIsFound) {
  for (const MemoryFiles& files : {MaterialCorpus(), BrdfCorpus(false), VaryingCorpus()}) {
    const StructureCheck check(files);
    for (const ManifestPayload& payload : check.payloads()) {
      const Bytes& bytes = files.files.at(payload.name);
      for (size_t size = 0; size < bytes.size(); ++size) {
        Bytes broken(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
        FixCrc(payload.name, &broken);
        // By structure alone at every length; by its size at some.
        if (payload.role != "report") {
          EXPECT_TRUE(check.Finds(payload, broken)) << payload.name << " of " << size << " bytes";
        }
        if (size % 97 != 0) continue;
        MemoryFiles cut = files;
        cut.files[payload.name] = std::move(broken);
        const auto numbers = test::NumbersOf(test::FindingsOf(cut));
        EXPECT_NE(std::count(numbers.begin(), numbers.end(), 1102), 0)
            << payload.name << " of " << size << " bytes";
      }
    }
  }
}

// One change with all checksums set right, and the code that must come of it.
struct Forgery {
  const char* name;
  const char* file;
  int number;
  std::function<void(Bytes*)> change;
};

TEST(ValidateCorpus, ForgedPayloadsGetTheirOwnCodes) {
  const auto put32 = [](size_t at, uint32_t value) {
    return [=](Bytes* bytes) { StoreLittle32(bytes->data() + at, value); };
  };
  const auto put16 = [](size_t at, uint16_t value) {
    return [=](Bytes* bytes) {
      (*bytes)[at] = static_cast<uint8_t>(value);
      (*bytes)[at + 1] = static_cast<uint8_t>(value >> 8);
    };
  };
  const Forgery forgeries[] = {
      {"magic", "features_0.dds", 2001, put32(0, 1)},
      {"width 0", "features_0.dds", 2002, put32(16, 0)},
      {"DXGI format", "features_0.dds", 2003, put32(128, 98)},
      {"longer", "features_0.dds", 2005, [](Bytes* bytes) { bytes->resize(bytes->size() + 16); }},
      {"signed", "features_0.dds", 2006, put32(128, 96)},
      {"pitch", "features_0.dds", 2007, put32(20, 1)},
      {"reserved mode", "features_0.dds", 2101, [](Bytes* bytes) { (*bytes)[148 + 16] = 0x17; }},
      {"reserved last block", "features_3.dds", 2101,
       [](Bytes* bytes) { (*bytes)[bytes->size() - 16] = 0x1F; }},
      {"magic", "decoder.weights", 3001, put32(0, 1)},
      {"no tensors", "decoder.weights", 3002, put32(12, 0)},
      {"version", "decoder.weights", 3003, put32(8, 2)},
      {"name", "decoder.weights", 3007, put32(64, 0x20202020)},
      {"not finite", "decoder.weights", 3008, put16(64 + 4 * 64 + 2, 0x7C00)},
      {"shape", "decoder.weights", 3009, put32(64 + 64 * 0, 0x30303030)},
      {"reserved", "decoder.weights", 3010, put32(40, 1)},
  };
  const auto expect_code = [](MemoryFiles files, const Forgery& forgery) {
    Bytes& bytes = files.files[forgery.file];
    forgery.change(&bytes);
    FixCrc(forgery.file, &bytes);
    FixHash(forgery.file, &files);
    const auto numbers = test::NumbersOf(test::FindingsOf(files));
    EXPECT_NE(std::count(numbers.begin(), numbers.end(), forgery.number), 0)
        << forgery.file << " " << forgery.name << ": " << (numbers.empty() ? 0 : numbers.front());
  };
  const MemoryFiles material = MaterialCorpus();
  for (const Forgery& forgery : forgeries) expect_code(material, forgery);
  const Forgery brdf_forgeries[] = {
      {"magic", "grid.hpx", 4001, put32(0, 1)},
      {"Nside 0", "grid.hpx", 4002, put16(28, 0)},
      {"version", "grid.hpx", 4003, put32(8, 2)},
      {"longer", "grid.hpx", 4005, [](Bytes* bytes) { bytes->push_back(0); }},
      {"stored corners", "grid.hpx", 4007, put32(40, 1)},
      {"not finite", "grid.hpx", 4010, put16(64, 0x7E00)},
      {"flags", "grid.hpx", 4012, put32(12, 5)},
      {"magic", "sampler.bin", 4101, put32(0, 1)},
      {"no bins", "sampler.bin", 4102, put16(16, 0)},
      {"version", "sampler.bin", 4103, put32(8, 2)},
      {"longer", "sampler.bin", 4105, [](Bytes* bytes) { bytes->push_back(0); }},
      {"empty bin", "sampler.bin", 4107,
       [](Bytes* bytes) { std::fill(bytes->begin() + 36, bytes->end(), uint8_t{0}); }},
  };
  const MemoryFiles brdf = BrdfCorpus(false);
  for (const Forgery& forgery : brdf_forgeries) expect_code(brdf, forgery);
  const Forgery halves_forgeries[] = {
      {"magic", "features_0.dds", 2001, put32(0, 1)},
      {"width 0", "features_0.dds", 2002, put32(16, 0)},
      {"DXGI format", "features_0.dds", 2003, put32(128, 11)},
      {"as blocks", "features_0.dds", 2005, put32(128, 95)},
      {"longer", "features_0.dds", 2005, [](Bytes* bytes) { bytes->resize(bytes->size() + 8); }},
      {"as linear size", "features_0.dds", 2007, put32(8, 0x000A1007)},
      {"alpha", "features_1.dds", 2007, put16(148 + 8 + 6, 0)},
      {"infinity", "features_0.dds", 2103, put16(148 + 2, 0x7C00)},
      {"minus infinity", "features_1.dds", 2103, put16(148 + 8 * 9, 0xFC00)},
      {"not a number, last texel", "features_1.dds", 2103,
       [](Bytes* bytes) { (*bytes)[bytes->size() - 3] = 0x7E; }},
  };
  const MemoryFiles varying = VaryingCorpus();
  for (const Forgery& forgery : halves_forgeries) expect_code(varying, forgery);
  // What blocks must not be taken for.
  ordered_json manifest = ManifestOf(varying);
  manifest["features"][1]["format"] = "BC6H_UF16";
  MemoryFiles other = varying;
  SetManifest(manifest, &other);
  EXPECT_EQ(test::NumbersOf(test::FindingsOf(other)), std::vector<int>{2006});
}

TEST(ValidateCorpus, NamesTheFirstTexelThatIsNotFiniteAndCountsTheOthers) {
  MemoryFiles files = VaryingCorpus();
  Bytes& bytes = files.files["features_0.dds"];
  for (const size_t texel : {13 * 2 + 5, 13 * 9 + 1}) {  // (5, 2) of level 0, (1, 0) of level 1
    bytes[148 + 8 * texel] = 1;
    bytes[148 + 8 * texel + 1] = 0xFE;
  }
  FixHash("features_0.dds", &files);
  const std::vector<Finding> findings = test::FindingsOf(files);
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(findings[0].number, 2103);
  EXPECT_EQ(findings[0].offset, 148u + 8 * (13 * 2 + 5));
  EXPECT_EQ(findings[0].message,
            "texel (5, 2) of level 0 is infinite or not a number, and 1 more");
}

TEST(ValidateCorpus, MissingAndForeignFilesAreFound) {
  const MemoryFiles whole = MaterialCorpus();
  for (const auto& [name, bytes] : whole.files) {
    MemoryFiles files = whole;
    files.files.erase(name);
    const auto numbers = test::NumbersOf(test::FindingsOf(files));
    if (name == "run.json") {
      EXPECT_TRUE(numbers.empty());
    } else {
      EXPECT_EQ(numbers, std::vector<int>{name == "manifest.json" ? 1001 : 1101}) << name;
    }
  }
  MemoryFiles files = whole;
  files.files["notes.txt"] = {};
  EXPECT_EQ(test::NumbersOf(test::FindingsOf(files)), std::vector<int>{1104});
  MemoryFiles brdf = BrdfCorpus(true);
  brdf.files.erase("shared.hpc");
  EXPECT_EQ(test::NumbersOf(test::FindingsOf(brdf)), (std::vector<int>{1107, 4009}));
}

}  // namespace
}  // namespace patina
