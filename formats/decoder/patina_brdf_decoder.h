// Reference decoder of Patina containers of kind "brdf": (wi, wo) -> rgb of f in 1/sr, linear
// Rec.709, without the cosine; and importance sampling.
//
// Two headers, this and patina_brdf_sampler.h; C++17, needs only the standard library and
// nlohmann/json: copy them into a renderer. They read what FORMATS.md describes and share no code
// with the rest of Patina. Files in a zstd frame are refused: `zstd -d` them first.
//
//   using patina::BrdfDecoder;
//   BrdfDecoder brdf;
//   std::string problem;
//   if (BrdfDecoder::Load("out/chrome", &brdf, &problem) != BrdfDecoder::LoadStatus::kOk) return;
//   float rgb[3];
//   brdf.Evaluate(wi, wo, rgb);
//
// Directions are unit vectors in the frame of the surface, z along the normal, both pointing away
// from it. A loaded decoder is immutable: all its const members may be called from many threads at
// once. Load does not throw.
//
// Results differ between machines only where their atan2, log and expm1 do, as long as the compiler
// neither fuses multiplications with additions nor reorders: -ffp-contract=off and no -ffast-math.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <fstream>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "patina_brdf_sampler.h"

namespace patina {
namespace brdf_decoder_detail {

// ---- Bytes ----

inline float HalfToFloat(uint32_t half) {
  const int exponent = static_cast<int>(half >> 10) & 31;
  const int mantissa = static_cast<int>(half & 0x3FF);
  const float magnitude = exponent == 0
                              ? std::ldexp(static_cast<float>(mantissa), -24)
                              : std::ldexp(static_cast<float>(1024 + mantissa), exponent - 25);
  return (half & 0x8000) != 0 ? -magnitude : magnitude;
}

inline bool HalfIsFinite(uint32_t half) { return (half & 0x7C00) != 0x7C00; }

inline uint32_t Load8(const std::string& bytes, size_t at) {
  return static_cast<uint8_t>(bytes[at]);
}
inline uint32_t Load16(const std::string& bytes, size_t at) {
  return Load8(bytes, at) | Load8(bytes, at + 1) << 8;
}
inline uint32_t Load32(const std::string& bytes, size_t at) {
  return Load16(bytes, at) | Load16(bytes, at + 2) << 16;
}

// CRC-32 of zlib and PNG, taking bytes [skip, skip + 4) for zeros.
inline uint32_t Crc32(const std::string& bytes, size_t skip) {
  uint32_t crc = 0xFFFFFFFFu;
  for (size_t i = 0; i < bytes.size(); ++i) {
    crc ^= i >= skip && i < skip + 4 ? 0u : Load8(bytes, i);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? (crc >> 1) ^ 0xEDB88320u : crc >> 1;
  }
  return ~crc;
}

// `count` finite halves at byte `at`, which must be within the bytes.
inline bool ReadHalves(const std::string& bytes, size_t at, size_t count,
                       std::vector<float>* values) {
  values->resize(count);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t half = Load16(bytes, at + 2 * i);
    if (!HalfIsFinite(half)) return false;
    (*values)[i] = HalfToFloat(half);
  }
  return true;
}

// ---- JSON ----

// A member of an object, or null.
inline const nlohmann::json& Member(const nlohmann::json& value, const char* key) {
  static const nlohmann::json null;
  if (!value.is_object()) return null;
  const auto found = value.find(key);
  return found == value.end() ? null : *found;
}

inline std::string Text(const nlohmann::json& value) {
  return value.is_string() ? value.get<std::string>() : std::string();
}

// A name without a path in it.
inline bool IsPlainName(const std::string& name) {
  return !name.empty() && name[0] != '.' && name.find_first_of("/\\") == std::string::npos &&
         name.find('\0') == std::string::npos;
}

// ---- The lattice of corners (FORMATS.md, "Corners") ----

// Corners in rings above ring k.
inline int RingStart(int n, int k) {
  if (k == 0) return 0;
  return k <= n ? 1 + 2 * k * (k - 1) : 1 + 2 * n * (n - 1) + 4 * n * (k - n);
}
inline int RingLength(int n, int k) { return k == 0 ? 1 : 4 * std::min(k, n); }
inline int RingShift(int n, int k) { return k > n ? (k - n) & 1 : 0; }

inline int RingOf(int n, int index) {
  int low = 0;
  int high = 2 * n + 2;  // the first ring beyond
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (RingStart(n, middle) <= index ? low : high) = middle;
  }
  return low;
}

