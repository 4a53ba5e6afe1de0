// Based on: Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition
// and Rendering".
#include "formats/brdf/rgl.h"

#include <algorithm>
#include <array>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/brdf/angles.h"
#include "formats/brdf/cells.h"
#include "formats/brdf/rgl_warp.h"
#include "formats/brdf/spectrum.h"
#include "formats/brdf/tensor_file.h"

namespace patina::brdf {
namespace {

constexpr float kMinCosine = 1e-2f;
constexpr uint64_t kMaxLightAxis = 4096;
constexpr uint64_t kMaxSide = 1 << 15;

// Symmetry of an anisotropic material, as the number of copies of its phi_i range in a circle.
enum class Reduction { kNone = 1, kTurned = 2, kMirrored = 4 };

struct RglData {
  std::vector<float> theta_i, phi_i;
  Reduction reduction = Reduction::kNone;
  bool isotropic = true;
  bool jacobian = true;
  UnitGrid sigma, ndf;
  UnitWarp vndf;
  int height = 0, width = 0;  // of the colours
  std::vector<Cell> cells;    // [P][T][height][width]
};

Place PlaceAmong(const std::vector<float>& nodes, float x) {
  const int count = static_cast<int>(nodes.size());
  if (!(x > nodes.front())) return {0, 0, 0};
  if (x >= nodes.back()) return {count - 1, count - 1, 0};
  const int high =
      static_cast<int>(std::upper_bound(nodes.begin(), nodes.end(), x) - nodes.begin());
  return {high - 1, high, (x - nodes[high - 1]) / (nodes[high] - nodes[high - 1])};
}

void Turn(Direction* w, float sign_x, float sign_y) {
  w->x *= sign_x;
  w->y *= sign_y;
}

class RglTable : public Table {
 public:
  explicit RglTable(RglData data)
      : data_(std::move(data)),
        middle_(0.5f * (data_.phi_i.front() + data_.phi_i.back())),
        left_(std::cos(middle_) < 0),
        lower_(std::sin(middle_) < 0) {}

  bool Evaluate(const Direction& light, const Direction& view, float rgb[3]) const override {
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(light.z > 0 && view.z > 0)) return false;
    Direction wi = light;
    Direction wo = view;
    const float phi_i = Canonical(&wi, &wo);
    const float theta_i = Colatitude(wi);
    const Direction m{wi.x + wo.x, wi.y + wo.y, wi.z + wo.z};
    float phi_m = Atan2(m.y, m.x);
    if (data_.isotropic) phi_m -= phi_i;
    const UnitPoint u_m{ThetaToUnit(Colatitude(m)), PhiToUnit(phi_m)};
    const UnitPoint u_i{ThetaToUnit(theta_i), PhiToUnit(phi_i)};

    const Place theta = PlaceAmong(data_.theta_i, theta_i);
    const Place phi = data_.isotropic ? Place{} : PlaceOfAzimuth(phi_i);
    int slices[4];
    float slice_weights[4];
    int slice_count = 0;
    const auto add = [&](int p, int t, float weight) {
      if (!(weight > 0)) return;
      slices[slice_count] = p * static_cast<int>(data_.theta_i.size()) + t;
      slice_weights[slice_count++] = weight;
    };
    add(phi.low, theta.low, (1 - phi.t) * (1 - theta.t));
    add(phi.low, theta.high, (1 - phi.t) * theta.t);
    add(phi.high, theta.low, phi.t * (1 - theta.t));
    add(phi.high, theta.high, phi.t * theta.t);

    const UnitPoint u = data_.vndf.Invert(u_m, slices, slice_weights, slice_count);
    const Place x = PlaceOnRow(u.x * static_cast<float>(data_.width - 1), data_.width);
    const Place y = PlaceOnRow(u.y * static_cast<float>(data_.height - 1), data_.height);
    const Cell* cells[16];
    float weights[16];
    for (int s = 0; s < slice_count; ++s) {
      const Cell* low = Row(slices[s], y.low);
      const Cell* high = Row(slices[s], y.high);
      const Cell* corners[4] = {low + x.low, low + x.high, high + x.low, high + x.high};
      const float corner_weights[4] = {(1 - x.t) * (1 - y.t), x.t * (1 - y.t), (1 - x.t) * y.t,
                                       x.t * y.t};
      for (int c = 0; c < 4; ++c) {
        cells[4 * s + c] = corners[c];
        weights[4 * s + c] = slice_weights[s] * corner_weights[c];
      }
    }
    float colour[3];
    if (!MeanOfValid(cells, weights, 4 * slice_count, colour)) return false;
    float scale = 1 / std::max(wo.z, kMinCosine);
    if (data_.jacobian) scale *= data_.ndf.At(u_m) / (4 * data_.sigma.At(u_i));
    for (int c = 0; c < 3; ++c) {
      colour[c] *= scale;
      if (!(std::abs(colour[c]) <= kMaxValue)) return false;
    }
    for (int c = 0; c < 3; ++c) rgb[c] = colour[c];
    return true;
  }

