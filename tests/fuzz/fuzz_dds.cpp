// ParseDds takes any bytes; what it accepts decodes, and survives being written and read again.
#include "formats/dds.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto texture = ParseDds({data, size});
  if (!texture) {
    FUZZ_CHECK(!texture.error().message.empty());
    return 0;
  }
  for (int level = 0; level < texture->level_count(); ++level) {
    const size_t texels = DecodeDdsLevel(*texture, level).size();
    FUZZ_CHECK(texels == size_t{3} * DdsLevelSide(texture->width, level) *
                             DdsLevelSide(texture->height, level));
  }
  const auto bytes = EncodeDds(*texture);
  FUZZ_CHECK(bytes.has_value() && bytes->size() == size);
  const auto again = ParseDds(*bytes);
  FUZZ_CHECK(again.has_value() && again->levels == texture->levels &&
             again->halves == texture->halves);
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  std::vector<std::vector<uint8_t>> seeds;
  const int sizes[][3] = {{1, 1, 1}, {9, 5, 4}, {16, 16, 5}, {64, 3, 2}};
  uint8_t value = 0;
  for (const auto& [width, height, count] : sizes) {
    std::vector<std::vector<bc6h::Block>> levels(static_cast<size_t>(count));
    for (int level = 0; level < count; ++level) {
      levels[level].resize(static_cast<size_t>(DdsBlocks(DdsLevelSide(width, level))) *
                           DdsBlocks(DdsLevelSide(height, level)));
      for (auto& block : levels[level]) {
        for (auto& byte : block) byte = value = static_cast<uint8_t>(value * 5 + 113);
      }
    }
    const auto format = count % 2 == 0 ? bc6h::Format::kUf16 : bc6h::Format::kSf16;
    seeds.push_back(EncodeDds(format, width, height, levels).value());
    std::vector<std::vector<uint16_t>> halves(static_cast<size_t>(count));
    for (int level = 0; level < count; ++level) {
      halves[level].resize(size_t{3} * static_cast<size_t>(DdsLevelSide(width, level)) *
                           static_cast<size_t>(DdsLevelSide(height, level)));
      for (uint16_t& half : halves[level]) {
        value = static_cast<uint8_t>(value * 5 + 113);
        half = static_cast<uint16_t>(value << 8 | value);
      }
    }
    seeds.push_back(EncodeHalvesDds(width, height, halves).value());
  }
  return seeds;
}