inline void CornerDirection(int n, int index, float xyz[3]) {
  const int k = RingOf(n, index);
  const int j = index - RingStart(n, k);
  float z, sine;
  int numerator, denominator;
  if (k <= n) {
    const float part = static_cast<float>(k) / static_cast<float>(n);
    z = 1 - part * part / 3;
    sine = part * std::sqrt((1 + z) / 3);
    numerator = j;
    denominator = std::max(k, 1);
  } else {
    z = static_cast<float>(4 * n - 2 * k) / static_cast<float>(3 * n);
    sine = std::sqrt((1 - z) * (1 + z));
    numerator = 2 * j + RingShift(n, k);
    denominator = 2 * n;
  }
  const float angle =
      1.57079632679f * static_cast<float>(numerator) / static_cast<float>(denominator);
  xyz[0] = sine * std::cos(angle);
  xyz[1] = sine * std::sin(angle);
  xyz[2] = z;
}

struct Lookup {
  int index[4];  // north, east, south, west
  float weight[4];
};

// Interpolation: 0 bilinear, 1 inverse distance, 2 uniform.
inline Lookup LookUp(int n, const float d[3], int interpolation) {
  const float z = d[2] > 0 ? d[2] : 0.0f;
  const auto nf = static_cast<float>(n);
  int quadrant = 3;
  float forward = -d[1];
  float side = d[0];
  if (d[0] > 0 && d[1] >= 0) {
    quadrant = 0, forward = d[0], side = d[1];
  } else if (d[1] > 0 && d[0] <= 0) {
    quadrant = 1, forward = d[1], side = -d[0];
  } else if (d[0] < 0 && d[1] <= 0) {
    quadrant = 2, forward = -d[0], side = -d[1];
  } else if (d[0] == 0 && d[1] == 0) {
    quadrant = 0, forward = 1, side = 0;
  }
  float t = std::atan2(side, forward) * 0.63661977236758134f;
  t = t >= 0 ? std::min(t, 1.0f) : 0.0f;

  int ring, j;
  float u, v;
  if (z > static_cast<float>(2.0 / 3.0)) {
    float radius = nf * std::sqrt(d[0] * d[0] + d[1] * d[1]) / std::sqrt((1 + z) / 3);
    radius = radius < nf ? radius : nf;
    const float a = t * radius;
    const float b = (1 - t) * radius;
    int jp = static_cast<int>(a);
    int jm = static_cast<int>(b);
    if (jp + jm >= n) --(jp > 0 ? jp : jm);
    ring = jp + jm + 1;
    j = quadrant * ring + jp;
    u = a - static_cast<float>(jp);
    v = b - static_cast<float>(jm);
  } else {
    const float middle = nf * (0.5f + t);
    const float rise = 0.75f * nf * z;
    const float a = middle - rise;
    const float b = middle + rise;
    int jp = static_cast<int>(std::floor(a));
    const int jm = static_cast<int>(std::floor(b));
    if (jm - jp > n) jp = jm - n;
    u = a - static_cast<float>(jp);
    v = 1 - (b - static_cast<float>(jm));
    const int sum = jp + jm + 2 * quadrant * n;
    ring = 2 * n + jp - jm;
    j = ((sum - n + 2 - ((n + 1 + jp - jm) & 1) + 8 * n) >> 1) % (4 * n);
  }
  u = std::min(std::max(u, 0.0f), 1.0f);
  v = std::min(std::max(v, 0.0f), 1.0f);

  Lookup lookup;
  const int start = RingStart(n, ring);
  const int length = RingLength(n, ring);
  if (ring <= n) {
    const int q = j / ring;
    const int m = j % ring;
    lookup.index[0] = ring == 1 ? 0 : RingStart(n, ring - 1) + (q * (ring - 1) + m) % (length - 4);
    lookup.index[1] = start + (j + 1) % length;
    lookup.index[2] = start + length + (ring < n ? q * (ring + 1) + m + 1 : j);
    lookup.index[3] = start + j;
  } else {
    const int shift = RingShift(n, ring);
    lookup.index[0] = start - length + j;
    lookup.index[1] = start + (j + 1 - shift) % length;
    lookup.index[2] = start + length + j;
    lookup.index[3] = start + (j - shift + length) % length;
  }
  float* weight = lookup.weight;
  if (interpolation == 0) {
    weight[0] = (1 - u) * (1 - v);
    weight[1] = u * (1 - v);
    weight[2] = u * v;
    weight[3] = (1 - u) * v;
  } else if (interpolation == 1) {
    float sum = 0;
    for (int c = 0; c < 4; ++c) {
      float corner[3];
      CornerDirection(n, lookup.index[c], corner);
      const float x = d[0] - corner[0];
      const float y = d[1] - corner[1];
      const float w = d[2] - corner[2];
      const float half_chord = std::min(1.0f, std::sqrt(x * x + y * y + w * w) / 2);
      weight[c] = 1 / std::max(2 * std::asin(half_chord), 1e-7f);
      sum += weight[c];
    }
    for (int c = 0; c < 4; ++c) weight[c] /= sum;
  } else {
    std::fill(weight, weight + 4, 0.25f);
  }
  return lookup;
}

