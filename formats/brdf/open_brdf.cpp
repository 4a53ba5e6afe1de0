#include <algorithm>
#include <string_view>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/brdf/brdf_source.h"
#include "formats/brdf/merl.h"
#include "formats/brdf/rgl.h"
#include "formats/brdf/sparse.h"
#include "formats/brdf/utia.h"

namespace patina::brdf {
namespace {

// What stands behind the last dot of the file's own name, in lower case, with the dot; "" without
// one, and for a name that is nothing else (".csv").
std::string Extension(const std::string& path) {
  const size_t slash = path.rfind('/');
  const std::string_view file =
      std::string_view(path).substr(slash == std::string::npos ? 0 : slash + 1);
  const size_t dot = file.rfind('.');
  if (dot == std::string_view::npos || dot == 0) return "";
  std::string extension(file.substr(dot));
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return extension;
}

constexpr const char* kExtensions[] = {".binary", ".bsdf", ".bin", ".csv", ".json"};

Result<Source> OpenBin(const std::string& path) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, 2 * kMerlFileBytes));
  return LooksLikeMerl(bytes) ? ParseMerl(bytes, path) : ParseUtia(bytes, path);
}

}  // namespace

bool HasBrdfExtension(const std::string& path) {
  const std::string extension = Extension(path);
  return std::find(std::begin(kExtensions), std::end(kExtensions), extension) !=
         std::end(kExtensions);
}

Result<Source> OpenBrdf(const std::string& path) {
  const std::string extension = Extension(path);
  if (extension == ".binary") return ReadMerl(path);
  if (extension == ".bsdf") return ReadRgl(path);
  if (extension == ".bin") return OpenBin(path);
  if (extension == ".csv") return ReadSparseCsv(path);
  if (extension == ".json") return ReadSparseJson(path);
  return Fail(ErrorCode::kUnsupported,
              path + ": no kind of BRDF file has the extension " + QuoteForMessage(extension) +
                  "; read are .binary (MERL), .bsdf (RGL), .bin (UTIA), .csv and .json (lists of "
                  "measurements)");
}

}  // namespace patina::brdf
