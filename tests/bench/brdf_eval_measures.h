// What the frozen protocol measures of a BRDF model against the table that it stands for.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "formats/brdf/brdf_source.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/sphere_render.h"
#include "tests/bench/brdf_eval_table.h"

namespace patina::bench {

inline constexpr float kExposure = 2;

// f of a table; noise below zero counts as zero, as every model cuts it off.
brdf::EvaluatePairs FunctionOf(std::shared_ptr<const brdf::Table> table);

// A table and what is known of it once for all models: images under each environment, values at
// fixed pairs of directions, albedo. All sets of pairs are the same for every table; pairs for
// which the table has no valid data are left out.
class Truth {
 public:
  // environments: one or more, with the same directions.
  Truth(std::shared_ptr<const brdf::Table> table, std::span<const brdf::Environment> environments,
        int side, ThreadPool& pool);

  // All columns but those of size and time, one set for each environment.
  //   image    lit spheres (sphere_render.h), exposure 2, clamped to [0, 1]; the frame's errors
  //            count the pixels beside the sphere, which are right
  //   log1p    log1p(f) - log1p(f*): mean of squares or magnitudes over channels and 65536 pairs
  //            without a weight, drawn uniformly in the table's coordinates (brdf::DrawPair,
  //            kHalfAngles) or uniformly on the hemisphere for either direction
  //   ghost    excess of f cos(theta_i) over the largest f* cos(theta_i) in the neighbourhood, the
  //            pair itself and those with one of the directions moved by 2 or 4 degrees to eight
  //            sides; largest and mean over channels and 16384 pairs of uniform directions. Zero
  //            for a peak that is blurred or shifted by less than that
  //   peak     |f - f*| / f* in the mirror direction, mean over channels and theta_d of 0 to 80
  //            degrees in steps of one
  //   reciprocity  mean |f(i, o) - f(o, i)| over the mean of f, both kinds of pairs of `log1p`
  //   albedo   directional albedo at kAlbedoDegrees (DirectionalAlbedo), mean of the channels; its
  //            error: mean magnitude over angles and channels; how many of these 15 are above 1
  //   minimum  least value of all pairs measured, and whether all were finite (1 or 0)
  //   grazing  largest f over the largest f*, both over pairs with one direction at 80 to 89.9
  //            degrees and the other at 0 to 89.9
  std::vector<Values> Measure(const brdf::EvaluatePairs& model, ThreadPool& pool) const;

 private:
  struct Pairs {
    std::vector<brdf::Direction> wi, wo;
    std::vector<float> wanted;  // [pairs][3]
    void Add(const brdf::Direction& i, const brdf::Direction& o, const float rgb[3]);
    size_t size() const { return wi.size(); }
  };

  Pairs ValidPairs(const std::vector<brdf::Direction>& wi, const std::vector<brdf::Direction>& wo,
                   ThreadPool& pool) const;
  void DrawPairs(ThreadPool& pool);
  void FindNeighbourhoods(ThreadPool& pool);

  brdf::EvaluatePairs function_;
  std::shared_ptr<const brdf::Table> table_;
  std::vector<brdf::Environment> environments_;
  int side_;
  std::vector<brdf::SphereImage> images_;
  Pairs table_pairs_, direction_pairs_, peaks_, grazing_;
  size_t ghost_pairs_ = 0;            // the first of direction_pairs_
  std::vector<float> neighbourhood_;  // [ghost_pairs_][3], largest f* cos(theta_i)
  std::vector<std::array<double, 3>> albedo_;
};

// Nanoseconds of CPU time for one evaluation in batches of 4096 uniform pairs on one core, median
// of seven; and the median ratio to the other function, measured in turns.
struct Speed {
  double nanoseconds = 0, times_other = 0;
};
Speed MeasureSpeed(const brdf::EvaluatePairs& function, const brdf::EvaluatePairs& other);

}  // namespace patina::bench
