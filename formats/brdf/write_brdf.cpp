#include "formats/brdf/write_brdf.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <numbers>

#include "formats/base/check.h"
#include "formats/base/little_endian.h"
#include "formats/brdf/angles.h"
#include "formats/brdf/merl.h"
#include "formats/brdf/rgl_warp.h"
#include "formats/brdf/tensor_file.h"
#include "formats/brdf/utia.h"

namespace patina::brdf {
namespace {

constexpr double kPiD = std::numbers::pi;

void StoreDouble(uint8_t* bytes, double value) {
  uint64_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  StoreLittle64(bytes, bits);
}

struct Vector {
  double x, y, z;
};

Vector FromAngles(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

Direction ToDirection(const Vector& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// The GGX distribution and what follows from it (Heitz 2014).
struct Ggx {
  double alpha_x, alpha_y;

  double Density(const Vector& m) const {
    const double x = m.x / alpha_x;
    const double y = m.y / alpha_y;
    const double sum = x * x + y * y + m.z * m.z;
    return 1 / (kPiD * alpha_x * alpha_y * sum * sum);
  }
  // The integral of density * max(0, w . m) over m, which is cos(theta) / G1(w).
  double ProjectedArea(const Vector& w) const {
    const double x = w.x * alpha_x;
    const double y = w.y * alpha_y;
    return 0.5 * (w.z + std::sqrt(x * x + y * y + w.z * w.z));
  }
};

double UnitToTheta(double u) { return u * u * kPiD / 2; }
double UnitToPhi(double u) { return (2 * u - 1) * kPiD; }

double Node(int i, int count) { return static_cast<double>(i) / (count - 1); }

void AppendNumber(float value, std::string* text) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  text->append(digits, end);
}

// Numbers separated by commas.
void AppendNumbers(std::initializer_list<float> values, std::string* text) {
  bool first = true;
  for (const float value : values) {
    if (!first) *text += ',';
    first = false;
    AppendNumber(value, text);
  }
}

}  // namespace

std::vector<uint8_t> EncodeMerl(const BrdfFunction& brdf) {
  std::vector<uint8_t> bytes(kMerlFileBytes);
  StoreLittle32(bytes.data(), kMerlThetaH);
  StoreLittle32(bytes.data() + 4, kMerlThetaD);
  StoreLittle32(bytes.data() + 8, kMerlPhiD);
  for (int cell = 0; cell < kMerlCells; ++cell) {
    const MerlNode node = MerlNodeAt(cell / (kMerlThetaD * kMerlPhiD),
                                     cell / kMerlPhiD % kMerlThetaD, cell % kMerlPhiD);
    Direction wi, wo;
    FromHalfDifference(node.theta_h, node.theta_d, node.phi_d, &wi, &wo);
    float rgb[3] = {-1, -1, -1};
    const bool above = wi.z > 0 && wo.z > 0;
    if (above) brdf(wi, wo, rgb);
    for (int c = 0; c < 3; ++c) {
      const double value = above ? static_cast<double>(rgb[c]) / kMerlScale[c] : -1;
      const size_t index = static_cast<size_t>(c) * kMerlCells + static_cast<size_t>(cell);
      StoreDouble(bytes.data() + kMerlHeaderBytes + 8 * index, value);
    }
  }
  return bytes;
}

std::vector<uint8_t> EncodeUtia(const BrdfFunction& brdf) {
  std::vector<Direction> directions;
  for (int t = 0; t < kUtiaThetas; ++t) {
    for (int p = 0; p < kUtiaPhis; ++p) {
      directions.push_back(ToDirection(FromAngles(t * kUtiaThetaStepDegrees * kPiD / 180,
                                                  p * kUtiaPhiStepDegrees * kPiD / 180)));
    }
  }
  std::vector<uint8_t> bytes(kUtiaFileBytes);
  for (int cell = 0; cell < kUtiaCells; ++cell) {
    float rgb[3];
    brdf(directions[cell / kUtiaSide], directions[cell % kUtiaSide], rgb);
    for (int c = 0; c < 3; ++c) {
      const size_t index = static_cast<size_t>(c) * kUtiaCells + static_cast<size_t>(cell);
      StoreDouble(bytes.data() + 8 * index, static_cast<double>(rgb[c]));
    }
  }
  return bytes;
}

std::vector<uint8_t> EncodeRgl(const BrdfFunction& brdf, const RglLayout& layout,
                               const std::string& description) {
  const int side = layout.warp_side;
  const int colours = layout.colour_side;
  const int thetas = layout.theta_count;
  const int phis = layout.isotropic ? 1 : layout.phi_count;
  PATINA_CHECK(side >= 2 && colours >= 2 && thetas >= 2 && (layout.isotropic || phis >= 3));
  PATINA_CHECK(layout.reduction == 1 || layout.reduction == 2 || layout.reduction == 4);
  const Ggx ggx{layout.alpha_x, layout.isotropic ? layout.alpha_x : layout.alpha_y};

  std::vector<float> theta_i, phi_i;
  for (int t = 0; t < thetas; ++t)
    theta_i.push_back(static_cast<float>(Node(t, thetas) * kPiD / 2));
  for (int p = 0; p < phis; ++p) {
    phi_i.push_back(layout.isotropic
                        ? 0.0f
                        : static_cast<float>(-kPiD + Node(p, phis) * 2 * kPiD / layout.reduction));
  }
  // f at grazing light is asked for just above the horizon.
  const auto light = [&](int p, int t) {
    Vector w = FromAngles(static_cast<double>(theta_i[t]), static_cast<double>(phi_i[p]));
    w.z = std::max(w.z, 1e-4);
    return w;
  };

  std::vector<float> sigma, ndf;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const Vector w = FromAngles(UnitToTheta(Node(x, side)), UnitToPhi(Node(y, side)));
      sigma.push_back(static_cast<float>(ggx.ProjectedArea(w)));
      ndf.push_back(static_cast<float>(ggx.Density(w)));
    }
  }
  const UnitGrid sigma_grid(sigma, side, side);
  const UnitGrid ndf_grid(ndf, side, side);

