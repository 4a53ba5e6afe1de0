#include "formats/layered/layered_file.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/json_view.h"
#include "formats/layered/varying_stack.h"

namespace patina::layered {
namespace {

using Json = nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

constexpr int kDeepestJson = 16;
constexpr int kFileVersion = 1;
constexpr double kDegrees = 180 / std::numbers::pi;

// Numbers that stand where a map gives them, for the checks of all the others.
constexpr double kAnyRoughness = 0.5, kAnyThickness = 1, kAnyCoefficient = 1;

std::string Number(double value) { return OrderedJson(value).dump(); }

// The first thing that is wrong with a stack.
class Checker {
 public:
  explicit Checker(const Stack& stack) : stack_(stack) {}

  Status Run() {
    if (stack_.layers.size() > kMaxLayers) {
      Complain("/layers", std::to_string(stack_.layers.size()) + " layers; merge some, at most " +
                              std::to_string(kMaxLayers) + " are simulated");
    }
    for (size_t i = 0; i < stack_.layers.size(); ++i)
      CheckLayer(stack_.layers[i], "/layers/" + std::to_string(i));
    CheckBase();
    if (problem_.empty()) return {};
    return Fail(ErrorCode::kInvalidArgument, problem_);
  }

 private:
  void Complain(const std::string& pointer, const std::string& what) {
    if (problem_.empty()) problem_ = pointer + ": " + what;
  }
  void Within(const std::string& pointer, double value, double min, double max,
              const std::string& remedy) {
    if (!(value >= min && value <= max)) Complain(pointer, Number(value) + " " + remedy);
  }

  void CheckRoughness(const Roughness& roughness, const std::string& pointer) {
    if (roughness.x == 0 && roughness.y == 0) return;
    for (const double alpha : {roughness.x, roughness.y}) {
      Within(pointer + "/roughness", alpha, kMinRoughness, 1,
             "is no GGX roughness; give 0 for a smooth surface, else 0.0001 to 1 along both axes");
    }
    Within(pointer + "/rotation_deg", roughness.rotation_rad * kDegrees, -360, 360,
           "is beyond a full turn; give degrees between -360 and 360");
  }

  void CheckLayer(const Layer& layer, const std::string& at) {
    Within(at + "/ior", layer.ior, 1, kMaxIor,
           layer.ior < 1
               ? "is below 1, which no dielectric has; give the index of the layer itself "
                 "(1 for none, 1.5 for lacquer), not that against the layer above"
               : "is more than 10; metals are a base of the kind \"conductor\"");
    CheckRoughness(layer.roughness, at);
    Within(at + "/thickness", layer.thickness, 0, kMaxThickness,
           layer.thickness < 0 ? "is negative; give 0 or more, in the unit of the coefficients"
                               : "is more than 1000000; choose a larger unit of length");
    bool fills = false;
    for (size_t c = 0; c < 3; ++c) {
      Within(at + "/absorption", layer.absorption[c], 0, kMaxCoefficient,
             "is no coefficient per length; give 0 to 1000000");
      Within(at + "/scattering", layer.scattering[c], 0, kMaxCoefficient,
             "is no coefficient per length; give 0 to 1000000");
      fills = fills || layer.absorption[c] > 0 || layer.scattering[c] > 0;
    }
    Within(at + "/asymmetry", layer.asymmetry, -kMaxAsymmetry, kMaxAsymmetry,
           "is no mean cosine that can be simulated; give -0.99 to 0.99");
    if (fills && layer.thickness == 0) {
      Complain(at,
               "absorbs or scatters without any thickness; give \"thickness\", or leave "
               "\"absorption\" and \"scattering\" out");
    }
  }

