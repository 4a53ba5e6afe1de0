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

// The member of one number that a role is; null for others.
float PbrSurface::*NumberOf(const std::string& role) {
  return role == "roughness"   ? &PbrSurface::roughness
         : role == "metalness" ? &PbrSurface::metalness
         : role == "specular"  ? &PbrSurface::specular
                               : nullptr;
}

// The factor of a role's component.
float FactorOf(const PbrSettings& settings, const std::string& role, size_t component) {
  for (const SceneValue& factor : settings.factors) {
    if (factor.map == role)
      return static_cast<float>(factor.value[std::min(component, factor.value.size() - 1)]);
  }
  return 1;
}

float Share(float value) { return std::clamp(value, 0.0f, 1.0f); }

}  // namespace

void EvaluatePbr(const PbrSurface& surface, const brdf::Direction& wi, const brdf::Direction& wo,
                 float rgb[3], float dielectric_f0) {
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
    const float f0 = (1 - m) * dielectric_f0 * surface.specular + m * surface.base[c];
    const float f90 = (1 - m) * surface.specular + m;
    const float fresnel = f0 + (f90 - f0) * schlick;
    rgb[c] = (1 - fresnel) * (1 - m) * surface.base[c] / kPi + fresnel * lobe;
  }
}

Result<std::shared_ptr<const PbrModel>> PbrModel::Make(const SourceMaps& maps,
                                                       const std::string& name, AddressMode address,
                                                       ThreadPool& pool,
                                                       const PbrSettings& settings) {
  std::shared_ptr<PbrModel> model(new PbrModel);
  model->width_ = maps.width;
  model->height_ = maps.height;
  model->address_ = address;
  model->dielectric_f0_ = settings.dielectric_f0;
  const auto width = static_cast<size_t>(maps.width);
  model->texels_.resize(width * static_cast<size_t>(maps.height));
  model->left_out_ = settings.left_out;
  for (const ConstantMap& constant : settings.constants) model->SetConstant(constant);
  for (const MapPlan& plan : maps.plans) {
    const char* role = plan.role->name;
    const LoadedFile& file = maps.files[static_cast<size_t>(plan.file)];
    const auto is = [role](const char* what) { return std::strcmp(role, what) == 0; };
    float PbrSurface::*number = NumberOf(role);
    if (!is("albedo") && !is("normal") && number == nullptr) {
      model->left_out_.push_back(role);
      continue;
    }
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
          const float nx = settings.normal_scale * planes[0][x];
          const float ny = settings.normal_scale * planes[1][x];
          const float length = settings.normal_scale == 1
                                   ? 1
                                   : std::sqrt(nx * nx + ny * ny + planes[2][x] * planes[2][x]);
          out[x].nx = length > 0 ? nx / length : 0;
          out[x].ny = length > 0 ? -ny / length : 0;  // rows of the frame run down
        }
        return;
      }
      if (is("albedo")) {
        for (float* plane : planes) LinearizeMapRow(plan, plane, maps.width);
      }
      uint64_t beyond = 0;
      const float factors[3] = {FactorOf(settings, role, 0), FactorOf(settings, role, 1),
                                FactorOf(settings, role, 2)};
      const auto share = [&](float value, size_t component) {
        value *= factors[component];
        const float within = Share(value);
        beyond += std::abs(value - within) > 1e-4f ? 1 : 0;
        return within;
      };
      for (size_t x = 0; x < width; ++x) {
        if (number != nullptr) {
          out[x].surface.*number = share(planes[0][x], 0);
          continue;
        }
        for (size_t c = 0; c < 3; ++c) out[x].surface.base[c] = share(planes[c][x], c);
      }
      clamped.fetch_add(beyond, std::memory_order_relaxed);
    });
    if (clamped > 0) {
      model->warnings_.push_back(maps.descriptions[static_cast<size_t>(plan.file)].file + ": " +
                                 std::to_string(clamped.load()) +
                                 " samples lie beyond 0 to 1 and are clamped.");
    }
  }
  const auto roles = [](const std::string& a, const std::string& b) {
    return MapRoleIndex(a) < MapRoleIndex(b);
  };
  std::sort(model->used_.begin(), model->used_.end(), roles);
  std::sort(model->left_out_.begin(), model->left_out_.end(), roles);
  if (std::find(model->used_.begin(), model->used_.end(), "albedo") == model->used_.end()) {
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

void PbrModel::SetConstant(const ConstantMap& constant) {
  float PbrSurface::*number = NumberOf(constant.role);
  const bool albedo = constant.role == "albedo";
  if (number == nullptr && !albedo) {
    left_out_.push_back(constant.role);
    return;
  }
  used_.push_back(constant.role);
  for (Texel& texel : texels_) {
    if (number != nullptr) texel.surface.*number = Share(constant.value[0]);
    for (size_t c = 0; albedo && c < 3; ++c) texel.surface.base[c] = Share(constant.value[c]);
  }
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
  EvaluatePbr(at.surface, frame.wi, frame.wo, rgb, dielectric_f0_);
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
