#include "pipeline/jobs/sample_stack.h"

#include <algorithm>
#include <cmath>

#include "formats/base/file_io.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/tileable_noise.h"

namespace patina {
namespace {

// Lacquer is worn to nothing in scratches, and dull along them.
constexpr const char* kStack = R"({
  "version": 1,
  "layers": [
    {
      "ior": 1.5,
      "roughness": {"map": "lacquer_roughness.png", "scale": 0.4, "offset": 0.04},
      "thickness": {"map": "lacquer_thickness.png", "scale": 1.2},
      "absorption": [0.06, 0.3, 0.75]
    }
  ],
  "base": {"kind": "diffuse", "albedo": {"map": "wood_albedo.png"}},
  "address": "wrap"
}
)";

float Smooth(float edge, float soft, float x) {
  const float t = std::clamp((x - edge) / soft, 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

// 0 beside scratches, 1 in them: where noise that is stretched along a direction crosses zero.
float Scratches(float u, float v, uint32_t seed) {
  float worn = 0;
  for (uint32_t k = 0; k < 3; ++k) {
    const auto turn = static_cast<float>(k % 2 == 0 ? 1 : -1);
    const float along = u + turn * v, across = 2 * v - turn * u;
    const float line = TileableNoise(along, 5 * across, 2, seed + 17 * k) +
                       0.15f * TileableNoise(u, v, 16, seed + 5 * k);
    const float there = Smooth(0.05f, 0.3f, TileableNoise(u, v, 4, seed + 31 * k));
    worn = std::max(worn, there * (1 - Smooth(0.015f, 0.05f, std::abs(line))));
  }
  return worn;
}

}  // namespace

Result<std::vector<std::string>> WriteSampleStack(const std::string& folder, int side,
                                                  uint64_t seed) {
  PATINA_TRY(MakeDirectories(folder));
  const auto mixed = static_cast<uint32_t>(seed * 2654435761u);
  const auto texels = static_cast<size_t>(side) * static_cast<size_t>(side);
  std::vector<float> albedo(3 * texels), thickness(texels), roughness(texels);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const float u = (static_cast<float>(x) + 0.5f) / static_cast<float>(side);
      const float v = (static_cast<float>(y) + 0.5f) / static_cast<float>(side);
      const size_t at = static_cast<size_t>(y) * static_cast<size_t>(side) + static_cast<size_t>(x);
      // Rings that run along u, and pores.
      const float bend = 0.35f * TileableFbm(u, v, 2, 3, mixed);
      const float ring = 0.5f + 0.5f * std::sin(6.2831853f * (6 * v + bend));
      const float pore = Smooth(0.25f, 0.2f, TileableNoise(u, 8 * v, 8, mixed + 3));
      const float light = std::clamp(0.45f + 0.4f * ring - 0.35f * pore, 0.05f, 1.0f);
      const float colour[3] = {0.86f, 0.70f, 0.50f};  // sRGB-coded
      for (size_t c = 0; c < 3; ++c)
        albedo[3 * at + c] = colour[c] * (0.55f + 0.45f * light) - 0.06f * pore;
      const float worn = Scratches(u, v, mixed + 7);
      thickness[at] = (0.8f + 0.2f * TileableFbm(u, v, 3, 2, mixed + 11)) * (1 - worn);
      roughness[at] = std::clamp(0.1f + 0.8f * worn, 0.0f, 1.0f);
    }
  }
  const std::string base = folder + "/";
  const std::vector<std::string> paths = {base + "scratched_lacquer.layers.json",
                                          base + "wood_albedo.png", base + "lacquer_thickness.png",
                                          base + "lacquer_roughness.png"};
  PATINA_TRY(WriteImage(paths[1], WriteFormat::kPng8, side, side, 3, albedo.data()));
  PATINA_TRY(WriteImage(paths[2], WriteFormat::kPng8, side, side, 1, thickness.data()));
  PATINA_TRY(WriteImage(paths[3], WriteFormat::kPng8, side, side, 1, roughness.data()));
  PATINA_TRY(WriteFileDurably(paths[0], std::string_view(kStack)));
  return paths;
}

}  // namespace patina
