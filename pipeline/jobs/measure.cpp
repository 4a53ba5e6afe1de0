#include "pipeline/jobs/measure.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <set>

#include "formats/decoder/patina_decoder.h"
#include "pipeline/jobs/decoder_status.h"

namespace patina {
namespace {

constexpr int kRowsPerTask = 16;

const char* DecoderEncodingName(Decoder::Encoding encoding) {
  switch (encoding) {
    case Decoder::Encoding::kSrgb:
      return EncodingName(Encoding::kSrgb);
    case Decoder::Encoding::kNormalXy:
      return EncodingName(Encoding::kNormalXy);
    case Decoder::Encoding::kSignedLog:
      return EncodingName(Encoding::kSignedLog);
    case Decoder::Encoding::kLinear:
      break;
  }
  return EncodingName(Encoding::kLinear);
}

metrics::MapKind KindOf(const TargetChannel& first, int channels) {
  if (first.encoding == Encoding::kNormalXy) return metrics::MapKind::kNormalXy;
  if (channels != 3) return metrics::MapKind::kData;
  // Logarithms over their peak look as codes do: dark and bright are both seen.
  return first.encoding == Encoding::kLinear ? metrics::MapKind::kLinearColor
                                             : metrics::MapKind::kSrgbColor;
}

// A channel that both sides have.
struct ChannelPair {
  const TargetChannel* reference = nullptr;
  const Decoder::Channel* decoded = nullptr;
  float factor = 1;  // of coded values on both sides: 1 / CodedPeak
};

// What is measured: channels, map after map, and the maps.
struct Layout {
  std::vector<ChannelPair> channels;
  std::vector<metrics::QualityMap> maps;
  std::vector<std::string> not_compared;
};

void AddOnce(const std::string& name, std::vector<std::string>* names) {
  if (std::find(names->begin(), names->end(), name) == names->end()) names->push_back(name);
}

Result<Layout> MatchChannels(const std::string& directory, const Decoder& decoder,
                             const MaterialReference& reference) {
  Layout layout;
  auto in_container = [&](const TargetChannel& channel) -> const Decoder::Channel* {
    for (const Decoder::Channel& other : decoder.channels()) {
      if (other.map == channel.map && other.component == channel.component) return &other;
    }
    return nullptr;
  };
  for (const TargetChannel& channel : reference.channels) {
    const Decoder::Channel* decoded = in_container(channel);
    if (decoded == nullptr) {
      AddOnce(channel.map, &layout.not_compared);
      continue;
    }
    if (std::string(EncodingName(channel.encoding)) != DecoderEncodingName(decoded->encoding)) {
      return Fail(ErrorCode::kConflict,
                  directory + ": its " + channel.map + " is coded as \"" +
                      DecoderEncodingName(decoded->encoding) + "\", that of the source as \"" +
                      EncodingName(channel.encoding) +
                      "\"; compare it with maps of the kind it was baked from");
    }
    if (channel.encoding == Encoding::kSignedLog && !channel.constant &&
        channel.scale != decoded->scale) {
      return Fail(ErrorCode::kConflict,
                  directory + ": its " + channel.map +
                      " has logarithms of another scale than the " +
                      "source's would have; compare it with the maps it was baked from");
    }
    if (layout.maps.empty() || layout.maps.back().name != channel.map) {
      layout.maps.push_back({channel.map, metrics::MapKind::kData, 0, false});
    }
    ++layout.maps.back().channels;
    layout.channels.push_back({&channel, decoded, 1 / CodedPeak(channel)});
  }
  for (const Decoder::Channel& channel : decoder.channels()) {
    const bool known =
        std::any_of(reference.channels.begin(), reference.channels.end(),
                    [&](const TargetChannel& other) { return other.map == channel.map; });
    if (!known) AddOnce(channel.map, &layout.not_compared);
  }
  if (layout.channels.empty()) {
    return Fail(ErrorCode::kConflict, directory + ": it has no map in common with the source");
  }
  Matrix3 to_rec709 = kIdentity3;
  if (ParseWorkingSpace(decoder.working_space()) == WorkingSpace::kAcesCg)
    to_rec709 = *ConversionMatrix(kAp1Primaries, kRec709Primaries);
  size_t first = 0;
  metrics::QualityMap* seen = nullptr;
  for (metrics::QualityMap& map : layout.maps) {
    const TargetChannel& channel = *layout.channels[first].reference;
    map.kind = KindOf(channel, map.channels);
    // Logarithms are looked at as they are.
    if (channel.encoding != Encoding::kSignedLog) map.to_rec709 = to_rec709;
    first += static_cast<size_t>(map.channels);
    const bool color =
        map.kind == metrics::MapKind::kSrgbColor || map.kind == metrics::MapKind::kLinearColor;
    if (color && (seen == nullptr || map.name == "albedo")) seen = &map;
  }
  if (seen != nullptr) seen->flip = true;
  return layout;
}

// One mip in planes: what is learned of the reference, and all outputs of the decoder.
class LevelPlanes {
 public:
  void Load(const Decoder& decoder, const TargetLevel& level, int index, ThreadPool& pool) {
    width_ = level.width;
    height_ = level.height;
    plane_ = static_cast<size_t>(width_) * static_cast<size_t>(height_);
    reference_.Reset(plane_ * static_cast<size_t>(level.channels));
    decoded_.Reset(plane_ * static_cast<size_t>(decoder.outputs()));
    std::atomic<bool> finite{true};
    pool.ParallelFor((height_ + kRowsPerTask - 1) / kRowsPerTask, [&](int task, int) {
      const int begin = task * kRowsPerTask;
      const int end = std::min(height_, begin + kRowsPerTask);
      decoder.DecodeRows(index, begin, end, decoded_.data() + static_cast<size_t>(begin) * width_,
                         plane_);
      bool rows_finite = true;
      for (int o = 0; o < decoder.outputs(); ++o) {
        const float* row = decoded_.data() + o * plane_ + static_cast<size_t>(begin) * width_;
        // A sum of zeros unless some value is not finite, and without a branch in the loop.
        float sum = 0;
        for (size_t i = 0; i < static_cast<size_t>(end - begin) * width_; ++i) sum += 0.0f * row[i];
        rows_finite = rows_finite && sum == 0.0f;
      }
      if (!rows_finite) finite.store(false, std::memory_order_relaxed);
      for (int y = begin; y < end; ++y) Deinterleave(level, y);
    });
    finite_ = finite.load();
  }

