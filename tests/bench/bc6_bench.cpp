// What each step of the BC6H encoder gains and costs, on blocks as the exporter meets them
// (block_samples.h). Prints the median and the range of the CPU time a block over alternating
// rounds, and errors as ratios to the first row, which is the only mode of Weinreich 2024.
//
// Usage: patina_bc6_bench [blocks]
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/kernels/dispatch.h"
#include "tests/pipeline/bc6/block_samples.h"

namespace {

using namespace patina;
using namespace patina::bc6;

constexpr int kRounds = 7;

double ErrorOf(const BlockSample& sample, const bc6h::BlockFields& fields) {
  float values[3][16];
  DecodeToFloat(fields, values);
  return WeightedError(sample.target, values);
}

// The mode that holds the soft block with the smallest distance between endpoints and codes.
bc6h::BlockFields NearestCodes(const SoftBlock& block) {
  bc6h::BlockFields best, fields;
  double least = 1e30;
  for (int mode = 0; mode < 10; ++mode) {
    if (!RoundSoftBlock(block, mode, &fields)) continue;
    const double step = std::ldexp(31.0, -bc6h::Mode(mode).endpoint_bits);
    double distance = 0;
    for (const auto& endpoint : block.endpoint) {
      for (float e : endpoint) {
        const double at = static_cast<double>(e) / step - 0.5, miss = (at - std::round(at)) * step;
        distance += miss * miss;
      }
    }
    if (distance < least) {
      least = distance;
      best = fields;
    }
  }
  return best;
}

struct Recipe {
  std::string name;
  std::string target;  // SIMD target to force
  std::function<bc6h::BlockFields(const BlockSample&)> run;
  std::array<double, kRounds> us = {};
  double error = 0, log_error = 0;
  std::array<int, bc6h::kModeCount> modes = {};
};

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::max(1, std::atoi(argv[1])) : 2000;
  std::vector<BlockSample> samples;
  for (int n = 0; n < count; ++n) samples.push_back(MakeBlockSample(static_cast<uint64_t>(n)));

  const auto six_bits = [](const BlockSample& s) {
    bc6h::BlockFields fields;
    RoundSoftBlock(s.current, bc6h::kModeSixBit, &fields);
    return fields;
  };
  const auto nearest = [](const BlockSample& s) { return NearestCodes(s.current); };
  const auto encode = [](const BlockSample& s) { return Encode(s.target, s.current).fields; };
  const auto refine = [](const BlockSample& s) {
    return Refine(s.target, NearestCodes(s.current)).fields;
  };
  const auto both = [](const BlockSample& s) {
    return Refine(s.target, Encode(s.target, s.current).fields).fields;
  };

  std::vector<Recipe> recipes;
  recipes.push_back({"6-bit mode, nearest", "auto", six_bits});
  recipes.push_back({"best two-region mode, nearest", "auto", nearest});
  recipes.push_back({"the same + Refine", "auto", refine});
  recipes.push_back({"Encode", "auto", encode});
  recipes.push_back({"Encode + Refine", "auto", both});
  if (SimdTargetSupported(SimdTarget::kAvx512)) {
    recipes.push_back({"Encode + Refine on AVX2", "avx2", both});
  }

  for (int round = 0; round < kRounds; ++round) {
    for (Recipe& recipe : recipes) {
      if (!ForceSimdTarget(recipe.target)) return 1;
      const std::clock_t start = std::clock();
      std::vector<bc6h::BlockFields> out;
      out.reserve(samples.size());
      for (const BlockSample& sample : samples) out.push_back(recipe.run(sample));
      recipe.us[static_cast<size_t>(round)] =
          static_cast<double>(std::clock() - start) * 1e6 / CLOCKS_PER_SEC / count;
      if (round > 0) continue;
      for (int n = 0; n < count; ++n) {
        const double error = ErrorOf(samples[static_cast<size_t>(n)], out[static_cast<size_t>(n)]);
        recipe.error += error / count;
        recipe.log_error += std::log(error) / count;
        ++recipe.modes[static_cast<size_t>(out[static_cast<size_t>(n)].mode)];
      }
    }
  }

  std::array<double, kRounds> fit_us = {};
  int fitted = 0;
  for (double& us : fit_us) {
    const std::clock_t start = std::clock();
    for (const BlockSample& sample : samples)
      fitted += FitTexels(sample.texels).partition == sample.current.partition;
    us = static_cast<double>(std::clock() - start) * 1e6 / CLOCKS_PER_SEC / count;
  }
  std::sort(fit_us.begin(), fit_us.end());
  if (fitted != kRounds * count) return 1;  // not deterministic

  double soft_error = 0;
  for (const BlockSample& sample : samples) {
    float values[3][16];
    SoftValues(sample.current, values);
    soft_error += WeightedError(sample.target, values) / count;
  }
  std::printf(
      "%d blocks; FitTexels %.2f us/block; its blocks in floats have a mean error of %.3e\n\n",
      count, fit_us[kRounds / 2], soft_error);
  std::printf(
      "| recipe | us/block, median (range) | mean error | ratio | geometric ratio "
      "|\n|---|---|---|---|---|\n");
  for (Recipe& recipe : recipes) {
    std::sort(recipe.us.begin(), recipe.us.end());
    std::printf("| %s | %.2f (%.2f-%.2f) | %.3e | %.4f | %.4f |\n", recipe.name.c_str(),
                recipe.us[kRounds / 2], recipe.us.front(), recipe.us.back(), recipe.error,
                recipe.error / recipes[0].error, std::exp(recipe.log_error - recipes[0].log_error));
  }
  std::printf("\nmodes chosen by Encode, per cent:");
  for (int mode = 0; mode < bc6h::kModeCount; ++mode) {
    std::printf(" %d: %.1f", mode, 100.0 * recipes[3].modes[static_cast<size_t>(mode)] / count);
  }
  std::printf("\n");
  return 0;
}
