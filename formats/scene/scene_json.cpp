#include "formats/scene/scene_json.h"

#include <cmath>

#include "formats/base/names.h"

namespace patina {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMaxEntries = 4096;

ordered_json ValuesToJson(const char* key, const std::vector<SceneValue>& values) {
  ordered_json json = ordered_json::array();
  for (const SceneValue& value : values) {
    ordered_json entry;
    entry[key] = value.map;
    entry["value"] = value.value;
    json.push_back(std::move(entry));
  }
  return json;
}

std::vector<SceneValue> ValuesFromJson(const char* key, const JsonView& json) {
  std::vector<SceneValue> values;
  json.ForEach(kMaxEntries, [&](const JsonView& entry) {
    SceneValue value;
    value.map = entry.Field(key).String();
    entry.Field("value").ForEach(4, [&](const JsonView& v) { value.value.push_back(v.Number()); });
    values.push_back(std::move(value));
  });
  return values;
}

std::array<double, 2> PairFromJson(const JsonView& json) {
  std::array<double, 2> pair = {0, 0};
  size_t i = 0;
  json.ForEach(2, [&](const JsonView& v) { pair[i++] = v.Number(); });
  return pair;
}

SceneWrap WrapFromName(const std::string& name) {
  if (name == "clamp") return SceneWrap::kClamp;
  return name == "mirror" ? SceneWrap::kMirror : SceneWrap::kRepeat;
}

}  // namespace

ordered_json SceneLookToJson(const SceneLook& look) {
  ordered_json json;
  json["file"] = look.file;
  json["material"] = look.material;
  json["index"] = look.index;
  json["alpha_mode"] = look.alpha_mode;
  if (look.alpha_mode == "mask") json["alpha_cutoff"] = look.alpha_cutoff;
  json["double_sided"] = look.double_sided;
  json["unlit"] = look.unlit;
  json["factors"] = ValuesToJson("map", look.factors);
  json["parameters"] = ValuesToJson("name", look.parameters);
  json["bindings"] = ordered_json::array();
  for (const SceneBinding& binding : look.bindings) {
    ordered_json entry;
    entry["slot"] = binding.slot;
    entry["maps"] = binding.maps;
    entry["tex_coord"] = binding.tex_coord;
    if (!(binding.transform == UvTransform())) {
      entry["transform"]["offset"] = binding.transform.offset;
      entry["transform"]["rotation"] = binding.transform.rotation;
      entry["transform"]["scale"] = binding.transform.scale;
    }
    entry["wrap"] = {SceneWrapName(binding.wrap_s), SceneWrapName(binding.wrap_t)};
    json["bindings"].push_back(std::move(entry));
  }
  return json;
}

SceneLook SceneLookFromJson(const JsonView& json) {
  SceneLook look;
  look.file = json.Field("file").String();
  look.material = json.Field("material").String();
  look.index = json.Field("index").Int(0, 1 << 24);
  look.alpha_mode = json.Field("alpha_mode").String();
  if (const JsonView cutoff = json.Optional("alpha_cutoff")) look.alpha_cutoff = cutoff.Number();
  look.double_sided = json.Field("double_sided").Bool();
  look.unlit = json.Field("unlit").Bool();
  look.factors = ValuesFromJson("map", json.Field("factors"));
  look.parameters = ValuesFromJson("name", json.Field("parameters"));
  json.Field("bindings").ForEach(kMaxEntries, [&](const JsonView& entry) {
    SceneBinding binding;
    binding.slot = entry.Field("slot").String();
    entry.Field("maps").ForEach(kMaxEntries,
                                [&](const JsonView& map) { binding.maps.push_back(map.String()); });
    binding.tex_coord = entry.Field("tex_coord").Int(0, kMaxTexCoord);
    if (const JsonView transform = entry.Optional("transform")) {
      binding.transform.offset = PairFromJson(transform.Field("offset"));
      binding.transform.rotation = transform.Field("rotation").Number();
      binding.transform.scale = PairFromJson(transform.Field("scale"));
    }
    std::vector<SceneWrap> wrap;
    entry.Field("wrap").ForEach(
        2, [&](const JsonView& name) { wrap.push_back(WrapFromName(name.String())); });
    wrap.resize(2, SceneWrap::kRepeat);
    binding.wrap_s = wrap[0];
    binding.wrap_t = wrap[1];
    look.bindings.push_back(std::move(binding));
  });
  return look;
}

Status CheckSceneLook(const SceneLook& look) {
  const auto bad = [](const std::string& pointer, const std::string& what) {
    return Fail(ErrorCode::kInvalidArgument, "/scene" + pointer + ": " + what);
  };
  if (look.alpha_mode != "opaque" && look.alpha_mode != "mask" && look.alpha_mode != "blend") {
    return bad("/alpha_mode",
               QuoteForMessage(look.alpha_mode) + " is not one of: opaque, mask, blend");
  }
  if (!std::isfinite(look.alpha_cutoff)) return bad("/alpha_cutoff", "not a finite number");
  for (const auto& [key, list] :
       {std::pair{"/factors/", &look.factors}, {"/parameters/", &look.parameters}}) {
    for (size_t i = 0; i < list->size(); ++i) {
      const SceneValue& value = (*list)[i];
      bool legal = !value.map.empty() && !value.value.empty();
      for (const double v : value.value) legal = legal && std::isfinite(v);
      if (!legal) return bad(key + std::to_string(i), "no name, or no finite numbers");
    }
  }
  return {};
}

}  // namespace patina