// Gives each corner that is not stored the mean of its parents, coarse lattices first; see
// FORMATS.md, "Derived corners". values: [corner][k].
inline void FillDerived(int nside, size_t k, const std::vector<bool>& stored, float* values) {
  int coarsest = nside;
  while (coarsest % 2 == 0) coarsest /= 2;
  for (int n = coarsest; n <= nside; n *= 2) {
    const auto place = [&](int ring, int j) {
      for (int m = n; m < nside; m *= 2) {
        j = 2 * j + RingShift(m, ring);
        ring *= 2;
      }
      return static_cast<size_t>(RingStart(nside, ring) + j) * k;
    };
    // Two or four parents of a corner, by ring and place in the ring.
    const auto set = [&](size_t to, std::initializer_list<std::pair<int, int>> parents) {
      const float share = parents.size() == 2 ? 0.5f : 0.25f;
      for (size_t i = 0; i < k; ++i) {
        float sum = 0;
        for (auto [ring, j] : parents) {
          const int length = RingLength(n, ring);
          if (ring > 2 * n) ring = 4 * n - ring;
          sum += values[place(ring, (j + length) % length) + i];
        }
        values[to + i] = share * sum;
      }
    };
    for (int ring = 0; ring <= (n == nside ? 2 * n + 1 : 2 * n); ++ring) {
      for (int j = 0; j < RingLength(n, ring); ++j) {
        const size_t at = place(ring, j);
        if (stored[at / k]) continue;
        if (n == coarsest) {
          std::fill(values + at, values + at + k, 0.0f);
          continue;
        }
        const bool cap = ring < n;
        const int q = ring > 0 ? j / ring : 0;
        const int p = ring > 0 ? j % ring : 0;
        if (ring % 2 == 0) {
          if ((j - RingShift(n / 2, ring / 2)) % 2 == 0) continue;
          set(at, {{ring - 2, ring <= n ? q * (ring - 2) + p - 1 : j},
                   {ring, j + 1},
                   {ring + 2, cap ? q * (ring + 2) + p + 1 : j},
                   {ring, j - 1}});
        } else if (cap) {
          const int odd = p % 2;
          set(at, {{ring - 1, q * (ring - 1) + p - odd}, {ring + 1, q * (ring + 1) + p + odd}});
        } else {
          const int east = (j - RingShift(n / 2, ring / 2)) % 2 == 0 ? 1 : 0;
          set(at, {{ring - 1, j + 1 - east}, {ring + 1, j + east}});
        }
      }
    }
  }
}

struct Layer {
  size_t inputs = 0;
  size_t outputs = 0;
  std::vector<float> weight;  // [input][output]
  std::vector<float> bias;    // [output]
};

}  // namespace brdf_decoder_detail

class BrdfDecoder {
 public:
  enum class LoadStatus { kOk, kNotFound, kCorrupt, kUnsupported };

  // `path` is a revision's directory or an asset's directory (its `current` is taken). Fills
  // *decoder only if it returns kOk, else *problem with what is wrong and where. Does not check
  // SHA-256 sums.
  static LoadStatus Load(const std::string& path, BrdfDecoder* decoder, std::string* problem) {
    BrdfDecoder loaded;
    Failure failure;
    bool good = false;
    try {
      good = loaded.LoadAll(path, "brdf", 0, &failure);
    } catch (const std::exception& error) {
      failure.Set(LoadStatus::kCorrupt, path + ": " + error.what());
    }
    if (good) {
      *decoder = std::move(loaded);
      return LoadStatus::kOk;
    }
    *problem = failure.text;
    return failure.status;
  }

