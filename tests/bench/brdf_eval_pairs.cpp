#include "tests/bench/brdf_eval_pairs.h"

#include <algorithm>

namespace patina::bench {
namespace {

constexpr int kTries = 64;
constexpr size_t kPairsPerTask = 4096;

// False if no pair with valid data was found.
bool Draw(const brdf::Source& source, const brdf::PoolOptions& options, uint64_t index,
          TrainingPair* pair) {
  Rng rng(options.seed, index);
  pair->importance = 1;
  bool valid = source.table == nullptr;
  if (valid) {
    const brdf::Sample& given =
        source.samples[rng.Below(static_cast<uint32_t>(source.samples.size()))];
    pair->wi = given.wi;
    pair->wo = given.wo;
    std::copy_n(given.rgb, 3, pair->value);
    pair->importance = given.weight;
  } else {
    const brdf::Draw draw = static_cast<double>(rng.Uniform()) < options.half_angle_share
                                ? brdf::Draw::kHalfAngles
                                : brdf::Draw::kDirections;
    for (int attempt = 0; attempt < kTries && !valid; ++attempt) {
      brdf::DrawPair(draw, &rng, &pair->wi, &pair->wo);
      valid = source.table->Evaluate(pair->wi, pair->wo, pair->value);
    }
  }
  pair->cosine = std::max(pair->wi.z, pair->wo.z);
  return valid;
}

}  // namespace

std::vector<TrainingPair> DrawTrainingPairs(const brdf::Source& source,
                                            const brdf::PoolOptions& options, ThreadPool& pool) {
  std::vector<TrainingPair> pairs(options.count);
  std::vector<uint8_t> valid(options.count);
  const auto tasks = static_cast<int>((options.count + kPairsPerTask - 1) / kPairsPerTask);
  pool.ParallelFor(tasks, [&](int task, int) {
    const size_t begin = static_cast<size_t>(task) * kPairsPerTask;
    const size_t end = std::min(options.count, begin + kPairsPerTask);
    for (size_t i = begin; i < end; ++i) valid[i] = Draw(source, options, i, &pairs[i]) ? 1 : 0;
  });
  size_t kept = 0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (valid[i] != 0) pairs[kept++] = pairs[i];
  }
  pairs.resize(kept);
  return pairs;
}

}  // namespace patina::bench
