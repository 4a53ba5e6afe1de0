#include "pipeline/tradeoff/decode_time.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "formats/container.h"
#include "formats/decoder/patina_decoder.h"
#include "pipeline/base/cpu_time.h"
#include "pipeline/base/rng.h"
#include "pipeline/jobs/decoder_status.h"
#include "pipeline/jobs/measure_brdf.h"

namespace patina {
namespace {

constexpr double kSecondsARound = 0.05;

// Times `decode` (which returns how many it decoded) for a round.
template <class Decode>
double NsEach(Decode decode) {
  const double start = ThreadCpuSeconds();
  double seconds = 0, count = 0;
  while (seconds < kSecondsARound) {
    count += decode();
    seconds = ThreadCpuSeconds() - start;
  }
  return 1e9 * seconds / count;
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

class MaterialTimer : public DecodeTimer {
 public:
  Status Load(const Container& container) {
    std::string problem;
    PATINA_TRY(DecoderStatus(Decoder::Load(container.directory, &decoder_, &problem), problem));
    if (container.manifest.lod_range) mip_ = (*container.manifest.lod_range)[0];
    rows_ = std::min(decoder_.MipHeight(mip_), 64);
    plane_ = static_cast<size_t>(decoder_.MipWidth(mip_)) * static_cast<size_t>(rows_);
    out_.resize(plane_ * static_cast<size_t>(std::max(1, decoder_.outputs())));
    return {};
  }

  void Round() override {
    const int places = std::max(1, decoder_.MipHeight(mip_) - rows_ + 1);
    int y = 0;
    times_.push_back(NsEach([&] {
      decoder_.DecodeRows(mip_, y, y + rows_, out_.data(), plane_);
      y = (y + rows_) % places;
      return static_cast<double>(plane_);
    }));
  }

  double MedianNs() const override { return decoder_.outputs() == 0 ? 0 : Median(times_); }

 private:
  Decoder decoder_;
  int mip_ = 0, rows_ = 0;
  size_t plane_ = 0;
  std::vector<float> out_;
  std::vector<double> times_;
};

class BrdfTimer : public DecodeTimer {
 public:
  explicit BrdfTimer(brdf::BatchEvaluator evaluator)
      : evaluator_(std::move(evaluator)), scratch_(evaluator_) {
    Rng rng(7);
    for (auto* directions : {&wi_, &wo_}) {
      for (size_t i = 0; i < kPairs; ++i) {
        const float z = rng.Uniform();
        const float phi = 2 * std::numbers::pi_v<float> * rng.Uniform();
        const float r = std::sqrt(1 - z * z);
        directions->push_back({r * std::cos(phi), r * std::sin(phi), z});
      }
    }
    rgb_.resize(3 * kPairs);
  }

  void Round() override {
    times_.push_back(NsEach([&] {
      evaluator_.Evaluate(&scratch_, kPairs, wi_.data(), wo_.data(), rgb_.data());
      return static_cast<double>(kPairs);
    }));
  }

  double MedianNs() const override { return Median(times_); }

 private:
  static constexpr size_t kPairs = 16384;

  brdf::BatchEvaluator evaluator_;
  brdf::BatchEvaluator::Scratch scratch_;
  std::vector<brdf::Direction> wi_, wo_;
  std::vector<float> rgb_;
  std::vector<double> times_;
};

}  // namespace

Result<std::unique_ptr<DecodeTimer>> DecodeTimer::Open(const std::string& path) {
  PATINA_ASSIGN(const Container container, OpenContainer(path));
  if (container.manifest.brdf) {
    PATINA_ASSIGN(brdf::BatchEvaluator evaluator,
                  OpenBrdfContainer(container.directory, *container.manifest.brdf));
    return std::make_unique<BrdfTimer>(std::move(evaluator));
  }
  auto timer = std::make_unique<MaterialTimer>();
  PATINA_TRY(timer->Load(container));
  return timer;
}

}  // namespace patina