  // f(wi, wo), each channel finite and at least 0; zero unless both are above the horizon.
  void Evaluate(const float wi[3], const float wo[3], float rgb[3]) const {
    Run(wi, wo, nullptr, rgb);
  }

  // Draws wo for wi from three numbers in [0, 1). Returns false if the sample is lost: it goes
  // below the horizon and counts as a sample of value zero. An estimate of the reflected light is f
  // cos / pdf. Without a sampler in the container: cosine-weighted.
  bool Sample(const float wi[3], const float u[3], float wo[3], float* pdf) const {
    return sampler_.Sample(wi, u, wo, pdf);
  }
  // The density of Sample, per solid angle of wo.
  float Pdf(const float wi[3], const float wo[3]) const { return sampler_.Pdf(wi, wo); }
  bool has_sampler() const { return has_sampler_; }

  bool isotropic() const { return isotropic_; }
  int nside() const { return nside_; }
  int primitive_size() const { return static_cast<int>(k_); }

 private:
  friend class SvbrdfDecoder;  // which adds a neural texture

  static constexpr size_t kMaxWidth = 512;  // of a layer, inputs included
  static constexpr size_t kMaxLayers = 16;
  static constexpr uint64_t kMaxFileBytes = uint64_t{1} << 26;
  static constexpr uint64_t kMaxFloats = uint64_t{1} << 28;

  struct Failure {
    LoadStatus status = LoadStatus::kCorrupt;
    std::string text;
    bool Set(LoadStatus new_status, std::string new_text) {
      status = new_status;
      text = std::move(new_text);
      return false;
    }
  };

