// Importance sampling of Patina containers of kind "brdf": a tabulated distribution of half
// vectors mixed with a cosine-weighted hemisphere.
//
// Standalone like patina_brdf_decoder.h, which includes it: C++17 and the standard library only.
// FORMATS.md describes the file. Directions are unit vectors, z up, both pointing away from the
// surface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace patina {

// What sampler.bin holds. Cells are indexed [theta_i bin][theta_h cell][phi cell].
struct BrdfSamplerTables {
  int theta_i_bins = 0;   // equal parts of [0, pi/2]; 1..64
  int theta_h_cells = 0;  // edges at pi/2 (c / cells)^2; 1..256
  int phi_cells = 0;      // 1..64
  // Azimuth of the half vector: true: against wi, folded to [0, pi]; false: in [0, 2 pi).
  bool relative_phi = true;
  std::vector<uint8_t> mixture;  // of each bin: code / 255 is the share of half-vector samples
  // Of each cell: 0, or its relative probability 2^((code - 255) / 8). A bin whose mixture is not 0
  // has a cell that is not 0.
  std::vector<uint8_t> mass;

  size_t CellsInBin() const {
    return static_cast<size_t>(theta_h_cells) * static_cast<size_t>(phi_cells);
  }
};

namespace brdf_sampler_detail {

constexpr uint32_t kVersion = 1;
constexpr size_t kHeaderBytes = 32;
constexpr int kMaxBins = 64;
constexpr int kMaxThetaCells = 256;
constexpr int kMaxPhiCells = 64;
constexpr double kPi = 3.14159265358979323846;

inline uint32_t Load(const uint8_t* bytes, int count) {
  uint32_t value = 0;
  for (int i = count - 1; i >= 0; --i) value = value << 8 | bytes[i];
  return value;
}

// CRC-32 of zlib and PNG, taking bytes [12, 16) for zeros.
inline uint32_t FileCrc(const uint8_t* bytes, size_t size) {
  uint32_t crc = 0xFFFFFFFFu;
  for (size_t i = 0; i < size; ++i) {
    crc ^= i >= 12 && i < 16 ? 0u : bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? (crc >> 1) ^ 0xEDB88320u : crc >> 1;
  }
  return ~crc;
}

// 2^((code - 255) / 8), 0 for 0; the same bits everywhere.
inline double MassOf(uint8_t code) {
  constexpr double kEighths[8] = {1.0,
                                  1.0905077326652577,
                                  1.1892071150027211,
                                  1.2968395546510096,
                                  1.4142135623730951,
                                  1.5422108254079407,
                                  1.6817928305074292,
                                  1.8340080864093424};
  if (code == 0) return 0;
  const int steps = code + 1;  // code - 255 = steps - 256
  return std::ldexp(kEighths[steps & 7], (steps >> 3) - 32);
}

// Empty, or what is wrong with the tables.
inline std::string Problem(const BrdfSamplerTables& tables) {
  const auto in = [](int value, int max) { return value >= 1 && value <= max; };
  if (!in(tables.theta_i_bins, kMaxBins) || !in(tables.theta_h_cells, kMaxThetaCells) ||
      !in(tables.phi_cells, kMaxPhiCells)) {
    return std::to_string(tables.theta_i_bins) + " bins of " +
           std::to_string(tables.theta_h_cells) + " x " + std::to_string(tables.phi_cells) +
           " cells are not within 1 to 64, 256 and 64";
  }
  const auto bins = static_cast<size_t>(tables.theta_i_bins);
  const size_t cells = tables.CellsInBin();
  if (tables.mixture.size() != bins || tables.mass.size() != bins * cells)
    return "the tables do not have the size that the numbers of bins and cells give";
  for (size_t bin = 0; bin < bins; ++bin) {
    const auto begin = tables.mass.begin() + static_cast<std::ptrdiff_t>(bin * cells);
    const bool empty = std::all_of(begin, begin + static_cast<std::ptrdiff_t>(cells),
                                   [](uint8_t code) { return code == 0; });
    if (empty && tables.mixture[bin] != 0)
      return "bin " + std::to_string(bin) + " samples half vectors from an empty table";
  }
  return "";
}

}  // namespace brdf_sampler_detail