 private:
  // Brings the light into the azimuths that the file has by the material's symmetry; returns its
  // azimuth.
  float Canonical(Direction* wi, Direction* wo) const {
    float phi = Atan2(wi->y, wi->x);
    if (data_.isotropic) return phi;
    const float first = data_.phi_i.front();
    if (data_.reduction == Reduction::kMirrored) {
      const float sign_x = left_ == (wi->x < 0) ? 1 : -1;
      const float sign_y = lower_ == (wi->y < 0) ? 1 : -1;
      Turn(wi, sign_x, sign_y);
      Turn(wo, sign_x, sign_y);
      phi = Atan2(wi->y, wi->x);
      // To the turn that is nearest to the range; the light may be just outside of it.
      while (phi < middle_ - kPi) phi += kTwoPi;
      while (phi > middle_ + kPi) phi -= kTwoPi;
      return phi;
    }
    if (data_.reduction == Reduction::kTurned) {
      bool odd = false;
      while (phi < first) phi += kPi, odd = !odd;
      while (phi >= first + kPi) phi -= kPi, odd = !odd;
      if (odd) {
        Turn(wi, -1, -1);
        Turn(wo, -1, -1);
      }
      return phi;
    }
    while (phi < first) phi += kTwoPi;
    while (phi >= first + kTwoPi) phi -= kTwoPi;
    return phi;
  }

  // Closes the circle between the last and the first azimuth of a file without symmetry.
  Place PlaceOfAzimuth(float phi) const {
    const std::vector<float>& nodes = data_.phi_i;
    const float gap = nodes.front() + kTwoPi - nodes.back();
    if (data_.reduction != Reduction::kNone || phi <= nodes.back() || gap < 1e-3f)
      return PlaceAmong(nodes, phi);
    const float t = std::min((phi - nodes.back()) / gap, 1.0f);
    return {static_cast<int>(nodes.size()) - 1, 0, t};
  }

  const Cell* Row(int slice, int row) const {
    return data_.cells.data() +
           (static_cast<size_t>(slice) * data_.height + row) * static_cast<size_t>(data_.width);
  }

  RglData data_;
  float middle_;       // of the range of phi_i
  bool left_, lower_;  // whether that is where x, y are negative
};

// Reads tensors of one file with checks; the messages name file, field and element.
class FieldReader {
 public:
  FieldReader(const TensorFile& file, const std::string& name) : file_(file), name_(name) {}

  tl::unexpected<Error> Corrupt(const std::string& what) const {
    return Fail(ErrorCode::kCorruptData, name_ + ": " + what);
  }

  Result<const Tensor*> Get(const char* field, size_t rank) const {
    const Tensor* tensor = file_.Find(field);
    if (tensor == nullptr) {
      return Corrupt(std::string("field \"") + field +
                     "\" is missing; is this a BRDF of the RGL database?");
    }
    if (tensor->shape.size() != rank) {
      return Corrupt(std::string("field \"") + field + "\" has rank " +
                     std::to_string(tensor->shape.size()) + ", not " + std::to_string(rank));
    }
    return tensor;
  }

  // All elements, each within [min, max].
  Result<std::vector<float>> Values(const Tensor& tensor, double min, double max) const {
    std::vector<float> values(tensor.count);
    for (uint64_t i = 0; i < tensor.count; ++i) {
      const double value = tensor.At(i);
      if (!(value >= min && value <= max)) {
        return Corrupt("field " + QuoteForMessage(tensor.name) + " at byte " +
                       std::to_string(tensor.offset) + ": element " + std::to_string(i) + " is " +
                       std::to_string(value) + ", not within " + std::to_string(min) + " to " +
                       std::to_string(max));
      }
      values[i] = static_cast<float>(value);
    }
    return values;
  }

