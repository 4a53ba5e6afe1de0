// Any bytes decode as BC6H blocks, signed and unsigned, to the halves that OpenImageIO and the
// decoder for engines give; legal blocks come back from their fields.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <memory>

#include "formats/dds.h"
#include "formats/decoder/patina_decoder.h"
#include "formats/half.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

namespace {

constexpr size_t kMaxBlocks = 8;

// A row of blocks, as their halves: [y][x][3].
std::vector<uint16_t> OfOpenImageIo(const std::vector<uint8_t>& dds, int width) {
  OIIO::Filesystem::IOMemReader memory(const_cast<uint8_t*>(dds.data()), dds.size());
  const auto input = OIIO::ImageInput::open("fuzz.dds", nullptr, &memory);
  FUZZ_CHECK(input != nullptr);
  std::vector<uint16_t> halves(static_cast<size_t>(width) * 4 * 3);
  FUZZ_CHECK(input->read_image(0, 0, 0, 3, OIIO::TypeDesc::HALF, halves.data()) &&
             !input->has_error());
  return halves;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const size_t count = std::min(size / bc6h::kBlockBytes, kMaxBlocks);
  if (count == 0) return 0;
  for (const bc6h::Format format : {bc6h::Format::kUf16, bc6h::Format::kSf16}) {
    std::vector<std::vector<bc6h::Block>> levels(1, std::vector<bc6h::Block>(count));
    for (size_t i = 0; i < count; ++i)
      std::copy_n(data + i * bc6h::kBlockBytes, bc6h::kBlockBytes, levels[0][i].begin());
    const int width = static_cast<int>(4 * count);
    const auto dds = EncodeDds(format, width, 4, levels);
    FUZZ_CHECK(dds.has_value());
    const std::vector<uint16_t> theirs = OfOpenImageIo(*dds, width);
    for (size_t i = 0; i < count; ++i) {
      const uint8_t* block = data + i * bc6h::kBlockBytes;
      uint16_t ours[16][3];
      bc6h::Decode(block, format, ours);
      uint16_t runtime[16][3];
      decoder_detail::DecodeBc6h(block, format == bc6h::Format::kSf16, runtime);
      for (int t = 0; t < 16; ++t) {
        for (int c = 0; c < 3; ++c) {
          FUZZ_CHECK(HalfIsFinite(ours[t][c]));
          FUZZ_CHECK(ours[t][c] == runtime[t][c]);
          FUZZ_CHECK(ours[t][c] ==
                     theirs[(static_cast<size_t>(t / 4) * width + 4 * i + t % 4) * 3 + c]);
        }
      }
      if (auto fields = bc6h::Unpack(block, format)) {
        // Bits that the indices' anchors leave out make every block that unpacks one that packs, to
        // the same bits.
        const auto packed = bc6h::Pack(*fields, format);
        FUZZ_CHECK(packed.has_value() && std::equal(packed->begin(), packed->end(), block));
      }
    }
  }
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  // Every mode with codes that vary.
  std::vector<std::vector<uint8_t>> seeds;
  for (int mode = 0; mode < bc6h::kModeCount; ++mode) {
    bc6h::BlockFields fields;
    fields.mode = mode;
    fields.partition = bc6h::Mode(mode).regions == 2 ? 2 * mode : 0;
    for (int e = 0; e < 2 * bc6h::Mode(mode).regions; ++e) {
      for (int c = 0; c < 3; ++c) fields.endpoints[e][c] = 20 + (e + c) % 4;
    }
    for (int t = 0; t < 16; ++t) fields.indices[t] = static_cast<uint8_t>(t % 4);
    const bc6h::Block block = bc6h::Pack(fields, bc6h::Format::kUf16).value();
    seeds.emplace_back(block.begin(), block.end());
  }
  return seeds;
}
