// A layered material with maps: the stack at each texel, simulated.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/layered/varying_stack.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/layered/prepared_stack.h"
#include "pipeline/material/color_choice.h"
#include "pipeline/svbrdf/texel_model.h"

namespace patina::svbrdf {

// Roughness from maps that is less is raised to it: a texel that only mirrors has no BRDF.
inline constexpr double kLeastMapRoughness = 0.005;
// A refractive index from maps, likewise: a rough surface without a step of the index cannot be
// told from none.
inline constexpr double kLeastMapIor = 1.001;
inline constexpr int kMaxMapSide = 8192;

// One kernel simulates all texels: that of the effects that any of them has.
class StackModel : public TexelModel {
 public:
  // Reads the maps of a stack, which lie beside the file `path` that it was read from.
  // Maps are data and taken as they are, value = offset + scale * sample; an albedo is brought to
  // linear Rec. 709 first, from the space that ChooseColor finds. Of a file of one or two channels
  // all channels of a colour are the first; normals need three or, with z found from them, two.
  // Errors, with file, JSON pointer and remedy: those of ReadImage and ChooseColor;
  // kInvalidArgument for maps of several sizes, channels that are not there, and for values that no
  // stack can have, with the texel; kCorruptData for samples that are not finite.
  static Result<std::shared_ptr<const StackModel>> Load(const layered::VaryingStack& stack,
                                                        const std::string& path,
                                                        const ColorOptions& color,
                                                        ThreadPool& pool);

  const layered::Effects& effects() const { return effects_; }
  bool has_normals() const { return normal_ >= 0; }
  // The stack with the means of its maps.
  const layered::Stack& mean() const { return mean_; }
  // The stack at a texel.
  layered::Stack StackAt(size_t texel) const;
  // Whether colours were brought from a space of the configuration, whose hash then counts.
  bool used_color_config() const { return used_color_config_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

  int width() const override { return width_; }
  int height() const override { return height_; }
  AddressMode address() const override {
    return varying_.wrap ? AddressMode::kWrap : AddressMode::kClamp;
  }
  bool isotropic() const override { return !has_normals() && !effects_.anisotropic; }
  bool exact() const override { return varying_.stack.layers.empty(); }
  void AddDraws(size_t texel, const brdf::Direction& wi, const brdf::Direction& wo, int draws,
                Rng* rng, double sum[3], double squares[3]) const override;
  int numbers() const override { return stride_; }
  void Numbers(size_t texel, float* out) const override;

 private:
  friend class StackLoader;

  StackModel() = default;
  void Apply(const float* numbers, layered::Stack* stack) const;

  layered::VaryingStack varying_;
  int width_ = 0, height_ = 0;
  int stride_ = 0;             // numbers of a texel
  std::vector<int> first_;     // of each map, in the numbers of a texel
  int normal_ = -1;            // x, y and z; -1: none
  std::vector<float> texels_;  // [texel][stride_]
  layered::Effects effects_;   // of any texel
  layered::EstimateKernel kernel_ = nullptr;
  layered::Stack mean_;
  bool used_color_config_ = false;
  std::vector<std::string> warnings_;
};

}  // namespace patina::svbrdf
