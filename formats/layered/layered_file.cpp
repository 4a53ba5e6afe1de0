#include "formats/layered/layered_file.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/json_view.h"

namespace patina::layered {
namespace {

using Json = nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

constexpr int kDeepestJson = 16;
constexpr int kFileVersion = 1;
constexpr double kDegrees = 180 / std::numbers::pi;

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

  Result<Stack> Run() {
    Complain(UnknownMember(json_, "", {"version", "layers", "base"}));
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
    if (!problem_.text.empty()) return Fail(ErrorCode::kInvalidArgument, problem_.text);
    PATINA_TRY(CheckStack(stack_));
    return std::move(stack_);
  }

 private:
  void Complain(const std::string& text) {
    if (problem_.text.empty()) problem_.text = text;
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
        value.ForEach(2, [&](const JsonView& v) { alpha[axis++] = v.Number(); });
        if (axis != 2) Complain(Pointer("roughness") + ": must be a number, or one for each axis");
        *roughness = {alpha[0], alpha[1], 0};
      } else {
        roughness->x = roughness->y = value.Number();
      }
    }
    if (const JsonView turn = object.Optional("rotation_deg"))
      roughness->rotation_rad = turn.Number() / kDegrees;
  }

  std::string Pointer(const char* key) const { return at_ + "/" + key; }

  void ReadLayer(const JsonView& object, const Json& json, const std::string& at) {
    at_ = at;
    Complain(UnknownMember(json, at,
                           {"ior", "roughness", "rotation_deg", "thickness", "absorption",
                            "scattering", "asymmetry"}));
    Layer layer;
    layer.ior = object.Field("ior").Number();
    ReadRoughness(object, json, &layer.roughness);
    if (const JsonView v = object.Optional("thickness")) layer.thickness = v.Number();
    ReadRgb(object, json, "absorption", &layer.absorption);
    ReadRgb(object, json, "scattering", &layer.scattering);
    if (const JsonView v = object.Optional("asymmetry")) layer.asymmetry = v.Number();
    stack_.layers.push_back(layer);
  }

  void ReadBase(const JsonView& base, const Json& json) {
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
    if (mixed) part.weight = object.Field("weight").Number();
    if (kind == "diffuse") {
      if (mixed) {
        Complain(UnknownMember(json, at, {"kind", "weight", "albedo"}));
      } else {
        Complain(UnknownMember(json, at, {"kind", "albedo"}));
      }
      object.Field("albedo");
      ReadRgb(object, json, "albedo", &part.albedo);
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
  Stack stack_;
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

Result<Stack> ParseStack(std::string_view text, const std::string& source_name) {
  auto json = ParseStrictJson(text, kDeepestJson);
  if (!json) return Fail(json.error(), source_name);
  auto stack = Reader(*json).Run();
  if (!stack) {
    return Fail(ErrorCode::kInvalidArgument,
                source_name + ": " + stack.error().message + " (see schemas/layered.schema.json)");
  }
  return stack;
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
