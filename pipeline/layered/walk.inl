// The walk through a stack and its connections, specialised to a set of effects.
//
// Based on: Guo, Hasan, Zhao 2018. The walk starts with light from wi. Every vertex is connected to
// a second path, which starts at wo and is refracted straight down through all surfaces. Differs
// from their bidirectional estimator: the second path makes no turns, and a connection may be made
// at each of its segments, weighted by the balance heuristic against all other ways to get the same
// path: those that go over to the second path at another surface on the straight way out.
//
// Throughput is that of energy, without the factors of squared indices that radiance has inside:
// along a whole path they cancel.
#pragma once

#include "pipeline/base/rng.h"
#include "pipeline/layered/prepared_stack.h"

// Inlined into one function, so that the state of a walk stays in registers.
#define PATINA_WALK_INLINE [[gnu::always_inline]]

namespace patina::layered {

// Walks that lose nothing in thick layers end here. Their share is below any error bar.
inline constexpr int kMaxEvents = 1 << 20;
// Throughput below which a walk is ended at random, after the first events.
inline constexpr double kRouletteBelow = 0.25;
inline constexpr int kEventsBeforeRoulette = 4;

inline double Uniform(Rng* rng) { return static_cast<double>(rng->Next() >> 11) * 0x1p-53; }

template <class E>
struct Colour {
  static constexpr int kChannels = E::kColour ? 3 : 1;
  double v[kChannels] = {};

  double Max() const {
    double max = v[0];
    for (int c = 1; c < kChannels; ++c) max = std::max(max, v[c]);
    return max;
  }
  void Scale(double s) {
    for (int c = 0; c < kChannels; ++c) v[c] *= s;
  }
};

// The second path: what it is like in each layer, pointing up.
template <class E>
struct WayOut {
  static constexpr int kSegments = E::kDeep ? kMaxLayers : 1;
  int layers = 0;  // that it reaches; total reflection may end it
  Vec direction[kSegments] = {};
  // What light of unit density in `direction`, below the upper surface of a layer, adds to f.
  Colour<E> gain[kSegments] = {};
  Colour<E> transmittance[kSegments] = {};  // of the whole layer
  double reach[kSegments] = {};             // chance of a walk to cross the whole layer
  double inverse_pdf[kSegments] = {};  // of the direction in this path; 1 below a smooth surface
  // The density of the other ways over the surfaces above, each over that of going over to this
  // path in this segment, which `inverse_pdf` and the walk's own density precede.
  double odds[kSegments] = {};
};

template <class E>
class Kernel {
 public:
  static constexpr int kChannels = Colour<E>::kChannels;

  static void Estimate(const PreparedStack& stack, const Vec& wi, const Vec& wo, int paths,
                       Rng* rng, double sum[3], double squares[3]) {
    Kernel kernel(stack, *rng);
    kernel.wo_ = wo;
    const Colour<E> mirrored = kernel.Mirrored(wi, wo);
    // Summed up here: stores through the arguments could change the stack, for all that the
    // compiler knows, which would then compute anew for each path what is the same for all.
    double sums[3], sums_of_squares[3];
    std::copy_n(sum, 3, sums);
    std::copy_n(squares, 3, sums_of_squares);
    for (int path = 0; path < paths; ++path) {
      kernel.total_ = mirrored;
      kernel.StartWayOut(wo);
      if (kernel.Enter(wi)) kernel.Walk();
      for (int c = 0; c < 3; ++c) {
        const double f = kernel.total_.v[E::kColour ? c : 0];
        sums[c] += f;
        sums_of_squares[c] += f * f;
      }
    }
    std::copy_n(sums, 3, sum);
    std::copy_n(sums_of_squares, 3, squares);
    *rng = kernel.rng_;
  }

  static Exit WalkAlone(const PreparedStack& stack, const Vec& w, Rng* rng) {
    Kernel kernel(stack, *rng);
    if (stack.layers == 0) {
      kernel.BounceOffBase(w);
    } else if (kernel.EnterOrReflect(w)) {
      kernel.Walk();
    }
    *rng = kernel.rng_;
    for (int c = 0; c < 3; ++c)
      kernel.exit_.weight[c] = kernel.exit_.left ? kernel.light_.v[E::kColour ? c : 0] : 0;
    kernel.exit_.events = kernel.events_;
    return kernel.exit_;
  }

