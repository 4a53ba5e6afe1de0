#include "tests/bench/peer_textures.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "pipeline/color/color.h"
#include "pipeline/metrics/normal_angle.h"

namespace patina::bench {
namespace {

// An affine code of a channel's range to [0, 1].
struct Scale {
  float low = 0;
  float span = 1;
};

Scale ScaleOf(const TargetChannel& channel) {
  if (channel.min_value >= 0 && channel.max_value <= 1) return {};
  return {channel.min_value, std::max(channel.max_value - channel.min_value, 1e-6f)};
}

float ReferenceValue(const MaterialReference& reference, int channel, int level, int x, int y) {
  const TargetChannel& info = reference.channels[channel];
  return info.constant ? info.constant_value
                       : reference.pyramid.levels[level].At(x, y, info.learned_index);
}

uint8_t ToByte(float value) {
  return static_cast<uint8_t>(std::lround(255.0f * std::min(std::max(value, 0.0f), 1.0f)));
}

using Plane = std::vector<float>;

// Bilinear magnification on texel centres.
Plane Magnify(const Plane& in, int in_width, int in_height, int width, int height,
              AddressMode address, ThreadPool& pool) {
  const auto at = [&](int i, int size) {
    return address == AddressMode::kWrap ? (i + size) % size : std::clamp(i, 0, size - 1);
  };
  Plane out(static_cast<size_t>(width) * height);
  pool.ParallelFor(height, [&](int y, int) {
    const float v = (static_cast<float>(y) + 0.5f) * static_cast<float>(in_height) /
                        static_cast<float>(height) -
                    0.5f;
    const int y0 = static_cast<int>(std::floor(v));
    const float fy = v - static_cast<float>(y0);
    const float* top = in.data() + static_cast<size_t>(at(y0, in_height)) * in_width;
    const float* bottom = in.data() + static_cast<size_t>(at(y0 + 1, in_height)) * in_width;
    for (int x = 0; x < width; ++x) {
      const float u = (static_cast<float>(x) + 0.5f) * static_cast<float>(in_width) /
                          static_cast<float>(width) -
                      0.5f;
      const int x0 = static_cast<int>(std::floor(u));
      const float fx = u - static_cast<float>(x0);
      const int left = at(x0, in_width), right = at(x0 + 1, in_width);
      const float upper = top[left] + fx * (top[right] - top[left]);
      const float lower = bottom[left] + fx * (bottom[right] - bottom[left]);
      out[static_cast<size_t>(y) * width + x] = upper + fy * (lower - upper);
    }
  });
  return out;
}

// The decoded planes of one level, by channel; empty where a channel is constant and in no texture.
using Planes = std::vector<Plane>;

void StorePlanes(const MaterialReference& reference, const PeerTexture& texture,
                 const Rgba8& decoded, Planes& planes) {
  for (size_t c = 0; c < texture.channels.size(); ++c) {
    const int channel = texture.channels[c];
    const Scale scale = ScaleOf(reference.channels[channel]);
    Plane& plane = planes[channel];
    plane.resize(static_cast<size_t>(decoded.width) * decoded.height);
    for (size_t i = 0; i < plane.size(); ++i) {
      plane[i] = scale.low + scale.span * static_cast<float>(decoded.texels[4 * i + c]) / 255.0f;
    }
  }
}

Planes MagnifyAll(const MaterialReference& reference, const Planes& planes, int from_level,
                  int to_level, ThreadPool& pool) {
  const TargetLevel &from = reference.pyramid.levels[from_level],
                    &to = reference.pyramid.levels[to_level];
  Planes result(planes.size());
  for (size_t c = 0; c < planes.size(); ++c) {
    if (planes[c].empty()) continue;
    const bool srgb = reference.channels[c].encoding == Encoding::kSrgb;
    Plane plane = planes[c];
    if (srgb) SrgbToLinearRow(plane.data(), plane.size(), plane.data());
    plane = Magnify(plane, from.width, from.height, to.width, to.height, reference.pyramid.address,
                    pool);
    if (srgb) LinearToSrgbRow(plane.data(), plane.size(), plane.data());
    result[c] = std::move(plane);
  }
  return result;
}

// As the verifier of a container reads the channels.
std::vector<metrics::QualityMap> QualityMaps(const MaterialReference& reference) {
  std::vector<metrics::QualityMap> maps;
  const TargetChannel* first = nullptr;
  for (const TargetChannel& channel : reference.channels) {
    if (maps.empty() || maps.back().name != channel.map) {
      maps.push_back({channel.map, metrics::MapKind::kData, 0, false});
      first = &channel;
    }
    metrics::QualityMap& map = maps.back();
    ++map.channels;
    if (first->encoding == Encoding::kNormalXy) map.kind = metrics::MapKind::kNormalXy;
    if (map.channels != 3) continue;
    map.kind = first->encoding == Encoding::kSrgb ? metrics::MapKind::kSrgbColor
                                                  : metrics::MapKind::kLinearColor;
    map.flip = map.name == "albedo";
  }
  return maps;
}

void AddLevel(const MaterialReference& reference, int level, const Planes& decoded,
              metrics::QualityMeter& meter, ThreadPool& pool) {
  const TargetLevel& target = reference.pyramid.levels[level];
  Planes expected(reference.channels.size());
  std::vector<metrics::PlanePair> pairs;
  for (size_t c = 0; c < reference.channels.size(); ++c) {
    const TargetChannel& channel = reference.channels[c];
    metrics::PlanePair pair;
    pair.reference_constant = pair.test_constant = channel.constant_value;
    if (!channel.constant) {
      expected[c].resize(static_cast<size_t>(target.width) * target.height);
      pool.ParallelFor(target.height, [&](int y, int) {
        for (int x = 0; x < target.width; ++x) {
          expected[c][static_cast<size_t>(y) * target.width + x] =
              target.At(x, y, channel.learned_index);
        }
      });
      pair.reference = metrics::DensePlane(expected[c].data(), target.width, target.height);
    }
    if (!decoded[c].empty())
      pair.test = metrics::DensePlane(decoded[c].data(), target.width, target.height);
    pairs.push_back(pair);
  }
  meter.AddLevel(target.width, target.height, pairs, pool);
}

}  // namespace

std::vector<PeerTexture> PlanTextures(const MaterialReference& reference) {
  std::vector<PeerTexture> textures;
  PeerTexture pack;
  const auto flush = [&] {
    if (!pack.channels.empty()) textures.push_back(std::exchange(pack, {}));
  };
  for (size_t begin = 0; begin < reference.channels.size();) {
    size_t end = begin;
    bool constant = true;
    PeerTexture own;
    while (end < reference.channels.size() &&
           reference.channels[end].map == reference.channels[begin].map) {
      constant = constant && reference.channels[end].constant;
      own.channels.push_back(static_cast<int>(end++));
    }
    own.normal = reference.channels[begin].encoding == Encoding::kNormalXy;
    const bool single = own.channels.size() == 1;
    const int first = static_cast<int>(begin);
    begin = end;
    if (constant) continue;
    if (!single) {
      textures.push_back(std::move(own));
      continue;
    }
    pack.channels.push_back(first);
    if (pack.channels.size() == 3) flush();
  }
  flush();
  return textures;
}

Rgba8 LoadTexture(const MaterialReference& reference, const PeerTexture& texture, int level) {
  const TargetLevel& target = reference.pyramid.levels[level];
  Rgba8 image(target.width, target.height);
  for (int y = 0; y < target.height; ++y) {
    for (int x = 0; x < target.width; ++x) {
      uint8_t* texel = image.Texel(x, y);
      float values[3] = {0, 0, 0};
      for (size_t c = 0; c < texture.channels.size(); ++c) {
        const Scale scale = ScaleOf(reference.channels[texture.channels[c]]);
        values[c] =
            (ReferenceValue(reference, texture.channels[c], level, x, y) - scale.low) / scale.span;
      }
      if (texture.normal) values[2] = metrics::CodedNormalZ(values[0], values[1]);
      // One channel alone is stored as grey: every codec is at its best there.
      if (texture.channels.size() == 1) values[1] = values[2] = values[0];
      for (int c = 0; c < 3; ++c) texel[c] = ToByte(values[c]);
    }
  }
  return image;
}

Result<PeerResult> MeasurePeer(const MaterialReference& reference, PeerCodec& codec,
                               int first_level, ThreadPool& pool) {
  PeerResult result;
  const auto textures = PlanTextures(reference);
  const int levels = static_cast<int>(reference.pyramid.levels.size());
  const int first = std::min(first_level, levels - 1);
  metrics::QualityMeter meter(QualityMaps(reference));
  for (int level = first; level < levels; ++level) {
    Planes planes(reference.channels.size());
    for (const PeerTexture& texture : textures) {
      const Rgba8 image = LoadTexture(reference, texture, level);
      const auto start = std::chrono::steady_clock::now();
      PATINA_ASSIGN(const CodedLevel coded, codec.RoundTrip(image, texture.normal, pool));
      result.seconds +=
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      result.bytes += coded.bytes;
      StorePlanes(reference, texture, coded.decoded, planes);
    }
    if (level == first) {
      for (int above = 0; above < first; ++above) {
        AddLevel(reference, above, MagnifyAll(reference, planes, first, above, pool), meter, pool);
      }
    }
    AddLevel(reference, level, planes, meter, pool);
  }
  result.quality = meter.Finish();
  return result;
}

}  // namespace patina::bench