// Reads the bytes of a sampler.bin. Returns an empty string, or what is wrong: it starts with
// "bad magic", "bad header", "bad table", "truncated", "trailing bytes", "bad checksum" or "newer".
inline std::string ReadBrdfSampler(const uint8_t* bytes, size_t size, BrdfSamplerTables* tables) {
  using namespace brdf_sampler_detail;
  if (size == 0) return "truncated: the file is empty";
  if (std::memcmp(bytes, "PATINASM", size < 8 ? size : 8) != 0)
    return "bad magic: the file does not start with \"PATINASM\"";
  if (size < kHeaderBytes) return "truncated: " + std::to_string(size) + " of 32 header bytes";
  const uint32_t version = Load(bytes + 8, 4);
  if (version == 0) return "bad header: version 0 at byte 8";
  if (version > kVersion) {
    return "newer: sampler version " + std::to_string(version) + ", this program reads up to " +
           std::to_string(kVersion);
  }
  BrdfSamplerTables read;
  read.theta_i_bins = static_cast<int>(Load(bytes + 16, 2));
  read.theta_h_cells = static_cast<int>(Load(bytes + 18, 2));
  read.phi_cells = static_cast<int>(Load(bytes + 20, 2));
  read.relative_phi = bytes[22] == 1;
  const uint32_t reserved = Load(bytes + 23, 1) | Load(bytes + 24, 4) | Load(bytes + 28, 4);
  if (read.theta_i_bins < 1 || read.theta_i_bins > kMaxBins || read.theta_h_cells < 1 ||
      read.theta_h_cells > kMaxThetaCells || read.phi_cells < 1 || read.phi_cells > kMaxPhiCells ||
      bytes[22] > 1 || reserved != 0) {
    return "bad header: " + std::to_string(read.theta_i_bins) + " bins of " +
           std::to_string(read.theta_h_cells) + " x " + std::to_string(read.phi_cells) +
           " cells at byte 16, or a reserved byte that is not 0";
  }
  const auto bins = static_cast<size_t>(read.theta_i_bins);
  const size_t cells = read.CellsInBin();
  const size_t wanted = kHeaderBytes + bins * (1 + cells);
  if (size < wanted)
    return "truncated: " + std::to_string(size) + " of " + std::to_string(wanted) + " bytes";
  if (size > wanted) {
    return "trailing bytes: the sampler ends at byte " + std::to_string(wanted) + ", the file at " +
           std::to_string(size);
  }
  if (FileCrc(bytes, size) != Load(bytes + 12, 4)) {
    return "bad checksum: the file says " + std::to_string(Load(bytes + 12, 4)) +
           " at byte 12, its bytes give " + std::to_string(FileCrc(bytes, size)) +
           "; bake or copy it again";
  }
  read.mixture.assign(bytes + kHeaderBytes, bytes + kHeaderBytes + bins);
  read.mass.assign(bytes + kHeaderBytes + bins, bytes + size);
  const std::string problem = Problem(read);
  if (!problem.empty()) return "bad table: " + problem;
  *tables = std::move(read);
  return "";
}

// A sampler ready for use; immutable. Made from no tables it samples the cosine hemisphere.
class BrdfSampler {
 public:
  BrdfSampler() = default;

