// BC1 for colour and packed data, BC5 for normals.
#pragma once

#include <cstdint>
#include <string>

#include "tests/bench/peer_textures.h"

namespace patina::bench {

// BC1 by libsquish's iterative cluster fit, its highest quality. BC5 by RoundTripBc4:
// libsquish 1.15 accepts its flag for BC5, but writes blocks that it cannot read back.
class BcCodec : public PeerCodec {
 public:
  std::string name() const override { return "BC1 + BC5"; }
  Result<CodedLevel> RoundTrip(const Rgba8& image, bool normal, ThreadPool& pool) override;
};

// One channel of a block through BC4 (a BC5 block is two of these): the best of both modes,
// endpoints searched from the extremes of the values inwards.
//   in, out: 16 values; out may be in
void RoundTripBc4(const uint8_t in[16], uint8_t out[16]);

}  // namespace patina::bench
