#include "pipeline/effects/effects.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

namespace patina {
namespace {

constexpr const char* kNames[] = {"constant", "equal", "unused", "alpha", "unlit", "mips"};

// A map of strength 0 and what has no meaning then.
struct Gate {
  const char* strength;
  std::array<const char*, 2> governed;
};
constexpr Gate kGates[] = {
    {"clearcoat", {"clearcoat_roughness", "clearcoat_normal"}},
    {"sheen_color", {"sheen_roughness", nullptr}},
    {"anisotropy", {"anisotropy_direction", "anisotropy_rotation"}},
    {"iridescence", {"iridescence_thickness", nullptr}},
    {"translucency", {"translucency_color", nullptr}},
};

std::string Shortest(float value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", static_cast<double>(value));
  return text;
}

}  // namespace

std::span<const char* const> EffectNames() { return kNames; }

bool* EffectSwitch(EffectSwitches* switches, std::string_view name) {
  bool* const all[] = {&switches->constant, &switches->equal, &switches->unused,
                       &switches->alpha,    &switches->unlit, &switches->mips};
  for (size_t i = 0; i < std::size(kNames); ++i) {
    if (name == kNames[i]) return all[i];
  }
  return nullptr;
}

bool EffectIsOn(const EffectSwitches& switches, ScenePrune prune) {
  switch (prune) {
    case ScenePrune::kNone:
      return false;
    case ScenePrune::kAlpha:
      return switches.alpha;
    case ScenePrune::kUnlit:
      return switches.unlit;
    case ScenePrune::kUnused:
      return switches.unused;
  }
  return false;
}

const char* EffectStateName(EffectState state) {
  switch (state) {
    case EffectState::kLearned:
      return "learned";
    case EffectState::kConstant:
      return "constant";
    case EffectState::kDerived:
      return "derived";
    case EffectState::kLeftOut:
      return "left_out";
  }
  return "learned";
}

std::vector<ChannelVerdict> JudgeChannels(std::span<const ChannelFacts> channels,
                                          const EffectSwitches& switches) {
  std::vector<ChannelVerdict> verdicts(channels.size());
  std::map<std::string, bool> zero;  // whether all channels of a map are 0
  for (size_t i = 0; i < channels.size(); ++i) {
    const ChannelFacts& facts = channels[i];
    ChannelVerdict& verdict = verdicts[i];
    const double tolerance = facts.map == "displacement" ? 0 : switches.constant_tolerance;
    const double spread = (static_cast<double>(facts.high) - facts.low) / facts.unit;
    const bool exact = facts.low == facts.high;
    // Neighbouring codes are a little more than one code apart in single precision.
    if (switches.constant && (exact || spread <= 2 * tolerance * (1 + 1e-6))) {
      verdict.state = EffectState::kConstant;
      verdict.constant = exact ? facts.low : 0.5f * facts.low + 0.5f * facts.high;
      verdict.reason = "constant " + Shortest(verdict.constant);
      if (!exact)
        verdict.reason +=
            ", its samples are " + Shortest(facts.low) + " to " + Shortest(facts.high);
    }
    const bool nothing = std::abs(facts.low) <= tolerance * facts.unit &&
                         std::abs(facts.high) <= tolerance * facts.unit;
    const auto [entry, first] = zero.emplace(facts.map, nothing);
    if (!first) entry->second = entry->second && nothing;
  }
  if (!switches.unused) return verdicts;
  for (const Gate& gate : kGates) {
    const auto strength = zero.find(gate.strength);
    if (strength == zero.end() || !strength->second) continue;
    for (size_t i = 0; i < channels.size(); ++i) {
      for (const char* governed : gate.governed) {
        if (governed == nullptr || channels[i].map != governed) continue;
        verdicts[i] = {EffectState::kLeftOut, 0, std::string(gate.strength) + " is 0"};
      }
    }
  }
  return verdicts;
}

std::string ChannelName(const std::string& map, const std::string& component) {
  return component.empty() ? map : map + "." + component;
}

std::array<int, 2> LodRangeOf(const TexelDensity& density, int width, int height, int levels) {
  const double texels_per_m = std::max(width, height) / density.uv_size_m;
  const double finest = std::floor(std::log2(texels_per_m / density.max_pixels_per_m));
  const double coarsest = std::ceil(std::log2(texels_per_m / density.min_pixels_per_m));
  const double last = levels - 1;
  return {static_cast<int>(std::clamp(finest, 0.0, last)),
          static_cast<int>(std::clamp(coarsest, 0.0, last))};
}

}  // namespace patina