  // f of the base times the cosine of r, and the density of r; smooth parts have none.
  static double EvaluateBase(const PreparedStack& stack, const Vec& w, const Vec& r,
                             double* value) {
    double pdf = 0;
    for (int c = 0; c < kChannels; ++c) value[c] = 0;
    for (int p = 0; p < stack.parts; ++p) {
      const PreparedPart& part = stack.base[p];
      if (part.kind == BaseKind::kDiffuse) {
        const double lobe = r.z / kPi;
        pdf += part.share * lobe;
        for (int c = 0; c < kChannels; ++c) value[c] += part.albedo[c] * lobe;
      } else if (!part.surface.smooth) {
        const FacetReflection lobe = EvaluateReflection(part.surface.ggx, ToFrame(part.surface, w),
                                                        ToFrame(part.surface, r));
        pdf += part.share * lobe.pdf;
        for (int c = 0; c < kChannels; ++c) {
          value[c] +=
              part.weight * lobe.value * FresnelConductor(lobe.cosine, part.eta[c], part.k[c]);
        }
      }
    }
    return pdf;
  }

 private:
  Kernel(const PreparedStack& stack, const Rng& rng) : stack_(stack), rng_(rng) {
    for (int c = 0; c < kChannels; ++c) light_.v[c] = total_.v[c] = 0;
  }

  static bool Smooth(const PreparedSurface& surface) {
    if constexpr (!E::kRough) return true;
    // The only surface is the rough one.
    if constexpr (!E::kDeep && !E::kAnisotropic) return false;
    return surface.smooth;
  }
  static Vec ToFrame(const PreparedSurface& s, const Vec& w) {
    if constexpr (!E::kAnisotropic) return w;
    return {s.cos_turn * w.x + s.sin_turn * w.y, s.cos_turn * w.y - s.sin_turn * w.x, w.z};
  }
  static Vec FromFrame(const PreparedSurface& s, const Vec& w) {
    if constexpr (!E::kAnisotropic) return w;
    return {s.cos_turn * w.x - s.sin_turn * w.y, s.cos_turn * w.y + s.sin_turn * w.x, w.z};
  }

  int LastLayer() const {
    if constexpr (!E::kDeep) return 0;
    return stack_.layers - 1;
  }

  // The layer that the walk is in.
  int CurrentLayer() const {
    if constexpr (!E::kDeep) return 0;
    return layer_;
  }

  static Colour<E> One() {
    Colour<E> one;
    for (int c = 0; c < kChannels; ++c) one.v[c] = 1;
    return one;
  }
  static Colour<E> Transmittance(const PreparedMedium& medium, double distance) {
    Colour<E> t = One();
    if constexpr (E::kAbsorption) {
      if (medium.extinguishes) {
        for (int c = 0; c < kChannels; ++c)
          t.v[c] = ExpOfNegative(-medium.extinction[c] * distance);
      }
    }
    return t;
  }
  // The chance of a walk to go that far without an event, for the weights of connections: any value
  // serves as long as it is the same for all ways to get a path.
  static double Reach(const PreparedMedium& medium, double distance) {
    if constexpr (!E::kScattering) return 1;
    return medium.scatters ? ExpOfNegative(-medium.mean_extinction * distance) : 1;
  }
  static double Along(double depth, double cosine) {
    return depth / std::max(std::abs(cosine), 1e-12);
  }

  // 1 where a walk that meets this surface can be connected there, else 0.
  double Connectable(int interface) const {
    return Smooth(stack_.interfaces[interface].surface) ? 0.0 : 1.0;
  }

  struct SmoothCrossing {
    Vec t;
    double fresnel;
    double ratio;  // solid angle of w over that of t
  };
  static SmoothCrossing CrossSmoothly(const Vec& w, double eta) {
    double cos_t;
    SmoothCrossing crossing;
    crossing.fresnel = FresnelDielectric(w.z, eta, &cos_t);
    crossing.t = {-w.x / eta, -w.y / eta, -cos_t};
    crossing.ratio = cos_t * eta * eta / w.z;
    return crossing;
  }

