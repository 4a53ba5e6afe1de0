#include "pipeline/material/time_reserve.h"

#include <algorithm>
#include <cmath>

namespace patina {
namespace {

// Measured on seven real sets of 1k and 2k with 6 to 11 channels, two cores (AVX-512), by the stages of run.json.
constexpr double kEncodePerBlock = 550;
// What follows the last step (final encode, refining, polishing) in encodes; without refining, in parts of one.
constexpr double kExportEncodes = 2, kQuickExportEncodes = 0.6;
// Decoding every texel of the written files, and comparing it with the source.
constexpr double kVerifyPerTexel = 3.5, kVerifyPerTexelChannel = 0.8;
// Report page; hardly depends on the material.
constexpr double kReport = 1.2e7;
// Before the first step: samples a second of one thread.
constexpr double kRateOfThread = 1.1e7;
// The rate is that of about so many seconds: the first steps, which wake caches and clocks, are soon forgotten.
constexpr double kHorizonS = 0.5;

}  // namespace

TimeReserve::TimeReserve(const MaterialReference& reference, const FeatureStore& store, int encodes, double tune_samples, int threads)
    : encodes_left_(encodes), quick_(encodes == 0), recent_samples_(kRateOfThread * threads * kHorizonS), recent_s_(kHorizonS) {
  double blocks = 0, texels = 0;
  for (const auto& texture : store.textures) {
    for (const FeatureLevel& level : texture) blocks += level.block_count();
  }
  for (const TargetLevel& level : reference.pyramid.levels) texels += static_cast<double>(level.width) * level.height;
  encode_samples_ = kEncodePerBlock * blocks;
  later_samples_ = tune_samples + texels * (kVerifyPerTexel + kVerifyPerTexelChannel * reference.pyramid.channels) + kReport;
}

void TimeReserve::CountStep(double samples, double seconds) {
  const double kept = std::exp(-seconds / kHorizonS);
  recent_samples_ = recent_samples_ * kept + samples;
  recent_s_ = recent_s_ * kept + seconds;
}

void TimeReserve::CountEncode(double seconds) {
  last_encode_s_ = seconds;
  encodes_left_ = std::max(0, encodes_left_ - 1);
}

double TimeReserve::Seconds() const {
  const double rate = recent_samples_ / recent_s_;
  const double encode_s = last_encode_s_ > 0 ? last_encode_s_ : encode_samples_ / rate;
  return (encodes_left_ + (quick_ ? kQuickExportEncodes : kExportEncodes)) * encode_s + later_samples_ / rate;
}

}  // namespace patina
