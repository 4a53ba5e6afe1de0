#include "pipeline/color/color.h"

#include <array>
#include <bit>
#include <cmath>

namespace patina {
namespace {

constexpr double kLinearKnee = 0.0031308;
constexpr double kCodedKnee = 0.04045;

constexpr double kRec709Gain = 1.09929682680944;
constexpr double kRec709Knee = 0.018053968510807;
constexpr double kRec709Slope = 4.5;
constexpr double kRec709Power = 0.45;

// Decoding is smooth: a uniform table with linear interpolation errs by h^2/8 max f'' = 2.2e-8 at
// 4096 cells.
struct DecodeTable {
  static constexpr int kCells = 4096;
  std::array<float, kCells + 1> value;
  DecodeTable() {
    for (int i = 0; i <= kCells; ++i) {
      const double coded = static_cast<double>(i) / kCells;
      // The power branch on both sides of the knee: below it the table is not used, and a cell that
      // straddles it stays smooth.
      value[i] = static_cast<float>(std::pow((coded + 0.055) / 1.055, 2.4));
    }
  }
};

// Encoding is steep near the knee: cells are 1/256 of an octave, so that the relative error of the
// interpolation, (1/256)^2 / 8 * |f'' x^2 / f|, is below 5e-7 everywhere.
struct EncodeTable {
  static constexpr int kCellBits = 8;
  static constexpr uint32_t kFirst = std::bit_cast<uint32_t>(0x1p-9f) >> (23 - kCellBits);
  static constexpr uint32_t kLast = std::bit_cast<uint32_t>(1.0f) >> (23 - kCellBits);
  std::array<float, kLast - kFirst + 1> value;
  EncodeTable() {
    for (uint32_t i = 0; i < value.size(); ++i) {
      const float linear = std::bit_cast<float>((kFirst + i) << (23 - kCellBits));
      value[i] = static_cast<float>(1.055 * std::pow(static_cast<double>(linear), 1 / 2.4) - 0.055);
    }
  }
};

const DecodeTable kDecode;
const EncodeTable kEncode;

struct Decode8Table {
  std::array<float, 256> value;
  Decode8Table() {
    for (int i = 0; i < 256; ++i) value[i] = static_cast<float>(SrgbToLinear(i / 255.0));
  }
};
const Decode8Table kDecode8;

float DecodeOne(float coded) {
  const float magnitude = std::fabs(coded);
  float linear;
  if (magnitude <= static_cast<float>(kCodedKnee)) {
    linear = magnitude / 12.92f;
  } else if (magnitude < 1.0f) {
    const float position = magnitude * DecodeTable::kCells;
    const int cell = static_cast<int>(position);
    const float fraction = position - static_cast<float>(cell);
    linear = kDecode.value[cell] + fraction * (kDecode.value[cell + 1] - kDecode.value[cell]);
  } else {
    linear = static_cast<float>(SrgbToLinear(magnitude));
  }
  return std::copysign(linear, coded);
}

float EncodeOne(float linear) {
  const float magnitude = std::fabs(linear);
  float coded;
  if (magnitude <= static_cast<float>(kLinearKnee)) {
    coded = magnitude * 12.92f;
  } else if (magnitude < 1.0f) {
    constexpr int kFractionBits = 23 - EncodeTable::kCellBits;
    const uint32_t bits = std::bit_cast<uint32_t>(magnitude);
    const uint32_t cell = (bits >> kFractionBits) - EncodeTable::kFirst;
    const float fraction =
        static_cast<float>(bits & ((1u << kFractionBits) - 1)) * (1.0f / (1u << kFractionBits));
    coded = kEncode.value[cell] + fraction * (kEncode.value[cell + 1] - kEncode.value[cell]);
  } else {
    coded = static_cast<float>(LinearToSrgb(magnitude));
  }
  return std::copysign(coded, linear);
}

}  // namespace

double SrgbToLinear(double coded) {
  const double magnitude = std::fabs(coded);
  const double linear =
      magnitude <= kCodedKnee ? magnitude / 12.92 : std::pow((magnitude + 0.055) / 1.055, 2.4);
  return std::copysign(linear, coded);
}

double LinearToSrgb(double linear) {
  const double magnitude = std::fabs(linear);
  const double coded =
      magnitude <= kLinearKnee ? magnitude * 12.92 : 1.055 * std::pow(magnitude, 1 / 2.4) - 0.055;
  return std::copysign(coded, linear);
}

double Rec709ToLinear(double coded) {
  const double magnitude = std::fabs(coded);
  const double linear =
      magnitude < kRec709Slope * kRec709Knee
          ? magnitude / kRec709Slope
          : std::pow((magnitude + (kRec709Gain - 1)) / kRec709Gain, 1 / kRec709Power);
  return std::copysign(linear, coded);
}

double LinearToRec709(double linear) {
  const double magnitude = std::fabs(linear);
  const double coded = magnitude < kRec709Knee
                           ? magnitude * kRec709Slope
                           : kRec709Gain * std::pow(magnitude, kRec709Power) - (kRec709Gain - 1);
  return std::copysign(coded, linear);
}

float Srgb8ToLinear(uint8_t code) { return kDecode8.value[code]; }

void SrgbToLinearRow(const float* in, size_t count, float* out) {
  for (size_t i = 0; i < count; ++i) out[i] = DecodeOne(in[i]);
}

void LinearToSrgbRow(const float* in, size_t count, float* out) {
  for (size_t i = 0; i < count; ++i) out[i] = EncodeOne(in[i]);
}

void SignedLogRow(const float* in, size_t count, float scale, float* out) {
  for (size_t i = 0; i < count; ++i) {
    const double x = static_cast<double>(in[i]);
    out[i] = static_cast<float>(
        std::copysign(std::log2(1 + std::fabs(x) / static_cast<double>(scale)), x));
  }
}

double SignedLogToLinear(double coded, double scale) {
  return std::copysign(scale * (std::exp2(std::fabs(coded)) - 1), coded);
}

}  // namespace patina
