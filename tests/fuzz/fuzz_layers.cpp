// ParseVaryingStack takes any bytes; what it accepts has a legal stack and maps that name numbers
// of it and files beside it.
#include <cmath>
#include <string>

#include "formats/base/names.h"
#include "formats/layered/layered_file.h"
#include "formats/layered/varying_stack.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

namespace {

void CheckMap(const layered::StackMap& map, const layered::Stack& stack) {
  FUZZ_CHECK((map.layer >= 0) != (map.part >= 0));
  FUZZ_CHECK(map.layer < static_cast<int>(stack.layers.size()));
  FUZZ_CHECK(map.part < static_cast<int>(stack.parts.size()));
  FUZZ_CHECK(CheckPlainName(map.file, "file").has_value());
  FUZZ_CHECK(std::abs(map.scale) <= layered::kMaxMapFactor);
  FUZZ_CHECK(std::abs(map.offset) <= layered::kMaxMapFactor);
  FUZZ_CHECK(!map.pointer.empty() && map.channel.size() <= 1);
}

// Whether it is accepted.
bool Try(std::string_view text) {
  const auto varying = layered::ParseVaryingStack(text, "x");
  const auto plain = layered::ParseStack(text, "x");
  FUZZ_CHECK(plain.has_value() == (varying.has_value() && !varying->varies()));
  if (!varying) {
    FUZZ_CHECK(varying.error().code == ErrorCode::kInvalidArgument);
    FUZZ_CHECK(varying.error().message.rfind("x", 0) == 0);
    return false;
  }
  FUZZ_CHECK(layered::CheckStack(varying->stack).has_value());
  for (const layered::StackMap& map : varying->maps) CheckMap(map, varying->stack);
  FUZZ_CHECK(varying->Files().size() <= varying->maps.size() + 1);
  if (plain) {
    const auto again = layered::ParseStack(layered::FormatStack(*plain), "x");
    FUZZ_CHECK(again.has_value());
  }
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Try({reinterpret_cast<const char*>(data), size});
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  const std::string texts[] = {
      R"({"version": 1, "layers": [{"ior": 1.5, "roughness": [0.1, 0.2], "rotation_deg": 30,
          "thickness": 1, "absorption": [0.1, 0.2, 0.3], "scattering": 2, "asymmetry": 0.5}],
          "base": {"kind": "mixture", "parts": [
            {"kind": "diffuse", "weight": 0.5, "albedo": 0.5},
            {"kind": "conductor", "weight": 0.25, "metal": "gold", "roughness": 0.2}]}})",
      R"({"version": 1, "layers": [{"ior": {"map": "i.png", "offset": 1}, "roughness":
          [{"map": "r.png", "scale": 0.5}, 0.1], "thickness": {"map": "t.png", "channel": "g"},
          "absorption": {"map": "a.png"}}], "base": {"kind": "diffuse", "albedo":
          {"map": "w.png", "color_space": "srgb"}}, "normal": {"map": "n.png",
          "convention": "directx"}, "address": "clamp"})",
      R"({"version": 1, "base": {"kind": "black"}})"};
  return SeedsOf(texts, Try);
}