  // A facet drawn as it is seen from w, and where it sends light.
  struct Facet {
    Vec m;
    double cosine, cos_t, fresnel;

    Vec Reflected(const Vec& w) const { return 2 * cosine * m + -w; }
    Vec Transmitted(const Vec& w, double eta) const {
      return (-1 / eta) * w + (cosine / eta - cos_t) * m;
    }
    bool Crosses(const Vec& t) const { return cos_t > 0 && cosine > 0 && t.z < 0; }
  };
  PATINA_WALK_INLINE Facet DrawFacet(const Ggx& ggx, const Vec& w, double eta) {
    Facet facet;
    const double u0 = Uniform(&rng_), u1 = Uniform(&rng_);
    facet.m = ggx.SampleVisible(w, u0, u1);
    facet.cosine = std::clamp(Dot(w, facet.m), 0.0, 1.0);
    facet.fresnel = FresnelDielectric(facet.cosine, eta, &facet.cos_t);
    return facet;
  }

  // What the uppermost surface reflects at once.
  Colour<E> Mirrored(const Vec& wi, const Vec& wo) const {
    const PreparedInterface& top = stack_.interfaces[0];
    Colour<E> f = One();
    f.Scale(0);
    if (Smooth(top.surface)) return f;
    const FacetReflection reflection =
        EvaluateReflection(top.surface.ggx, ToFrame(top.surface, wi), ToFrame(top.surface, wo));
    double cos_t;
    const double value =
        reflection.value / wo.z * FresnelDielectric(reflection.cosine, top.eta, &cos_t);
    for (int c = 0; c < kChannels; ++c) f.v[c] = value;
    return f;
  }

  PATINA_WALK_INLINE void StartWayOut(const Vec& wo) {
    out_.layers = 0;
    Vec w = wo;
    Colour<E> gain = One();
    gain.Scale(1 / wo.z);  // f is what leaves over the cosine
    for (int i = 0; i <= LastLayer(); ++i) {
      const PreparedInterface& interface = stack_.interfaces[i];
      const PreparedMedium& medium = stack_.media[i];
      Vec t;
      double share;   // of the light that crosses, against the density of t
      double up_pdf;  // of w, when a walk comes along t
      if (Smooth(interface.surface)) {
        const SmoothCrossing crossing = CrossSmoothly(w, interface.eta);
        if (!(crossing.t.z < 0)) return;
        t = crossing.t;
        share = 1 - crossing.fresnel;
        up_pdf = share / crossing.ratio;
        out_.inverse_pdf[i] = 1;
      } else {
        const Ggx& ggx = interface.surface.ggx;
        const Vec local = ToFrame(interface.surface, w);
        const Facet facet = DrawFacet(ggx, local, interface.eta);
        t = facet.Transmitted(local, interface.eta);
        if (!facet.Crosses(t)) return;
        const FacetCrossing crossing = CrossingAt(ggx, local, t, facet.m, facet.cosine, facet.cos_t,
                                                  facet.fresnel, interface.eta);
        if (!(crossing.pdf > 0)) return;
        share = crossing.value / crossing.pdf;
        up_pdf = (1 - facet.fresnel) * crossing.reverse_pdf;
        out_.inverse_pdf[i] = 1 / crossing.pdf;
        t = FromFrame(interface.surface, t);
      }
      out_.odds[i] = 0;
      if (i > 0) {
        out_.odds[i] = up_pdf * out_.reach[i - 1] * out_.inverse_pdf[i - 1] *
                       (Connectable(i - 1) + out_.odds[i - 1]);
      }
      // By reciprocity of f over squared index.
      gain.Scale(share * w.z / (interface.eta * interface.eta * -t.z));
      out_.gain[i] = gain;
      w = -t;
      out_.direction[i] = w;
      const double distance = Along(medium.thickness, w.z);
      out_.transmittance[i] = Transmittance(medium, distance);
      out_.reach[i] = Reach(medium, distance);
      for (int c = 0; c < kChannels; ++c) gain.v[c] *= out_.transmittance[i].v[c];
      out_.layers = i + 1;
    }
  }