  void CheckBase() {
    if (stack_.parts.size() > kMaxParts) {
      Complain("/base/parts", std::to_string(stack_.parts.size()) + " parts; merge some, at most " +
                                  std::to_string(kMaxParts) + " are simulated");
    }
    double sum = 0;
    const bool mixed = stack_.parts.size() > 1;
    for (size_t p = 0; p < stack_.parts.size(); ++p) {
      const BasePart& part = stack_.parts[p];
      const std::string at = mixed ? "/base/parts/" + std::to_string(p) : "/base";
      Within(at + "/weight", part.weight, 0, 1, "is no share of the base; give 0 to 1");
      sum += part.weight;
      if (part.kind == BaseKind::kDiffuse) {
        for (const double albedo : part.albedo) {
          Within(at + "/albedo", albedo, 0, 1,
                 albedo > 1 ? "is above 1: the base would make light; give 0 to 1"
                            : "is no share of light; give 0 to 1");
        }
        continue;
      }
      for (size_t c = 0; c < 3; ++c) {
        Within(at + "/eta", part.eta[c], 0.01, 100, "is no index of a metal; give 0.01 to 100");
        Within(at + "/k", part.k[c], 0, 100, "is no extinction of a metal; give 0 to 100");
      }
      CheckRoughness(part.roughness, at);
      if (mixed && part.roughness.smooth()) {
        Complain(at + "/roughness",
                 "is 0, which a part of a mixture cannot be; give 0.0001 or more");
      }
    }
    if (sum > 1 + 1e-9) {
      Complain("/base/parts", "the weights sum to " + Number(std::round(sum * 1e9) / 1e9) +
                                  ", so the base would make light; let them sum to at most 1");
    }
  }

  const Stack& stack_;
  std::string problem_;
};

class Reader {
 public:
  explicit Reader(const Json& json) : json_(json), view_(&json, &problem_) {}

  Result<VaryingStack> Run() {
    Complain(UnknownMember(json_, "", {"version", "layers", "base", "normal", "address"}));
    const int version = view_.Field("version").Int(1, 1 << 20);
    if (problem_.text.empty() && version != kFileVersion) {
      Complain("/version: " + std::to_string(version) +
               " is a version that this program does not know; it reads 1");
    }
    if (const JsonView layers = view_.Optional("layers")) {
      size_t i = 0;
      layers.ForEach(kMaxLayers, [&](const JsonView& layer) {
        const std::string at = "/layers/" + std::to_string(i);
        ReadLayer(layer, json_["layers"][i++], at);
      });
    }
    const JsonView base = view_.Optional("base");
    if (problem_.text.empty() && !base && json_.is_object()) {
      Complain(
          "/base: is missing; say what the layers lie on: {\"kind\": \"diffuse\", \"albedo\": "
          "0.5}, a conductor, a mixture, or {\"kind\": \"black\"}");
    }
    if (base) ReadBase(base, json_["base"]);
    ReadSurface();
    if (!problem_.text.empty()) return Fail(ErrorCode::kInvalidArgument, problem_.text);
    PATINA_TRY(CheckStack(stack_));
    varying_.stack = std::move(stack_);
    return std::move(varying_);
  }

 private:
  void Complain(const std::string& text) {
    if (problem_.text.empty()) problem_.text = text;
  }

  // What belongs to the surface as a whole.
  void ReadSurface() {
    if (const JsonView normal = view_.Optional("normal")) {
      Complain(UnknownMember(json_["normal"], "/normal", {"map", "convention"}));
      StackNormal& read = varying_.normal.emplace();
      read.file = ReadFileName(normal, "/normal");
      if (const JsonView convention = normal.Optional("convention")) {
        const std::string word = convention.String();
        read.directx = word == "directx";
        if (word != "directx" && word != "opengl") {
          Complain("/normal/convention: " + QuoteForMessage(word) +
                   " is neither \"opengl\" (Y up) nor \"directx\" (Y down)");
        }
      }
    }
    const JsonView address = view_.Optional("address");
    if (!address) return;
    const std::string word = address.String();
    varying_.wrap = word != "clamp";
    if (word != "wrap" && word != "clamp")
      Complain("/address: " + QuoteForMessage(word) + " is neither \"wrap\" nor \"clamp\"");
    if (!varying_.varies())
      Complain("/address: says how maps go on, and there is no map; leave it out");
  }

  std::string ReadFileName(const JsonView& object, const std::string& pointer) {
    std::string file = object.Field("map").String();
    if (!problem_.text.empty()) return file;
    if (const Status plain = CheckPlainName(file, pointer + "/map:"); !plain)
      Complain(plain.error().message + "; give the name of an image beside this file");
    return file;
  }

