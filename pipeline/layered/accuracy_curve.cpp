#include "pipeline/layered/accuracy_curve.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pipeline/base/cpu_time.h"

namespace patina::layered {
namespace {

constexpr int kPairs = 24;
constexpr int kFewestPaths = 16, kMostPaths = 1024, kGrowth = 4;

brdf::Direction DrawDirection(Rng* rng) {
  const float z = 1 - rng->Uniform(), phi = 2 * std::numbers::pi_v<float> * rng->Uniform();
  const float s = std::sqrt(std::max(0.0f, 1 - z * z));
  return {s * std::cos(phi), s * std::sin(phi), z};
}

}  // namespace

std::vector<AccuracyPoint> MeasureAccuracy(const Simulator& simulator, uint64_t seed) {
  std::vector<AccuracyPoint> curve;
  for (int paths = kFewestPaths; paths <= kMostPaths; paths *= kGrowth) {
    Rng rng(seed);
    double squares = 0;
    const double start = ThreadCpuSeconds();
    for (int pair = 0; pair < kPairs; ++pair) {
      const brdf::Direction wi = DrawDirection(&rng), wo = DrawDirection(&rng);
      const double error = Simulator::StandardError(simulator.Average(wi, wo, paths, seed), wi, wo);
      squares += error * error;
    }
    curve.push_back({paths, std::sqrt(squares / kPairs), (ThreadCpuSeconds() - start) / kPairs});
  }
  return curve;
}

}  // namespace patina::layered