  bool finite() const { return finite_; }

  // Brings coded values to a peak of 1. Equal channels share planes, and have the same factor.
  void Scale(const std::vector<ChannelPair>& channels, ThreadPool& pool) {
    std::set<int> references, outputs;
    for (const ChannelPair& pair : channels) {
      if (pair.factor == 1.0f) continue;
      const int reference = pair.reference->constant ? -1 : pair.reference->learned_index;
      const int output = pair.decoded->output;
      if (reference >= 0 && references.insert(reference).second)
        ScalePlane(&reference_, reference, pair.factor, pool);
      if (output >= 0 && outputs.insert(output).second)
        ScalePlane(&decoded_, output, pair.factor, pool);
    }
  }

  metrics::PlanePair Pair(const ChannelPair& channel) const {
    metrics::PlanePair pair;
    if (channel.reference->constant) {
      pair.reference_constant = channel.reference->constant_value * channel.factor;
    } else {
      pair.reference = Plane(reference_, channel.reference->learned_index);
    }
    if (channel.decoded->output < 0) {
      pair.test_constant = channel.decoded->constant * channel.factor;
    } else {
      pair.test = Plane(decoded_, channel.decoded->output);
    }
    return pair;
  }

 private:
  void ScalePlane(AlignedBuffer<float>* planes, int index, float factor, ThreadPool& pool) const {
    float* plane = planes->data() + static_cast<size_t>(index) * plane_;
    pool.ParallelFor(height_, [&](int y, int) {
      float* row = plane + static_cast<size_t>(y) * width_;
      for (int x = 0; x < width_; ++x) row[x] *= factor;
    });
  }