  // A list of increasing values.
  Result<std::vector<float>> Axis(const char* field, double min, double max) const {
    PATINA_ASSIGN(const Tensor* tensor, Get(field, 1));
    if (tensor->count > kMaxLightAxis) {
      return Corrupt(std::string("field \"") + field + "\" has " + std::to_string(tensor->count) +
                     " values, more than " + std::to_string(kMaxLightAxis));
    }
    PATINA_ASSIGN(std::vector<float> values, Values(*tensor, min, max));
    for (size_t i = 1; i < values.size(); ++i) {
      if (!(values[i] > values[i - 1])) {
        return Corrupt(std::string("field \"") + field + "\": element " + std::to_string(i) +
                       " is not larger than the one before it");
      }
    }
    return values;
  }

  // Sides of the last two axes.
  Status CheckPlane(const Tensor& tensor, int* height, int* width) const {
    const uint64_t h = tensor.shape[tensor.shape.size() - 2];
    const uint64_t w = tensor.shape.back();
    if (h < 2 || w < 2 || h > kMaxSide || w > kMaxSide) {
      return Corrupt("field " + QuoteForMessage(tensor.name) + " has planes of " +
                     std::to_string(h) + " x " + std::to_string(w) + "; sides are 2 to " +
                     std::to_string(kMaxSide));
    }
    *height = static_cast<int>(h);
    *width = static_cast<int>(w);
    return {};
  }

  // Leading axes phi_i and theta_i.
  Status CheckLights(const Tensor& tensor, size_t phis, size_t thetas) const {
    if (tensor.shape[0] == phis && tensor.shape[1] == thetas) return {};
    return Corrupt("field " + QuoteForMessage(tensor.name) + " is for " +
                   std::to_string(tensor.shape[0]) + " x " + std::to_string(tensor.shape[1]) +
                   " light directions; phi_i and theta_i have " + std::to_string(phis) + " x " +
                   std::to_string(thetas));
  }

  Result<UnitGrid> Grid(const char* field, double max) const {
    PATINA_ASSIGN(const Tensor* tensor, Get(field, 2));
    int height = 0, width = 0;
    PATINA_TRY(CheckPlane(*tensor, &height, &width));
    PATINA_ASSIGN(std::vector<float> values, Values(*tensor, 0, max));
    return UnitGrid(std::move(values), height, width);
  }

  // A field of one integer; `otherwise` if it is missing.
  Result<double> Number(const char* field, double otherwise) const {
    const Tensor* tensor = file_.Find(field);
    if (tensor == nullptr) return otherwise;
    if (tensor->count != 1) {
      return Corrupt(std::string("field \"") + field + "\" has " + std::to_string(tensor->count) +
                     " elements, not one");
    }
    return tensor->At(0);
  }

 private:
  const TensorFile& file_;
  const std::string& name_;
};

Result<Reduction> ReadReduction(const FieldReader& fields, const std::vector<float>& phi_i) {
  PATINA_ASSIGN(const double stated, fields.Number("reduction", 0));
  if (stated == 1) return Reduction::kNone;
  if (stated == 2) return Reduction::kTurned;
  if (stated == 4) return Reduction::kMirrored;
  if (stated != 0) {
    return fields.Corrupt("field \"reduction\" is " + std::to_string(stated) + ", not 1, 2 or 4");
  }
  const float copies = kTwoPi / (phi_i.back() - phi_i.front());
  if (copies > 3.5f && copies < 4.5f) return Reduction::kMirrored;
  if (copies > 1.5f && copies < 2.5f) return Reduction::kTurned;
  if (copies < 1.5f) return Reduction::kNone;
  return fields.Corrupt("field \"phi_i\" covers " + std::to_string(phi_i.back() - phi_i.front()) +
                        " rad, neither a circle, a half nor a quarter of one");
}

// Colours of all cells from rgb or spectra; `height` and `width` of their planes.
Result<std::vector<Cell>> ReadColours(const TensorFile& file, const FieldReader& fields,
                                      size_t phis, size_t thetas, int* height, int* width,
                                      CellReport* report) {
  const bool spectral = file.Find("rgb") == nullptr && file.Find("spectra") != nullptr;
  PATINA_ASSIGN(const Tensor* tensor, fields.Get(spectral ? "spectra" : "rgb", 5));
  PATINA_TRY(fields.CheckLights(*tensor, phis, thetas));
  PATINA_TRY(fields.CheckPlane(*tensor, height, width));
  std::vector<std::array<double, 3>> to_rgb{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  if (spectral) {
    PATINA_ASSIGN(const std::vector<float> axis, fields.Axis("wavelengths", 1, 1e5));
    to_rgb = SpectrumToRec709(std::vector<double>(axis.begin(), axis.end()));
  }
  const size_t channels = to_rgb.size();
  if (tensor->shape[2] != channels) {
    return fields.Corrupt("field \"" + tensor->name + "\" has " + std::to_string(tensor->shape[2]) +
                          " channels, not " + std::to_string(channels));
  }
  const size_t plane = static_cast<size_t>(*height) * *width;
  std::vector<Cell> cells(phis * thetas * plane);
  for (size_t cell = 0; cell < cells.size(); ++cell) {
    const uint64_t first = cell / plane * channels * plane + cell % plane;
    double rgb[3] = {0, 0, 0};
    for (size_t channel = 0; channel < channels; ++channel) {
      const double value = tensor->At(first + channel * plane);
      for (int c = 0; c < 3; ++c) rgb[c] += to_rgb[channel][c] * value;
    }
    bool finite = true;
    for (const double value : rgb) finite &= std::abs(value) <= static_cast<double>(kMaxValue);
    const auto place = [&] {
      const size_t slice = cell / plane;
      return "field \"" + tensor->name + "\" (phi_i " + std::to_string(slice / thetas) +
             ", theta_i " + std::to_string(slice % thetas) + ", row " +
             std::to_string(cell % plane / *width) + ", column " +
             std::to_string(cell % plane % *width) + ")";
    };
    if (!finite) {
      report->NotFinite(place);
      cells[cell] = Cell::Invalid();
    } else if (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2] < 0) {
      report->Negative(place);
      cells[cell] = Cell::Invalid();
    } else {
      for (int c = 0; c < 3; ++c) cells[cell].rgb[c] = static_cast<float>(rgb[c]);
    }
  }
  if (report->count() == cells.size()) {
    return fields.Corrupt("no valid colour: all " + std::to_string(cells.size()) +
                          " are negative or not finite; nothing can be baked from this file");
  }
  return cells;
}

}  // namespace