  std::vector<float> vndf;
  for (int p = 0; p < phis; ++p) {
    for (int t = 0; t < thetas; ++t) {
      const Vector wi = light(p, t);
      const size_t first = vndf.size();
      double sum = 0;
      for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
          const double u = Node(x, side);
          const Vector m = FromAngles(UnitToTheta(u), UnitToPhi(Node(y, side)));
          const double visible = std::max(0.0, wi.x * m.x + wi.y * m.y + wi.z * m.z);
          // dm = sin(theta) dtheta dphi, and dtheta = pi u du.
          const double value = ggx.Density(m) * visible * std::sin(UnitToTheta(u)) * u;
          sum += value;
          vndf.push_back(static_cast<float>(value));
        }
      }
      for (size_t i = first; i < vndf.size(); ++i)
        vndf[i] = static_cast<float>(static_cast<double>(vndf[i]) / sum);
    }
  }
  const UnitWarp warp(vndf, phis * thetas, side, side);

  const size_t plane = static_cast<size_t>(colours) * colours;
  std::vector<float> rgb(static_cast<size_t>(phis) * thetas * 3 * plane, 0.0f);
  std::vector<float> luminance(static_cast<size_t>(phis) * thetas * plane, 0.0f);
  for (int slice = 0; slice < phis * thetas; ++slice) {
    const Vector wi = light(slice / thetas, slice % thetas);
    const Direction light_direction = ToDirection(wi);
    const float phi = phi_i[slice / thetas];
    const UnitPoint u_i{ThetaToUnit(theta_i[slice % thetas]), PhiToUnit(phi)};
    for (size_t cell = 0; cell < plane; ++cell) {
      const UnitPoint uniform{static_cast<float>(Node(static_cast<int>(cell % colours), colours)),
                              static_cast<float>(Node(static_cast<int>(cell / colours), colours))};
      const UnitPoint u_m = warp.Sample(uniform, slice);
      const Vector m = FromAngles(UnitToTheta(static_cast<double>(u_m.x)),
                                  UnitToPhi(static_cast<double>(u_m.y)));
      const double dot = wi.x * m.x + wi.y * m.y + wi.z * m.z;
      const Vector wo{2 * dot * m.x - wi.x, 2 * dot * m.y - wi.y, 2 * dot * m.z - wi.z};
      if (!(wo.z > 1e-6)) continue;
      float f[3];
      brdf(light_direction, ToDirection(wo), f);
      // What the reader will divide by: the tables as they are stored, between their nodes.
      const float scale = static_cast<float>(wo.z) * 4 * sigma_grid.At(u_i) / ndf_grid.At(u_m);
      const size_t at = static_cast<size_t>(slice) * 3 * plane + cell;
      for (int c = 0; c < 3; ++c) rgb[at + static_cast<size_t>(c) * plane] = f[c] * scale;
      luminance[static_cast<size_t>(slice) * plane + cell] =
          (0.2126f * f[0] + 0.7152f * f[1] + 0.0722f * f[2]) * scale;
    }
  }

  const auto size = [](int value) { return static_cast<uint64_t>(value); };
  const uint64_t p = size(phis), t = size(thetas), n = size(colours), w = size(side);
  const uint8_t version[2] = {1, 0};
  const uint8_t jacobian[1] = {1};
  std::vector<TensorToWrite> tensors;
  tensors.push_back(ByteTensor("version", version));
  if (!description.empty()) {
    tensors.push_back(ByteTensor(
        "description", {reinterpret_cast<const uint8_t*>(description.data()), description.size()}));
  }
  tensors.push_back(FloatTensor("phi_i", {p}, phi_i));
  tensors.push_back(FloatTensor("theta_i", {t}, theta_i));
  tensors.push_back(FloatTensor("sigma", {w, w}, sigma));
  tensors.push_back(FloatTensor("ndf", {w, w}, ndf));
  tensors.push_back(FloatTensor("vndf", {p, t, w, w}, vndf));
  tensors.push_back(FloatTensor("luminance", {p, t, n, n}, luminance));
  tensors.push_back(FloatTensor("rgb", {p, t, 3, n, n}, rgb));
  tensors.push_back(ByteTensor("jacobian", jacobian));
  if (!layout.isotropic && layout.reduction > 1) {
    const uint8_t reduction[1] = {static_cast<uint8_t>(layout.reduction)};
    tensors.push_back(ByteTensor("reduction", reduction));
  }
  return EncodeTensorFile(tensors);
}

