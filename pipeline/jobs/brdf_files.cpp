#include "pipeline/jobs/brdf_files.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/base/strict_json.h"
#include "formats/brdf/brdf_source.h"
#include "formats/brdf/merl.h"
#include "formats/brdf/sparse.h"
#include "formats/brdf/utia.h"
#include "formats/layered/layered_file.h"
#include "formats/layered/varying_stack.h"
#include "pipeline/jobs/job.h"
#include "pipeline/svbrdf/image_set.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string Extension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return extension;
}

// Files by the names that another gives them, beside it, links resolved.
std::vector<std::string> RealPaths(const std::string& beside, const std::vector<std::string>& names) {
  std::vector<std::string> paths;
  for (const std::string& name : names) {
    std::error_code error;
    const fs::path path = fs::weakly_canonical(fs::path(beside).parent_path() / name, error);
    if (!error) paths.push_back(path.string());
  }
  return paths;
}

// The beginning of a file; empty if it cannot be read.
std::string Head(const std::string& path, size_t bytes) {
  std::ifstream file(path, std::ios::binary);
  std::string head(bytes, '\0');
  file.read(head.data(), static_cast<std::streamsize>(bytes));
  head.resize(static_cast<size_t>(std::max<std::streamsize>(0, file.gcount())));
  return head;
}

// A buffer of geometry beside the textures of a glTF file is a .bin, too.
bool IsBin(const std::string& path) {
  std::error_code error;
  const uintmax_t size = fs::file_size(path, error);
  if (error) return false;
  const std::string head = Head(path, 12);
  const auto bytes = AsBytes(head);
  return size == brdf::kUtiaFileBytes || brdf::LooksLikeMerl(bytes);
}

// A table of anything else is a .csv, too: the first line that says something must name directions
// or hold at least the nine numbers of a measurement.
bool IsCsv(const std::string& path) {
  constexpr size_t kHeadBytes = 65536;
  constexpr int kCommas = 8;
  const std::string head = Head(path, kHeadBytes);
  for (size_t at = 0; at < head.size();) {
    const size_t end = std::min(head.find('\n', at), head.size());
    const std::string line = head.substr(at, end - at);
    at = end + 1;
    const size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    if (line.find("wix") != std::string::npos || line.find("theta_i") != std::string::npos)
      return true;
    return line.find_first_not_of("0123456789+-.eE, \t\r") == std::string::npos &&
           std::count(line.begin(), line.end(), ',') >= kCommas;
  }
  return false;
}

}  // namespace

bool IsMeasurementList(const std::string& path) {
  auto text = ReadTextFile(path, brdf::kMaxSparseJsonBytes);
  if (!text) return false;
  bool has_list = false;
  bool is_job = false;
  std::string key;
  // Keeps nothing but looks at the keys of the outermost object.
  auto watch = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::key && depth == 1) {
      key = parsed.get<std::string>();
      is_job = is_job || key == "kind" || key == "version";
    } else if (event == Json::parse_event_t::array_start && depth == 1) {
      has_list = has_list || key == "samples";
    }
    return depth == 0 || event == Json::parse_event_t::key;
  };
  const Json ignored = Json::parse(*text, watch, false);
  return has_list && !is_job;
}

bool LooksLikeBrdfFile(const std::string& path) {
  if (layered::IsLayersFileName(path)) return true;
  const std::string extension = Extension(path);
  if (extension == ".bin") return IsBin(path);
  if (extension == ".csv") return IsCsv(path);
  if (extension == ".json") return IsMeasurementList(path);
  return brdf::HasBrdfExtension(path);
}

std::string BrdfAssetName(const std::string& path) {
  const fs::path stem = fs::path(path).stem();
  // Without both parts of ".layers.json" and ".btf.json".
  const bool two = layered::IsLayersFileName(path) || svbrdf::IsImageSetFileName(path);
  return AssetNameFromPath((two ? stem.stem() : stem).string());
}

std::vector<std::string> FindImageSets(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    const std::string path = entry->path().string();
    if (entry->path().filename().string()[0] != '.' && svbrdf::IsImageSetFileName(path) &&
        entry->is_regular_file(ignored)) {
      files.push_back(path);
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<std::string> FindMappedStacks(const std::string& folder) {
  auto files = FindBrdfFiles(folder);
  if (!files) return {};
  std::erase_if(*files, [](const std::string& file) {
    return !layered::IsLayersFileName(file) || !layered::HasStackMaps(file);
  });
  return std::move(*files);
}

std::vector<std::string> ImagesOfSet(const std::string& list) {
  std::vector<std::string> images;
  const auto text = ReadTextFile(list, svbrdf::kMaxImageSetBytes);
  if (!text) return images;
  constexpr int kDeepestList = 8;
  const auto json = ParseStrictJson(*text, kDeepestList);
  if (!json || !json->is_object()) return images;
  const auto entries = json->find("images");
  if (entries == json->end() || !entries->is_array()) return images;
  std::vector<std::string> names;
  for (const auto& entry : *entries) {
    if (!entry.is_object()) continue;
    const auto name = entry.find("file");
    if (name != entry.end() && name->is_string()) names.push_back(name->get<std::string>());
  }
  return RealPaths(list, names);
}

std::vector<std::string> MapsOfStack(const std::string& file) {
  const auto stack = layered::ReadVaryingStack(file);
  return stack ? RealPaths(file, stack->Files()) : std::vector<std::string>();
}

Job JobOfBrdfFile(const std::string& asset, const std::string& file) {
  Job job;
  const bool varies = svbrdf::IsImageSetFileName(file) ||
                      (layered::IsLayersFileName(file) && layered::HasStackMaps(file));
  job.kind = varies ? JobKind::kSvbrdf : JobKind::kBrdf;
  job.asset = asset;
  job.file = file;
  return job;
}

Result<std::vector<std::string>> FindBrdfFiles(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    const std::string path = entry->path().string();
    if (entry->path().filename().string()[0] == '.' || !entry->is_regular_file(ignored)) continue;
    if (brdf::HasBrdfExtension(path) && LooksLikeBrdfFile(path)) files.push_back(path);
  }
  if (error)
    return Fail(ErrorCode::kIo, "cannot list the folder " + folder + ": " + error.message());
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace patina
