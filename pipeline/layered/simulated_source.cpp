#include "pipeline/layered/simulated_source.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>

namespace patina::layered {
namespace {

constexpr double kTrustedError = 0.05;
constexpr double kUsualEvents = 8;
// Walks that tell how long paths are and what leaves a stack.
constexpr int kTrialAngles = 8;
constexpr int kTrialWalks = 64;
// Squared errors are summed as integers: their order, which threads decide, must not count.
constexpr double kErrorUnit = 1e-9;

}  // namespace

Result<Outlook> LookAhead(const Simulator& simulator) {
  Outlook trial;
  double scattered = 0;
  Rng rng(1);
  for (int angle = 0; angle < kTrialAngles; ++angle) {
    const double z = (angle + 0.5) / kTrialAngles;
    const brdf::Direction w{static_cast<float>(std::sqrt(1 - z * z)), 0, static_cast<float>(z)};
    for (int walk = 0; walk < kTrialWalks; ++walk) {
      const Exit exit = simulator.Walk(w, &rng);
      trial.events += exit.events;
      const double share = std::max({exit.weight[0], exit.weight[1], exit.weight[2]});
      (exit.smooth ? trial.mirrored : scattered) += share;
    }
  }
  constexpr double kCount = kTrialAngles * kTrialWalks;
  trial.events /= kCount;
  trial.mirrored /= kCount;
  if (scattered > 0) return trial;
  return Fail(ErrorCode::kInvalidArgument,
              "the material only mirrors, or reflects nothing at all: there is no BRDF to learn; "
              "give a surface a roughness of 0.005 or more, or a layer or the base something "
              "that scatters");
}

std::vector<std::string> WarningsOf(const Outlook& outlook) {
  if (!(outlook.mirrored > 1e-4)) return {};
  char text[200];
  std::snprintf(text, sizeof text,
                "smooth surfaces mirror %.1f %% of the light, which no BRDF can hold and which is "
                "left out; give them a roughness of 0.005 or more to have it",
                100 * outlook.mirrored);
  return {text};
}

Effort ScaledFor(const Outlook& outlook, Effort effort) {
  const double scale = std::clamp(kUsualEvents / std::max(outlook.events, 1.0), 1.0 / 16, 1.0);
  const auto scaled = [scale](int paths, int least) {
    return std::max(least, static_cast<int>(scale * paths));
  };
  Accuracy& accuracy = effort.accuracy;
  accuracy.pilot_paths = scaled(accuracy.pilot_paths, 8);
  accuracy.min_paths = scaled(accuracy.min_paths, 8);
  accuracy.max_paths = std::max(accuracy.min_paths, scaled(accuracy.max_paths, 8));
  effort.draft_paths = scaled(effort.draft_paths, 2);
  return effort;
}

double TrustOf(double standard_error) {
  const double relative = standard_error / kTrustedError;
  return 1 / (1 + relative * relative);
}

uint64_t CountedSquare(double standard_error) {
  // More than any error of a logarithm that is still of use.
  return static_cast<uint64_t>(std::min(standard_error * standard_error, 1.0) / kErrorUnit);
}

double MeanOfCounted(uint64_t squares, uint64_t pairs) {
  if (pairs == 0) return 0;
  return std::sqrt(static_cast<double>(squares) * kErrorUnit / static_cast<double>(pairs));
}

namespace {

class StackTable : public brdf::SimulatedTable {
 public:
  StackTable(const Simulator& simulator, const Effort& effort)
      : simulator_(simulator), effort_(effort) {}

  bool Evaluate(const brdf::Direction& wi, const brdf::Direction& wo, float rgb[3]) const override {
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(wi.z > 0 && wo.z > 0)) return false;
    Store(simulator_.Evaluate(wi, wo, effort_.accuracy, effort_.seed), rgb);
    return true;
  }

  bool EvaluateToLearn(const brdf::Direction& wi, const brdf::Direction& wo, float rgb[3],
                       float* weight) const override {
    *weight = 1;
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(wi.z > 0 && wo.z > 0)) return false;
    const Estimate estimate = simulator_.Evaluate(wi, wo, effort_.accuracy, effort_.seed);
    Store(estimate, rgb);
    const double error = Simulator::StandardError(estimate, wi, wo);
    *weight = static_cast<float>(TrustOf(error));
    pairs_.fetch_add(1, std::memory_order_relaxed);
    paths_.fetch_add(static_cast<uint64_t>(estimate.spent), std::memory_order_relaxed);
    squares_.fetch_add(CountedSquare(error), std::memory_order_relaxed);
    return true;
  }

  void EvaluateDraft(const brdf::Direction& wi, const brdf::Direction& wo,
                     float rgb[3]) const override {
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(wi.z > 0 && wo.z > 0)) return;
    Store(simulator_.Average(wi, wo, effort_.draft_paths, effort_.seed), rgb);
  }

  brdf::SimulationCost Spent() const override {
    brdf::SimulationCost cost;
    cost.pairs = pairs_.load();
    cost.paths = paths_.load();
    cost.standard_error = MeanOfCounted(squares_.load(), cost.pairs);
    return cost;
  }

 private:
  static void Store(const Estimate& estimate, float rgb[3]) {
    for (size_t c = 0; c < 3; ++c) rgb[c] = static_cast<float>(std::min(estimate.f[c], 1e30));
  }

  Simulator simulator_;
  Effort effort_;
  mutable std::atomic<uint64_t> pairs_{0}, paths_{0}, squares_{0};
};

}  // namespace

Result<brdf::Source> SimulatedSource(const Stack& stack, const Effort& effort) {
  const Simulator simulator(stack);
  PATINA_ASSIGN(const Outlook outlook, LookAhead(simulator));
  brdf::Source source;
  source.format = "layered";
  source.isotropic = simulator.isotropic();
  source.simulated = std::make_shared<StackTable>(simulator, ScaledFor(outlook, effort));
  source.table = source.simulated;
  source.effects = EffectNames(simulator.effects());
  source.left_out_effects = LeftOutNames(simulator.effects());
  source.warnings = WarningsOf(outlook);
  return source;
}

}  // namespace patina::layered
