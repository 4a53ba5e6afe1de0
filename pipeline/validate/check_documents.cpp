#include "pipeline/validate/check_documents.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/base/strict_json.h"
#include "formats/container.h"
#include "formats/manifest_json.h"
#include "formats/scene/scene.h"
#include "formats/scene/scene_json.h"
#include "formats/schema_check.h"
#include "pipeline/jobs/job.h"
#include "pipeline/validate/container_files.h"

namespace patina::validate {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr uint64_t kMaxDocumentBytes = uint64_t{32} << 20;
constexpr int kDeepestDocument = 64;
constexpr uint64_t kMaxShaderFileBytes = uint64_t{256} << 20;

std::string Without(std::string text, const std::string& part, const std::string& in_its_place) {
  for (size_t at = 0; !part.empty() && (at = text.find(part, at)) != std::string::npos;
       at += in_its_place.size()) {
    text.replace(at, part.size(), in_its_place);
  }
  return text;
}

// The text and the JSON of a document; findings if there is none.
std::optional<json> ReadDocument(const std::string& path, const std::string& label,
                                 std::string* text, FindingList* findings) {
  const auto bytes = ReadFileAs(path, label, kMaxDocumentBytes);
  if (!bytes) {
    findings->AddUnreadable(label, bytes.error());
    return std::nullopt;
  }
  text->assign(bytes->begin(), bytes->end());
  auto document = ParseStrictJson(*text, kDeepestDocument);
  if (!document) {
    findings->AddError(5001, label, document.error());
    return std::nullopt;
  }
  return std::move(*document);
}

bool CheckSchema(int number, const char* schema, const json& document, const std::string& label,
                 FindingList* findings) {
  const auto problems = FindSchemaProblems(schema, document);
  if (!problems) {
    findings->AddError(number, label, problems.error());
    return false;
  }
  for (const SchemaFinding& problem : *problems)
    findings->Add(number, label, {problem.pointer, {}}, problem.message);
  return problems->empty();
}

// A job's reader lists what is wrong, one line each.
void AddJobProblems(const Error& error, const std::string& label, FindingList* findings) {
  if (error.code == ErrorCode::kUnsupported) {
    findings->AddError(5003, label, {error.code, Without(error.message, label + ": ", "")});
    return;
  }
  size_t begin = error.message.find("\n  ");
  if (begin == std::string::npos) {
    findings->AddError(5002, label, {error.code, Without(error.message, label + ": ", "")});
    return;
  }
  while (begin != std::string::npos) {
    begin += 3;
    const size_t end = error.message.find("\n  ", begin);
    findings->AddError(5002, label, {error.code, error.message.substr(begin, end - begin)});
    begin = end;
  }
}

void CheckJob(const std::string& path, const std::string& label, FindingList* findings) {
  std::string text;
  if (!ReadDocument(path, label, &text, findings)) return;
  const auto job = ParseJob(text, FolderOfFile(path), label);
  if (!job) {
    AddJobProblems(job.error(), label, findings);
    return;
  }
  const auto wants = [&](const std::string& input, const std::string& pointer) {
    std::error_code ignored;
    if (input.empty() || fs::exists(input, ignored)) return;
    findings->Add(5004, label, {pointer, {}},
                  QuoteForMessage(fs::path(input).filename().string()) + " is not there");
  };
  wants(job->folder, "/folder");
  wants(job->file, "/file");
  wants(job->scene, "/scene");
  wants(job->ocio, "/ocio");
  for (size_t i = 0; i < job->maps.size(); ++i) {
    const fs::path file = job->maps[i].file;
    wants(file.is_absolute() ? file.string() : (fs::path(job->maps_folder) / file).string(),
          "/maps/" + std::to_string(i) + "/file");
  }
}

void CheckScene(const std::string& path, const std::string& label, FindingList* findings) {
  const bool ours = path.size() > 5 && path.compare(path.size() - 5, 5, ".json") == 0;
  if (ours) {
    std::string text;
    const auto document = ReadDocument(path, label, &text, findings);
    if (!document || !CheckSchema(5202, "scene", *document, label, findings)) return;
  }
  const auto scene = ReadScene(path);
  const auto relabel = [&](const Error& error) {
    const std::string name = fs::path(path).filename().string();
    std::string message = Without(error.message, path + ": ", "");
    message = Without(std::move(message), fs::path(path).parent_path().string() + "/", "");
    return Error{error.code, Without(std::move(message), name + ": ", "")};
  };
  if (!scene) {
    const ErrorCode code = scene.error().code;
    if (code == ErrorCode::kNotFound || code == ErrorCode::kIo) {
      findings->AddUnreadable(label, relabel(scene.error()));
    } else {
      findings->AddError(5201, label, relabel(scene.error()));
    }
    return;
  }
  for (const SceneMaterial& material : scene->materials) {
    if (material.problem)
      findings->Add(5203, label, {material.pointer, {}}, relabel(*material.problem).message);
  }
  for (const SceneImage& image : scene->images) {
    if (image.problem)
      findings->Add(5203, label, {image.pointer, {}}, relabel(*image.problem).message);
  }
}

void CompareMember(const json& material, const char* member, const json& wanted,
                   const std::string& pointer, const std::string& label, FindingList* findings) {
  if (material[member] == wanted) return;
  findings->Add(5303, label, {pointer + "/" + member, {}},
                "not what the container's manifest says");
}

void CheckSceneManifest(const std::string& path, const std::string& label, FindingList* findings) {
  std::string text;
  const auto document = ReadDocument(path, label, &text, findings);
  if (!document || !CheckSchema(5301, "scene-manifest", *document, label, findings)) return;
  const json& materials = (*document)["materials"];
  for (size_t i = 0; i < materials.size(); ++i) {
    const json& material = materials[i];
    const std::string pointer = "/materials/" + std::to_string(i);
    if (material.contains("problem")) {
      findings->Add(5304, label, {pointer + "/problem", {}},
                    material["problem"].get<std::string>());
    }
    if (!material.contains("container")) continue;
    const auto place = material["container"].get<std::string>();
    const Status safe = CheckRelativePath(place, "the path");
    if (!safe) {
      findings->Add(5301, label, {pointer + "/container", {}}, safe.error().message);
      continue;
    }
    const auto container =
        OpenContainer((fs::path(path).parent_path() / place / kManifestName).string());
    if (!container) {
      findings->Add(5302, label, {pointer + "/container", {}},
                    QuoteForMessage(place) + (container.error().code == ErrorCode::kNotFound
                                                  ? " is not there"
                                                  : " cannot be opened"));
      continue;
    }
    const Manifest& manifest = container->manifest;
    CompareMember(material, "asset", manifest.asset, pointer, label, findings);
    if (material.contains("kind") || manifest.kind != "material")
      CompareMember(material, "kind", manifest.kind, pointer, label, findings);
    CompareMember(material, "fingerprint", manifest.fingerprint, pointer, label, findings);
    CompareMember(material, "constants", ConstantsToJson(manifest.channels), pointer, label,
                  findings);
    CompareMember(material, "effects", EffectsToJson(manifest.effects), pointer, label, findings);
    if (manifest.scene) {
      CompareMember(material, "scene", SceneLookToJson(*manifest.scene), pointer, label, findings);
    } else {
      findings->Add(5303, label, {pointer + "/scene", {}}, "the container is of no scene");
    }
    const std::string revision = fs::path(place).filename().string();
    CompareMember(material, "revision", revision, pointer, label, findings);
  }
}

void CheckBindings(const std::string& path, const std::string& label, FindingList* findings) {
  std::string text;
  const auto document = ReadDocument(path, label, &text, findings);
  if (!document || !CheckSchema(5401, "bindings", *document, label, findings)) return;
  const fs::path folder = fs::path(path).parent_path();
  const auto read = [&](const json& name,
                        const std::string& pointer) -> std::optional<std::vector<uint8_t>> {
    const auto file = name.get<std::string>();
    const Status safe = CheckPlainName(file, "the file");
    auto bytes = safe ? ReadFileAs((folder / file).string(), file, kMaxShaderFileBytes)
                      : Result<std::vector<uint8_t>>(Fail(safe.error()));
    if (bytes) return std::move(*bytes);
    findings->Add(5402, label, {pointer, {}}, bytes.error().message);
    return std::nullopt;
  };
  if (const auto shader = read((*document)["shader"], "/shader");
      shader && Sha256Hex(*shader) != (*document)["shader_sha256"].get<std::string>()) {
    findings->Add(5402, label, {"/shader_sha256", {}}, "the shader has another SHA-256");
  }
  if (document->contains("constants")) {
    const json& constants = (*document)["constants"];
    const auto bytes = read(constants["file"], "/constants/file");
    if (bytes && bytes->size() != constants["bytes"].get<uint64_t>()) {
      findings->Add(5402, label, {"/constants/bytes", {}},
                    "the file has " + std::to_string(bytes->size()) + " bytes");
    }
  }
  const json& textures = (*document)["textures"];
  for (size_t i = 0; i < textures.size(); ++i) {
    if (textures[i].contains("file"))
      read(textures[i]["file"], "/textures/" + std::to_string(i) + "/file");
  }
}

bool EndsWith(const std::string& text, std::string_view end) {
  return text.size() > end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

DocumentKind KindOfDocument(const std::string& path) {
  const std::string name = fs::path(path).filename().string();
  if (IsSceneFileName(name)) return DocumentKind::kScene;
  if (EndsWith(name, ".scene.json")) return DocumentKind::kSceneManifest;
  if (!EndsWith(name, ".json")) return DocumentKind::kNone;
  const auto text = ReadTextFile(path, kMaxDocumentBytes);
  if (!text) return DocumentKind::kNone;
  const auto document = ParseStrictJson(*text, kDeepestDocument);
  if (!document) {
    // A job with a comma too many is a job all the same.
    const auto says = [&](const char* word) { return text->find(word) != std::string::npos; };
    if (says("\"patina-shader\"")) return DocumentKind::kBindings;
    return says("\"kind\"") && says("\"asset\"") && says("\"version\"") && !says("\"fingerprint\"")
               ? DocumentKind::kJob
               : DocumentKind::kNone;
  }
  if (!document->is_object()) return DocumentKind::kNone;
  const auto has = [&](const char* key) { return document->contains(key); };
  if (has("format")) {
    if ((*document)["format"] == "patina-shader") return DocumentKind::kBindings;
    return (*document)["format"] == "patina-scene" ? DocumentKind::kSceneManifest
                                                   : DocumentKind::kNone;
  }
  // Results and reports have a fingerprint.
  if (!has("version") || has("fingerprint") || has("exit_code")) return DocumentKind::kNone;
  if (has("kind") && has("asset")) return DocumentKind::kJob;
  if (has("materials")) return DocumentKind::kNone;
  for (const char* key : {"watch", "state_dir", "input_roots", "output_roots", "failed_dir", "job"})
    if (has(key)) return DocumentKind::kConfig;
  return DocumentKind::kNone;
}

void CheckDocument(DocumentKind kind, const std::string& path, const std::string& label,
                   FindingList* findings) {
  switch (kind) {
    case DocumentKind::kJob:
      return CheckJob(path, label, findings);
    case DocumentKind::kConfig: {
      std::string text;
      if (const auto document = ReadDocument(path, label, &text, findings))
        CheckSchema(5101, "config", *document, label, findings);
      return;
    }
    case DocumentKind::kScene:
      return CheckScene(path, label, findings);
    case DocumentKind::kSceneManifest:
      return CheckSceneManifest(path, label, findings);
    case DocumentKind::kBindings:
      return CheckBindings(path, label, findings);
    case DocumentKind::kNone:
      findings->Add(9003, label, {}, "it is no kind of file that can be validated");
  }
}

}  // namespace patina::validate
