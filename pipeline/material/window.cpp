#include "pipeline/material/window.h"

#include <algorithm>

#include "formats/base/check.h"

namespace patina {
namespace {

int Mod(int a, int n) {
  const int m = a % n;
  return m < 0 ? m + n : m;
}

// Floor of a value above -65536, without a call into libm: this is planned for every window.
int FloorInt(double value) { return static_cast<int>(value + 65536.0) - 65536; }

// Splits the unwrapped texels [from, to) into blocks of a level of `size` texels along this axis.
template <class Emit>
void ForBlocks(int from, int to, int size, Emit&& emit) {
  for (int at = from; at < to;) {
    const int texel = Mod(at, size);
    const int block = texel >> 2;
    const int start = at - (texel & 3);
    const int count = std::min(4, size - 4 * block);
    emit(AxisTaps::BlockSpan{static_cast<int16_t>(block), static_cast<int16_t>(count), start});
    at = start + count;
  }
}

// Texture sides stay below 2^16 and samples below 2^17, so every position is exact to 2^-30 in double.
void PlanTaps(int samples, int origin, double phase, int mip_size, int level_size, AddressMode address, AxisTaps* taps) {
  const double ratio = static_cast<double>(level_size) / mip_size;
  int first = 0;
  bool identity = true;
  bool contiguous = true;
  for (int k = 0; k < samples; ++k) {
    const double at = (origin + k + 0.5 + phase) * ratio - 0.5;
    const int texel = FloorInt(at);
    if (k == 0) first = texel;
    taps->index[k] = texel - first;
    taps->weight[k] = static_cast<float>(at - texel);
    contiguous &= taps->index[k] == k;
    identity &= contiguous && taps->weight[k] == 0.0f;
  }
  taps->first = first;
  taps->identity = identity;
  taps->contiguous = contiguous;
  taps->extent = taps->index[samples - 1] + (identity ? 1 : 2);
  PATINA_CHECK(taps->extent <= kMaxExtent);

  const bool covers = samples >= mip_size;
  const int last = first + taps->extent;
  const int owned_from = -FloorInt(0.5 - (origin + phase) * ratio);
  const int owned_to = -FloorInt(0.5 - (origin + phase + samples) * ratio);
  taps->span_count = 0;
  const auto add_span = [&](const AxisTaps::BlockSpan& span, int owned) {
    if (covers || 2 * owned >= span.count) taps->spans[taps->span_count++] = span;
  };
  const auto owned_of = [&](int start, int count) {
    return std::max(0, std::min(start + count, owned_to) - std::max(start, owned_from));
  };
  if (address == AddressMode::kClamp) {
    taps->fold = first < 0 || last > level_size;
    taps->canonical_first = std::clamp(first, 0, level_size - 1);
    taps->canonical_extent = std::clamp(last, taps->canonical_first + 1, level_size) - taps->canonical_first;
    const int from = covers ? 0 : std::clamp(owned_from, 0, level_size);
    const int to = covers ? level_size : std::clamp(owned_to, 0, level_size);
    ForBlocks(from, to, level_size, [&](const AxisTaps::BlockSpan& span) { add_span(span, owned_of(span.start, span.count)); });
  } else if (taps->extent + 6 > level_size) {
    // The ends of the window may meet in one block: bring everything to the level's own range.
    taps->fold = true;
    taps->canonical_first = 0;
    taps->canonical_extent = level_size;
    ForBlocks(0, level_size, level_size, [&](const AxisTaps::BlockSpan& span) {
      int owned = 0;
      for (int lap = (owned_from / level_size - 1) * level_size; lap < owned_to; lap += level_size) {
        owned += owned_of(span.start + lap, span.count);
      }
      add_span(span, owned);
    });
  } else {
    taps->fold = false;
    taps->canonical_first = first;
    taps->canonical_extent = taps->extent;
    ForBlocks(owned_from, owned_to, level_size,
              [&](const AxisTaps::BlockSpan& span) { add_span(span, owned_of(span.start, span.count)); });
  }

  taps->decode_count = 0;
  int decode_from = first, decode_to = last;
  if (address == AddressMode::kClamp) {
    decode_from = taps->canonical_first;
    decode_to = taps->canonical_first + taps->canonical_extent;
  }
  ForBlocks(decode_from, decode_to, level_size,
            [&](const AxisTaps::BlockSpan& span) { taps->decode[taps->decode_count++] = span; });
}

// Catmull-Rom weights of the four texels around a point `t` in [0,1) after the second.
void CatmullRom(double t, double weight[4]) {
  weight[0] = t * (-0.5 + t * (1.0 - 0.5 * t));
  weight[1] = 1.0 + t * t * (-2.5 + 1.5 * t);
  weight[2] = t * (0.5 + t * (2.0 - 1.5 * t));
  weight[3] = t * t * (-0.5 + 0.5 * t);
}

void PlanFilter(int samples, int origin, double phase, int mip_size, int level_size, FilterTaps* taps) {
  const double ratio = static_cast<double>(level_size) / mip_size;
  for (int k = 0; k < samples; ++k) {
    const double at = (origin + k + 0.5 + phase) * ratio - 0.5;
    const int texel = FloorInt(at);
    if (k == 0) taps->first = texel - 1;
    taps->index[k] = texel - 1 - taps->first;
    double weight[4];
    CatmullRom(at - texel, weight);
    for (int i = 0; i < 4; ++i) taps->weight[i][k] = static_cast<float>(weight[i]);
  }
  taps->extent = taps->index[samples - 1] + 4;
}

// Whether [a, a+a_count) and [b, b+b_count) meet, modulo `period`.
bool Meets(int a, int a_count, int b, int b_count, int period) {
  return Mod(b - a, period) < a_count || Mod(a - b, period) < b_count;
}

}  // namespace

int WindowCols(int width) { return std::min(kWindowSide, (width + 15) / 16 * 16); }
int WindowRows(int height) { return std::min(kWindowSide, height); }

void PlanWindow(const TargetPyramid& target, const ModelShape& shape, FeatureStore* store, const WindowSpec& spec,
                WindowPlan* plan) {
  const TargetLevel& mip = target.levels[spec.mip];
  plan->cols = spec.cols;
  plan->rows = spec.rows;
  plan->mip = spec.mip;
  plan->address = target.address;
  plan->on_grid = spec.phase_x == 0 && spec.phase_y == 0 && spec.fraction == 0;
  plan->target = &mip;
  plan->target_block = spec.x0 / 16;
  plan->target_row = spec.y0;
  if (!plan->on_grid) {
    const int next = std::min<int>(spec.mip + 1, static_cast<int>(target.levels.size()) - 1);
    plan->target_next = spec.fraction > 0 && next != spec.mip ? &target.levels[next] : nullptr;
    plan->filter_weight[0] = plan->target_next ? 1 - spec.fraction : 1;
    plan->filter_weight[1] = plan->target_next ? spec.fraction : 0;
    for (int k = 0; k < (plan->target_next ? 2 : 1); ++k) {
      const TargetLevel& from = k == 0 ? mip : *plan->target_next;
      PlanFilter(spec.cols, spec.x0, spec.phase_x, mip.width, from.width, &plan->filter_x[k]);
      PlanFilter(spec.rows, spec.y0, spec.phase_y, mip.height, from.height, &plan->filter_y[k]);
    }
  }

  plan->level_count = 0;
  if (store == nullptr) return;
  for (int t = 0; t < kFeatureTextures; ++t) {
    const float s = static_cast<float>(spec.mip) + spec.fraction;
    const float lod = std::clamp(s - static_cast<float>(shape[t].lod_shift), 0.0f, static_cast<float>(shape[t].levels - 1));
    const int fine = static_cast<int>(lod);
    const float blend = lod - static_cast<float>(fine);
    for (int k = 0; k < (blend > 0 ? 2 : 1); ++k) {
      LevelTaps& taps = plan->levels[plan->level_count++];
      taps.level = &store->textures[t][fine + k];
      taps.texture = t;
      taps.weight = k == 0 ? 1 - blend : blend;
      PlanTaps(spec.cols, spec.x0, spec.phase_x, mip.width, taps.level->width, target.address, &taps.x);
      PlanTaps(spec.rows, spec.y0, spec.phase_y, mip.height, taps.level->height, target.address, &taps.y);
    }
  }
}

bool WindowsConflict(const WindowPlan& a, const WindowPlan& b) {
  for (int i = 0; i < a.level_count; ++i) {
    for (int j = 0; j < b.level_count; ++j) {
      const LevelTaps& p = a.levels[i];
      const LevelTaps& q = b.levels[j];
      if (p.level != q.level) continue;
      // Whole blocks around the taps: up to 3 texels more at each end.
      if (Meets(p.x.first - 3, p.x.extent + 6, q.x.first - 3, q.x.extent + 6, p.level->width) &&
          Meets(p.y.first - 3, p.y.extent + 6, q.y.first - 3, q.y.extent + 6, p.level->height)) {
        return true;
      }
    }
  }
  return false;
}

}  // namespace patina