  // Adds what goes over to the way out in `layer`. value: what the walk's light scatters into the
  // way's direction, density per solid angle, times what is left of it at the layer's upper
  // surface; pdf: the walk's density of this direction; reach: its chance to get to that surface;
  // links: density of the ways that went over earlier, over that of this one.
  PATINA_WALK_INLINE void Connect(int layer, const double* value, double pdf, double reach,
                                  double links) {
    double later = pdf * out_.inverse_pdf[layer] * Connectable(layer);
    if constexpr (E::kDeep) later += pdf * out_.inverse_pdf[layer] * out_.odds[layer];
    if constexpr (E::kScattering) later *= reach;
    const double weight = 1 / (1 + links + later);
    for (int c = 0; c < kChannels; ++c)
      total_.v[c] += light_.v[c] * value[c] * out_.gain[layer].v[c] * weight;
  }
  bool HasWayOut(int layer) const { return E::kConnect && layer < out_.layers; }

  // The walk gets through the uppermost surface. False: nothing does.
  PATINA_WALK_INLINE bool Enter(const Vec& wi) {
    light_ = One();
    events_ = 1;
    const PreparedInterface& top = stack_.interfaces[0];
    layer_ = 0;
    depth_ = 0;
    if (Smooth(top.surface)) {
      const SmoothCrossing crossing = CrossSmoothly(wi, top.eta);
      direction_ = crossing.t;
      light_.Scale(1 - crossing.fresnel);
      return crossing.t.z < 0;
    }
    const Vec w = ToFrame(top.surface, wi);
    const Facet facet = DrawFacet(top.surface.ggx, w, top.eta);
    const Vec t = facet.Transmitted(w, top.eta);
    if (!facet.Crosses(t)) return false;
    light_.Scale((1 - facet.fresnel) * top.surface.ggx.Masking(t));
    direction_ = FromFrame(top.surface, t);
    return true;
  }
  // The same where reflected light counts as an exit.
  bool EnterOrReflect(const Vec& w) {
    light_ = One();
    only_smooth_ = true;
    depth_ = 0;
    layer_ = -1;
    direction_ = -w;
    return MeetFromAbove(0);
  }

  void BounceOffBase(const Vec& w) {
    light_ = One();
    direction_ = -w;
    if (MeetBase()) Leave();
  }

  PATINA_WALK_INLINE void Walk() {
    for (;;) {
      if (!(light_.Max() > 0)) return;
      if constexpr (E::kScattering) {
        if (events_ >= kMaxEvents) return;
      }
      if (events_ >= kEventsBeforeRoulette && light_.Max() < kRouletteBelow) {
        const double survival = light_.Max() / kRouletteBelow;
        if (!(Uniform(&rng_) < survival)) return;
        light_.Scale(1 / survival);
      }
      bool goes_on;
      if (Fly()) {
        goes_on = Scatter();
      } else if (direction_.z > 0) {
        goes_on = MeetFromBelow();
      } else if (CurrentLayer() == LastLayer()) {
        goes_on = MeetBase();
      } else {
        goes_on = MeetNextSurface();
      }
      if (!goes_on) return;
    }
  }

  // To the next event. True: it is inside the medium; false: at the layer's border.
  bool Fly() {
    const PreparedMedium& medium = stack_.media[CurrentLayer()];
    reached_ = 1;
    if constexpr (E::kAbsorption) {
      if (medium.extinguishes) {
        const bool up = direction_.z > 0;
        const double cosine = std::abs(direction_.z);
        const double border = Along(up ? depth_ : medium.thickness - depth_, cosine);
        if constexpr (E::kScattering) {
          if (medium.scatters) return FlyFreely(medium, border);
        }
        for (int c = 0; c < kChannels; ++c)
          light_.v[c] *= ExpOfNegative(-medium.extinction[c] * border);
      }
    }
    if constexpr (E::kAbsorption) depth_ = direction_.z > 0 ? 0 : medium.thickness;
    return false;
  }

