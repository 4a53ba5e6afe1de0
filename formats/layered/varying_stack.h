// A layered material whose numbers vary over a surface: a stack, and the maps that stand in place
// of some of its numbers.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/layered/layered_stack.h"

namespace patina::layered {

inline constexpr double kMaxMapFactor = 1e6;  // of scale and offset, either sign

// Which number of a layer or of a part of the base.
enum class StackNumber {
  kIor,
  kRoughness,
  kRotation,  // in degrees
  kThickness,
  kAbsorption,
  kScattering,
  kAsymmetry,
  kWeight,
  kAlbedo
};
// Whether it has three channels.
inline bool IsColour(StackNumber number) {
  return number == StackNumber::kAbsorption || number == StackNumber::kScattering ||
         number == StackNumber::kAlbedo;
}

// value = offset + scale * sample
struct StackMap {
  std::string pointer;  // of the map's object
  std::string file;     // a plain name, beside the JSON file
  StackNumber number = StackNumber::kAlbedo;
  int layer = -1;       // index into Stack::layers, or -1:
  int part = -1;        // into Stack::parts
  int axis = -1;        // of roughness: 0 along x, 1 along y; -1 both
  std::string channel;  // "r", "g", "b", "a"; "": the first, of a colour the first three
  // Of an albedo: as MapSource::color_space. Other maps are never converted.
  std::string color_space = "auto";
  double scale = 1, offset = 0;
};

// A normal map, which turns the whole stack.
struct StackNormal {
  std::string file;
  bool directx = false;  // Y points down
};

struct VaryingStack {
  Stack stack;  // with some legal value where a map gives the number
  std::vector<StackMap> maps;
  std::optional<StackNormal> normal;
  bool wrap = true;  // beyond the edge of the maps; else the edge goes on

  bool varies() const { return !maps.empty() || normal.has_value(); }
  // The names of the maps' files, each once, sorted.
  std::vector<std::string> Files() const;
};

// As ParseStack (layered_file.h), maps allowed; of those only the words are looked at.
Result<VaryingStack> ParseVaryingStack(std::string_view text, const std::string& source_name);

// Errors: those of ReadTextFile and of ParseVaryingStack.
Result<VaryingStack> ReadVaryingStack(const std::string& path);

// Whether a file *.layers.json speaks of maps, by a look at its keys; false if it cannot be read.
bool HasStackMaps(const std::string& path);

}  // namespace patina::layered