  // The map in place of a value of the object at at_.
  void ReadMap(const JsonView& view, const Json& json, const std::string& pointer,
               StackNumber number, int axis = -1) {
    Complain(
        number == StackNumber::kAlbedo
            ? UnknownMember(json, pointer, {"map", "channel", "scale", "offset", "color_space"})
            : UnknownMember(json, pointer, {"map", "channel", "scale", "offset"}));
    StackMap map;
    map.pointer = pointer;
    map.number = number;
    map.axis = axis;
    (in_base_ ? map.part : map.layer) =
        static_cast<int>(in_base_ ? stack_.parts.size() : stack_.layers.size());
    map.file = ReadFileName(view, pointer);
    if (const JsonView channel = view.Optional("channel")) {
      map.channel = channel.String();
      const bool is_one = map.channel.size() == 1 &&
                          std::string_view("rgba").find(map.channel) != std::string_view::npos;
      if (!is_one) {
        Complain(pointer + "/channel: " + QuoteForMessage(map.channel) +
                 " is not one of: r, g, b, a");
      }
    }
    if (const JsonView space = view.Optional("color_space")) {
      map.color_space = space.String(255);
      if (map.color_space.empty())
        Complain(pointer + "/color_space: is empty; leave it out to have it found out");
    }
    ReadFactor(view, "scale", pointer, &map.scale);
    ReadFactor(view, "offset", pointer, &map.offset);
    varying_.maps.push_back(std::move(map));
  }

  void ReadFactor(const JsonView& map, const char* key, const std::string& pointer,
                  double* factor) {
    if (const JsonView value = map.Optional(key)) *factor = value.Number();
    if (std::abs(*factor) <= kMaxMapFactor) return;
    Complain(pointer + "/" + key + ": " + Number(*factor) +
             " is beyond 1000000; choose another unit of length");
  }

  // The number under `key`, or the map in its place, for which `any` stands.
  void ReadNumber(const JsonView& object, const Json& json, const char* key, StackNumber number,
                  double any, double* value) {
    const JsonView view = object.Optional(key);
    if (!view) return;
    if (!json[key].is_object()) {
      *value = view.Number();
      return;
    }
    ReadMap(view, json[key], Pointer(key), number);
    *value = any;
  }

  // One number for all channels, three, or a map.
  void ReadColour(const JsonView& object, const Json& json, const char* key, StackNumber number,
                  double any, Rgb* rgb) {
    const JsonView value = object.Optional(key);
    if (!value) return;
    if (!json[key].is_object()) return ReadRgb(object, json, key, rgb);
    ReadMap(value, json[key], Pointer(key), number);
    rgb->fill(any);
  }

  // One number for all channels, or three.
  void ReadRgb(const JsonView& object, const Json& json, const char* key, Rgb* rgb) {
    const JsonView value = object.Optional(key);
    if (!value) return;
    if (!json[key].is_array()) {
      rgb->fill(value.Number());
      return;
    }
    size_t c = 0;
    value.ForEach(3, [&](const JsonView& v) { (*rgb)[c++] = v.Number(); });
    if (c != 3) Complain(Pointer(key) + ": must be a number, or three of them");
  }

  void ReadRoughness(const JsonView& object, const Json& json, Roughness* roughness) {
    if (const JsonView value = object.Optional("roughness")) {
      if (json["roughness"].is_array()) {
        size_t axis = 0;
        double alpha[2] = {0, 0};
        value.ForEach(2, [&](const JsonView& v) {
          const Json& element = json["roughness"][axis];
          if (element.is_object()) {
            ReadMap(v, element, Pointer("roughness") + "/" + std::to_string(axis),
                    StackNumber::kRoughness, static_cast<int>(axis));
            alpha[axis++] = kAnyRoughness;
          } else {
            alpha[axis++] = v.Number();
          }
        });
        if (axis != 2) Complain(Pointer("roughness") + ": must be a number, or one for each axis");
        *roughness = {alpha[0], alpha[1], 0};
      } else {
        ReadNumber(object, json, "roughness", StackNumber::kRoughness, kAnyRoughness,
                   &roughness->x);
        roughness->y = roughness->x;
      }
    }
    double turn_deg = 0;
    ReadNumber(object, json, "rotation_deg", StackNumber::kRotation, 0, &turn_deg);
    roughness->rotation_rad = turn_deg / kDegrees;
  }

  std::string Pointer(const char* key) const { return at_ + "/" + key; }

  void ReadLayer(const JsonView& object, const Json& json, const std::string& at) {
    at_ = at;
    Complain(UnknownMember(json, at,
                           {"ior", "roughness", "rotation_deg", "thickness", "absorption",
                            "scattering", "asymmetry"}));
    Layer layer;
    object.Field("ior");
    ReadNumber(object, json, "ior", StackNumber::kIor, layer.ior, &layer.ior);
    ReadRoughness(object, json, &layer.roughness);
    ReadNumber(object, json, "thickness", StackNumber::kThickness, kAnyThickness, &layer.thickness);
    ReadColour(object, json, "absorption", StackNumber::kAbsorption, kAnyCoefficient,
               &layer.absorption);
    ReadColour(object, json, "scattering", StackNumber::kScattering, kAnyCoefficient,
               &layer.scattering);
    ReadNumber(object, json, "asymmetry", StackNumber::kAsymmetry, 0, &layer.asymmetry);
    stack_.layers.push_back(layer);
  }