std::string EncodeSparseCsv(const BrdfFunction& brdf,
                            std::span<const std::pair<Direction, Direction>> pairs,
                            bool isotropic) {
  std::string text;
  if (!isotropic) text += "# anisotropic\n";
  text += "wix,wiy,wiz,wox,woy,woz,r,g,b\n";
  for (const auto& [wi, wo] : pairs) {
    float rgb[3];
    brdf(wi, wo, rgb);
    AppendNumbers({wi.x, wi.y, wi.z, wo.x, wo.y, wo.z, rgb[0], rgb[1], rgb[2]}, &text);
    text += '\n';
  }
  return text;
}

std::string EncodeSparseJson(const BrdfFunction& brdf,
                             std::span<const std::pair<Direction, Direction>> pairs,
                             bool isotropic) {
  std::string text =
      std::string("{\"isotropic\": ") + (isotropic ? "true" : "false") + ", \"samples\": [";
  const char* separator = "\n";
  for (const auto& [wi, wo] : pairs) {
    float rgb[3];
    brdf(wi, wo, rgb);
    text += separator;
    separator = ",\n";
    text += "  {\"wi\": [";
    AppendNumbers({wi.x, wi.y, wi.z}, &text);
    text += "], \"wo\": [";
    AppendNumbers({wo.x, wo.y, wo.z}, &text);
    text += "], \"rgb\": [";
    AppendNumbers({rgb[0], rgb[1], rgb[2]}, &text);
    text += "]}";
  }
  return text + "\n]}\n";
}

}  // namespace patina::brdf
