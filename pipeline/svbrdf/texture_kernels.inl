// Included inside a target section, after simd16.h, unroll.h and block_kernels.inl.

namespace patina::PATINA_SIMD {
namespace {

using svbrdf::kRowFloats;
using svbrdf::LevelRows;

// Calls visit(texel of the block, floats before its row) for the texels of a block that the level
// has.
template <class Visit>
PATINA_INLINE void ForTexels(const FeatureLevel& level, int block, const LevelRows& rows,
                             Visit&& visit) {
  const int x0 = block % level.blocks_x * 4, y0 = block / level.blocks_x * 4;
  const int columns = rows.width - x0 < 4 ? rows.width - x0 : 4;
  const int lines = rows.height - y0 < 4 ? rows.height - y0 : 4;
  for (int y = 0; y < lines; ++y) {
    const ptrdiff_t row = static_cast<ptrdiff_t>(y0 + y) * rows.width + x0;
    for (int x = 0; x < columns; ++x) visit(4 * y + x, (row + x) * kRowFloats + rows.column);
  }
}

template <BlockForm kForm>
PATINA_INLINE void DecodeToRows(const FeatureLevel& level, int block, const LevelRows& rows) {
  F16 value[3];
  DecodeTexels<kForm>(level.params.data() + static_cast<size_t>(block) * BlockStride(kForm),
                      kPartitionMasks[level.partition[block]], value);
  alignas(64) float texels[3][16];
  Unroll<3>([&](auto c) PATINA_LAMBDA { Store(texels[c], value[c]); });
  ForTexels(level, block, rows, [&](int texel, ptrdiff_t at) PATINA_LAMBDA {
    for (int c = 0; c < 3; ++c) rows.values[at + c] = texels[c][texel];
  });
}

template <BlockForm kForm>
void DecodeBlocksOf(const FeatureLevel& level, int first, int count, const LevelRows& rows) {
  for (int block = first; block < first + count; ++block) DecodeToRows<kForm>(level, block, rows);
}

void DecodeBlocks(const FeatureLevel& level, BlockForm form, int first, int count,
                  const LevelRows& rows) noexcept {
  if (form == BlockForm::kSegments) {
    DecodeBlocksOf<BlockForm::kSegments>(level, first, count, rows);
  } else {
    DecodeBlocksOf<BlockForm::kFree>(level, first, count, rows);
  }
}

template <BlockForm kForm>
bool UpdateBlocksOf(FeatureLevel* level, const int32_t* blocks, int count, const AdamRates& rates,
                    const LevelRows& rows) {
  F16 check = Zero();
  for (int i = 0; i < count; ++i) {
    const int block = blocks[i];
    alignas(64) float texels[3][16] = {};
    ForTexels(*level, block, rows, [&](int texel, ptrdiff_t at) PATINA_LAMBDA {
      for (int c = 0; c < 3; ++c) {
        texels[c][texel] = rows.gradient[at + c];
        rows.gradient[at + c] = 0;
      }
    });
    F16 by_texel[3], gradient[3];
    Unroll<3>([&](auto c) PATINA_LAMBDA { by_texel[c] = Load(texels[c]); });
    BlockGradient<kForm>(level->params.data() + static_cast<size_t>(block) * BlockStride(kForm),
                         kPartitionMasks[level->partition[block]], by_texel, gradient);
    UpdateBlock<kForm>(level, block, gradient, rates, &check);
    DecodeToRows<kForm>(*level, block, rows);
  }
  return ReduceSum(check) == 0.0f;
}

bool UpdateBlocks(FeatureLevel* level, BlockForm form, const int32_t* blocks, int count,
                  const AdamRates& rates, const LevelRows& rows) noexcept {
  return form == BlockForm::kSegments
             ? UpdateBlocksOf<BlockForm::kSegments>(level, blocks, count, rates, rows)
             : UpdateBlocksOf<BlockForm::kFree>(level, blocks, count, rates, rows);
}

}  // namespace

extern const svbrdf::TextureKernels kTextureKernels;
const svbrdf::TextureKernels kTextureKernels = {DecodeBlocks, UpdateBlocks};

}  // namespace patina::PATINA_SIMD
