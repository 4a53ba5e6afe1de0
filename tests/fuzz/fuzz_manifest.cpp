// ParseManifest and the schema check take any bytes; what the reader accepts has one canonical
// text, and that text satisfies the reader again.
#include <nlohmann/json.hpp>
#include <string>

#include "formats/manifest.h"
#include "formats/schema_check.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto manifest = ParseManifest(text);
  if (manifest) {
    const auto canonical = ToJson(*manifest);
    FUZZ_CHECK(canonical.has_value());
    FUZZ_CHECK(ToJson(*ParseManifest(*canonical)).value() == *canonical);
  } else {
    FUZZ_CHECK(!manifest.error().message.empty());
  }
  const auto document = nlohmann::json::parse(text, nullptr, false);
  if (!document.is_discarded()) {
    const auto status = CheckAgainstSchema("manifest", document);
    FUZZ_CHECK(status.has_value() || status.error().code != ErrorCode::kInternal);
  }
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  Manifest manifest;
  manifest.asset = "seed";
  manifest.tool.version = "1";
  manifest.fingerprint = std::string(64, '0');
  manifest.profile = "bcf-1k";
  manifest.source.width = 8;
  manifest.source.height = 4;
  manifest.source.levels = 4;
  manifest.source.files = {{"a.png", {"albedo"}, std::string(64, '1'), 8, 4, 3, "uint8", "png"}};
  manifest.payloads = {{"f.dds", "features", 180, std::string(64, '2')},
                       {"w", "weights", 320, std::string(64, '3')}};
  manifest.features = {{"f.dds", 4, 2, 3, -1, "BC6H_UF16"}};
  manifest.network = ManifestNetwork{"w", 3, 16, 1, "relu"};
  manifest.channels = {{"albedo", "r", "srgb", 0.1f, 0.9f, 0, 0},
                       {"ao", "", "linear", 0, 1, -1, 0.5f}};
  manifest.maps = {{"albedo", 0, {0}, "uint8", false, "srgb", "sRGB", "default"}};
  manifest.quality.ssim = 0.5;
  manifest.quality.maps = {{"albedo", {30.5, 0.5, 0.25, 1.5}, {{30.5, {}, {}, {}}}}};
  manifest.quality.gate_min_psnr_db = 10;
  manifest.training.stopped_by = "budget";
  manifest.training.curve = {{10, 1.5, 2.5, {{"albedo", 1.5}}}};
  manifest.effects = {{"a", "constant", "c", ManifestSavings{1, 2, 3, 4}}};
  manifest.warnings = {"w"};
  const std::string text = ToJson(manifest).value();
  const std::string compact = nlohmann::json::parse(text).dump();
  return {{text.begin(), text.end()}, {compact.begin(), compact.end()}};
}
