// The training samples of a BRDF, drawn and looked up once.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "formats/brdf/brdf_source.h"
#include "formats/healpix_corners.h"
#include "pipeline/base/aligned_buffer.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/rng.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/brdf_kernels.h"

namespace patina::brdf {

// What of a model decides how a pair of directions is looked up.
struct GridShape {
  int nside = 16;
  healpix::Interpolation interpolation = healpix::Interpolation::kBilinear;
  bool isotropic = true;            // the azimuth is folded: wi at 0, wo at |phi_o - phi_i|
  bool canonical_order = true;      // wi is the direction nearer to the normal: exactly reciprocal
  bool angle_inputs = true;         // the scalars l, t, q of angle_inputs.h
  bool half_vector_inputs = false;  // and X, Y: of use to anisotropic materials; needs angle_inputs

  int corners() const { return healpix::CornerCount(nside); }  // of one grid
  int extra_inputs() const { return !angle_inputs ? 0 : half_vector_inputs ? 5 : 3; }
};

// Corners, weights and scalars of a pair of directions above the horizon. Corners of wi are 0 ..
// corners() - 1, those of wo follow; value and importance stay as they are.
void LookUpPair(const GridShape& shape, Direction wi, Direction wo, PoolSample* sample);

// How pairs of directions are drawn.
enum class Draw { kHalfAngles, kDirections };
// A pair with wi and wo above the horizon. kHalfAngles: uniform in sqrt(theta_h), theta_d and
// phi_d, so that a peak gets its share at any width. kDirections: both uniform on the hemisphere.
void DrawPair(Draw draw, Rng* rng, Direction* wi, Direction* wo);

struct PoolOptions {
  size_t count = size_t{1} << 20;
  double half_angle_share = 0.5;
  uint64_t seed = 1;
  std::function<void(double fraction)> on_progress;  // on the calling thread; may be empty
  const CancelToken* cancel = nullptr;               // once set, what is missing is left out
};

// Samples in random order. Of a table: pairs that have valid data. Of a sparse list: its samples,
// each about equally often. The same for any number of threads. May be shorter than asked for if
// most of a table is invalid; empty if all is.
AlignedBuffer<PoolSample> DrawPool(const Source& source, const GridShape& shape,
                                   const PoolOptions& options, ThreadPool& pool);

}  // namespace patina::brdf
