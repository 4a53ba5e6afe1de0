#include "pipeline/jobs/describe.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "formats/model_bytes.h"
#include "pipeline/jobs/package.h"

namespace patina {
namespace {

template <class... Args>
std::string Format(const char* format, Args... args) {
  char text[512];
  const int n = std::snprintf(text, sizeof text, format, args...);
  return n > 0 ? std::string(text, std::min(static_cast<size_t>(n), sizeof text - 1))
               : std::string();
}

std::string Decibels(double db) { return std::isfinite(db) ? Format("%.2f dB", db) : "exact"; }

std::string MapLine(const Manifest& manifest, const ManifestMapQuality& quality) {
  std::string line = Format("  %-18s", quality.map.c_str());
  if (quality.overall.psnr_db) line += Format("%10s", Decibels(*quality.overall.psnr_db).c_str());
  if (!quality.mips.empty() && quality.mips[0].psnr_db) {
    line += Format("   mip 0 %10s", Decibels(*quality.mips[0].psnr_db).c_str());
  }
  std::string constants;
  int learned = 0;
  for (const ManifestChannel& channel : manifest.channels) {
    if (channel.map != quality.map) continue;
    if (channel.output >= 0) {
      ++learned;
    } else {
      constants +=
          (constants.empty() ? "" : ", ") + Format("%.4g", static_cast<double>(channel.constant));
    }
  }
  if (learned > 0) line += Format("   %d channel%s learned", learned, learned == 1 ? "" : "s");
  if (!constants.empty()) line += "   constant " + constants;
  return line + "\n";
}

std::string Numbers(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += Format(" %.6g", value);
  return text;
}

std::string SceneText(const Manifest& manifest) {
  if (!manifest.scene) return "";
  const SceneLook& look = *manifest.scene;
  std::string text = "\nScene\n  " + look.file + ", material " + std::to_string(look.index) +
                     " \"" + look.material + "\", alpha " + look.alpha_mode;
  if (look.alpha_mode == "mask") text += Format(" at %.4g", look.alpha_cutoff);
  text +=
      std::string(look.double_sided ? ", double-sided" : "") + (look.unlit ? ", unlit" : "") + "\n";
  for (const SceneValue& factor : look.factors)
    text += "  factor of " + factor.map + Numbers(factor.value) + "\n";
  for (const SceneValue& parameter : look.parameters)
    text += "  " + parameter.map + Numbers(parameter.value) + "\n";
  return text;
}

// What was not learned, and what that saved.
std::string EffectsText(const Manifest& manifest) {
  std::string text;
  for (const ManifestEffect& effect : manifest.effects) {
    if (effect.state == "learned") continue;
    text += Format("  %-22s%-9s %s", effect.what.c_str(),
                   effect.state == "left_out" ? "left out" : effect.state.c_str(),
                   effect.reason.c_str());
    if (effect.saved) {
      text += Format("; saves %llu bytes, %llu multiply-adds a lookup",
                     static_cast<unsigned long long>(effect.saved->bytes),
                     static_cast<unsigned long long>(effect.saved->decode_multiply_adds));
    }
    text += "\n";
  }
  if (manifest.lod_range) {
    text +=
        Format("  mips %d to %d are stored\n", (*manifest.lod_range)[0], (*manifest.lod_range)[1]);
  }
  return text.empty() ? "" : "\nNot learned\n" + text;
}

std::string Measure(const char* name, const std::optional<double>& value) {
  return value ? Format("  %-24s%.6f\n", name, *value) : "";
}

std::string Joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

// What a BRDF was baked from, as people call it.
std::string OriginText(const ManifestBrdf& brdf) {
  if (brdf.source_format == "texture_set") return "a texture set";
  if (brdf.source_format == "image_set") return "measured images";
  if (brdf.source_format == "layered") return brdf.images ? "layers with maps" : "layers";
  return "a file of format " + brdf.source_format;
}

std::string BrdfText(const Manifest& m) {
  const ManifestBrdf& brdf = *m.brdf;
  std::string text =
      Format("  %s from %s, %s, quality %s, recipe %s %d, seed %llu\n",
             brdf.images ? "spatially varying BRDF" : "BRDF", OriginText(brdf).c_str(),
             brdf.isotropic ? "isotropic" : "anisotropic", m.quality_setting.c_str(),
             m.tool.recipe.c_str(), m.tool.recipe_version, static_cast<unsigned long long>(m.seed));
  text += "\nQuality\n";
  text += Measure(brdf.images ? "lit planes, MAE" : "lit sphere, MAE", brdf.quality.image_mae);
  text += Measure(brdf.images ? "lit planes, RMSE" : "lit sphere, RMSE", brdf.quality.image_rmse);
  text += Measure(brdf.images ? "lit planes, SSIM" : "lit sphere, SSIM", brdf.quality.image_ssim);
  text += Measure("MSE of log(1 + f)", brdf.quality.log1p_mse);
  text += Measure("reciprocity error", brdf.quality.reciprocity_error);
  for (const ManifestAlbedo& albedo : brdf.quality.albedo) {
    text += Format("  albedo at %2.0f degrees    %.4f %.4f %.4f\n", albedo.theta_deg, albedo.rgb[0],
                   albedo.rgb[1], albedo.rgb[2]);
  }
  text += "\nFiles\n";
  for (const ManifestPayload& payload : m.payloads) {
    text += Format("  %-18s%12llu bytes  %s\n", payload.name.c_str(),
                   static_cast<unsigned long long>(payload.bytes), payload.role.c_str());
  }
  text += Format("  grid Nside %d, primitives of %d, %d index bits, %s%s%s\n", brdf.nside,
                 brdf.primitive_size, brdf.index_bits, brdf.interpolation.c_str(),
                 brdf.half_vector_inputs ? ", angle and half vector inputs"
                 : brdf.angle_inputs     ? ", angle inputs"
                                         : "",
                 brdf.canonical_order ? ", canonical order" : "");
  if (!brdf.shared_codebook_file.empty())
    text += "  codebook shared with other assets: " + brdf.shared_codebook_file + "\n";
  text += "  network";
  for (size_t i = 0; i < brdf.layers.size(); ++i)
    text += (i > 0 ? " -> " : " ") + std::to_string(brdf.layers[i]);
  text += ", " + brdf.activation + "\n";
  text += Format("  %llu bytes for an engine to load\n",
                 static_cast<unsigned long long>(ModelBytes(m.payloads)));
  if (!m.features.empty()) {
    text += Format("  neural texture: %zu x %d x %d texels, %d mips, %s, %s\n", m.features.size(),
                   m.features[0].width, m.features[0].height, m.features[0].levels,
                   m.features[0].format.c_str(), brdf.images->address.c_str());
  }
  text += "\nSource\n";
  for (const ManifestBrdfFile& file : brdf.files) text += "  " + file.path + "\n";
  if (brdf.images && brdf.images->images == 0)
    text += Format("  maps of %d x %d texels\n", brdf.images->width, brdf.images->height);
  if (brdf.images && brdf.images->images > 0) {
    text += Format(
        "  %llu images of %d x %d; the container is %.0f times smaller than they are as "
        "halves\n",
        static_cast<unsigned long long>(brdf.images->images), brdf.images->width,
        brdf.images->height, CompressionRatio(brdf, ModelBytes(m.payloads)));
  } else if (brdf.simulation) {
    text += Format("  simulated: %llu pairs of directions, %llu paths, standard error %.4f\n",
                   static_cast<unsigned long long>(brdf.simulation->pairs),
                   static_cast<unsigned long long>(brdf.simulation->paths),
                   brdf.simulation->standard_error);
    text += "  effects: " + Joined(brdf.simulation->effects) +
            "; left out: " + Joined(brdf.simulation->left_out) + "\n";
  } else if (!brdf.images) {
    text += Format("  %llu colours, %llu of them not valid\n",
                   static_cast<unsigned long long>(brdf.cells),
                   static_cast<unsigned long long>(brdf.invalid_cells));
  }
  text += SceneText(m) + EffectsText(m);
  for (const std::string& warning : m.warnings) text += "Warning: " + warning + "\n";
  return text;
}

}  // namespace

std::string ContainerText(const Container& container) {
  const Manifest& m = container.manifest;
  std::string text = m.asset + "  (" + container.directory + ")\n";
  if (m.brdf) return text + BrdfText(m);
  text += Format("  %d x %d texels, %d mips, %s, profile %s, quality %s, recipe %s %d, seed %llu\n",
                 m.source.width, m.source.height, m.source.levels, m.source.address.c_str(),
                 m.profile.c_str(), m.quality_setting.c_str(), m.tool.recipe.c_str(),
                 m.tool.recipe_version, static_cast<unsigned long long>(m.seed));
  text += Format(
      "  PSNR %s overall, %s mip 0, %s mean of mips", Decibels(m.quality.psnr_overall_db).c_str(),
      Decibels(m.quality.psnr_mip0_db).c_str(), Decibels(m.quality.psnr_mean_mips_db).c_str());
  if (m.quality.ssim) text += Format(", SSIM %.4f", *m.quality.ssim);
  if (m.quality.flip) text += Format(", FLIP %.4f", *m.quality.flip);
  text += "\n";
  if (m.training.choice) {
    const ManifestChoice& choice = *m.training.choice;
    text +=
        Format(
            "  asked for:%s%s: %s; ",
            choice.target_psnr_db > 0 ? Format(" %.2f dB of mip 0", choice.target_psnr_db).c_str()
                                      : "",
            choice.most_bytes > 0
                ? Format(" at most %llu bytes", static_cast<unsigned long long>(choice.most_bytes))
                      .c_str()
                : "",
            choice.met ? "met" : "missed") +
        choice.reason + "\n";
  }
  if (m.quality.gate_min_psnr_db) {
    text += Format("  quality gate %.2f dB: %s\n", *m.quality.gate_min_psnr_db,
                   m.quality.gate_met ? "met" : "missed");
  }
  text += "\nMaps\n";
  for (const ManifestMapQuality& map : m.quality.maps) text += MapLine(m, map);
  text += "\nColour\n  working space " + m.working_space;
  if (m.color_config) {
    text += ", configuration " +
            (m.color_config->file.empty() ? "built in" : m.color_config->file) + " (" +
            (m.color_config->source == "environment" ? "of $OCIO, " : "") + "sha256 " +
            m.color_config->sha256.substr(0, 12) + "...)";
  }
  text += "\n";
  for (const ManifestMap& map : m.maps) {
    if (!map.color_space.empty())
      text +=
          Format("  %-18s", map.role.c_str()) + map.color_space + " (by " + map.color_rule + ")\n";
  }
  text += SceneText(m) + EffectsText(m);
  text += "\nFiles\n";
  for (const ManifestPayload& payload : m.payloads) {
    text += Format("  %-18s%12llu bytes  %s", payload.name.c_str(),
                   static_cast<unsigned long long>(payload.bytes), payload.role.c_str());
    for (const ManifestFeature& feature : m.features) {
      if (feature.payload == payload.name) {
        text += Format("  %d x %d, %d mips, sampled at s%+d", feature.width, feature.height,
                       feature.levels, feature.lod_bias);
      }
    }
    text += "\n";
  }
  if (m.network) {
    text += Format("  network %d -> %d -> %d, %s\n", m.network->inputs, m.network->hidden,
                   m.network->outputs, m.network->activation.c_str());
  }
  text += Format("  %llu bytes for an engine to load\n",
                 static_cast<unsigned long long>(ModelBytes(m.payloads)));
  text += "\nSource\n";
  for (const ManifestSourceFile& file : m.source.files) {
    std::string roles;
    for (const std::string& role : file.roles) roles += (roles.empty() ? "" : ", ") + role;
    text += Format("  %s  %d x %d x %d %s: ", file.path.c_str(), file.width, file.height,
                   file.channels, file.type.c_str());
    text += roles + "\n";
  }
  text += Format("\nTraining: %.1f M samples, stopped by %s; patina %s\n",
                 static_cast<double>(m.training.samples) / 1e6, m.training.stopped_by.c_str(),
                 m.tool.version.c_str());
  for (const std::string& warning : m.warnings) text += "Warning: " + warning + "\n";
  return text;
}

Result<std::string> ContainerJson(const Container& container) {
  PATINA_ASSIGN(const std::string text,
                ReadTextFile(container.PathOf(kManifestName), kMaxManifestBytes));
  using Json = nlohmann::ordered_json;
  Json manifest = Json::parse(text, nullptr, false);
  if (manifest.is_discarded()) {
    return Fail(ErrorCode::kCorruptData,
                container.PathOf(kManifestName) + ": not JSON; bake the asset again");
  }
  Json json{{"container", container.directory}, {"bytes", ModelBytes(container.manifest.payloads)}};
  json["manifest"] = std::move(manifest);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace patina
