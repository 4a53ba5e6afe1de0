// The quality of a material against its reference, map by map and mip by mip: one definition for
// the verifier, for `patina compare` and for the peers of the benchmark.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/base/thread_pool.h"
#include "pipeline/color/primaries.h"
#include "pipeline/metrics/plane.h"

namespace patina::metrics {

// How the planes of a map are to be read.
enum class MapKind {
  kData,         // any number of channels
  kSrgbColor,    // 1 or 3 channels, coded by the curve of sRGB
  kLinearColor,  // 1 or 3 channels, linear
  kNormalXy      // 2 channels, coded x and y; z is reconstructed and counts as a third channel
};

// One map of a material.
struct QualityMap {
  std::string name;  // role, e.g. "albedo"
  MapKind kind = MapKind::kData;
  int channels = 1;   // planes that AddLevel gets for it
  bool flip = false;  // measure FLIP on mip 0 (colour maps only)
  // Of colour maps with 3 channels: from their linear space to Rec. 709, which FLIP and screens are
  // made for.
  Matrix3 to_rec709 = kIdentity3;
};

// One channel of one mip: coded values of the reference and of what is measured, of the same size.
// A plane with null data stands for a constant plane of that value.
struct PlanePair {
  PlanarView reference;
  PlanarView test;
  float reference_constant = 0;
  float test_constant = 0;
};

// PSNR of a set of channels. Peak 1, coded values.
struct PsnrTable {
  std::vector<double> mse;      // per mip: mean over its texels and channels
  std::vector<double> psnr_db;  // per mip
  double overall_db = 0;        // of the mean over the mips of mse, as Weinreich 2024 measures
  double mip0_db = 0;
  double mean_mips_db = 0;  // mean over the mips of psnr_db
};

struct MapQuality {
  std::string name;
  PsnrTable psnr;
  std::optional<double> ssim;  // mip 0, mean over channels that are not constant; none if all are
  std::optional<double> flip;  // mip 0, where asked for
  std::optional<double> normal_angle_deg;  // mip 0, normal maps
};

struct QualityResult {
  std::vector<MapQuality> maps;  // in the order of the QualityMaps
  PsnrTable psnr;  // mean over all channels of the source: z of normals and constants included
  std::optional<double> ssim;              // mean over all channels that are not constant
  std::optional<double> flip;              // of the first map that has one
  std::optional<double> normal_angle_deg;  // of the first map that has one
};

// Collects levels one at a time, so that no more than one decoded level is ever in memory.
// Deterministic for any number of threads.
class QualityMeter {
 public:
  explicit QualityMeter(std::vector<QualityMap> maps) : maps_(std::move(maps)) {}

  // Measures the next mip, from 0 on. planes: the channels of all maps in order. Every plane with
  // data has the size width x height (each >= 1).
  void AddLevel(int width, int height, std::span<const PlanePair> planes, ThreadPool& pool);

  // The table of all levels so far; at least one.
  QualityResult Finish() const;

 private:
  struct MapLevel {
    double squared_error = 0;  // summed over texels and channels
    int channels = 0;          // including z
  };
  struct MapScores {
    double ssim_sum = 0;
    int ssim_channels = 0;
    std::optional<double> flip;
    std::optional<double> normal_angle_deg;
  };

  std::vector<QualityMap> maps_;
  std::vector<double> texels_;                 // per level
  std::vector<std::vector<MapLevel>> levels_;  // [level][map]
  std::vector<MapScores> scores_;              // of level 0, per map
};

}  // namespace patina::metrics