  // The distance is drawn for one of the channels, each as likely as it is bright, and weighted by
  // the density of all.
  bool FlyFreely(const PreparedMedium& medium, double border) {
    double share[kChannels];
    int channel = 0;
    if constexpr (kChannels == 1) {
      share[0] = 1;
    } else {
      const double sum = light_.v[0] + light_.v[1] + light_.v[2];
      const double u = Uniform(&rng_) * sum;
      for (int c = 0; c < kChannels; ++c) share[c] = light_.v[c] / sum;
      channel = u < light_.v[0] ? 0 : u < light_.v[0] + light_.v[1] ? 1 : 2;
    }
    const double depth = -Log(1 - Uniform(&rng_));
    const double extinction = medium.extinction[channel];
    const bool scatters = depth < extinction * border;
    const double distance = scatters ? depth / extinction : border;
    double density = 0, value[kChannels];
    for (int c = 0; c < kChannels; ++c) {
      const double through = ExpOfNegative(-medium.extinction[c] * distance);
      density += share[c] * through * (scatters ? medium.extinction[c] : 1);
      value[c] = through * (scatters ? medium.scattering[c] : 1);
    }
    for (int c = 0; c < kChannels; ++c) light_.v[c] *= density > 0 ? value[c] / density : 0;
    if (scatters) {
      depth_ = std::clamp(depth_ - distance * direction_.z, 0.0, medium.thickness);
    } else {
      depth_ = direction_.z > 0 ? 0 : medium.thickness;
      reached_ = ExpOfNegative(-medium.mean_extinction * border);
    }
    return scatters;
  }

  static double Phase(double g, double cosine) {
    const double d = 1 + g * g - 2 * g * cosine;
    return (1 - g * g) / (4 * kPi * d * std::sqrt(d));
  }

  bool Scatter() {
    const int layer = CurrentLayer();
    const PreparedMedium& medium = stack_.media[layer];
    ++events_;
    only_smooth_ = false;
    const double g = medium.asymmetry;
    if (HasWayOut(layer)) {
      const Vec& o = out_.direction[layer];
      const double pdf = Phase(g, Dot(direction_, o));
      const double distance = Along(depth_, o.z);
      Colour<E> value = Transmittance(medium, distance);
      value.Scale(pdf);
      Connect(layer, value.v, pdf, Reach(medium, distance), 0);
    }
    const double u = Uniform(&rng_);
    double cosine = 1 - 2 * u;
    if (std::abs(g) > 1e-4) {
      const double s = (1 - g * g) / (1 + g - 2 * g * u);
      cosine = std::clamp((1 + g * g - s * s) / (2 * g), -1.0, 1.0);
    }
    double sin_phi, cos_phi;
    SinCosTurns(Uniform(&rng_), &sin_phi, &cos_phi);
    const double sine = std::sqrt(1 - cosine * cosine);
    // Two directions across, by Duff et al. 2017.
    const Vec& d = direction_;
    const double sign = d.z >= 0 ? 1 : -1;
    const double a = -1 / (sign + d.z), b = d.x * d.y * a;
    const Vec t{1 + sign * d.x * d.x * a, sign * b, -sign * d.x};
    const Vec s{b, sign + d.y * d.y * a, -d.y};
    direction_ = Normalized(sine * cos_phi * t + sine * sin_phi * s + cosine * d);
    pdf_ = Phase(g, cosine);
    links_ = 1;
    return true;
  }