  // texture: texture_inputs_ values.
  void Run(const float wi[3], const float wo[3], const float* texture, float rgb[3]) const {
    using namespace brdf_decoder_detail;
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(wi[2] > 0) || !(wo[2] > 0) || layers_.empty()) return;
    float a[3] = {wi[0], wi[1], wi[2]};
    float b[3] = {wo[0], wo[1], wo[2]};
    if (canonical_order_ && b[2] > a[2]) std::swap(a, b);
    float x[kMaxWidth];
    float y[kMaxWidth];
    if (angle_inputs_) AngleInputs(a, b, x + 2 * k_);
    if (half_vector_inputs_) HalfVectorInputs(a, b, x + 2 * k_ + 3);
    std::copy(texture, texture + texture_inputs_, x + layers_[0].inputs - texture_inputs_);
    if (isotropic_) Fold(a, b);
    Feature(0, a, x);
    Feature(1, b, x + k_);
    float* from = x;
    float* to = y;
    for (size_t l = 0; l < layers_.size(); ++l) {
      const Layer& layer = layers_[l];
      std::copy(layer.bias.begin(), layer.bias.end(), to);
      for (size_t i = 0; i < layer.inputs; ++i) {
        const float* row = layer.weight.data() + i * layer.outputs;
        const float value = from[i];
        for (size_t o = 0; o < layer.outputs; ++o) to[o] += row[o] * value;
      }
      if (l + 1 < layers_.size()) {
        for (size_t o = 0; o < layer.outputs; ++o) to[o] = to[o] > 0 ? to[o] : 0.0f;
      }
      std::swap(from, to);
    }
    // NaN, which only absurd weights can give, becomes 0.
    for (int c = 0; c < 3; ++c) rgb[c] = from[c] > 0 ? std::expm1(std::min(from[c], 12.0f)) : 0.0f;
  }

  // X, Y of FORMATS.md, "BRDF": where the half vector lies.
  static void HalfVectorInputs(const float a[3], const float b[3], float out[2]) {
    float h[3];
    for (int d = 0; d < 3; ++d) h[d] = a[d] + b[d];
    const float length = std::sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
    for (int d = 0; d < 2; ++d) {
      const float size = std::abs(h[d]) / std::max(length, 1e-12f);
      out[d] = std::copysign(std::log(1 + 200 * size) / 5.30330491f, h[d]);
    }
  }

  // l, t, q of FORMATS.md, "BRDF": the half angle, the difference angle and sin 2 phi_d.
  static void AngleInputs(const float a[3], const float b[3], float out[3]) {
    float h[3];
    float sum = 0;
    float difference = 0;
    for (int d = 0; d < 3; ++d) {
      h[d] = a[d] + b[d];
      sum += h[d] * h[d];
      difference += (a[d] - b[d]) * (a[d] - b[d]);
    }
    const float length = std::sqrt(sum);
    for (float& value : h) value = length > 1e-15f ? value / length : 0.0f;
    const float s = std::sqrt(h[0] * h[0] + h[1] * h[1]);
    const float theta_h = std::atan2(s, h[2]);
    const float theta_d = std::atan2(std::sqrt(difference), length);
    const float c_phi = s < 1e-7f ? 1.0f : h[0] / s;
    const float s_phi = s < 1e-7f ? 0.0f : h[1] / s;
    const float dx = h[2] * (c_phi * a[0] + s_phi * a[1]) - s * a[2];
    const float dy = c_phi * a[1] - s_phi * a[0];
    const float square = dx * dx + dy * dy;
    out[0] = 2 * std::log(1 + 200 * theta_h) / 5.75f - 1;
    out[1] = theta_d * static_cast<float>(4 / brdf_sampler_detail::kPi) - 1;
    out[2] = square < 1e-12f ? 0.0f : 2 * dx * dy / square;
  }

  // wi to azimuth 0, wo to the azimuth between them, in [0, pi].
  static void Fold(float a[3], float b[3]) {
    const float radius = std::sqrt(a[0] * a[0] + a[1] * a[1]);
    float x = std::sqrt(b[0] * b[0] + b[1] * b[1]);
    float y = 0;
    if (!(radius < 1e-7f)) {
      const float c = a[0] / radius;
      const float s = a[1] / radius;
      x = c * b[0] + s * b[1];
      y = std::abs(c * b[1] - s * b[0]);
    }
    a[0] = radius, a[1] = 0;
    b[0] = x, b[1] = y;
  }

  void Feature(size_t hemisphere, const float direction[3], float* out) const {
    const brdf_decoder_detail::Lookup lookup =
        brdf_decoder_detail::LookUp(nside_, direction, interpolation_);
    const float* from[4];
    for (int c = 0; c < 4; ++c) {
      from[c] =
          features_.data() + (hemisphere * corners_ + static_cast<size_t>(lookup.index[c])) * k_;
    }
    const float* w = lookup.weight;
    for (size_t i = 0; i < k_; ++i) {
      out[i] = w[0] * from[0][i] + w[1] * from[1][i] + w[2] * from[2][i] + w[3] * from[3][i];
    }
  }

  static bool ReadFile(const std::string& path, std::string* bytes, Failure* failure) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    const std::streamoff size = file ? static_cast<std::streamoff>(file.tellg()) : -1;
    if (size < 0) return failure->Set(LoadStatus::kNotFound, path + ": cannot be read");
    if (static_cast<uint64_t>(size) > kMaxFileBytes) {
      return failure->Set(LoadStatus::kCorrupt,
                          path + ": " + std::to_string(size) + " bytes are too many");
    }
    bytes->resize(static_cast<size_t>(size));
    file.seekg(0);
    file.read(&(*bytes)[0], size);
    if (file.gcount() != size)
      return failure->Set(LoadStatus::kNotFound, path + ": cannot be read");
    return true;
  }

  // The header that packs, codebooks and weights have in common.
  static bool CheckFile(const std::string& path, const std::string& bytes, const char* magic,
                        Failure* failure) {
    using namespace brdf_decoder_detail;
    if (bytes.compare(0, 4, "\x28\xB5\x2F\xFD") == 0) {
      return failure->Set(LoadStatus::kUnsupported,
                          path +
                              ": in a zstd frame, which this decoder does not read; "
                              "decompress it with `zstd -d`");
    }
    if (bytes.size() < 64 || bytes.compare(0, 8, magic) != 0) {
      return failure->Set(LoadStatus::kCorrupt,
                          path + ": does not start with " + magic + " or has no whole header");
    }
    if (Load32(bytes, 8) > 1)
      return failure->Set(LoadStatus::kUnsupported, path + ": newer than this decoder");
    if (Load32(bytes, 8) != 1 || Load32(bytes, 16) != bytes.size() || Load32(bytes, 20) != 0)
      return failure->Set(LoadStatus::kCorrupt, path + ": the header is not legal");
    if (Load32(bytes, 24) != Crc32(bytes, 24))
      return failure->Set(LoadStatus::kCorrupt, path + ": the checksum is wrong");
    return true;
  }

  bool LoadAll(const std::string& path, const std::string& kind, size_t texture_inputs,
               Failure* failure) {
    using namespace brdf_decoder_detail;
    texture_inputs_ = texture_inputs;
    std::string directory = path;
    if (!std::ifstream(directory + "/manifest.json")) directory += "/current";
    const std::string manifest_path = directory + "/manifest.json";
    std::string text;
    if (!ReadFile(manifest_path, &text, failure)) return false;
    const nlohmann::json manifest = nlohmann::json::parse(text, nullptr, false);
    const auto corrupt = [&](const std::string& what) {
      return failure->Set(LoadStatus::kCorrupt, manifest_path + ": " + what);
    };
    const auto unsupported = [&](const std::string& what) {
      return failure->Set(LoadStatus::kUnsupported, manifest_path + ": " + what);
    };
    if (!manifest.is_object()) return corrupt("not a JSON object");
    if (Text(Member(manifest, "format")) != "patina-container")
      return corrupt("/format is not \"patina-container\"");
    const nlohmann::json& version = Member(manifest, "format_version");
    if (!version.is_number_unsigned() || version.get<uint64_t>() == 0)
      return corrupt("/format_version is not a positive integer");
    if (version.get<uint64_t>() > 1)
      return unsupported("/format_version is newer than this decoder");
    if (Text(Member(manifest, "kind")) != kind) return unsupported("/kind is not \"" + kind + "\"");
    const nlohmann::json& brdf = Member(manifest, "brdf");
    if (Text(Member(brdf, "output_transform")) != "expm1")
      return unsupported("/brdf/output_transform is not \"expm1\"");
    const nlohmann::json& network = Member(brdf, "network");
    if (Text(Member(network, "activation")) != "relu")
      return unsupported("/brdf/network/activation is not \"relu\"");
    const std::string grid = Text(Member(brdf, "grid"));
    const std::string weights = Text(Member(network, "payload"));
    const std::string sampler = Text(Member(brdf, "sampler"));
    if (!IsPlainName(grid) || !IsPlainName(weights) || (!sampler.empty() && !IsPlainName(sampler)))
      return corrupt("/brdf does not name its payloads");
    return ReadPack(directory, grid, failure) && ReadNetwork(directory + "/" + weights, failure) &&
           (sampler.empty() || ReadSampler(directory + "/" + sampler, failure));
  }

  bool ReadPack(const std::string& directory, const std::string& name, Failure* failure) {
    using namespace brdf_decoder_detail;
    const std::string path = directory + "/" + name;
    std::string bytes;
    if (!ReadFile(path, &bytes, failure) || !CheckFile(path, bytes, "PATINAHX", failure))
      return false;
    const auto corrupt = [&](const std::string& what) {
      return failure->Set(LoadStatus::kCorrupt, path + ": " + what);
    };
    const uint32_t flags = Load32(bytes, 12);
    nside_ = static_cast<int>(Load16(bytes, 28));
    k_ = Load16(bytes, 30);
    const uint32_t bits = Load8(bytes, 36);
    interpolation_ = static_cast<int>(Load8(bytes, 37));
    if (flags > 15 || (flags & 12) == 8 || nside_ < 1 || nside_ > 1024 || k_ < 1 || k_ > 64 ||
        bits < 1 || bits > 16 || interpolation_ > 2) {
      return corrupt("the header is not legal");
    }
    isotropic_ = (flags & 1) != 0;
    canonical_order_ = (flags & 2) != 0;
    angle_inputs_ = (flags & 4) != 0;
    half_vector_inputs_ = (flags & 8) != 0;
    corners_ = static_cast<size_t>(RingStart(nside_, 2 * nside_ + 2));
    if (2 * corners_ * k_ > kMaxFloats) return corrupt("too large for this decoder");

    size_t at = 64;
    std::vector<float> codebook;
    const size_t entries_inline = Load32(bytes, 32);
    const size_t name_bytes = Load16(bytes, 56);
    if (entries_inline > 65536 || (entries_inline == 0) == (name_bytes == 0))
      return corrupt("the header is not legal");
    if (entries_inline > 0) {
      const size_t count = entries_inline * k_;
      if (bytes.size() - at < 2 * count) return corrupt("the codebook is not whole");
      if (!ReadHalves(bytes, at, count, &codebook)) return corrupt("the codebook is not finite");
      at += 2 * count;
    } else {
      if (bytes.size() - at < 32 + name_bytes) return corrupt("the codebook's name is not whole");
      const std::string file = bytes.substr(at + 32, name_bytes);
      if (!IsPlainName(file)) return corrupt("the codebook's name is not legal");
      at += 32 + name_bytes;
      if (!ReadCodebook(directory, file, &codebook, failure)) return false;
    }
    std::vector<bool> stored[2];
    size_t count = 0;
    for (size_t h = 0; h < 2; ++h) {
      const size_t map_bytes = Load32(bytes, 48 + 4 * h);
      if (bytes.size() - at < map_bytes ||
          !ReadMap(bytes, at, map_bytes, Load8(bytes, 38 + h), &stored[h])) {
        return corrupt("the map of hemisphere " + std::to_string(h) + " is not legal");
      }
      at += map_bytes;
      count += static_cast<size_t>(std::count(stored[h].begin(), stored[h].end(), true));
    }
    if (bytes.size() - at != (count * bits + 7) / 8) return corrupt("the indices are not whole");

    features_.assign(2 * corners_ * k_, 0.0f);
    const size_t entries = codebook.size() / k_;
    size_t bit = 8 * at;
    for (size_t h = 0; h < 2; ++h) {
      for (size_t c = 0; c < corners_; ++c) {
        if (!stored[h][c]) continue;
        size_t index = 0;
        for (size_t b = 0; b < bits; ++b, ++bit)
          index |= static_cast<size_t>(Load8(bytes, bit / 8) >> (bit % 8) & 1) << b;
        if (index >= entries) return corrupt("an index is beyond the codebook");
        std::copy_n(codebook.data() + index * k_, k_, features_.data() + (h * corners_ + c) * k_);
      }
      FillDerived(nside_, k_, stored[h], features_.data() + h * corners_ * k_);
    }
    return true;
  }

  // Beside the pack, or in the folder that holds the assets.
  bool ReadCodebook(const std::string& directory, const std::string& name,
                    std::vector<float>* codebook, Failure* failure) const {
    using namespace brdf_decoder_detail;
    std::string path = directory + "/" + name;
    if (!std::ifstream(path)) path = directory + "/../../" + name;
    std::string bytes;
    if (!ReadFile(path, &bytes, failure) || !CheckFile(path, bytes, "PATINAHC", failure))
      return false;
    const size_t entries = Load32(bytes, 32);
    if (entries < 1 || entries > 65536 || Load16(bytes, 30) != k_ ||
        bytes.size() != 64 + 2 * entries * k_) {
      return failure->Set(LoadStatus::kCorrupt, path + ": does not fit the index pack");
    }
    if (!ReadHalves(bytes, 64, entries * k_, codebook))
      return failure->Set(LoadStatus::kCorrupt, path + ": not finite");
    return true;
  }

  bool ReadMap(const std::string& bytes, size_t at, size_t size, uint32_t coding,
               std::vector<bool>* stored) const {
    using namespace brdf_decoder_detail;
    if (coding == 0) {
      if (size != (corners_ + 7) / 8) return false;
      for (size_t c = 0; c < corners_; ++c)
        stored->push_back((Load8(bytes, at + c / 8) >> (c % 8) & 1) != 0);
      return true;
    }
    if (coding != 1) return false;
    bool kind = true;
    for (const size_t end = at + size; at < end; kind = !kind) {
      uint64_t length = 0;
      for (int shift = 0;; shift += 7, ++at) {
        if (at >= end || shift > 28) return false;
        length |= static_cast<uint64_t>(Load8(bytes, at) & 127) << shift;
        if (Load8(bytes, at) < 128) break;
      }
      ++at;
      if (length > corners_ - stored->size()) return false;
      stored->insert(stored->end(), static_cast<size_t>(length), kind);
    }
    return stored->size() == corners_;
  }

  bool ReadNetwork(const std::string& path, Failure* failure) {
    using namespace brdf_decoder_detail;
    std::string bytes;
    if (!ReadFile(path, &bytes, failure) || !CheckFile(path, bytes, "PATINAWT", failure))
      return false;
    const auto corrupt = [&](const std::string& what) {
      return failure->Set(LoadStatus::kCorrupt, path + ": " + what);
    };
    const size_t count = Load32(bytes, 12);
    if (count < 2 || count > 2 * kMaxLayers || count % 2 != 0 || bytes.size() < 64 + 64 * count)
      return corrupt(std::to_string(count) + " tensors are not 1 to 16 layers");
    const auto tensor = [&](const std::string& name, uint32_t rank, uint32_t shape[2],
                            std::vector<float>* values) {
      for (size_t i = 0; i < count; ++i) {
        const size_t entry = 64 + 64 * i;
        // The name with its closing zero.
        if (bytes.compare(entry, name.size() + 1, name.c_str(), name.size() + 1) != 0) continue;
        shape[0] = Load32(bytes, entry + 40);
        shape[1] = rank == 2 ? Load32(bytes, entry + 44) : 1;
        if (Load32(bytes, entry + 32) != 1 || Load32(bytes, entry + 36) != rank || shape[0] < 1 ||
            shape[0] > kMaxWidth || shape[1] < 1 || shape[1] > kMaxWidth) {
          return corrupt("tensor " + name + " is not legal");
        }
        const size_t elements = size_t{shape[0]} * shape[1];
        const uint64_t offset =
            Load32(bytes, entry + 56) | static_cast<uint64_t>(Load32(bytes, entry + 60)) << 32;
        if (offset > bytes.size() || bytes.size() - offset < 2 * elements)
          return corrupt("tensor " + name + " is not whole");
        if (!ReadHalves(bytes, static_cast<size_t>(offset), elements, values))
          return corrupt("tensor " + name + " is not finite");
        return true;
      }
      return corrupt("there is no tensor " + name);
    };
    size_t inputs =
        2 * k_ + (angle_inputs_ ? 3 : 0) + (half_vector_inputs_ ? 2 : 0) + texture_inputs_;
    for (size_t l = 0; l < count / 2; ++l) {
      const std::string name = "layer" + std::to_string(l);
      uint32_t shape[2], bias_shape[2];
      Layer layer;
      std::vector<float> rows;  // [output][input]
      if (!tensor(name + ".weight", 2, shape, &rows) ||
          !tensor(name + ".bias", 1, bias_shape, &layer.bias)) {
        return false;
      }
      if (shape[1] != inputs || bias_shape[0] != shape[0])
        return corrupt("the shapes of " + name + " do not fit");
      layer.inputs = inputs;
      layer.outputs = shape[0];
      layer.weight.resize(rows.size());
      for (size_t o = 0; o < layer.outputs; ++o) {
        for (size_t i = 0; i < inputs; ++i)
          layer.weight[i * layer.outputs + o] = rows[o * inputs + i];
      }
      inputs = layer.outputs;
      layers_.push_back(std::move(layer));
    }
    if (inputs != 3) return corrupt("the network does not have three outputs");
    return true;
  }

  bool ReadSampler(const std::string& path, Failure* failure) {
    std::string bytes;
    if (!ReadFile(path, &bytes, failure)) return false;
    BrdfSamplerTables tables;
    const std::string wrong =
        ReadBrdfSampler(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size(), &tables);
    if (!wrong.empty()) {
      const bool newer = wrong.compare(0, 5, "newer") == 0;
      return failure->Set(newer ? LoadStatus::kUnsupported : LoadStatus::kCorrupt,
                          path + ": " + wrong);
    }
    sampler_ = BrdfSampler(tables);
    has_sampler_ = true;
    return true;
  }

  int nside_ = 0;
  size_t k_ = 0;
  size_t corners_ = 0;
  int interpolation_ = 0;
  bool isotropic_ = true;
  bool canonical_order_ = true;
  bool angle_inputs_ = true;
  bool half_vector_inputs_ = false;
  size_t texture_inputs_ = 0;    // of a spatially varying BRDF, the last of the network's inputs
  std::vector<float> features_;  // [hemisphere][corner][k]
  std::vector<brdf_decoder_detail::Layer> layers_;
  BrdfSampler sampler_;
  bool has_sampler_ = false;
};

}  // namespace patina
