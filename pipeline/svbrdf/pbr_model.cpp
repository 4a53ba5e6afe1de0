#include "pipeline/svbrdf/pbr_model.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <numbers>

#include "pipeline/svbrdf/tilted_frame.h"

namespace patina::svbrdf {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

// 1 / (|n.w| + sqrt(alpha^2 + (1 - alpha^2) (n.w)^2)); the two of light and view are V.
float Visibility(float cosine, float alpha2) {
  return 1 / (cosine + std::sqrt(alpha2 + (1 - alpha2) * cosine * cosine));
}

}  // namespace

void EvaluatePbr(const PbrSurface& surface, const brdf::Direction& wi, const brdf::Direction& wo,
                 float rgb[3]) {
  const float roughness = std::max(surface.roughness, kLeastPbrRoughness);
  const float alpha = roughness * roughness, alpha2 = alpha * alpha;
  brdf::Direction h = {wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
  const float length = std::sqrt(std::max(1e-30f, DotOf(h, h)));
  h = {h.x / length, h.y / length, h.z / length};
  // cos^2 (alpha^2 - 1) + 1 loses all its digits at a narrow peak: sin^2 is what it is about.
  const float sin2 = h.x * h.x + h.y * h.y;
  const float core = sin2 + h.z * h.z * alpha2;
  const float density = alpha2 / (kPi * core * core);
  const float lobe = density * Visibility(wi.z, alpha2) * Visibility(wo.z, alpha2);
  const float away = 1 - std::clamp(DotOf(wo, h), 0.0f, 1.0f);
  const float schlick = away * away * away * away * away;
  const float m = surface.metalness;
  for (int c = 0; c < 3; ++c) {
    const float f0 = (1 - m) * 0.04f * surface.specular + m * surface.base[c];
    const float f90 = (1 - m) * surface.specular + m;
    const float fresnel = f0 + (f90 - f0) * schlick;
    rgb[c] = (1 - fresnel) * (1 - m) * surface.base[c] / kPi + fresnel * lobe;
  }
}

Result<std::shared_ptr<const PbrModel>> PbrModel::Make(const SourceMaps& maps,
                                                       const std::string& name, AddressMode address,
                                                       ThreadPool& pool) {
  std::shared_ptr<PbrModel> model(new PbrModel);
  model->width_ = maps.width;
  model->height_ = maps.height;
  model->address_ = address;
  const auto width = static_cast<size_t>(maps.width);
  model->texels_.resize(width * static_cast<size_t>(maps.height));
  bool has_albedo = false;
  for (const MapPlan& plan : maps.plans) {
    const char* role = plan.role->name;
    const LoadedFile& file = maps.files[static_cast<size_t>(plan.file)];
    const auto is = [role](const char* what) { return std::strcmp(role, what) == 0; };
    float PbrSurface::*number = is("roughness")   ? &PbrSurface::roughness
                                : is("metalness") ? &PbrSurface::metalness
                                : is("specular")  ? &PbrSurface::specular
                                                  : nullptr;
    if (!is("albedo") && !is("normal") && number == nullptr) {
      model->left_out_.push_back(role);
      continue;
    }
    has_albedo = has_albedo || is("albedo");
    model->has_normals_ = model->has_normals_ || (is("normal") && !plan.constant_file);
    model->used_.push_back(role);
    std::atomic<uint64_t> clamped{0};
    pool.ParallelFor(maps.height, [&](int y, int) {
      std::vector<float> row(3 * width);
      float* planes[3] = {row.data(), row.data() + width, row.data() + 2 * width};
      NormalDefects defects;
      LoadMapRow(plan, file, maps.width, y, planes, &defects);
      Texel* out = model->texels_.data() + static_cast<size_t>(y) * width;
      if (is("normal")) {
        for (size_t x = 0; x < width; ++x) {
          out[x].nx = planes[0][x];
          out[x].ny = -planes[1][x];  // rows of the frame run down
        }
        return;
      }
      if (is("albedo")) {
        for (float* plane : planes) LinearizeMapRow(plan, plane, maps.width);
      }
      uint64_t beyond = 0;
      const auto share = [&beyond](float value) {
        const float within = std::clamp(value, 0.0f, 1.0f);
        beyond += std::abs(value - within) > 1e-4f ? 1 : 0;
        return within;
      };
      for (size_t x = 0; x < width; ++x) {
        if (number != nullptr) {
          out[x].surface.*number = share(planes[0][x]);
          continue;
        }
        for (size_t c = 0; c < 3; ++c) out[x].surface.base[c] = share(planes[c][x]);
      }
      clamped.fetch_add(beyond, std::memory_order_relaxed);
    });
    if (clamped > 0) {
      model->warnings_.push_back(maps.descriptions[static_cast<size_t>(plan.file)].file + ": " +
                                 std::to_string(clamped.load()) +
                                 " samples lie beyond 0 to 1 and are clamped.");
    }
  }
  if (!has_albedo) {
    return Fail(ErrorCode::kInvalidArgument,
                name +
                    ": there is no base colour, from which reflectance follows; add a map such as "
                    "*_basecolor.png, or bake it as a material");
  }
  if (!model->left_out_.empty()) {
    std::string list;
    for (const std::string& role : model->left_out_) list += (list.empty() ? "" : ", ") + role;
    model->warnings_.push_back("no part of the reflectance: " + list +
                               "; a material (without --as svbrdf) has all maps.");
  }
  return std::shared_ptr<const PbrModel>(std::move(model));
}

void PbrModel::AddDraws(size_t texel, const brdf::Direction& wi, const brdf::Direction& wo,
                        int draws, Rng*, double sum[3], double squares[3]) const {
  const Texel& at = texels_[texel];
  TiltedFrame frame = {wi, wo, 1};
  if (has_normals_) {
    const float nz = std::sqrt(std::max(0.0f, 1 - at.nx * at.nx - at.ny * at.ny));
    frame = TiltTo({at.nx, at.ny, nz}, wi, wo);
  }
  if (frame.factor == 0) return;
  float rgb[3];
  EvaluatePbr(at.surface, frame.wi, frame.wo, rgb);
  for (int c = 0; c < 3; ++c) {
    const double f = static_cast<double>(frame.factor * rgb[c]);
    sum[c] += draws * f;
    squares[c] += draws * f * f;
  }
}

void PbrModel::Numbers(size_t texel, float* out) const {
  const Texel& at = texels_[texel];
  std::copy_n(at.surface.base, 3, out);
  out[3] = at.surface.roughness;
  out[4] = at.surface.metalness;
  out[5] = at.nx;
  out[6] = at.ny;
  out[7] = at.surface.specular;
}

}  // namespace patina::svbrdf