  PATINA_WALK_INLINE bool MeetBase() {
    ++events_;
    if (!E::kDiffuseBase && stack_.parts == 0) [[unlikely]]
      return false;
    const Vec w = -direction_;
    const int layer = CurrentLayer();
    if (HasWayOut(layer)) {
      const Vec& o = out_.direction[layer];
      double value[kChannels];
      double pdf = o.z / kPi;
      if constexpr (E::kDiffuseBase) {
        for (int c = 0; c < kChannels; ++c) value[c] = stack_.base[0].albedo[c] * pdf;
      } else {
        pdf = EvaluateBase(stack_, w, o, value);
      }
      if constexpr (E::kAbsorption) {
        for (int c = 0; c < kChannels; ++c) value[c] *= out_.transmittance[layer].v[c];
      }
      if (pdf > 0) Connect(layer, value, pdf, out_.reach[layer], 0);
    }
    int chosen = 0;
    if (!E::kDiffuseBase && stack_.parts > 1) {
      double u = Uniform(&rng_);
      while (chosen + 1 < stack_.parts && u >= stack_.base[chosen].share)
        u -= stack_.base[chosen++].share;
    }
    const PreparedPart& part = stack_.base[chosen];
    depth_ = stack_.media[layer].thickness;
    if (E::kDiffuseBase || part.kind == BaseKind::kDiffuse) {
      const double u = Uniform(&rng_);
      double sine, cosine;
      SinCosTurns(Uniform(&rng_), &sine, &cosine);
      const double r = std::sqrt(u);
      direction_ = {r * cosine, r * sine, std::sqrt(1 - u)};
    } else if (part.surface.smooth) {
      // A base of several parts has no smooth ones.
      direction_ = Flipped(direction_);
      for (int c = 0; c < kChannels; ++c)
        light_.v[c] *= part.weight * FresnelConductor(w.z, part.eta[c], part.k[c]);
      links_ = 0;
      pdf_ = 1;
      return true;
    } else {
      const Vec local = ToFrame(part.surface, w);
      const double u0 = Uniform(&rng_), u1 = Uniform(&rng_);
      const Vec m = part.surface.ggx.SampleVisible(local, u0, u1);
      const Vec r = 2 * Dot(local, m) * m + -local;
      if (!(r.z > 0)) return false;
      direction_ = FromFrame(part.surface, r);
    }
    only_smooth_ = false;
    links_ = 1;
    if constexpr (E::kDiffuseBase) {
      pdf_ = direction_.z / kPi;
      for (int c = 0; c < kChannels; ++c) light_.v[c] *= part.albedo[c];
      return true;
    }
    double value[kChannels];
    pdf_ = EvaluateBase(stack_, w, direction_, value);
    if (!(pdf_ > 0)) return false;
    for (int c = 0; c < kChannels; ++c) light_.v[c] *= value[c] / pdf_;
    return true;
  }

  bool MeetNextSurface() {
    if constexpr (E::kDeep) return MeetFromAbove(layer_ + 1);
    return false;
  }

  // Surface i, from the layer above it.
  bool MeetFromAbove(int i) {
    ++events_;
    const PreparedInterface& interface = stack_.interfaces[i];
    const Vec w = -direction_;
    if (Smooth(interface.surface)) {
      const SmoothCrossing crossing = CrossSmoothly(w, interface.eta);
      if (!(crossing.t.z < 0) || Uniform(&rng_) < crossing.fresnel) {
        direction_ = Flipped(direction_);
        links_ = 0;
        pdf_ = 1;
        return StayAbove(i);
      }
      direction_ = crossing.t;
    } else {
      const Ggx& ggx = interface.surface.ggx;
      const Vec local = ToFrame(interface.surface, w);
      double cos_t;
      if (i > 0 && HasWayOut(i - 1)) {
        const FacetReflection lobe =
            EvaluateReflection(ggx, local, ToFrame(interface.surface, out_.direction[i - 1]));
        const double fresnel = FresnelDielectric(lobe.cosine, interface.eta, &cos_t);
        double value[kChannels];
        for (int c = 0; c < kChannels; ++c)
          value[c] = fresnel * lobe.value * out_.transmittance[i - 1].v[c];
        Connect(i - 1, value, fresnel * lobe.pdf, out_.reach[i - 1], 0);
      }
      only_smooth_ = false;
      const Facet facet = DrawFacet(ggx, local, interface.eta);
      if (Uniform(&rng_) < facet.fresnel) {
        const Vec r = facet.Reflected(local);
        if (!(r.z > 0)) return false;
        const FacetReflection lobe = EvaluateReflection(ggx, local, r);
        if (!(lobe.pdf > 0)) return false;
        light_.Scale(lobe.value / lobe.pdf);
        links_ = 1;
        pdf_ = facet.fresnel * lobe.pdf;
        direction_ = FromFrame(interface.surface, r);
        return StayAbove(i);
      }
      const Vec t = facet.Transmitted(local, interface.eta);
      if (!facet.Crosses(t)) return false;
      light_.Scale(ggx.Masking(t));
      direction_ = FromFrame(interface.surface, t);
    }
    layer_ = i;
    depth_ = 0;
    return true;
  }

  // Light goes up from surface i: into the layer above, or out.
  bool StayAbove(int i) {
    if (i == 0) return Leave();
    depth_ = stack_.media[i - 1].thickness;
    return true;
  }
  bool Leave() {
    exit_.left = true;
    exit_.smooth = only_smooth_;
    exit_.direction = direction_;
    return false;
  }