  // `tables` as ReadBrdfSampler gives them.
  explicit BrdfSampler(const BrdfSamplerTables& tables)
      : bins_(tables.theta_i_bins),
        phi_cells_(tables.phi_cells),
        relative_phi_(tables.relative_phi) {
    using namespace brdf_sampler_detail;
    for (int c = 0; c <= tables.theta_h_cells; ++c) {
      const double x = static_cast<double>(c) / tables.theta_h_cells;
      const double half_sine = std::sin(kPi / 4 * x * x);
      edges_.push_back(static_cast<float>(half_sine * half_sine));
    }
    const size_t cells = tables.CellsInBin();
    for (size_t bin = 0; bin < static_cast<size_t>(bins_); ++bin) {
      share_.push_back(static_cast<float>(tables.mixture[bin]) / 255.0f);
      const uint8_t* codes = tables.mass.data() + bin * cells;
      double sum = 0;
      for (size_t c = 0; c < cells; ++c) sum += MassOf(codes[c]);
      double below = 0;
      for (size_t c = 0; c < cells; ++c) {
        below += MassOf(codes[c]);
        ends_.push_back(sum > 0 ? static_cast<float>(below / sum) : 1.0f);
      }
      // The pdf is the one of the rounded table, so that it is the one that is sampled.
      for (size_t c = 0; c < cells; ++c) {
        const float* ends = ends_.data() + bin * cells;
        const double mass =
            static_cast<double>(ends[c]) - (c == 0 ? 0.0 : static_cast<double>(ends[c - 1]));
        const size_t theta = c / static_cast<size_t>(phi_cells_);
        const double area =
            4 * kPi / phi_cells_ *
            (static_cast<double>(edges_[theta + 1]) - static_cast<double>(edges_[theta]));
        density_.push_back(static_cast<float>(mass / area));
      }
    }
  }

  // The density of Sample at wo, per solid angle; 0 if either direction is not above the horizon.
  // Over the hemisphere it integrates to 1 less the share of lost samples.
  float Pdf(const float wi[3], const float wo[3]) const {
    using namespace brdf_sampler_detail;
    if (!(wi[2] > 0) || !(wo[2] > 0)) return 0;
    const float cosine = wo[2] * static_cast<float>(1 / kPi);
    if (bins_ == 0) return cosine;
    const size_t bin = BinOf(wi[2]);
    if (share_[bin] == 0) return cosine;
    const float hx = wi[0] + wo[0];
    const float hy = wi[1] + wo[1];
    const float hz = wi[2] + wo[2];
    const float length = std::sqrt(hx * hx + hy * hy + hz * hz);
    if (!(length > 1e-12f)) return (1 - share_[bin]) * cosine;
    // sin^2(theta_h / 2) = (1 - cos) / 2 without its cancellation
    const float radius = std::sqrt(hx * hx + hy * hy) / length;
    const float m = radius * radius / (2 * (1 + hz / length));
    const auto found = std::upper_bound(edges_.begin() + 1, edges_.end() - 1, m);
    const auto theta = static_cast<size_t>(found - (edges_.begin() + 1));
    const auto phi_cells = static_cast<size_t>(phi_cells_);
    const size_t cell = theta * phi_cells + (phi_cells == 1 ? 0 : PhiCell(wi, hx, hy));
    // dh / dwo = 1 / (4 wo.h), and wo.h = |wi + wo| / 2
    const float half = density_[bin * CellsInBin() + cell] / (2 * length);
    return (1 - share_[bin]) * cosine + share_[bin] * half;
  }

