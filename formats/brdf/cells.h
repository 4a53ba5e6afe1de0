// What the readers of tables share: cells as they lie in memory, and the account of those that were
// left out.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "formats/base/little_endian.h"
#include "formats/brdf/brdf_source.h"

namespace patina::brdf {

// Larger values are no BRDF; and sums of a few cells stay finite.
inline constexpr float kMaxValue = 1e30f;

inline double LoadLittleDouble(const uint8_t* bytes) {
  const uint64_t bits = LoadLittle64(bytes);
  double value;
  static_assert(sizeof value == sizeof bits);
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

// A colour of a table; NaN in all channels marks a cell without data.
struct Cell {
  float rgb[3];

  static Cell Invalid() {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    return {{nan, nan, nan}};
  }
  bool valid() const { return rgb[0] == rgb[0]; }
};

// The weighted mean of the valid cells among `count`; their weights are at least 0. False where no
// valid cell has a weight; rgb is then zero.
inline bool MeanOfValid(const Cell* const* cells, const float* weights, int count, float rgb[3]) {
  float sum[3] = {0, 0, 0};
  for (int i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c) sum[c] += weights[i] * cells[i]->rgb[c];
  }
  if (sum[0] == sum[0]) {
    for (int c = 0; c < 3; ++c) rgb[c] = sum[c];
    return true;
  }
  float total = 0;
  for (int c = 0; c < 3; ++c) sum[c] = 0;
  for (int i = 0; i < count; ++i) {
    if (!cells[i]->valid()) continue;
    total += weights[i];
    for (int c = 0; c < 3; ++c) sum[c] += weights[i] * cells[i]->rgb[c];
  }
  const bool any = total > 0;
  for (int c = 0; c < 3; ++c) rgb[c] = any ? sum[c] / total : 0;
  return any;
}

// Counts cells that were left out and remembers the first place of each kind.
class CellReport {
 public:
  // `place` is called for the first cell of a kind only.
  template <class Place>
  void Negative(Place&& place) {
    if (negative_++ == 0) first_negative_ = place();
  }
  template <class Place>
  void NotFinite(Place&& place) {
    if (not_finite_++ == 0) first_not_finite_ = place();
  }

  // The cell of these channels; invalid if one is negative, not finite or above
  // kMaxValue. Noted only if it counts.
  template <class Place>
  Cell Check(const double rgb[3], bool counts, Place&& place) {
    Cell cell;
    bool negative = false;
    bool finite = true;
    for (int c = 0; c < 3; ++c) {
      negative |= rgb[c] < 0;
      finite &= std::abs(rgb[c]) <= static_cast<double>(kMaxValue);
      cell.rgb[c] = finite ? static_cast<float>(rgb[c]) : 0;
    }
    if (finite && !negative) return cell;
    if (counts && !finite) {
      NotFinite(place);
    } else if (counts) {
      Negative(place);
    }
    return Cell::Invalid();
  }

  uint64_t count() const { return negative_ + not_finite_; }

  // "12 negative cells left out, the first at ..."
  void AddWarnings(std::vector<std::string>* warnings) const {
    Add(negative_, "negative", first_negative_, warnings);
    Add(not_finite_, "not finite or above 1e30", first_not_finite_, warnings);
  }

 private:
  static void Add(uint64_t count, const char* what, const std::string& first,
                  std::vector<std::string>* warnings) {
    if (count == 0) return;
    warnings->push_back(std::to_string(count) +
                        (count == 1 ? " cell that is " : " cells that are ") + what +
                        " left out, the first at " + first);
  }

  uint64_t negative_ = 0, not_finite_ = 0;
  std::string first_negative_, first_not_finite_;
};

}  // namespace patina::brdf