  void ReadBase(const JsonView& base, const Json& json) {
    in_base_ = true;
    const std::string kind = base.Field("kind").String(64);
    if (!problem_.text.empty()) return;
    if (kind == "black") return Complain(UnknownMember(json, "/base", {"kind"}));
    if (kind != "mixture") return ReadPart(base, json, "/base", false);
    Complain(UnknownMember(json, "/base", {"kind", "parts"}));
    size_t p = 0;
    base.Field("parts").ForEach(kMaxParts, [&](const JsonView& part) {
      const std::string at = "/base/parts/" + std::to_string(p);
      ReadPart(part, json["parts"][p++], at, true);
    });
    if (stack_.parts.size() < 2) Complain("/base/parts: a mixture has two parts or more");
  }

  void ReadPart(const JsonView& object, const Json& json, const std::string& at, bool mixed) {
    at_ = at;
    const std::string kind = object.Field("kind").String(64);
    if (!problem_.text.empty()) return;
    BasePart part;
    if (mixed) {
      object.Field("weight");
      ReadNumber(object, json, "weight", StackNumber::kWeight, 0, &part.weight);
    }
    if (kind == "diffuse") {
      if (mixed) {
        Complain(UnknownMember(json, at, {"kind", "weight", "albedo"}));
      } else {
        Complain(UnknownMember(json, at, {"kind", "albedo"}));
      }
      object.Field("albedo");
      ReadColour(object, json, "albedo", StackNumber::kAlbedo, part.albedo[0], &part.albedo);
    } else if (kind == "conductor") {
      part.kind = BaseKind::kConductor;
      if (mixed) {
        Complain(UnknownMember(
            json, at, {"kind", "weight", "metal", "eta", "k", "roughness", "rotation_deg"}));
      } else {
        Complain(
            UnknownMember(json, at, {"kind", "metal", "eta", "k", "roughness", "rotation_deg"}));
      }
      ReadMetal(object, json, at, &part);
      ReadRoughness(object, json, &part.roughness);
    } else {
      Complain(at + "/kind: " + QuoteForMessage(kind) + " is not one of: diffuse, conductor" +
               (mixed ? "" : ", black, mixture"));
    }
    stack_.parts.push_back(part);
  }

  void ReadMetal(const JsonView& object, const Json& json, const std::string& at, BasePart* part) {
    const JsonView named = object.Optional("metal");
    if (!named) {
      object.Field("eta");
      object.Field("k");
      ReadRgb(object, json, "eta", &part->eta);
      ReadRgb(object, json, "k", &part->k);
      return;
    }
    if (json.contains("eta") || json.contains("k"))
      Complain(at + "/metal: stands beside \"eta\" and \"k\", which say the same; keep one");
    const std::string name = named.String(64);
    std::string known;
    for (const Metal& metal : Metals()) {
      known += (known.empty() ? "" : ", ") + std::string(metal.name);
      if (name != metal.name) continue;
      part->eta = metal.eta;
      part->k = metal.k;
      return;
    }
    Complain(at + "/metal: " + QuoteForMessage(name) + " is not one of: " + known +
             "; give \"eta\" and \"k\" for another");
  }

