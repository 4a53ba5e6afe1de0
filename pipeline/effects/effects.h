// Which channels of a material have to be learned at all, decided from what the scene calls for and
// from the range of the samples. Pure functions: no pixels are read here.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/scene/scene.h"

namespace patina {

// Half an 8-bit code. A channel that stays within it of one value differs from it by less than what
// rounding to 8 bits does, a PSNR of at least 54 dB: above what a learned channel reaches.
inline constexpr double kDefaultConstantTolerance = 0.5 / 255;

// What prunes work. Each can be turned off, to measure what it brings. Names reach job files.
struct EffectSwitches {
  bool constant = true;  // channels of one value are numbers
  bool equal = true;     // channels with the same values share an output of the network
  bool unused = true;    // maps that nothing looks at: extensions of strength 0, not in "uses"
  bool alpha = true;     // no opacity of an opaque material
  bool unlit = true;     // only colour and opacity of an unlit material
  bool mips = true;      // only the mips that are looked at
  // Largest deviation from the stored number, of coded values; 0 is exactly constant.
  double constant_tolerance = kDefaultConstantTolerance;
  bool operator==(const EffectSwitches&) const = default;
};

// "constant", "equal", "unused", "alpha", "unlit", "mips".
std::span<const char* const> EffectNames();
// The switch of that name, or nullptr.
bool* EffectSwitch(EffectSwitches* switches, std::string_view name);
bool EffectIsOn(const EffectSwitches& switches, ScenePrune prune);

enum class EffectState { kLearned, kConstant, kDerived, kLeftOut };
const char* EffectStateName(EffectState state);  // "learned", "constant", "derived", "left_out"

// What became of a channel, a map or a group of mips.
struct Effect {
  std::string what;  // "metalness", "albedo.r", "normal.z", "mips 0 to 1"
  EffectState state = EffectState::kLearned;
  std::string reason;
  int outputs = 0;  // outputs of the network that are not needed for it
};

// What is known of a channel from its samples on mip 0.
struct ChannelFacts {
  std::string map;
  std::string component;
  float low = 0, high = 0;  // coded
  float unit = 1;           // coded values are learned divided by this
};

struct ChannelVerdict {
  EffectState state = EffectState::kLearned;
  float constant = 0;  // coded, of kConstant; within the tolerance of every sample
  std::string reason;
};

// One verdict for each channel. Constant: high - low is at most twice the tolerance (of
// displacement, whose unit nobody knows, 0). Left out: what a map of strength 0 governs, such as
// the direction of an anisotropy of 0.
std::vector<ChannelVerdict> JudgeChannels(std::span<const ChannelFacts> channels,
                                          const EffectSwitches& switches);

// "metalness", "albedo.r".
std::string ChannelName(const std::string& map, const std::string& component);

// The mips that a density calls for: the finest and the coarsest. Of a texture of width x height
// with `levels` mips.
std::array<int, 2> LodRangeOf(const TexelDensity& density, int width, int height, int levels);

}  // namespace patina