  // The surface on top of the current layer, from below.
  PATINA_WALK_INLINE bool MeetFromBelow() {
    ++events_;
    const int i = CurrentLayer();
    const PreparedInterface& interface = stack_.interfaces[i];
    const double eta = 1 / interface.eta;
    const Vec w = Flipped(-direction_);  // as if from above
    double links = links_ / (pdf_ * reached_);
    if (Smooth(interface.surface)) {
      const SmoothCrossing crossing = CrossSmoothly(w, eta);
      if (!(crossing.t.z < 0) || Uniform(&rng_) < crossing.fresnel) {
        direction_ = Flipped(direction_);
        return true;
      }
      direction_ = Flipped(crossing.t);
      links_ = links;
      pdf_ = (1 - crossing.fresnel) * crossing.ratio;
      return Rise(i);
    }
    const Ggx& ggx = interface.surface.ggx;
    const Vec local = ToFrame(interface.surface, w);
    if (i == 0 ? E::kConnect : HasWayOut(i - 1)) ConnectAcross(i, local, eta, links);
    only_smooth_ = false;
    const Facet facet = DrawFacet(ggx, local, eta);
    if (Uniform(&rng_) < facet.fresnel) {
      const Vec r = facet.Reflected(local);
      if (!(r.z > 0)) return false;
      const double lambda = ggx.Lambda(local);
      light_.Scale((1 + lambda) / (1 + lambda + ggx.Lambda(r)));
      direction_ = Flipped(FromFrame(interface.surface, r));
      return true;
    }
    if (E::kConnect && i == 0) return false;  // what leaves has been connected
    const Vec t = facet.Transmitted(local, eta);
    if (!facet.Crosses(t)) return false;
    if constexpr (E::kConnect) {
      const FacetCrossing crossing =
          CrossingAt(ggx, local, t, facet.m, facet.cosine, facet.cos_t, facet.fresnel, eta);
      if (!(crossing.pdf > 0)) return false;
      links_ = 1 + links * crossing.reverse_pdf;
      pdf_ = (1 - facet.fresnel) * crossing.pdf;
    }
    light_.Scale(ggx.Masking(t));
    direction_ = Flipped(FromFrame(interface.surface, t));
    return Rise(i);
  }

  bool Rise(int i) {
    if (i == 0) return Leave();
    layer_ = i - 1;
    depth_ = stack_.media[i - 1].thickness;
    return true;
  }

  // Goes over to the way out at the rough surface i, from below. w: in the surface's frame, as if
  // from above.
  PATINA_WALK_INLINE void ConnectAcross(int i, const Vec& w, double eta, double links) {
    const PreparedSurface& surface = stack_.interfaces[i].surface;
    const Vec t = ToFrame(surface, Flipped(i == 0 ? wo_ : out_.direction[i - 1]));
    const FacetCrossing crossing = EvaluateCrossing(surface.ggx, w, t, eta);
    if (!(crossing.value > 0)) return;
    const double earlier = links * crossing.reverse_pdf;
    double value[kChannels];
    if (i == 0) {
      const double f = crossing.value / -t.z / (1 + earlier);
      for (int c = 0; c < kChannels; ++c) total_.v[c] += light_.v[c] * f;
      return;
    }
    for (int c = 0; c < kChannels; ++c) value[c] = crossing.value * out_.transmittance[i - 1].v[c];
    Connect(i - 1, value, (1 - crossing.fresnel) * crossing.pdf, out_.reach[i - 1], earlier);
  }

  const PreparedStack& stack_;
  Rng rng_;
  Vec wo_;
  WayOut<E> out_;
  Colour<E> total_, light_;
  // The walk: where it is, where it goes.
  int layer_ = 0;
  double depth_ = 0;  // below the layer's upper surface
  Vec direction_;
  double reached_ = 1;  // chance that it got here from its last event
  // Of a walk on its way straight up: density of its direction, and that of the ways that went over
  // before this segment over that of this one, the last vertex's own included.
  double pdf_ = 1, links_ = 0;
  int events_ = 0;
  bool only_smooth_ = true;
  Exit exit_;
};

}  // namespace patina::layered

#undef PATINA_WALK_INLINE