  // Draws wo for wi from three numbers in [0, 1). Returns false if the sample is lost: it goes
  // below the horizon and counts as a sample of value zero.
  bool Sample(const float wi[3], const float u[3], float wo[3], float* pdf) const {
    using namespace brdf_sampler_detail;
    wo[0] = wo[1] = wo[2] = *pdf = 0;
    if (!(wi[2] > 0)) return false;
    const size_t bin = bins_ == 0 ? 0 : BinOf(wi[2]);
    const float share = bins_ == 0 ? 0.0f : share_[bin];
    constexpr auto kTurn = static_cast<float>(2 * kPi);
    if (!(u[0] < share)) {
      const float radius = std::sqrt(u[1]);
      wo[0] = radius * std::cos(kTurn * u[2]);
      wo[1] = radius * std::sin(kTurn * u[2]);
      wo[2] = std::sqrt(std::max(0.0f, 1 - u[1]));
    } else {
      const size_t cells = CellsInBin();
      const auto begin = ends_.begin() + static_cast<std::ptrdiff_t>(bin * cells);
      const auto end = begin + static_cast<std::ptrdiff_t>(cells) - 1;
      const auto cell = static_cast<size_t>(std::upper_bound(begin, end, u[0] / share) - begin);
      const size_t theta = cell / static_cast<size_t>(phi_cells_);
      const float m = edges_[theta] + (edges_[theta + 1] - edges_[theta]) * u[1];
      const float sine = 2 * std::sqrt(m * (1 - m));
      const float place = static_cast<float>(cell % static_cast<size_t>(phi_cells_));
      float h[3];
      h[2] = 1 - 2 * m;
      if (relative_phi_) {
        const bool right = u[2] < 0.5f;
        const float v = right ? 2 * u[2] : 2 * u[2] - 1;
        const float phi = static_cast<float>(kPi) * (place + v) / static_cast<float>(phi_cells_);
        const float x = sine * std::cos(phi);
        const float y = right ? sine * std::sin(phi) : -sine * std::sin(phi);
        const float radius = std::sqrt(wi[0] * wi[0] + wi[1] * wi[1]);
        const float c = radius > 1e-7f ? wi[0] / radius : 1.0f;
        const float s = radius > 1e-7f ? wi[1] / radius : 0.0f;
        h[0] = c * x - s * y;
        h[1] = s * x + c * y;
      } else {
        const float phi = kTurn * (place + u[2]) / static_cast<float>(phi_cells_);
        h[0] = sine * std::cos(phi);
        h[1] = sine * std::sin(phi);
      }
      const float cosine = wi[0] * h[0] + wi[1] * h[1] + wi[2] * h[2];
      if (!(cosine > 0)) return false;
      for (int d = 0; d < 3; ++d) wo[d] = 2 * cosine * h[d] - wi[d];
    }
    if (!(wo[2] > 0)) return false;
    *pdf = Pdf(wi, wo);
    return *pdf > 0;
  }

 private:
  size_t CellsInBin() const { return (edges_.size() - 1) * static_cast<size_t>(phi_cells_); }

  size_t BinOf(float cosine) const {
    const float theta = std::acos(std::min(1.0f, cosine));
    const int bin = static_cast<int>(theta * static_cast<float>(2 / brdf_sampler_detail::kPi) *
                                     static_cast<float>(bins_));
    return static_cast<size_t>(std::min(bin, bins_ - 1));
  }

  size_t PhiCell(const float wi[3], float hx, float hy) const {
    using namespace brdf_sampler_detail;
    float turn;
    if (relative_phi_) {
      const bool pole = !(wi[0] * wi[0] + wi[1] * wi[1] > 1e-14f);
      const float c = pole ? 1.0f : wi[0];
      const float s = pole ? 0.0f : wi[1];
      turn = std::atan2(std::abs(c * hy - s * hx), c * hx + s * hy) * static_cast<float>(1 / kPi);
    } else {
      turn = std::atan2(hy, hx) * static_cast<float>(0.5 / kPi);
      if (turn < 0) turn += 1;
    }
    const int cell = static_cast<int>(turn * static_cast<float>(phi_cells_));
    return static_cast<size_t>(std::min(std::max(cell, 0), phi_cells_ - 1));
  }

  int bins_ = 0;
  int phi_cells_ = 1;
  bool relative_phi_ = true;
  std::vector<float> edges_;    // sin^2(theta_h / 2) at the edges of the theta_h cells
  std::vector<float> share_;    // [bin]
  std::vector<float> ends_;     // [bin][cell]: the cumulative probability at the cell's end
  std::vector<float> density_;  // [bin][cell]: of the half vector, per solid angle
};

}  // namespace patina
