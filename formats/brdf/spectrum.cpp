// Source of the tables: CIE 1931 2 degree colour matching functions and CIE standard illuminant
// D65, every 10 nm.
#include "formats/brdf/spectrum.h"

#include <algorithm>

namespace patina::brdf {
namespace {

constexpr int kFirstNm = 380;
constexpr int kStepNm = 10;
constexpr int kEntries = 41;

struct Entry {
  double x, y, z;  // colour matching functions
  double d65;
};

constexpr Entry kTable[kEntries] = {
    {.0014, .0000, .0065, 49.9755},  {.0042, .0001, .0201, 54.6482},
    {.0143, .0004, .0679, 82.7549},  {.0435, .0012, .2074, 91.4860},
    {.1344, .0040, .6456, 93.4318},  {.2839, .0116, 1.3856, 86.6823},
    {.3483, .0230, 1.7471, 104.865}, {.3362, .0380, 1.7721, 117.008},
    {.2908, .0600, 1.6692, 117.812}, {.1954, .0910, 1.2876, 114.861},
    {.0956, .1390, .8130, 115.923},  {.0320, .2080, .4652, 108.811},
    {.0049, .3230, .2720, 109.354},  {.0093, .5030, .1582, 107.802},
    {.0633, .7100, .0782, 104.790},  {.1655, .8620, .0422, 107.689},
    {.2904, .9540, .0203, 104.405},  {.4334, .9950, .0087, 104.046},
    {.5945, .9950, .0039, 100.000},  {.7621, .9520, .0021, 96.3342},
    {.9163, .8700, .0017, 95.7880},  {1.0263, .7570, .0011, 88.6856},
    {1.0622, .6310, .0008, 90.0062}, {1.0026, .5030, .0003, 89.5991},
    {.8544, .3810, .0002, 87.6987},  {.6424, .2650, .0000, 83.2886},
    {.4479, .1750, .0000, 83.6992},  {.2835, .1070, .0000, 80.0268},
    {.1649, .0610, .0000, 80.2146},  {.0874, .0320, .0000, 82.2778},
    {.0468, .0170, .0000, 78.2842},  {.0227, .0082, .0000, 69.7213},
    {.0114, .0041, .0000, 71.6091},  {.0058, .0021, .0000, 74.3490},
    {.0029, .0010, .0000, 61.6040},  {.0014, .0005, .0000, 69.8856},
    {.0007, .0002, .0000, 75.0870},  {.0003, .0001, .0000, 63.5927},
    {.0002, .0001, .0000, 46.4182},  {.0001, .0000, .0000, 66.8054},
    {.0000, .0000, .0000, 63.3828}};

// CIE XYZ to linear Rec. 709 (IEC 61966-2-1).
constexpr double kToRec709[3][3] = {{3.2404542, -1.5371385, -0.4985314},
                                    {-0.9692660, 1.8760108, 0.0415560},
                                    {0.0556434, -0.2040259, 1.0572252}};

}  // namespace

std::vector<std::array<double, 3>> SpectrumToRec709(std::span<const double> wavelengths_nm) {
  const size_t count = wavelengths_nm.size();
  std::vector<std::array<double, 3>> weights(count, {0, 0, 0});
  size_t low = 0;
  for (int nm = kFirstNm; nm <= kFirstNm + kStepNm * (kEntries - 1); ++nm) {
    const int entry = std::min((nm - kFirstNm) / kStepNm, kEntries - 2);
    const double u = static_cast<double>(nm - kFirstNm - kStepNm * entry) / kStepNm;
    const Entry& a = kTable[entry];
    const Entry& b = kTable[entry + 1];
    const double light = a.d65 + (b.d65 - a.d65) * u;
    const double xyz[3] = {light * (a.x + (b.x - a.x) * u), light * (a.y + (b.y - a.y) * u),
                           light * (a.z + (b.z - a.z) * u)};
    // The two samples that decide at this wavelength.
    while (low + 1 < count && wavelengths_nm[low + 1] <= nm) ++low;
    const size_t high = std::min(low + 1, count - 1);
    const double gap = wavelengths_nm[high] - wavelengths_nm[low];
    const double t = gap > 0 ? std::clamp((nm - wavelengths_nm[low]) / gap, 0.0, 1.0) : 0.0;
    for (int c = 0; c < 3; ++c) {
      const double rgb =
          kToRec709[c][0] * xyz[0] + kToRec709[c][1] * xyz[1] + kToRec709[c][2] * xyz[2];
      weights[low][c] += rgb * (1 - t);
      weights[high][c] += rgb * t;
    }
  }
  for (int c = 0; c < 3; ++c) {
    double sum = 0;
    for (const auto& weight : weights) sum += weight[c];
    for (auto& weight : weights) weight[c] /= sum;
  }
  return weights;
}

}  // namespace patina::brdf
