// ASTC by the program `astcenc`.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "tests/bench/peer_textures.h"

namespace patina::bench {

struct AstcBlock {
  int width = 12;
  int height = 12;
};

class AstcCodec : public PeerCodec {
 public:
  // quality: "fast", "medium", "thorough", ...; scratch: an existing folder for two files.
  AstcCodec(AstcBlock block, std::string quality, std::string scratch)
      : block_(block), quality_(std::move(quality)), scratch_(std::move(scratch)) {}
  std::string name() const override;
  // Errors: kNotFound (no astcenc), kInternal (it failed), and those of reading its output.
  Result<CodedLevel> RoundTrip(const Rgba8& image, bool normal, ThreadPool& pool) override;

 private:
  AstcBlock block_;
  std::string quality_;
  std::string scratch_;
};

// The block size whose textures come nearest to `bytes`, all mips of the reference counted.
AstcBlock NearestAstcBlock(const MaterialReference& reference, uint64_t bytes);

}  // namespace patina::bench