  const Json& json_;
  JsonProblem problem_;
  JsonView view_;
  std::string at_;  // the object that is read
  bool in_base_ = false;
  Stack stack_;
  VaryingStack varying_;
};

OrderedJson RgbJson(const Rgb& rgb) {
  if (rgb[0] == rgb[1] && rgb[1] == rgb[2]) return rgb[0];
  return rgb;
}

void AddRoughness(const Roughness& roughness, OrderedJson* json) {
  if (roughness.anisotropic()) {
    (*json)["roughness"] = {roughness.x, roughness.y};
  } else if (roughness.x > 0) {
    (*json)["roughness"] = roughness.x;
  }
  if (roughness.rotation_rad != 0) (*json)["rotation_deg"] = roughness.rotation_rad * kDegrees;
}

OrderedJson LayerJson(const Layer& layer) {
  OrderedJson json;
  const Rgb none = {0, 0, 0};
  json["ior"] = layer.ior;
  AddRoughness(layer.roughness, &json);
  if (layer.thickness > 0) json["thickness"] = layer.thickness;
  if (layer.absorption != none) json["absorption"] = RgbJson(layer.absorption);
  if (layer.scattering != none) json["scattering"] = RgbJson(layer.scattering);
  if (layer.asymmetry != 0) json["asymmetry"] = layer.asymmetry;
  return json;
}

OrderedJson PartJson(const BasePart& part, bool mixed) {
  OrderedJson json;
  json["kind"] = part.kind == BaseKind::kDiffuse ? "diffuse" : "conductor";
  if (mixed) json["weight"] = part.weight;
  if (part.kind == BaseKind::kDiffuse) {
    json["albedo"] = RgbJson(part.albedo);
    return json;
  }
  const char* name = nullptr;
  for (const Metal& metal : Metals()) {
    if (metal.eta == part.eta && metal.k == part.k) name = metal.name;
  }
  if (name != nullptr) {
    json["metal"] = name;
  } else {
    json["eta"] = RgbJson(part.eta);
    json["k"] = RgbJson(part.k);
  }
  AddRoughness(part.roughness, &json);
  return json;
}

}  // namespace

bool IsLayersFileName(std::string_view path) {
  if (path.size() <= kLayersSuffix.size()) return false;
  const std::string_view end = path.substr(path.size() - kLayersSuffix.size());
  for (size_t i = 0; i < end.size(); ++i) {
    const char c = end[i] >= 'A' && end[i] <= 'Z' ? static_cast<char>(end[i] - 'A' + 'a') : end[i];
    if (c != kLayersSuffix[i]) return false;
  }
  return path[path.size() - kLayersSuffix.size() - 1] != '/';
}

Status CheckStack(const Stack& stack) { return Checker(stack).Run(); }

Result<VaryingStack> ParseVaryingStack(std::string_view text, const std::string& source_name) {
  auto json = ParseStrictJson(text, kDeepestJson);
  if (!json) return Fail(json.error(), source_name);
  auto stack = Reader(*json).Run();
  if (!stack) {
    return Fail(ErrorCode::kInvalidArgument,
                source_name + ": " + stack.error().message + " (see schemas/layered.schema.json)");
  }
  return stack;
}

Result<VaryingStack> ReadVaryingStack(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxLayersBytes));
  return ParseVaryingStack(text, path);
}

bool HasStackMaps(const std::string& path) {
  const auto text = ReadTextFile(path, kMaxLayersBytes);
  if (!text) return false;
  bool found = false;
  // Keeps nothing but looks at the keys, as far as it is JSON.
  const auto watch = [&](int, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::key && parsed == "map") found = true;
    return true;
  };
  const Json ignored = Json::parse(*text, watch, false);
  return found;
}

std::vector<std::string> VaryingStack::Files() const {
  std::vector<std::string> files;
  for (const StackMap& map : maps) files.push_back(map.file);
  if (normal) files.push_back(normal->file);
  std::sort(files.begin(), files.end());
  files.erase(std::unique(files.begin(), files.end()), files.end());
  return files;
}

Result<Stack> ParseStack(std::string_view text, const std::string& source_name) {
  PATINA_ASSIGN(VaryingStack varying, ParseVaryingStack(text, source_name));
  if (varying.varies()) {
    return Fail(ErrorCode::kInvalidArgument,
                source_name + ": " +
                    (varying.maps.empty() ? std::string("/normal") : varying.maps[0].pointer) +
                    ": is a map, so that the material varies over the surface; bake it as kind "
                    "\"svbrdf\", or give a number");
  }
  return std::move(varying.stack);
}

Result<Stack> ReadStack(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxLayersBytes));
  return ParseStack(text, path);
}

std::string FormatStack(const Stack& stack) {
  OrderedJson json;
  json["version"] = kFileVersion;
  json["layers"] = OrderedJson::array();
  for (const Layer& layer : stack.layers) json["layers"].push_back(LayerJson(layer));
  if (stack.parts.empty()) {
    json["base"]["kind"] = "black";
  } else if (stack.parts.size() == 1) {
    json["base"] = PartJson(stack.parts[0], false);
  } else {
    json["base"]["kind"] = "mixture";
    for (const BasePart& part : stack.parts) json["base"]["parts"].push_back(PartJson(part, true));
  }
  return json.dump(2) + "\n";
}

}  // namespace patina::layered