  metrics::PlanarView Plane(const AlignedBuffer<float>& planes, int index) const {
    return metrics::DensePlane(planes.data() + static_cast<size_t>(index) * plane_, width_,
                               height_);
  }

  void Deinterleave(const TargetLevel& level, int y) {
    for (int xb = 0; 16 * xb < width_; ++xb) {
      const float* block = level.Block(xb, y);
      const size_t bytes = static_cast<size_t>(std::min(16, width_ - 16 * xb)) * sizeof(float);
      for (int c = 0; c < level.channels; ++c) {
        float* row =
            reference_.data() + static_cast<size_t>(c) * plane_ + static_cast<size_t>(y) * width_;
        __builtin_memcpy(row + 16 * xb, block + 16 * c, bytes);
      }
    }
  }

  int width_ = 0;
  int height_ = 0;
  size_t plane_ = 0;
  bool finite_ = true;
  AlignedBuffer<float> reference_, decoded_;
};

}  // namespace

Result<Measurement> MeasureContainer(const std::string& directory,
                                     const MaterialReference& reference, ThreadPool& pool,
                                     const CancelToken& cancel, ProgressSink& progress,
                                     const LevelViewer& viewer) {
  const auto start = std::chrono::steady_clock::now();
  Decoder decoder;
  std::string problem;
  PATINA_TRY(DecoderStatus(Decoder::Load(directory, &decoder, &problem), problem));
  const std::vector<TargetLevel>& levels = reference.pyramid.levels;
  const int first = reference.pyramid.first_mip;
  if (first + static_cast<int>(levels.size()) > decoder.levels() ||
      levels[0].width != decoder.MipWidth(first) || levels[0].height != decoder.MipHeight(first)) {
    return Fail(ErrorCode::kConflict,
                directory + ": it is for " + std::to_string(decoder.width()) + " x " +
                    std::to_string(decoder.height()) + " texels, the source has " +
                    std::to_string(levels[0].width) + " x " + std::to_string(levels[0].height));
  }
  PATINA_ASSIGN(Layout layout, MatchChannels(directory, decoder, reference));
  metrics::QualityMeter meter(layout.maps);
  LevelPlanes planes;
  std::vector<metrics::PlanePair> pairs;
  double texels = 0;
  for (const TargetLevel& level : levels) texels += static_cast<double>(level.width) * level.height;
  double done = 0;
  for (size_t i = 0; i < levels.size(); ++i) {
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    planes.Load(decoder, levels[i], first + static_cast<int>(i), pool);
    if (!planes.finite()) {
      return Fail(ErrorCode::kInternal, directory + ": mip " +
                                            std::to_string(first + static_cast<int>(i)) +
                                            " decodes to a value that is not finite");
    }
    planes.Scale(layout.channels, pool);
    pairs.clear();
    for (const ChannelPair& channel : layout.channels) pairs.push_back(planes.Pair(channel));
    meter.AddLevel(levels[i].width, levels[i].height, pairs, pool);
    if (viewer)
      viewer(static_cast<int>(i), layout.maps, levels[i].width, levels[i].height, pairs);
    done += static_cast<double>(levels[i].width) * levels[i].height;
    ProgressEvent event;
    event.stage = "verify";
    event.fraction = done / texels;
    event.elapsed_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    progress.OnProgress(event);
  }
  return Measurement{meter.Finish(), std::move(layout.not_compared)};
}

PsnrSummary SummarizePsnr(const metrics::QualityResult& quality) {
  PsnrSummary summary;
  summary.overall_db = CapPsnr(quality.psnr.overall_db);
  summary.mip0_db = CapPsnr(quality.psnr.mip0_db);
  summary.mean_mips_db = CapPsnr(quality.psnr.mean_mips_db);
  for (const metrics::MapQuality& map : quality.maps)
    summary.maps.emplace_back(map.name, CapPsnr(map.psnr.overall_db));
  return summary;
}

}  // namespace patina
