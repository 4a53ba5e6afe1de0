// A texture set as spatially varying reflectance: the metallic-roughness model at each texel.
//
// Based on: glTF 2.0, appendix B, "BRDF Implementation" (GGX, separable Smith masking, Schlick), in
// its combined form: c_diff = lerp(base, 0, metalness), f0 = lerp(0.04, base, metalness),
// f = (1 - F) c_diff / pi + F D V. The normal map tilts the frame (tilted_frame.h).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/material/source_maps.h"
#include "pipeline/svbrdf/texel_model.h"

namespace patina::svbrdf {

// Less is raised to it, an alpha of 0.002, beyond which highlights are narrower than any light.
inline constexpr float kLeastPbrRoughness = 0.045f;

// One surface. All within [0, 1].
struct PbrSurface {
  float base[3] = {1, 1, 1};  // linear Rec. 709
  float roughness = 1;
  float metalness = 0;
  float specular = 1;  // factor of the 0.04, KHR_materials_specular's strength
};

// Of what no metal is, at normal incidence: index of refraction 1.5.
inline constexpr float kDielectricF0 = 0.04f;

// f of a surface, 1/sr, without the cosine; both directions above its horizon.
void EvaluatePbr(const PbrSurface& surface, const brdf::Direction& wi, const brdf::Direction& wo,
                 float rgb[3], float dielectric_f0 = kDielectricF0);

// What a scene says of a material besides its textures.
struct PbrSettings {
  std::vector<ConstantMap> constants;  // of maps without a texture
  std::vector<SceneValue> factors;     // of maps with one: one or three numbers
  float normal_scale = 1;              // of x and y, before the normal is made a unit vector
  float dielectric_f0 = kDielectricF0;
  std::vector<std::string> left_out;  // roles that were found, and are not among the maps
};

class PbrModel : public TexelModel {
 public:
  // Takes albedo (which must be there), normal, roughness (else 1), metalness (else 0) and specular
  // (else 1) from maps that LoadSourceMaps has read in the working space lin_rec709; what else
  // there is plays no part, which the warnings say. Values beyond [0, 1], after the factor, are
  // clamped, with a warning. Errors: kInvalidArgument (no albedo).
  static Result<std::shared_ptr<const PbrModel>> Make(const SourceMaps& maps,
                                                      const std::string& name, AddressMode address,
                                                      ThreadPool& pool,
                                                      const PbrSettings& settings = {});

  bool has_normals() const { return has_normals_; }
  // Roles that f follows from, and others that were found, in the order of MapRoles().
  const std::vector<std::string>& used() const { return used_; }
  const std::vector<std::string>& left_out() const { return left_out_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

  int width() const override { return width_; }
  int height() const override { return height_; }
  AddressMode address() const override { return address_; }
  bool isotropic() const override { return !has_normals_; }
  bool exact() const override { return true; }
  void AddDraws(size_t texel, const brdf::Direction& wi, const brdf::Direction& wo, int draws,
                Rng* rng, double sum[3], double squares[3]) const override;
  int numbers() const override { return 8; }
  void Numbers(size_t texel, float* out) const override;

 private:
  struct Texel {
    PbrSurface surface;
    float nx = 0, ny = 0;  // of the normal, y down
  };

  PbrModel() = default;
  void SetConstant(const ConstantMap& constant);

  int width_ = 0, height_ = 0;
  AddressMode address_ = AddressMode::kWrap;
  bool has_normals_ = false;
  float dielectric_f0_ = kDielectricF0;
  std::vector<Texel> texels_;
  std::vector<std::string> used_, left_out_, warnings_;
};

}  // namespace patina::svbrdf