Result<Source> ParseRgl(std::span<const uint8_t> bytes, const std::string& name) {
  PATINA_ASSIGN(const TensorFile file, ParseTensorFile(bytes, name));
  const FieldReader fields(file, name);
  PATINA_ASSIGN(std::vector<float> theta_i, fields.Axis("theta_i", 0, 1.5709));
  PATINA_ASSIGN(std::vector<float> phi_i, fields.Axis("phi_i", -12.6, 12.6));
  const bool isotropic = phi_i.size() <= 2;
  Reduction reduction = Reduction::kNone;
  if (!isotropic) {
    PATINA_ASSIGN(reduction, ReadReduction(fields, phi_i));
  }
  PATINA_ASSIGN(const double jacobian, fields.Number("jacobian", 1));
  PATINA_ASSIGN(UnitGrid sigma, fields.Grid("sigma", 1e6));
  PATINA_ASSIGN(UnitGrid ndf, fields.Grid("ndf", 1e12));

  PATINA_ASSIGN(const Tensor* vndf, fields.Get("vndf", 4));
  PATINA_TRY(fields.CheckLights(*vndf, phi_i.size(), theta_i.size()));
  int height = 0, width = 0;
  PATINA_TRY(fields.CheckPlane(*vndf, &height, &width));
  PATINA_ASSIGN(std::vector<float> density, fields.Values(*vndf, 0, 1e12));
  const int slices = static_cast<int>(phi_i.size() * theta_i.size());
  const int empty = UnitWarp::FirstEmptySlice(density, slices, height, width);
  if (empty >= 0) {
    return fields.Corrupt("field \"vndf\": the density for phi_i " +
                          std::to_string(empty / static_cast<int>(theta_i.size())) + ", theta_i " +
                          std::to_string(empty % static_cast<int>(theta_i.size())) +
                          " is zero everywhere");
  }
  UnitWarp warp(std::move(density), slices, height, width);

  CellReport report;
  PATINA_ASSIGN(std::vector<Cell> cells,
                ReadColours(file, fields, phi_i.size(), theta_i.size(), &height, &width, &report));
  Source source;
  source.format = "rgl";
  source.isotropic = isotropic;
  source.max_theta_rad = std::min(theta_i.back(), kHalfPi);
  source.cells = cells.size();
  source.invalid_cells = report.count();
  report.AddWarnings(&source.warnings);
  source.table = std::make_shared<RglTable>(
      RglData{std::move(theta_i), std::move(phi_i), reduction, isotropic, jacobian != 0,
              std::move(sigma), std::move(ndf), std::move(warp), height, width, std::move(cells)});
  return source;
}

Result<Source> ReadRgl(const std::string& path) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, kMaxRglBytes));
  return ParseRgl(bytes, path);
}

}  // namespace patina::brdf
