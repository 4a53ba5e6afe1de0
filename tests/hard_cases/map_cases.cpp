#include "tests/hard_cases/map_cases.h"

#include <cmath>
#include <memory>

#include "pipeline/base/rng.h"
#include "tests/pipeline/material/synthetic_reference.h"

namespace patina::test {
namespace {

float Waves(double u, double v, int c) {
  return static_cast<float>(0.5 + 0.3 * std::sin(12.566 * u + c) * std::cos(18.85 * v - 2 * c) +
                            0.1 * std::sin(62.83 * (u + v) + c));
}

float SignedLog(double value, double scale) {
  return static_cast<float>(std::copysign(std::log2(1 + std::abs(value) / scale), value));
}

bool IsTexel(double u, double v, int x, int y, int side) {
  return static_cast<int>(u * side) == x && static_cast<int>(v * side) == y;
}

}  // namespace

MapCase OrdinaryMap(int width, int height, int channels) {
  auto grain = std::make_shared<Rng>(4);
  return {"ordinary",
          "",
          width,
          height,
          channels,
          Encoding::kLinear,
          [grain](double u, double v, int c) { return Waves(u, v, c) + 0.05f * grain->Uniform(); }};
}

std::vector<MapCase> MapCases() {
  auto noise = std::make_shared<Rng>(77);
  const auto linear = Encoding::kLinear, logs = Encoding::kSignedLog;
  return {
      {"pure noise", "nothing in a texel tells of its neighbours, so that gradients never settle",
       32, 32, 3, linear, [noise](double, double, int) { return noise->Uniform(); }},
      {"checkerboard at Nyquist",
       "every filter but the identity gives grey; mips differ from mip 0 in all", 32, 32, 3, linear,
       [](double u, double v, int) {
         return static_cast<float>((static_cast<int>(u * 32) + static_cast<int>(v * 32)) % 2);
       }},
      {"a single different texel", "one texel of a thousand has all the variance", 32, 32, 3,
       linear, [](double u, double v, int) { return IsTexel(u, v, 5, 9, 32) ? 1.0f : 0.25f; }},
      {"constant but for the last bit",
       "the variance is of the order of the rounding: a division by it "
       "would blow up",
       32, 32, 3, linear,
       [](double u, double v, int) {
         return IsTexel(u, v, 3, 3, 32) ? std::nextafterf(0.5f, 1.0f) : 0.5f;
       }},
      {"all zero", "all gradients of the features are zero or noise; nothing to divide by", 32, 32,
       3, linear, [](double, double, int) { return 0.0f; }},
      {"negative zero", "the sign of zero must not become an infinity or another result", 32, 32, 3,
       linear, [](double u, double, int) { return u < 0.5 ? -0.0f : 0.0f; }},
      {"smallest denormals of halves", "values below the normal halves, which features cannot hold",
       32, 32, 3, linear,
       [](double u, double v, int c) { return 0x1p-24f * (Waves(u, v, c) < 0.5f ? 0.0f : 1.0f); }},
      {"denormals of floats", "arithmetic on denormals is slow and is flushed: everywhere alike",
       32, 32, 3, linear, [](double u, double v, int c) { return 1e-40f * Waves(u, v, c); }},
      {"largest halves as logarithms", "65504 and -65504 side by side", 32, 32, 3, logs,
       [](double u, double v, int c) {
         return SignedLog(Waves(u, v, c) < 0.5f ? -65504 : 65504, 0.25);
       }},
      {"a spike of 1e5 in the dark", "five decades between one texel and the rest", 32, 32, 3, logs,
       [](double u, double v, int c) {
         return SignedLog(
             IsTexel(u, v, 17, 8, 32) ? 1e5 : 1e-2 * static_cast<double>(Waves(u, v, c)), 0x1p-7);
       }},
      {"a linear spike in the dark", "the mean of the mips is that of one texel", 32, 32, 3, linear,
       [](double u, double v, int c) {
         return IsTexel(u, v, 17, 8, 32) ? 1.0f : 1e-5f * Waves(u, v, c);
       }},
      {"all negative", "features are positive: only the network can turn the sign", 32, 32, 3,
       linear, [](double u, double v, int c) { return -Waves(u, v, c); }},
      {"a range of 100", "far beyond [-1, 1], which half weights are made for", 32, 32, 3, linear,
       [](double u, double v, int c) { return 100.0f * Waves(u, v, c); }},
      {"wildly different scales", "one network serves channels of 1e-6 and of 1e2", 32, 32, 5,
       linear,
       [](double u, double v, int c) {
         return std::pow(10.0f, static_cast<float>(2 * c - 6)) * Waves(u, v, c);
       }},
      {"duplicated channels", "the covariance is singular: components of no variance", 32, 32, 4,
       linear, [](double u, double v, int) { return Waves(u, v, 0); }},
      {"one texel", "one mip, windows that repeat it", 1, 1, 3, linear,
       [](double, double, int c) { return 0.2f + 0.3f * static_cast<float>(c); }},
      {"1 x 200", "one column: wraps meet themselves in every window", 1, 200, 3, linear, Waves},
      {"200 x 1", "one row", 200, 1, 3, linear, Waves},
      {"31 x 17", "no side is a multiple of a block, nor are those of the mips", 31, 17, 3, linear,
       Waves},
      {"2000 x 2", "a thousand to one: mips are lines after the first", 2000, 2, 3, linear, Waves},
      {"16 channels", "more outputs than the hidden layer has units", 32, 32, 16, linear, Waves},
      {"33 channels", "no multiple of anything", 32, 32, 33, linear, Waves},
      {"64 channels", "as many as there may be", 32, 32, 64, linear, Waves},
  };
}

MaterialReference ReferenceOf(const MapCase& map) {
  MaterialReference reference =
      MakeReference(map.width, map.height, map.channels, AddressMode::kWrap, map.value);
  for (TargetChannel& channel : reference.channels) channel.encoding = map.encoding;
  return reference;
}

}  // namespace patina::test
