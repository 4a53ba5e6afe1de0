#include "formats/brdf/merl.h"

#include <numbers>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "formats/brdf/angles.h"
#include "formats/brdf/cells.h"

namespace patina::brdf {
namespace {

constexpr char kLayout[] = "90 x 90 x 180, the only layout of the MERL database";

class MerlTable : public Table {
 public:
  explicit MerlTable(std::vector<Cell> cells) : cells_(std::move(cells)) {}

  bool Evaluate(const Direction& wi, const Direction& wo, float rgb[3]) const override {
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(wi.z > 0 && wo.z > 0)) return false;
    const HalfDifference angles = ToHalfDifference(wi, wo);
    const Place h =
        PlaceOnRow(kMerlThetaH * std::sqrt(angles.theta_h * (1 / kHalfPi)) - 0.5f, kMerlThetaH);
    const Place d = PlaceOnRow(angles.theta_d * (kMerlThetaD / kHalfPi) - 0.5f, kMerlThetaD);
    const Place p = PlaceOnRing(angles.phi_d * (kMerlPhiD / kPi) - 0.5f, kMerlPhiD);
    const Cell* rows[4] = {Row(h.low, d.low), Row(h.low, d.high), Row(h.high, d.low),
                           Row(h.high, d.high)};
    const float row_weights[4] = {(1 - h.t) * (1 - d.t), (1 - h.t) * d.t, h.t * (1 - d.t),
                                  h.t * d.t};
    const Cell* cells[8];
    float weights[8];
    for (int i = 0; i < 4; ++i) {
      cells[2 * i] = rows[i] + p.low;
      cells[2 * i + 1] = rows[i] + p.high;
      weights[2 * i] = row_weights[i] * (1 - p.t);
      weights[2 * i + 1] = row_weights[i] * p.t;
    }
    return MeanOfValid(cells, weights, 8, rgb);
  }

 private:
  const Cell* Row(int h, int d) const {
    return cells_.data() + static_cast<size_t>(h * kMerlThetaD + d) * kMerlPhiD;
  }

  std::vector<Cell> cells_;
};

// Whether both directions of the middle of a cell are above the surface.
std::vector<bool> CellsAboveHorizon() {
  std::vector<bool> above(kMerlCells);
  std::vector<double> cos_phi(kMerlPhiD);
  for (int k = 0; k < kMerlPhiD; ++k) cos_phi[k] = std::cos(MerlNodeAt(0, 0, k).phi_d);
  for (int i = 0; i < kMerlThetaH; ++i) {
    for (int j = 0; j < kMerlThetaD; ++j) {
      const MerlNode node = MerlNodeAt(i, j, 0);
      const double level = std::cos(node.theta_h) * std::cos(node.theta_d);
      const double tilt = std::sin(node.theta_h) * std::sin(node.theta_d);
      const int first = (i * kMerlThetaD + j) * kMerlPhiD;
      for (int k = 0; k < kMerlPhiD; ++k) above[first + k] = level > tilt * std::abs(cos_phi[k]);
    }
  }
  return above;
}

std::string CellText(int cell) {
  return "cell (theta_h " + std::to_string(cell / (kMerlThetaD * kMerlPhiD)) + ", theta_d " +
         std::to_string(cell / kMerlPhiD % kMerlThetaD) + ", phi_d " +
         std::to_string(cell % kMerlPhiD) + "), byte " +
         std::to_string(kMerlHeaderBytes + int64_t{8} * cell);
}

}  // namespace

MerlNode MerlNodeAt(int theta_h, int theta_d, int phi_d) {
  const double warped = (theta_h + 0.5) / kMerlThetaH;
  return {warped * warped * std::numbers::pi / 2,
          (theta_d + 0.5) / kMerlThetaD * std::numbers::pi / 2,
          (phi_d + 0.5) / kMerlPhiD * std::numbers::pi};
}

bool LooksLikeMerl(std::span<const uint8_t> bytes) {
  return bytes.size() >= kMerlHeaderBytes && LoadLittle32(bytes.data()) == kMerlThetaH &&
         LoadLittle32(bytes.data() + 4) == kMerlThetaD &&
         LoadLittle32(bytes.data() + 8) == kMerlPhiD;
}

Result<Source> ParseMerl(std::span<const uint8_t> bytes, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Fail(ErrorCode::kCorruptData, name + ": " + what);
  };
  if (bytes.size() < kMerlHeaderBytes) {
    return corrupt("truncated: " + std::to_string(bytes.size()) +
                   " bytes, no room for the 12 header bytes of a MERL table; get the file again");
  }
  if (!LooksLikeMerl(bytes)) {
    const auto side = [&](int i) {
      return std::to_string(static_cast<int32_t>(LoadLittle32(bytes.data() + 4 * i)));
    };
    return corrupt("bad header: the dimensions at byte 0 are " + side(0) + " x " + side(1) + " x " +
                   side(2) + ", not " + kLayout + "; convert the table to it");
  }
  if (bytes.size() < kMerlFileBytes) {
    return corrupt("truncated: " + std::to_string(bytes.size()) + " of the " +
                   std::to_string(kMerlFileBytes) + " bytes of a MERL table; get the file again");
  }
  if (bytes.size() > kMerlFileBytes) {
    return corrupt("trailing bytes: a MERL table ends at byte " + std::to_string(kMerlFileBytes) +
                   ", the file at " + std::to_string(bytes.size()) + "; get the file again");
  }

  const std::vector<bool> above = CellsAboveHorizon();
  std::vector<Cell> cells(kMerlCells);
  CellReport report;
  uint64_t valid = 0;
  for (int cell = 0; cell < kMerlCells; ++cell) {
    double rgb[3];
    for (int c = 0; c < 3; ++c) {
      const size_t index = static_cast<size_t>(c) * kMerlCells + static_cast<size_t>(cell);
      rgb[c] = LoadLittleDouble(bytes.data() + kMerlHeaderBytes + 8 * index) * kMerlScale[c];
    }
    cells[cell] = report.Check(rgb, above[cell], [&] { return CellText(cell); });
    valid += cells[cell].valid() ? 1 : 0;
  }
  if (valid == 0) {
    return corrupt("no valid cell: all " + std::to_string(kMerlCells) +
                   " are negative or not finite; nothing can be baked from this file");
  }
  Source source;
  source.format = "merl";
  source.isotropic = true;
  source.cells = kMerlCells;
  source.invalid_cells = report.count();
  report.AddWarnings(&source.warnings);
  source.table = std::make_shared<MerlTable>(std::move(cells));
  return source;
}

Result<Source> ReadMerl(const std::string& path) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, 2 * kMerlFileBytes));
  return ParseMerl(bytes, path);
}

}  // namespace patina::brdf
