// ParseWeights takes any bytes, also with a right checksum; what it accepts survives being written
// and read again.
#include <algorithm>

#include "formats/base/little_endian.h"
#include "formats/half.h"
#include "formats/weights.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

namespace {

bool Same(const WeightBuffer& a, const WeightBuffer& b) {
  return std::equal(a.tensors.begin(), a.tensors.end(), b.tensors.begin(), b.tensors.end(),
                    [](const WeightTensor& x, const WeightTensor& y) {
                      return x.name == y.name && x.shape == y.shape && x.elements == y.elements;
                    });
}

void Try(const std::vector<uint8_t>& bytes) {
  const auto buffer = ParseWeights(bytes);
  if (!buffer) {
    FUZZ_CHECK(!buffer.error().message.empty());
    return;
  }
  for (const WeightTensor& tensor : buffer->tensors) {
    FUZZ_CHECK(std::all_of(tensor.elements.begin(), tensor.elements.end(), HalfIsFinite));
  }
  const auto written = EncodeWeights(*buffer);
  FUZZ_CHECK(written.has_value() && written->size() == bytes.size());
  const auto again = ParseWeights(*written);
  FUZZ_CHECK(again.has_value() && Same(*again, *buffer));
  const auto network = UnpackNetwork(*buffer);
  if (network) FUZZ_CHECK(PackNetwork(*network).has_value());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::vector<uint8_t> bytes(data, data + size);
  Try(bytes);
  if (size < 64) return 0;
  // The checksum, and the size that follows from the file, would stop nearly every mutation.
  StoreLittle64(&bytes[16], size);
  StoreLittle32(&bytes[24], 0);
  StoreLittle32(&bytes[24], Crc32(bytes));
  Try(bytes);
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  NetworkWeights network{12,
                         16,
                         9,
                         std::vector<float>(192, 0.5f),
                         std::vector<float>(16, -1.0f),
                         std::vector<float>(144, 0.25f),
                         std::vector<float>(9, 3.0f)};
  const WeightBuffer other{
      {{"a", {2}, {0x3C00, 0xBC00}}, {"b.c", {1, 2, 1, 3}, {1, 2, 3, 4, 5, 6}}}};
  return {EncodeWeights(*PackNetwork(network)).value(), EncodeWeights(other).value()};
}
