#include "pipeline/color/primaries.h"

#include <cmath>

namespace patina {
namespace {

constexpr Matrix3 kBradford{0.8951, 0.2664, -0.1614, -0.7502, 1.7135,
                            0.0367, 0.0389, -0.0685, 1.0296};

using Vector3 = std::array<double, 3>;

Vector3 Apply(const Matrix3& m, const Vector3& v) {
  Vector3 out{};
  for (int i = 0; i < 3; ++i) out[i] = m[3 * i] * v[0] + m[3 * i + 1] * v[1] + m[3 * i + 2] * v[2];
  return out;
}

Vector3 ToXyz(const Chromaticity& c) { return {c.x / c.y, 1, (1 - c.x - c.y) / c.y}; }

// A matrix whose determinant is smaller, against its entries, has lost its meaning.
constexpr double kLeastDeterminant = 1e-9;

}  // namespace

Matrix3 Multiply(const Matrix3& a, const Matrix3& b) {
  Matrix3 out{};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) out[3 * i + j] += a[3 * i + k] * b[3 * k + j];
    }
  }
  return out;
}

std::optional<Matrix3> Inverse(const Matrix3& m) {
  const Matrix3 adjugate{
      m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
      m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
      m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3]};
  const double determinant = m[0] * adjugate[0] + m[1] * adjugate[3] + m[2] * adjugate[6];
  double largest = 0;
  for (const double entry : m) largest = std::fmax(largest, std::fabs(entry));
  const double least = kLeastDeterminant * largest * largest * largest;
  if (!std::isfinite(determinant) || !(std::fabs(determinant) > least)) return std::nullopt;
  Matrix3 inverse;
  for (int i = 0; i < 9; ++i) inverse[i] = adjugate[i] / determinant;
  return inverse;
}

std::optional<Matrix3> RgbToXyz(const Primaries& p) {
  // Scaled by y, so that a primary on the line y = 0 is no division by zero.
  const Matrix3 columns{p.red.x,
                        p.green.x,
                        p.blue.x,
                        p.red.y,
                        p.green.y,
                        p.blue.y,
                        1 - p.red.x - p.red.y,
                        1 - p.green.x - p.green.y,
                        1 - p.blue.x - p.blue.y};
  const auto inverse = Inverse(columns);
  if (!inverse || !std::isfinite(p.white.x) || !(p.white.y > 1e-3)) return std::nullopt;
  const Vector3 scale = Apply(*inverse, ToXyz(p.white));
  Matrix3 matrix;
  for (int i = 0; i < 9; ++i) matrix[i] = columns[i] * scale[i % 3];
  if (!Inverse(matrix)) return std::nullopt;
  return matrix;
}

std::optional<Matrix3> ConversionMatrix(const Primaries& from, const Primaries& to) {
  const auto source = RgbToXyz(from);
  const auto target = RgbToXyz(to);
  if (!source || !target) return std::nullopt;
  const Vector3 cone_from = Apply(kBradford, ToXyz(from.white));
  const Vector3 cone_to = Apply(kBradford, ToXyz(to.white));
  Matrix3 adapt{};
  for (int i = 0; i < 3; ++i) {
    if (!(std::fabs(cone_from[i]) > 1e-6)) return std::nullopt;
    adapt[4 * i] = cone_to[i] / cone_from[i];
  }
  const Matrix3 white = Multiply(*Inverse(kBradford), Multiply(adapt, kBradford));
  return Multiply(*Inverse(*target), Multiply(white, *source));
}

bool AreSameSpace(const Primaries& a, const Primaries& b, double tolerance) {
  const auto matrix = ConversionMatrix(a, b);
  if (!matrix) return false;
  for (int i = 0; i < 9; ++i) {
    if (!(std::fabs((*matrix)[i] - kIdentity3[i]) <= tolerance)) return false;
  }
  return true;
}

const char* WorkingSpaceName(WorkingSpace space) {
  return space == WorkingSpace::kAcesCg ? "acescg" : "lin_rec709";
}

std::optional<WorkingSpace> ParseWorkingSpace(std::string_view name) {
  if (name == "lin_rec709") return WorkingSpace::kLinearRec709;
  if (name == "acescg") return WorkingSpace::kAcesCg;
  return std::nullopt;
}

const Primaries& PrimariesOf(WorkingSpace space) {
  return space == WorkingSpace::kAcesCg ? kAp1Primaries : kRec709Primaries;
}

}  // namespace patina
