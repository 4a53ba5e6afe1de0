// How an engine without neural materials stores the maps of a set: as 8-bit textures, each
// compressed by itself.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/material/target_pyramid.h"
#include "pipeline/metrics/quality.h"

namespace patina::bench {

// Interleaved RGBA, rows from the top, no padding.
struct Rgba8 {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> texels;

  Rgba8() = default;
  Rgba8(int w, int h) : width(w), height(h), texels(static_cast<size_t>(w) * h * 4, 255) {}
  uint8_t* Texel(int x, int y) { return texels.data() + (static_cast<size_t>(y) * width + x) * 4; }
  const uint8_t* Texel(int x, int y) const {
    return texels.data() + (static_cast<size_t>(y) * width + x) * 4;
  }
};

// One texture: the channels (indices into MaterialReference::channels) in R, G, B.
struct PeerTexture {
  std::vector<int> channels;  // one to three; two for a normal map
  bool normal = false;        // R and G are x and y, B is z
};

// A colour map has a texture, a normal map too; the other channels are packed by three in their
// order. A map that is constant needs no texture.
std::vector<PeerTexture> PlanTextures(const MaterialReference& reference);

// One level of a texture in 8 bits: coded values in [0, 1], rounded; channels with another range
// are scaled by it.
Rgba8 LoadTexture(const MaterialReference& reference, const PeerTexture& texture, int level);

// What came back from a codec for one level of one texture.
struct CodedLevel {
  Rgba8 decoded;
  uint64_t bytes = 0;
};

class PeerCodec {
 public:
  virtual ~PeerCodec() = default;
  virtual std::string name() const = 0;
  // Compresses and decompresses. Errors: those of the program behind it.
  virtual Result<CodedLevel> RoundTrip(const Rgba8& image, bool normal, ThreadPool& pool) = 0;
};

struct PeerResult {
  uint64_t bytes = 0;  // all textures, all mips
  double seconds = 0;  // encoding and decoding
  metrics::QualityResult quality;
};

// Encodes the mips of all textures from `first_level` on and measures what a sampler sees, with the
// same reference and the same meter as a container of ours. Levels above the first are magnified
// bilinearly, colours in linear light.
Result<PeerResult> MeasurePeer(const MaterialReference& reference, PeerCodec& codec,
                               int first_level, ThreadPool& pool);

}  // namespace patina::bench
