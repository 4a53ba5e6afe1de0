#include "pipeline/material/color_choice.h"

#include <cstdio>

namespace patina {
namespace {

// ICC profiles round to 1/65536 and adapt the white in their own ways.
constexpr double kSamePrimaries = 2e-3;
constexpr double kSameCurve = 1e-3;

std::string InWords(const Primaries& p, const TransferCurve& curve) {
  char text[160];
  std::snprintf(text, sizeof text, "primaries %.4f %.4f %.4f %.4f %.4f %.4f, white %.4f %.4f, ",
                p.red.x, p.red.y, p.green.x, p.green.y, p.blue.x, p.blue.y, p.white.x, p.white.y);
  std::string words = text;
  if (curve == TransferCurve()) return words + "linear";
  if (AreClose(curve, SrgbCurve(), kSameCurve)) return words + "sRGB curve";
  if (curve == PowerCurve(curve.gamma)) {
    std::snprintf(text, sizeof text, "gamma %.4f", curve.gamma);
    return words + text;
  }
  return words + "its own curve";
}

class Chooser {
 public:
  explicit Chooser(const ColorOptions& options) : options_(options) {}

  Result<ColorChoice> FromWord(const std::string& word) const {
    if (word == "srgb") return FromPrimaries(kRec709Primaries, SrgbCurve());
    if (word == "linear") return FromPrimaries(kRec709Primaries, TransferCurve());
    if (word == "raw") return Raw("raw");
    PATINA_ASSIGN(const ConfigSpace space, options_.config.Find(word));
    return FromSpace(space);
  }

  Result<ColorChoice> FromSpace(const ConfigSpace& space) const {
    if (space.is_data) return Raw(space.name);
    if (options_.config.source() == ConfigSource::kBuiltin) {
      // Known exactly, without tables.
      if (space.name == "sRGB") return FromPrimaries(kRec709Primaries, SrgbCurve());
      if (space.name == "lin_rec709") return FromPrimaries(kRec709Primaries, TransferCurve());
    }
    ColorChoice choice;
    choice.space = space.name;
    PATINA_ASSIGN(choice.transform, options_.config.ToWorking(space, options_.working));
    choice.linear_light = IsProportional(*choice.transform);
    return choice;
  }

  // The primaries must span a triangle.
  ColorChoice FromPrimaries(Primaries primaries, const TransferCurve& curve) const {
    const bool linear = curve == TransferCurve();
    ColorChoice choice;
    struct Known {
      const Primaries& primaries;
      const char* linear_name;
    };
    for (const Known& known :
         {Known{kRec709Primaries, "lin_rec709"}, Known{kAp1Primaries, "ACEScg"},
          Known{kAp0Primaries, "ACES2065-1"}}) {
      if (!AreSameSpace(primaries, known.primaries, kSamePrimaries)) continue;
      primaries = known.primaries;
      if (linear) choice.space = known.linear_name;
    }
    const bool srgb = AreClose(curve, SrgbCurve(), kSameCurve);
    if (srgb && primaries == kRec709Primaries) choice.space = "sRGB";
    if (choice.space.empty()) choice.space = InWords(primaries, curve);
    choice.linear_light = linear;
    const Primaries& working = PrimariesOf(options_.working);
    choice.srgb = srgb && primaries == working;
    if (!choice.srgb && !(linear && primaries == working))
      choice.transform = TransformFromTag(srgb ? SrgbCurve() : curve, primaries, working);
    return choice;
  }

 private:
  static ColorChoice Raw(const std::string& name) {
    ColorChoice choice;
    choice.space = name;
    return choice;
  }

  const ColorOptions& options_;
};

ColorChoice With(ColorRule rule, ColorChoice choice) {
  choice.rule = rule;
  return choice;
}

}  // namespace

const char* ColorRuleName(ColorRule rule) {
  switch (rule) {
    case ColorRule::kList:
      return "list";
    case ColorRule::kOption:
      return "option";
    case ColorRule::kName:
      return "name";
    case ColorRule::kTag:
      return "tag";
    case ColorRule::kFileRule:
      return "file_rule";
    case ColorRule::kDefault:
      return "default";
  }
  return "default";
}

std::string ColorPointer(const MapSource& source) {
  return "/maps/" + std::to_string(source.list_index) + "/color_space";
}

Result<ColorChoice> ChooseColor(const MapSource& source, const ImageInfo& info,
                                const ColorOptions& options, std::vector<std::string>* warnings) {
  const Chooser chooser(options);
  const bool listed = source.list_index >= 0;
  const auto by_word = [&](const std::string& word, ColorRule rule,
                           const std::string& pointer) -> Result<ColorChoice> {
    auto choice = chooser.FromWord(word);
    if (!choice) return Fail(std::move(choice).error(), pointer);
    return With(rule, std::move(*choice));
  };
  if (listed && source.color_space != "auto")
    return by_word(source.color_space, ColorRule::kList, ColorPointer(source));
  if (options.space != "auto") return by_word(options.space, ColorRule::kOption, "/color_space");
  if (source.color_space != "auto")
    return by_word(source.color_space, ColorRule::kName, source.path);
  const ColorTag& tag = info.color_tag;
  if (!tag.problem.empty()) warnings->push_back(source.file + ": " + tag.problem + ".");
  if (!tag.empty()) return With(ColorRule::kTag, chooser.FromPrimaries(tag.primaries, tag.curve));
  if (const auto space = options.config.FileRule(source.path)) {
    auto choice = chooser.FromSpace(*space);
    if (!choice) return Fail(std::move(choice).error(), source.path);
    return With(ColorRule::kFileRule, std::move(*choice));
  }
  return With(ColorRule::kDefault,
              chooser.FromPrimaries(kRec709Primaries,
                                    IsInteger(info.type) ? SrgbCurve() : TransferCurve()));
}

}  // namespace patina
