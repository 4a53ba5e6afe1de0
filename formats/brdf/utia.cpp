#include "formats/brdf/utia.h"

#include "formats/base/file_io.h"
#include "formats/brdf/angles.h"
#include "formats/brdf/cells.h"

namespace patina::brdf {
namespace {

constexpr float kDegree = kPi / 180;
constexpr float kMaxTheta = (kUtiaThetas - 1) * static_cast<float>(kUtiaThetaStepDegrees) * kDegree;

// The four nodes round a direction, as rows or columns of the table.
struct Corners {
  explicit Corners(const Direction& w) {
    const Place theta = PlaceOnRow(
        Colatitude(w) * (1 / (static_cast<float>(kUtiaThetaStepDegrees) * kDegree)), kUtiaThetas);
    const Place phi =
        PlaceOnRing(Atan2(w.y, w.x) * (static_cast<float>(kUtiaPhis) / kTwoPi), kUtiaPhis);
    index[0] = theta.low * kUtiaPhis + phi.low;
    index[1] = theta.low * kUtiaPhis + phi.high;
    index[2] = theta.high * kUtiaPhis + phi.low;
    index[3] = theta.high * kUtiaPhis + phi.high;
    weight[0] = (1 - theta.t) * (1 - phi.t);
    weight[1] = (1 - theta.t) * phi.t;
    weight[2] = theta.t * (1 - phi.t);
    weight[3] = theta.t * phi.t;
  }
  int index[4];
  float weight[4];
};

class UtiaTable : public Table {
 public:
  explicit UtiaTable(std::vector<Cell> cells) : cells_(std::move(cells)) {}

  bool Evaluate(const Direction& wi, const Direction& wo, float rgb[3]) const override {
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(wi.z > 0 && wo.z > 0)) return false;
    const Corners light(wi);
    const Corners view(wo);
    const Cell* cells[16];
    float weights[16];
    for (int i = 0; i < 4; ++i) {
      for (int v = 0; v < 4; ++v) {
        cells[4 * i + v] = &cells_[static_cast<size_t>(light.index[i] * kUtiaSide + view.index[v])];
        weights[4 * i + v] = light.weight[i] * view.weight[v];
      }
    }
    return MeanOfValid(cells, weights, 16, rgb);
  }

 private:
  std::vector<Cell> cells_;
};

}  // namespace

Result<Source> ParseUtia(std::span<const uint8_t> bytes, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Fail(ErrorCode::kCorruptData, name + ": " + what);
  };
  const std::string wanted =
      std::to_string(kUtiaFileBytes) + " bytes of a UTIA table (3 x 288 x 288 float64)";
  if (bytes.size() < kUtiaFileBytes) {
    return corrupt("truncated: " + std::to_string(bytes.size()) + " of the " + wanted +
                   "; get the file again");
  }
  if (bytes.size() > kUtiaFileBytes) {
    return corrupt("trailing bytes: the file has " + std::to_string(bytes.size()) +
                   " bytes, more than the " + wanted + "; get the file again");
  }
  std::vector<Cell> cells(kUtiaCells);
  CellReport report;
  for (int cell = 0; cell < kUtiaCells; ++cell) {
    double rgb[3];
    for (int c = 0; c < 3; ++c) {
      const size_t index = static_cast<size_t>(c) * kUtiaCells + static_cast<size_t>(cell);
      rgb[c] = LoadLittleDouble(bytes.data() + 8 * index);
    }
    cells[cell] = report.Check(rgb, true, [&] {
      return "row " + std::to_string(cell / kUtiaSide) + ", column " +
             std::to_string(cell % kUtiaSide) + ", byte " + std::to_string(int64_t{8} * cell);
    });
  }
  if (report.count() == kUtiaCells) {
    return corrupt("no valid cell: all " + std::to_string(kUtiaCells) +
                   " are negative or not finite; nothing can be baked from this file");
  }
  Source source;
  source.format = "utia";
  source.isotropic = false;
  source.max_theta_rad = kMaxTheta;
  source.cells = kUtiaCells;
  source.invalid_cells = report.count();
  report.AddWarnings(&source.warnings);
  source.table = std::make_shared<UtiaTable>(std::move(cells));
  return source;
}

Result<Source> ReadUtia(const std::string& path) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, 64 << 20));
  return ParseUtia(bytes, path);
}

}  // namespace patina::brdf
