// Sampler tables: any bytes, also with a right checksum; what is accepted is written the same, and
// samples are unit vectors with the density that the table says.
#include <cmath>

#include "formats/base/little_endian.h"
#include "formats/brdf_sampler.h"
#include "formats/weights.h"
#include "tests/formats/sample_brdf.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

namespace {

void Try(const std::vector<uint8_t>& bytes) {
  const auto tables = ParseBrdfSampler(bytes);
  if (!tables) {
    FUZZ_CHECK(!tables.error().message.empty());
    return;
  }
  const auto written = EncodeBrdfSampler(*tables);
  FUZZ_CHECK(written.has_value() && *written == bytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::vector<uint8_t> bytes(data, data + size);
  Try(bytes);
  if (size < 32) return 0;
  StoreLittle32(&bytes[16], static_cast<uint32_t>(size));
  StoreLittle32(&bytes[24], 0);
  StoreLittle32(&bytes[24], Crc32(bytes));
  Try(bytes);
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  test::Random random(1);
  const std::vector<std::vector<uint8_t>> seeds = {
      EncodeBrdfSampler(test::RandomTables(random, 2, 4, 4, true)).value(),
      EncodeBrdfSampler(test::RandomTables(random, 4, 8, 8, false)).value()};
  for (const auto& seed : seeds) FUZZ_CHECK(ParseBrdfSampler(seed).has_value());
  return seeds;
}
