#include "pipeline/layered/simulator.h"

#include <bit>

#include "formats/base/check.h"
#include "pipeline/layered/adaptive.h"

namespace patina::layered {
namespace {

// Of unit length in double precision, whatever single precision made of it.
Vec Exact(const brdf::Direction& w) {
  return Normalized({static_cast<double>(w.x), static_cast<double>(w.y), static_cast<double>(w.z)});
}

Vec ToFrame(const PreparedSurface& s, const Vec& w) {
  return {s.cos_turn * w.x + s.sin_turn * w.y, s.cos_turn * w.y - s.sin_turn * w.x, w.z};
}
Vec FromFrame(const PreparedSurface& s, const Vec& w) {
  return {s.cos_turn * w.x - s.sin_turn * w.y, s.cos_turn * w.y + s.sin_turn * w.x, w.z};
}

uint64_t Bits(const brdf::Direction& w) {
  const auto low = std::bit_cast<uint32_t>(w.x), high = std::bit_cast<uint32_t>(w.y);
  return (uint64_t{high} << 32) | low;
}

// A generator of its own for each pair of directions and each purpose.
Rng PairRng(const brdf::Direction& wi, const brdf::Direction& wo, uint64_t seed, uint64_t purpose) {
  return Rng(Rng(seed, Bits(wi)).Next() + purpose, Bits(wo));
}

}  // namespace

Simulator::Simulator(const Stack& stack)
    : stack_(Prepare(stack)), kernel_(KernelFor(stack_.effects)) {
  // The lobe of the base: its own roughness and that of each surface on the way in and out, whose
  // refraction bends less than reflection does.
  double x2 = 0, y2 = 0, weight = 0;
  bool clear = true;
  for (int p = 0; p < stack_.parts; ++p) {
    const PreparedPart& part = stack_.base[p];
    if (part.kind != BaseKind::kConductor) continue;
    weight += part.weight;
    x2 += part.weight * part.surface.ggx.x * part.surface.ggx.x;
    y2 += part.weight * part.surface.ggx.y * part.surface.ggx.y;
    base_lobe_ = part.surface;
  }
  for (int i = 0; i < stack_.layers; ++i) clear = clear && !stack_.media[i].scatters;
  has_base_lobe_ = weight > 0 && clear;
  if (!has_base_lobe_) return;
  x2 /= weight;
  y2 /= weight;
  for (int i = 0; i < stack_.layers; ++i) {
    const PreparedInterface& interface = stack_.interfaces[i];
    if (interface.surface.smooth) continue;
    const double bend = std::abs(interface.eta - 1);
    x2 += bend * interface.surface.ggx.x * interface.surface.ggx.x;
    y2 += bend * interface.surface.ggx.y * interface.surface.ggx.y;
  }
  base_lobe_.ggx = {std::min(1.0, std::sqrt(x2)), std::min(1.0, std::sqrt(y2))};
}

void Simulator::AddPaths(const brdf::Direction& wi, const brdf::Direction& wo, int paths, Rng* rng,
                         double sum[3], double squares[3]) const {
  if (!(wi.z > 0 && wo.z > 0)) return;
  const Vec i = Exact(wi), o = Exact(wo);
  if (!closed_form()) return kernel_(stack_, i, o, paths, rng, sum, squares);
  double f[3];
  EvaluateBareBase(stack_, i, o, f);
  for (int c = 0; c < 3; ++c) {
    sum[c] += paths * f[c];
    squares[c] += paths * f[c] * f[c];
  }
}

Estimate Simulator::Average(const brdf::Direction& wi, const brdf::Direction& wo, int paths,
                            uint64_t seed) const {
  PATINA_CHECK(paths >= 2);
  double sum[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
  if (closed_form()) {
    Rng unused(seed);
    AddPaths(wi, wo, 1, &unused, sum, squares);
    Estimate exact;
    exact.f = {sum[0], sum[1], sum[2]};
    return exact;
  }
  Rng rng = PairRng(wi, wo, seed, 1);
  AddPaths(wi, wo, paths, &rng, sum, squares);
  return MeanOf(sum, squares, paths);
}

Estimate Simulator::Evaluate(const brdf::Direction& wi, const brdf::Direction& wo,
                             const Accuracy& accuracy, uint64_t seed) const {
  if (closed_form()) return Average(wi, wo, 2, seed);
  return EstimateTo(accuracy, wi, wo, PairRng(wi, wo, seed, 0), PairRng(wi, wo, seed, 1),
                    [&](int paths, Rng* rng, double sum[3], double squares[3]) {
                      AddPaths(wi, wo, paths, rng, sum, squares);
                    });
}

double Simulator::StandardError(const Estimate& estimate, const brdf::Direction& wi,
                                const brdf::Direction& wo) {
  const double cosine = static_cast<double>(std::max(wi.z, wo.z));
  double worst = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double error = std::sqrt(estimate.variance[c]) * cosine;
    worst = std::max(worst, error / (1 + std::max(0.0, estimate.f[c]) * cosine));
  }
  return worst;
}

Exit Simulator::Walk(const brdf::Direction& w, Rng* rng) const {
  return w.z > 0 ? WalkOnce(stack_, Exact(w), rng) : Exit();
}

Simulator::LobeShares Simulator::SharesFor(const Vec& wi) const {
  double top = 0;
  if (stack_.layers > 0 && !stack_.interfaces[0].surface.smooth) {
    double cos_t;
    const double fresnel = FresnelDielectric(wi.z, stack_.interfaces[0].eta, &cos_t);
    // Of what comes back in all, about; never alone, since there is always something else.
    top = std::clamp(fresnel / (fresnel + 0.5), 0.1, 0.9);
  }
  const double base = has_base_lobe_ ? 0.8 * (1 - top) : 0;
  return {top, base, 1 - top - base};
}

bool Simulator::Sample(const brdf::Direction& wi, const double u[3], brdf::Direction* wo,
                       double* pdf) const {
  *pdf = 0;
  if (!(wi.z > 0)) return false;
  const Vec w = Exact(wi);
  const LobeShares shares = SharesFor(w);
  Vec r;
  if (u[0] < shares.top + shares.base) {
    const PreparedSurface& lobe = u[0] < shares.top ? stack_.interfaces[0].surface : base_lobe_;
    const Vec local = ToFrame(lobe, w);
    const Vec m = lobe.ggx.SampleVisible(local, u[1], u[2]);
    r = FromFrame(lobe, 2 * Dot(local, m) * m + -local);
  } else {
    double sine, cosine;
    SinCosTurns(u[1], &sine, &cosine);
    const double radius = std::sqrt(u[2]);
    r = {radius * cosine, radius * sine, std::sqrt(1 - u[2])};
  }
  *wo = {static_cast<float>(r.x), static_cast<float>(r.y), static_cast<float>(r.z)};
  *pdf = Pdf(wi, *wo);
  return *pdf > 0;
}

double Simulator::Pdf(const brdf::Direction& wi, const brdf::Direction& wo) const {
  if (!(wi.z > 0 && wo.z > 0)) return 0;
  const Vec w = Exact(wi), r = Exact(wo);
  const LobeShares shares = SharesFor(w);
  double pdf = shares.cosine * r.z / kPi;
  if (shares.top > 0) {
    const PreparedSurface& top = stack_.interfaces[0].surface;
    pdf += shares.top * EvaluateReflection(top.ggx, ToFrame(top, w), ToFrame(top, r)).pdf;
  }
  if (shares.base > 0) {
    pdf += shares.base *
           EvaluateReflection(base_lobe_.ggx, ToFrame(base_lobe_, w), ToFrame(base_lobe_, r)).pdf;
  }
  return pdf;
}

namespace {

struct NamedEffect {
  bool Effects::*present;
  const char* name;
};
constexpr NamedEffect kNames[] = {
    {&Effects::deep, "several layers"},    {&Effects::rough, "rough refraction"},
    {&Effects::anisotropic, "anisotropy"}, {&Effects::absorption, "absorption"},
    {&Effects::scattering, "scattering"},  {&Effects::colour, "colour"},
};

std::vector<std::string> NamesWhere(const Effects& effects, bool present) {
  std::vector<std::string> names;
  for (const NamedEffect& effect : kNames) {
    if (effects.*effect.present == present) names.push_back(effect.name);
  }
  return names;
}

}  // namespace

std::vector<std::string> EffectNames(const Effects& effects) { return NamesWhere(effects, true); }
std::vector<std::string> LeftOutNames(const Effects& effects) { return NamesWhere(effects, false); }

}  // namespace patina::layered
