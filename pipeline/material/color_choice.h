// Which colour space the numbers of a colour map are in, who says so, and what brings them to the
// working space.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/color/color_config.h"
#include "pipeline/image/image.h"
#include "pipeline/image/map_finder.h"

namespace patina {

// When float colours are learned as logarithms. Jobs leave it at kByRange (see ChooseEncodings);
// the others are for measurements of that rule.
enum class LogEncoding { kByRange, kNever, kAlways };

// How colours are read. The same for all maps of a material.
struct ColorOptions {
  WorkingSpace working = WorkingSpace::kLinearRec709;
  ColorConfig config = ColorConfig::Builtin();
  std::string space = "auto";  // of every colour map that no list gives one; see MapSource
  LogEncoding logarithms = LogEncoding::kByRange;
};

// Who said which space it is, the first of these that says anything. Names reach manifests.
enum class ColorRule {
  kList,      // the entry of a list of maps
  kOption,    // ColorOptions::space
  kName,      // a word of the file's name: "linear", "srgb", "raw"
  kTag,       // the file itself: ICC profile, PNG chunks, EXR chromaticities
  kFileRule,  // a rule of the configuration, but not its default one
  kDefault    // integers are sRGB, floats linear Rec.709
};
const char* ColorRuleName(
    ColorRule rule);  // "list", "option", "name", "tag", "file_rule", "default"

struct ColorChoice {
  ColorRule rule = ColorRule::kDefault;
  // For people and manifests: of the configuration, or "sRGB", "lin_rec709", "ACEScg",
  // "ACES2065-1", "raw", or in words where it has no name.
  std::string space;
  // Codes of the sRGB curve over the working space's own primaries: kept as they are.
  bool srgb = false;
  // From the file's numbers to the working space, linear; null: they are in it (or srgb).
  ColorTransformPtr transform;
  bool linear_light = true;  // the file's numbers are proportional to light
};

// Chooses for a map of three components. Adds to `warnings` tags that cannot be followed.
// "srgb" and "linear" are those with the primaries of Rec.709 whatever the configuration holds,
// "raw" is taken for the working space; other names are the configuration's.
// Errors: those of ColorConfig::Find and ToWorking, led by the JSON pointer of a job's field where
// one named the space.
Result<ColorChoice> ChooseColor(const MapSource& source, const ImageInfo& info,
                                const ColorOptions& options, std::vector<std::string>* warnings);

// "/maps/2/color_space" of a listed map.
std::string ColorPointer(const MapSource& source);

}  // namespace patina
