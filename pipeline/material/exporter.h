// Makes the trained features legal BC6H without losing what was learned: the sensitivity-weighted re-encode.
//
// For one texture after another, so that a later one absorbs the error of the earlier: per texel of each level, J^T r and
// J^T J of the loss; the wanted value is a damped Newton step from the current one, and each block is encoded for the least
// weighted error with the exact integer decode. A level above 0 decides one mip alone: there a pass that made the true error
// larger is undone.
#pragma once

#include <array>
#include <vector>

#include "formats/bc6h.h"
#include "pipeline/bc6/block_encoder.h"
#include "pipeline/material/trainer.h"

namespace patina {

class Exporter {
 public:
  // Works on trainer's store (form kSegments) and network. All must outlive the exporter.
  Exporter(Trainer* trainer, const ModelShape& shape, FeatureStore* store, ThreadPool& pool);

  // Re-encodes all blocks with free choice of mode and partition; the store's parameters become those of the legal blocks
  // and the optimiser's state is reset. After it fields() and blocks() are valid.
  void Encode(bc6::Effort effort);
  // The same with mode and partition kept, for levels first_level and up. Needs a preceding Encode.
  void Refine(int first_level);
  // The paper's export: 6-bit absolute endpoints and 3-bit indices, each rounded to the nearest; mode 0x1E only.
  void EncodeSixBit();

  // Legal blocks of the last pass, [texture][level][block].
  std::array<std::vector<std::vector<bc6h::Block>>, kFeatureTextures> TakeBlocks();
  // Exactly what a decoder gives for the last pass, as a store of form kFree.
  void DecodeTo(FeatureStore* free_store) const;

  // The last word on levels of 1 and above with few blocks, whose mips are exact enough to feel every code and every rounded
  // weight: rounds of encoding and refining in turn, judged by the values of a decoder and the network that is written.
  // `exact` trains on `decoded`, which is what DecodeTo gave; both stay in step with the blocks.
  void Polish(int rounds, Trainer* exact, FeatureStore* decoded);

 private:
  static constexpr int kPolishedBlocks = 256;

  using LevelFields = std::vector<bc6h::BlockFields>;
  struct LevelState {
    LevelFields fields;
    std::vector<bc6h::Block> blocks;
    std::vector<float> params;
    std::vector<uint8_t> partition;
  };
  LevelState SaveLevel(int texture, int level) const;
  void RestoreLevel(int texture, int level, const LevelState& state);
  void DecodeLevel(int texture, int level, FeatureStore* free_store) const;
  template <class EncodeBlock>
  void PassTexture(int texture, int first_level, bool guarded_pass, EncodeBlock&& encode);
  void StoreEncoded(const bc6::EncodedBlock& encoded, int texture, int level, int block);

  Trainer* trainer_;
  const ModelShape& shape_;
  FeatureStore* store_;
  ThreadPool& pool_;
  std::array<std::vector<LevelFields>, kFeatureTextures> fields_;
  std::array<std::vector<std::vector<bc6h::Block>>, kFeatureTextures> blocks_;
};

}  // namespace patina
