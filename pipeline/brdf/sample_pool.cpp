#include "pipeline/brdf/sample_pool.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>

#include "formats/brdf/angles.h"
#include "pipeline/brdf/angle_inputs.h"

namespace patina::brdf {
namespace {

// Of a table that is invalid nearly everywhere, more tries would make drawing cost more than training does: at 99.9 %
// 64 tries took 2.6 times an ordinary table, these 1.3 times. With half of it invalid one sample in 10^6 is given up.
constexpr int kTries = 20;
// Few enough for simulated sources to tell of progress and to stop when told.
constexpr int kSamplesPerTask = 512;

void FillValue(const float rgb[3], float weight, const Direction& wi, const Direction& wo,
               PoolSample* sample) {
  // A value that no output can reach would pull outputs up for ever, and with them whatever shares
  // their features: mirrors grew ghost highlights.
  for (int c = 0; c < 3; ++c) sample->value[c] = std::min(rgb[c], kMaxValue);
  sample->cosine = std::max(wi.z, wo.z);
  sample->importance = weight;
}

}  // namespace

void LookUpPair(const GridShape& shape, Direction wi, Direction wo, PoolSample* sample) {
  if (shape.canonical_order) MakeCanonical(&wi, &wo);
  if (shape.angle_inputs) AngleInputs(wi, wo, sample->extra);
  if (shape.half_vector_inputs) HalfVectorInputs(wi, wo, sample->extra + 3);
  float in[3] = {wi.x, wi.y, wi.z}, out[3] = {wo.x, wo.y, wo.z};
  if (shape.isotropic) healpix::FoldIsotropic(in, out);
  const auto near = healpix::LookUp(shape.nside, in, shape.interpolation);
  const auto far = healpix::LookUp(shape.nside, out, shape.interpolation);
  const int corners = shape.corners();
  for (int c = 0; c < 4; ++c) {
    sample->corner[c] = near.index[c];
    sample->weight[c] = near.weight[c];
    sample->corner[4 + c] = corners + far.index[c];
    sample->weight[4 + c] = far.weight[c];
  }
}

void DrawPair(Draw draw, Rng* rng, Direction* wi, Direction* wo) {
  const float turn = 2 * std::numbers::pi_v<float>;
  if (draw == Draw::kDirections) {
    for (Direction* w : {wi, wo}) {
      const float z = 1 - rng->Uniform();
      const float s = std::sqrt(std::max(0.0f, 1 - z * z)), phi = turn * rng->Uniform();
      *w = {s * std::cos(phi), s * std::sin(phi), z};
    }
    return;
  }
  for (;;) {
    const float u = rng->Uniform();
    const float theta_h = u * u * kHalfPi, theta_d = rng->Uniform() * kHalfPi,
                phi_d = turn * rng->Uniform(), phi_h = turn * rng->Uniform();
    FromHalfDifference(theta_h, theta_d, phi_d, wi, wo);
    const float c = std::cos(phi_h), s = std::sin(phi_h);
    for (Direction* w : {wi, wo}) *w = {c * w->x - s * w->y, s * w->x + c * w->y, w->z};
    if (wi->z > 0 && wo->z > 0) return;
  }
}

AlignedBuffer<PoolSample> DrawPool(const Source& source, const GridShape& shape,
                                   const PoolOptions& options, ThreadPool& pool) {
  AlignedBuffer<PoolSample> samples(options.count);
  std::vector<uint8_t> valid(options.count);
  const int tasks = static_cast<int>((options.count + kSamplesPerTask - 1) / kSamplesPerTask);
  std::atomic<size_t> drawn{0};
  pool.ParallelFor(tasks, [&](int task, int worker) {
    if (options.cancel != nullptr && options.cancel->cancelled()) return;
    const size_t begin = static_cast<size_t>(task) * kSamplesPerTask,
                 end = std::min(options.count, begin + kSamplesPerTask);
    for (size_t i = begin; i < end; ++i) {
      Rng rng(options.seed, i);
      if (source.table == nullptr) {
        const Sample& given =
            source.samples[rng.Below(static_cast<uint32_t>(source.samples.size()))];
        LookUpPair(shape, given.wi, given.wo, &samples[i]);
        FillValue(given.rgb, given.weight, given.wi, given.wo, &samples[i]);
        valid[i] = 1;
        continue;
      }
      const Draw draw = static_cast<double>(rng.Uniform()) < options.half_angle_share
                            ? Draw::kHalfAngles
                            : Draw::kDirections;
      Direction wi, wo;
      float rgb[3], weight = 1;
      for (int attempt = 0; attempt < kTries && valid[i] == 0; ++attempt) {
        DrawPair(draw, &rng, &wi, &wo);
        valid[i] = source.table->EvaluateToLearn(wi, wo, rgb, &weight) ? 1 : 0;
      }
      if (valid[i] == 0) continue;
      LookUpPair(shape, wi, wo, &samples[i]);
      FillValue(rgb, weight, wi, wo, &samples[i]);
    }
    drawn.fetch_add(end - begin, std::memory_order_relaxed);
    if (worker == 0 && options.on_progress) {
      options.on_progress(static_cast<double>(drawn.load(std::memory_order_relaxed)) /
                          static_cast<double>(options.count));
    }
  });
  if (std::find(valid.begin(), valid.end(), 0) == valid.end()) return samples;
  size_t kept = 0;
  for (size_t i = 0; i < options.count; ++i) kept += valid[i];
  AlignedBuffer<PoolSample> compact(kept);
  for (size_t i = 0, to = 0; i < options.count; ++i) {
    if (valid[i] != 0) compact[to++] = samples[i];
  }
  return compact;
}

}  // namespace patina::brdf
