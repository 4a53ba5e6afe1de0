#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/dds.h"
#include "formats/schema_check.h"
#include "pipeline/validate/check_container.h"

namespace patina::validate {
namespace {

using nlohmann::json;

constexpr int kDeepestManifest = 64;

// Members of `document` that a rewritten manifest does not have.
void FindUnknown(const json& document, const json& rewritten, const std::string& pointer,
                 const std::string& file, FindingList* findings) {
  if (document.is_object() && rewritten.is_object()) {
    for (const auto& [key, value] : document.items()) {
      const std::string at = pointer + "/" + EscapePointer(key);
      const auto known = rewritten.find(key);
      if (known != rewritten.end()) {
        FindUnknown(value, *known, at, file, findings);
        continue;
      }
      // Values that the writer leaves out because readers take them for granted.
      if (key == "scale" || key == "half_vector_inputs" || key == "transform") continue;
      findings->Add(1006, file, {at, {}},
                    QuoteForMessage(key) + " is not a member that this version knows");
    }
  } else if (document.is_array() && rewritten.is_array()) {
    for (size_t i = 0; i < std::min(document.size(), rewritten.size()); ++i)
      FindUnknown(document[i], rewritten[i], pointer + "/" + std::to_string(i), file, findings);
  }
}

// A version that is written too low lets old readers decode the container wrongly; one that is too
// high only keeps them away, and manifests of old writers may have one.
void CheckVersion(const json& document, const Manifest& manifest, const std::string& file,
                  FindingList* findings) {
  const int version = document["format_version"].get<int>();
  const int wanted = FormatVersionOf(manifest);
  if (version == wanted) return;
  findings->Add(1007, file, {"/format_version", {}},
                std::to_string(version) + ", but what the container holds is of version " +
                    std::to_string(wanted));
}

// The channels that an effect speaks of: one by its full name, or all of a map.
std::vector<const ManifestChannel*> ChannelsNamed(const Manifest& manifest,
                                                  const std::string& what) {
  std::vector<const ManifestChannel*> channels;
  for (const ManifestChannel& channel : manifest.channels) {
    const std::string name =
        channel.component.empty() ? channel.map : channel.map + "." + channel.component;
    if (name == what || channel.map == what) channels.push_back(&channel);
  }
  return channels;
}

// "mip 3", "mips 0 to 1".
std::string MipsText(int first, int last) {
  return first == last ? "mip " + std::to_string(first)
                       : "mips " + std::to_string(first) + " to " + std::to_string(last);
}

// How effects name the mips that a container does not have.
std::set<std::string> MissingMips(const Manifest& manifest) {
  std::set<std::string> missing;
  if (!manifest.lod_range) return missing;
  const auto [first, last] = *manifest.lod_range;
  if (first > 0) missing.insert(MipsText(0, first - 1));
  if (last + 1 < manifest.source.levels)
    missing.insert(MipsText(last + 1, manifest.source.levels - 1));
  return missing;
}

bool SharesOutput(const Manifest& manifest, const ManifestChannel& channel) {
  return std::count_if(
             manifest.channels.begin(), manifest.channels.end(),
             [&](const ManifestChannel& other) { return other.output == channel.output; }) > 1;
}

void CheckEffectStates(const Manifest& manifest, const std::string& file, FindingList* findings) {
  std::set<const ManifestChannel*> told;
  std::set<std::string> missing_mips = MissingMips(manifest);
  for (size_t i = 0; i < manifest.effects.size(); ++i) {
    const ManifestEffect& effect = manifest.effects[i];
    const Place place{"/effects/" + std::to_string(i), {}};
    if (effect.what.rfind("mip", 0) == 0 && effect.what.find(' ') != std::string::npos) {
      if (missing_mips.erase(effect.what) == 0 || effect.state != "left_out") {
        findings->Add(1302, file, place,
                      QuoteForMessage(effect.what) + " is " + effect.state +
                          ", which does not go with lod_range");
      }
      continue;
    }
    const auto channels = ChannelsNamed(manifest, effect.what);
    told.insert(channels.begin(), channels.end());
    const bool wants_channels = effect.state == "learned" || effect.state == "constant";
    if (wants_channels && channels.empty()) {
      findings->Add(
          1302, file, place,
          QuoteForMessage(effect.what) + " is " + effect.state + ", but there is no such channel");
    }
    for (const ManifestChannel* channel : channels) {
      const bool learned = channel->output >= 0;
      if (effect.state == "constant" ? !learned : effect.state == "learned" && learned) continue;
      // What the scene left out may stand in the manifest as a number.
      if (effect.state == "left_out" && !learned) continue;
      // Equal channels share an output: derived, and decoded all the same.
      if (effect.state == "derived" && learned && SharesOutput(manifest, *channel)) continue;
      findings->Add(1302, file, place,
                    QuoteForMessage(effect.what) + " is " + effect.state + ", but its channel is " +
                        (learned ? "learned" : "a constant"));
    }
  }
  // Writers before `effects` listed only what is not learned.
  const bool complete =
      std::any_of(manifest.effects.begin(), manifest.effects.end(),
                  [](const ManifestEffect& effect) { return effect.state == "learned"; });
  for (size_t i = 0; complete && i < manifest.channels.size(); ++i) {
    if (told.count(&manifest.channels[i]) != 0) continue;
    findings->Add(1302, file, {"/channels/" + std::to_string(i), {}},
                  "no effect says what became of this channel");
  }
  for (const std::string& mips : missing_mips) {
    if (complete)
      findings->Add(1302, file, {"/lod_range", {}}, "no effect says that it leaves out " + mips);
  }
}

void CheckRoles(const Manifest& manifest, const std::set<std::string>& maps,
                const std::string& file, FindingList* findings) {
  std::set<std::string> told;
  const auto check = [&](const std::string& role, const std::string& pointer) {
    if (maps.count(role) != 0) return;
    findings->Add(1306, file, {pointer, {}}, QuoteForMessage(role) + " is no map of the container");
  };
  for (size_t i = 0; i < manifest.maps.size(); ++i) {
    check(manifest.maps[i].role, "/maps/" + std::to_string(i) + "/role");
    told.insert(manifest.maps[i].role);
  }
  for (const std::string& map : maps) {
    if (told.count(map) == 0)
      findings->Add(1306, file, {"/maps", {}}, QuoteForMessage(map) + " is not listed");
  }
  for (size_t i = 0; i < manifest.source.files.size(); ++i) {
    const std::vector<std::string>& roles = manifest.source.files[i].roles;
    for (size_t r = 0; r < roles.size(); ++r) {
      check(roles[r], "/source/files/" + std::to_string(i) + "/roles/" + std::to_string(r));
    }
  }
}

}  // namespace

std::optional<Manifest> CheckManifestText(std::string_view text, const std::string& file,
                                          FindingList* findings) {
  auto document = ParseStrictJson(text, kDeepestManifest);
  if (!document) {
    const bool twice = document.error().message.find("stands twice") != std::string::npos;
    findings->Add(twice ? 1008 : 1002, file, {}, document.error().message);
    return std::nullopt;
  }
  auto manifest = ParseManifest(text);
  if (!manifest && manifest.error().code == ErrorCode::kUnsupported &&
      manifest.error().message.rfind("/format", 0) == 0) {
    // The schema of this version says nothing about others.
    findings->AddError(1003, file, manifest.error());
    return std::nullopt;
  }
  const auto problems = FindSchemaProblems("manifest", *document);
  if (!problems) {
    findings->AddError(1004, file, problems.error());
  } else {
    for (const SchemaFinding& problem : *problems)
      findings->Add(1004, file, {problem.pointer, {}}, problem.message);
  }
  if (!manifest) {
    if (problems && problems->empty()) {
      const bool unsupported = manifest.error().code == ErrorCode::kUnsupported;
      findings->AddError(unsupported ? 1003 : 1005, file, manifest.error());
    }
    return std::nullopt;
  }
  CheckVersion(*document, *manifest, file, findings);
  if (const auto rewritten = ToJson(*manifest))
    FindUnknown(*document, json::parse(*rewritten), "", file, findings);
  return std::move(*manifest);
}

void CheckGate(const Manifest& manifest, const std::string& file, FindingList* findings) {
  if (manifest.brdf) return;  // gates are those of materials
  const ManifestQuality& quality = manifest.quality;
  if (!quality.gate_min_psnr_db) {
    findings->Add(6002, file, {"/quality", {}}, "the container was baked without --min-psnr");
    return;
  }
  const Place place{"/quality/gate", {}};
  const std::string numbers = "overall PSNR " + std::to_string(quality.psnr_overall_db) +
                              " dB, gate " + std::to_string(*quality.gate_min_psnr_db) + " dB";
  if (!quality.gate_met) findings->Add(6001, file, place, numbers);
  const bool met = quality.psnr_overall_db >= *quality.gate_min_psnr_db;
  if (met != quality.gate_met) {
    findings->Add(6003, file, place,
                  numbers + ", but `met` is " + (quality.gate_met ? "true" : "false"));
  }
}

void CheckConsistency(const Manifest& manifest, const std::string& file, FindingList* findings) {
  if (manifest.brdf) return;
  std::set<std::string> maps;
  for (size_t i = 0; i < manifest.channels.size(); ++i) {
    const ManifestChannel& channel = manifest.channels[i];
    maps.insert(channel.map);
    if (channel.output < 0 &&
        !(channel.constant >= channel.range_min && channel.constant <= channel.range_max)) {
      findings->Add(1301, file, {"/channels/" + std::to_string(i) + "/constant", {}},
                    std::to_string(channel.constant) + " is not within " +
                        std::to_string(channel.range_min) + " to " +
                        std::to_string(channel.range_max));
    }
  }
  for (size_t i = 0; i < manifest.features.size(); ++i) {
    const ManifestFeature& feature = manifest.features[i];
    if (DdsLevelSide(manifest.source.width, -feature.lod_bias) == feature.width &&
        DdsLevelSide(manifest.source.height, -feature.lod_bias) == feature.height)
      continue;
    findings->Add(1303, file, {"/features/" + std::to_string(i) + "/lod_bias", {}},
                  std::to_string(feature.lod_bias) + " for a texture of " +
                      std::to_string(feature.width) + "x" + std::to_string(feature.height) +
                      " and a source of " + std::to_string(manifest.source.width) + "x" +
                      std::to_string(manifest.source.height));
  }
  CheckEffectStates(manifest, file, findings);
  uint64_t before = 0;
  for (size_t i = 0; i < manifest.training.curve.size(); ++i) {
    const uint64_t samples = manifest.training.curve[i].samples;
    if (samples < before || samples > manifest.training.samples) {
      findings->Add(1304, file, {"/training/curve/" + std::to_string(i) + "/samples", {}},
                    std::to_string(samples) + " samples after " + std::to_string(before) + ", of " +
                        std::to_string(manifest.training.samples) + " in all");
    }
    before = samples;
  }
  std::set<std::string> measured;
  for (size_t i = 0; i < manifest.quality.maps.size(); ++i) {
    const std::string& map = manifest.quality.maps[i].map;
    const Place place{"/quality/maps/" + std::to_string(i) + "/map", {}};
    if (maps.count(map) == 0)
      findings->Add(1305, file, place, QuoteForMessage(map) + " is no map of the container");
    if (!measured.insert(map).second)
      findings->Add(1305, file, place, QuoteForMessage(map) + " is measured twice");
  }
  for (const std::string& map : maps) {
    if (measured.empty() || measured.count(map) != 0) continue;
    findings->Add(1305, file, {"/quality/maps", {}}, QuoteForMessage(map) + " was not measured");
  }
  CheckRoles(manifest, maps, file, findings);
}

}  // namespace patina::validate
