#include "pipeline/jobs/block_sizes.h"

#include <algorithm>

namespace patina {
namespace {

constexpr uint64_t kSmallBlock = 8, kLargeBlock = 16;

// Maps that vary, by what formats they take.
struct MapCounts {
  uint64_t colors = 0;    // three channels in [0, 1]
  uint64_t hdr = 0;       // three channels beyond it
  uint64_t normals = 0;   // two channels
  uint64_t channels = 0;  // all others

  bool none() const { return colors + hdr + normals + channels == 0; }
};

MapCounts CountMaps(const Manifest& manifest) {
  MapCounts counts;
  const std::vector<ManifestChannel>& channels = manifest.channels;
  for (size_t begin = 0, end = 0; begin < channels.size(); begin = end) {
    uint64_t size = 0;
    bool varies = false, beyond = false;
    for (end = begin; end < channels.size() && channels[end].map == channels[begin].map; ++end) {
      ++size;
      varies = varies || channels[end].output >= 0;
      beyond = beyond || channels[end].encoding == "signed_log" || channels[end].range_max > 1;
    }
    if (!varies) continue;
    if (channels[begin].encoding == "normal_xy") {
      ++counts.normals;
    } else if (size == 3) {
      ++(beyond ? counts.hdr : counts.colors);
    } else {
      counts.channels += size;
    }
  }
  return counts;
}

}  // namespace

std::vector<TextureBytes> UsualTextures(const Manifest& manifest) {
  const MapCounts maps = CountMaps(manifest);
  if (maps.none()) return {};
  uint64_t blocks = 0, texels = 0;
  const int last = manifest.lod_range ? (*manifest.lod_range)[1] : manifest.source.levels - 1;
  for (int mip = manifest.lod_range ? (*manifest.lod_range)[0] : 0; mip <= last; ++mip) {
    const auto side = [mip](int full) { return static_cast<uint64_t>(std::max(1, full >> mip)); };
    const uint64_t width = side(manifest.source.width), height = side(manifest.source.height);
    blocks += ((width + 3) / 4) * ((height + 3) / 4);
    texels += width * height;
  }
  const auto packed = [&](uint64_t to_a_texture) {
    return (maps.channels + to_a_texture - 1) / to_a_texture;
  };
  const uint64_t others = kLargeBlock * (maps.hdr + maps.normals);
  return {
      {"BC1 colours, BC5 normals, other channels three to a BC1",
       blocks * (others + kSmallBlock * (maps.colors + packed(3)))},
      {"BC1 colours, BC5 normals, BC4 for each other channel",
       blocks * (others + kSmallBlock * (maps.colors + maps.channels))},
      {"BC7 colours, BC5 normals, other channels four to a BC7",
       blocks * (others + kLargeBlock * (maps.colors + packed(4)))},
      {"not compressed, 8 bits a channel",
       texels * (3 * maps.colors + 6 * maps.hdr + 2 * maps.normals + maps.channels)},
  };
}

}  // namespace patina
