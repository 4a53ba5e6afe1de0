#include <charconv>

#include "formats/base/names.h"
#include "formats/manifest_json.h"

namespace patina {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMaxEffects = 65536;

}  // namespace

double FloatAsWritten(float value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  double written = 0;
  std::from_chars(text, end, written);
  return static_cast<float>(written) == value ? written : static_cast<double>(value);
}

ordered_json EffectsToJson(const std::vector<ManifestEffect>& effects) {
  ordered_json json = ordered_json::array();
  for (const ManifestEffect& effect : effects) {
    ordered_json entry;
    entry["what"] = effect.what;
    entry["state"] = effect.state;
    entry["reason"] = effect.reason;
    if (effect.saved) {
      entry["saved"]["bytes"] = effect.saved->bytes;
      entry["saved"]["decode_multiply_adds"] = effect.saved->decode_multiply_adds;
      entry["saved"]["train_samples"] = effect.saved->train_samples;
      entry["saved"]["train_multiply_adds"] = effect.saved->train_multiply_adds;
    }
    json.push_back(std::move(entry));
  }
  return json;
}

ordered_json ConstantsToJson(const std::vector<ManifestChannel>& channels) {
  ordered_json constants = ordered_json::array();
  for (const ManifestChannel& channel : channels) {
    if (channel.output >= 0) continue;
    constants.push_back({{"map", channel.map},
                         {"component", channel.component},
                         {"encoding", channel.encoding},
                         {"value", FloatAsWritten(channel.constant)}});
    if (channel.scale != 1) constants.back()["scale"] = FloatAsWritten(channel.scale);
  }
  return constants;
}

std::vector<ManifestEffect> EffectsFromJson(const JsonView& manifest) {
  std::vector<ManifestEffect> effects;
  const JsonView list = manifest.Optional("effects");
  list.ForEach(kMaxEffects, [&](const JsonView& entry) {
    ManifestEffect effect;
    effect.what = entry.Field("what").String();
    effect.state = entry.Field("state").String();
    effect.reason = entry.Field("reason").String();
    if (const JsonView saved = entry.Optional("saved")) {
      effect.saved.emplace();
      effect.saved->bytes = saved.Field("bytes").Unsigned();
      effect.saved->decode_multiply_adds = saved.Field("decode_multiply_adds").Unsigned();
      effect.saved->train_samples = saved.Field("train_samples").Unsigned();
      effect.saved->train_multiply_adds = saved.Field("train_multiply_adds").Unsigned();
    }
    effects.push_back(std::move(effect));
  });
  if (list) return effects;
  manifest.Field("left_out").ForEach(kMaxEffects, [&](const JsonView& entry) {
    ManifestEffect effect;
    effect.what = entry.Field("what").String();
    effect.reason = entry.Field("reason").String();
    entry.Field("saved").String();
    effect.state = effect.reason.rfind("constant", 0) == 0 ? "constant" : "left_out";
    effects.push_back(std::move(effect));
  });
  return effects;
}

Status CheckEffects(const std::vector<ManifestEffect>& effects) {
  for (size_t i = 0; i < effects.size(); ++i) {
    const std::string& state = effects[i].state;
    if (state == "learned" || state == "constant" || state == "derived" || state == "left_out")
      continue;
    return Fail(ErrorCode::kInvalidArgument,
                "/effects/" + std::to_string(i) + "/state: " + QuoteForMessage(state) +
                    " is not one of: learned, constant, derived, left_out");
  }
  return {};
}

}  // namespace patina
