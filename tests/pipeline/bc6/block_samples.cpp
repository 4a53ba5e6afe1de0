#include "tests/pipeline/bc6/block_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "pipeline/base/rng.h"

namespace patina::bc6 {
namespace {

// Near enough to a normal distribution, and the same everywhere.
float Normal(Rng& rng) {
  float sum = -6;
  for (int n = 0; n < 12; ++n) sum += rng.Uniform();
  return sum;
}

float Between(Rng& rng, float low, float high) { return low + (high - low) * rng.Uniform(); }

float ExpBetween(Rng& rng, float low, float high) {
  return low * std::exp2(rng.Uniform() * std::log2(high / low));
}

float FromBinades(float binades) {
  const float exponent = std::max(std::floor(binades), 1.0f);
  return std::ldexp(binades - exponent + 1.0f, static_cast<int>(exponent) - 15);
}

double TexelError(const WeightedTarget& target, int t, const double d[3]) {
  const auto h = [&](int q) { return static_cast<double>(target.hessian[q][t]); };
  return d[0] * (h(0) * d[0] + 2 * h(1) * d[1] + 2 * h(2) * d[2]) +
         d[1] * (h(3) * d[1] + 2 * h(4) * d[2]) + d[2] * h(5) * d[2];
}

}  // namespace

BlockSample MakeBlockSample(uint64_t seed) {
  Rng rng(seed, 17);
  BlockSample sample = {};
  float mix[3][3];
  for (auto& row : mix) {
    for (float& entry : row) entry = Normal(rng) * 0.6f;
  }
  const float gradient = ExpBetween(rng, 0.02f, 0.6f);
  const float noise = ExpBetween(rng, 0.02f, 0.5f);
  const float edge = rng.Uniform() < 0.5f ? ExpBetween(rng, 0.1f, 1.5f) : 0.0f;
  const float angle = Between(rng, 0, 6.2831853f), offset = Between(rng, -1.2f, 1.2f);
  const float cosine = std::cos(angle), sine = std::sin(angle);
  float base[3], slope[3][2], jump[3];
  for (int c = 0; c < 3; ++c) {
    base[c] = Normal(rng);
    slope[c][0] = Normal(rng) * gradient;
    slope[c][1] = Normal(rng) * gradient;
    jump[c] = Normal(rng) * edge;
  }
  for (int t = 0; t < 16; ++t) {
    const float x = static_cast<float>(t % 4) - 1.5f, y = static_cast<float>(t / 4) - 1.5f;
    const float side = std::clamp(2 * (x * cosine + y * sine - offset), -1.0f, 1.0f);
    float z[3];
    for (int c = 0; c < 3; ++c)
      z[c] = slope[c][0] * x + slope[c][1] * y + jump[c] * side + noise * Normal(rng);
    for (int c = 0; c < 3; ++c) {
      const float mixed = z[c] + mix[c][0] * z[0] + mix[c][1] * z[1] + mix[c][2] * z[2];
      sample.texels[c][t] = std::clamp(1.0f + 0.25f * (base[c] + mixed), 0.05f, 8.0f);
    }
  }
  sample.current = FitTexels(sample.texels);

  float output[9], jacobian[9][3];
  for (int o = 0; o < 9; ++o) {
    output[o] = ExpBetween(rng, 0.05f, 1.0f);
    for (float& entry : jacobian[o]) entry = Normal(rng) * output[o];
  }
  double trace = 0;
  for (int t = 0; t < 16; ++t) {
    const float size = ExpBetween(rng, 0.3f, 2.0f);
    float h[6] = {};
    for (int o = 0; o < 9; ++o) {
      float j[3];
      for (int c = 0; c < 3; ++c) j[c] = size * (jacobian[o][c] + 0.35f * Normal(rng) * output[o]);
      for (int q = 0, r = 0; r < 3; ++r) {
        for (int c = r; c < 3; ++c, ++q) h[q] += j[r] * j[c];
      }
    }
    for (int q = 0; q < 6; ++q) sample.target.hessian[q][t] = h[q];
    trace += h[0] + h[3] + h[5];
  }
  const float normalise = static_cast<float>(16 / trace);
  for (auto& row : sample.target.hessian) {
    for (float& entry : row) entry *= normalise;
  }
  std::copy(&sample.texels[0][0], &sample.texels[0][0] + 48, &sample.target.value[0][0]);
  return sample;
}

void SoftValues(const SoftBlock& block, float out[3][16]) {
  const unsigned mask = bc6h::PartitionMask(block.partition);
  for (int t = 0; t < 16; ++t) {
    const int r = (mask >> t) & 1;
    for (int c = 0; c < 3; ++c) {
      const float a = block.endpoint[2 * r][c], b = block.endpoint[2 * r + 1][c];
      out[c][t] = FromBinades(a + block.index[t] * (b - a));
    }
  }
}

double WeightedError(const WeightedTarget& target, const float values[3][16]) {
  double error = 0;
  for (int t = 0; t < 16; ++t) {
    double d[3];
    for (int c = 0; c < 3; ++c)
      d[c] = static_cast<double>(values[c][t]) - static_cast<double>(target.value[c][t]);
    error += TexelError(target, t, d);
  }
  return error;
}

double LeastErrorOverIndices(const WeightedTarget& target, const bc6h::BlockFields& fields) {
  const bc6h::ModeInfo& mode = bc6h::Mode(fields.mode);
  const int entries = 1 << mode.index_bits;
  double least = std::numeric_limits<double>::infinity();
  for (int order = 0; order < 2; ++order) {
    bc6h::BlockFields trial = fields;
    if (order == 1) std::swap(trial.endpoints[0], trial.endpoints[1]);
    std::fill(trial.indices, trial.indices + 16, uint8_t{0});
    if (!bc6h::Pack(trial, bc6h::Format::kUf16)) continue;
    // Entry k of all texels at once, then each texel takes its best. Region 1 may always be turned
    // round: no limit there.
    double best[16];
    std::fill(best, best + 16, std::numeric_limits<double>::infinity());
    for (int k = 0; k < entries; ++k) {
      float values[3][16];
      std::fill(trial.indices, trial.indices + 16, static_cast<uint8_t>(k));
      DecodeToFloat(trial, values);
      for (int t = 0; t < 16; ++t) {
        if (t == 0 && k >= entries / 2) continue;
        double d[3];
        for (int c = 0; c < 3; ++c)
          d[c] = static_cast<double>(values[c][t]) - static_cast<double>(target.value[c][t]);
        best[t] = std::min(best[t], TexelError(target, t, d));
      }
    }
    double sum = 0;
    for (double error : best) sum += error;
    least = std::min(least, sum);
  }
  return least;
}

bool RoundSoftBlock(const SoftBlock& block, int mode, bc6h::BlockFields* fields) {
  const bc6h::ModeInfo& info = bc6h::Mode(mode);
  *fields = {};
  fields->mode = mode;
  fields->partition = block.partition;
  const double step = std::ldexp(31.0, -info.endpoint_bits);
  for (int e = 0; e < 4; ++e) {
    for (int c = 0; c < 3; ++c) {
      const auto code =
          static_cast<int>(std::lround(static_cast<double>(block.endpoint[e][c]) / step - 0.5));
      fields->endpoints[e][c] = std::clamp(code, 0, (1 << info.endpoint_bits) - 1);
    }
  }
  for (int t = 0; t < 16; ++t)
    fields->indices[t] = static_cast<uint8_t>(std::lround(block.index[t] * 7));
  bc6h::FixAnchors(fields);
  return bc6h::Pack(*fields, bc6h::Format::kUf16).has_value();
}

}  // namespace patina::bc6
