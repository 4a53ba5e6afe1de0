// One surface: Fresnel's equations and GGX microfacets with Smith masking.
//
// Based on: Walter et al. 2007 (refraction through rough surfaces), Heitz 2014 (masking), Dupuy and
// Benyoub 2023 (visible normals). Single scattering: what a facet sends onto another facet is lost.
//
// w is the direction to where light comes from, r that of reflected and t that of transmitted
// light, all pointing away from the surface; w.z > 0, r.z > 0, t.z < 0. eta is the refractive index
// on the side of t over that on the side of w. Densities are per solid angle of r or t.
#pragma once

#include <algorithm>
#include <cmath>

#include "pipeline/layered/numeric.h"

namespace patina::layered {

// Reflectance of a dielectric for unpolarised light; 1 beyond the critical angle, exactly 0 for eta
// of 1. cos_t: the cosine in the other medium, 0 beyond the critical angle.
PATINA_HOT inline double FresnelDielectric(double cos_w, double eta, double* cos_t) {
  const double square = 1 - (1 - cos_w * cos_w) / (eta * eta);
  if (!(square > 0)) {
    *cos_t = 0;
    return 1;
  }
  const double c = std::sqrt(square);
  *cos_t = c;
  const double p = (eta * cos_w - c) / (eta * cos_w + c);
  const double s = (cos_w - eta * c) / (cos_w + eta * c);
  return 0.5 * (p * p + s * s);
}

// The same of a conductor with the complex index eta + i k, relative to the medium before it.
inline double FresnelConductor(double cosine, double eta, double k) {
  const double cos2 = cosine * cosine;
  const double sin2 = 1 - cos2;
  const double t0 = eta * eta - k * k - sin2;
  const double sum = std::sqrt(t0 * t0 + 4 * eta * eta * k * k);
  const double a = std::sqrt(std::max(0.0, 0.5 * (sum + t0)));
  const double t1 = sum + cos2;
  const double t2 = 2 * a * cosine;
  const double s = (t1 - t2) / (t1 + t2);
  const double t3 = cos2 * sum + sin2 * sin2;
  const double t4 = t2 * sin2;
  const double p = s * (t3 - t4) / (t3 + t4);
  return 0.5 * (s + p);
}

// The distribution of facets, in its own frame.
struct Ggx {
  double x = 1, y = 1;  // alpha

  PATINA_HOT double Density(const Vec& m) const {
    const double mx = m.x / x, my = m.y / y;
    const double sum = mx * mx + my * my + m.z * m.z;
    return 1 / (kPi * x * y * sum * sum);
  }
  PATINA_HOT double Lambda(const Vec& w) const {
    const double wx = x * w.x, wy = y * w.y;
    return 0.5 * (std::sqrt(1 + (wx * wx + wy * wy) / (w.z * w.z)) - 1);
  }
  PATINA_HOT double Masking(const Vec& w) const { return 1 / (1 + Lambda(w)); }
  // A normal that is seen from w, with density Masking(w) Density(m) max(0, w.m) / w.z.
  PATINA_HOT Vec SampleVisible(const Vec& w, double u0, double u1) const {
    const Vec s = Normalized({x * w.x, y * w.y, w.z});
    double sine, cosine;
    SinCosTurns(u0, &sine, &cosine);
    const double z = (1 - u1) * (1 + s.z) - s.z;
    const double r = std::sqrt(std::max(0.0, 1 - z * z));
    const Vec h{r * cosine + s.x, r * sine + s.y, z + s.z};
    return Normalized({x * h.x, y * h.y, h.z});
  }
};

// Reflection by facets without Fresnel's factor: `value` is f times the cosine of r, `pdf` the
// density of r when facets are drawn as they are seen from w.
struct FacetReflection {
  double value = 0, pdf = 0;
  double cosine = 1;  // between w and the facet
};
PATINA_HOT inline FacetReflection EvaluateReflection(const Ggx& ggx, const Vec& w, const Vec& r) {
  const Vec sum = w + r;
  const double length2 = Dot(sum, sum);
  FacetReflection result;
  // Opposite directions along the surface have no facet between them.
  if (!(length2 > 1e-280)) return result;
  const Vec m = (1 / std::sqrt(length2)) * sum;
  const double lambda_w = ggx.Lambda(w);
  const double lobe = ggx.Density(m) / (4 * w.z);
  result.cosine = std::min(1.0, Dot(w, m));
  result.pdf = lobe / (1 + lambda_w);
  result.value = lobe / (1 + lambda_w + ggx.Lambda(r));
  return result;
}

// Transmission through a rough dielectric, seen from both sides.
struct FacetCrossing {
  double fresnel = 1;      // reflectance of the facet; 1: no facet joins the two directions
  double value = 0;        // f times the cosine of t
  double pdf = 0;          // of t, facets drawn from w and always crossed
  double reverse_pdf = 0;  // of w, facets drawn from t and always crossed
};
// For a facet m that is known to send w to t. cos_m_t is the cosine of t to the facet, positive.
PATINA_HOT inline FacetCrossing CrossingAt(const Ggx& ggx, const Vec& w, const Vec& t, const Vec& m,
                                           double cos_m_w, double cos_m_t, double fresnel,
                                           double eta) {
  FacetCrossing crossing;
  crossing.fresnel = fresnel;
  const double across = cos_m_w - eta * cos_m_t;
  const double core = ggx.Density(m) * cos_m_w * cos_m_t / (across * across);
  const double mask_w = ggx.Masking(w), mask_t = ggx.Masking(t);
  crossing.pdf = mask_w * eta * eta * core / w.z;
  crossing.reverse_pdf = mask_t * core / -t.z;
  crossing.value = (1 - fresnel) * mask_t * crossing.pdf;
  return crossing;
}
PATINA_HOT inline FacetCrossing EvaluateCrossing(const Ggx& ggx, const Vec& w, const Vec& t,
                                                 double eta) {
  Vec sum = w + eta * t;
  if (sum.z < 0) sum = -sum;
  const double length2 = Dot(sum, sum);
  if (!(length2 > 1e-280)) return {};
  const Vec m = (1 / std::sqrt(length2)) * sum;
  const double cos_m_w = Dot(w, m), cos_m_t = -Dot(t, m);
  // The facet must be met from its front on both sides.
  if (!(cos_m_w > 0 && cos_m_t > 0)) return {};
  double cosine;
  const double fresnel = FresnelDielectric(std::min(1.0, cos_m_w), eta, &cosine);
  if (!(fresnel < 1)) return {};
  return CrossingAt(ggx, w, t, m, cos_m_w, cos_m_t, fresnel, eta);
}

}  // namespace patina::layered
