// Index packs and codebooks: any bytes, also with a right checksum; what is accepted survives being
// written and read again, and expands to finite features.
#include <algorithm>
#include <cmath>

#include "formats/base/little_endian.h"
#include "formats/half.h"
#include "formats/index_pack.h"
#include "formats/weights.h"
#include "tests/formats/sample_brdf.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

namespace {

void TryPack(const std::vector<uint8_t>& bytes) {
  const auto pack = ParseIndexPack(bytes);
  if (!pack) {
    FUZZ_CHECK(!pack.error().message.empty());
    return;
  }
  const auto written = EncodeIndexPack(*pack);
  FUZZ_CHECK(written.has_value());
  const auto again = ParseIndexPack(*written);
  FUZZ_CHECK(again.has_value() && again->indices == pack->indices &&
             again->codebook == pack->codebook && again->codebook_file == pack->codebook_file);
  if (pack->codebook.empty() || pack->nside > 32) return;
  const auto features = ExpandCorners(*pack, {pack->primitive_size, pack->codebook});
  if (!features) return;
  // Means of halves stay below the largest half.
  FUZZ_CHECK(std::all_of(features->begin(), features->end(),
                         [](float f) { return std::abs(f) <= kMaxHalf; }));
}

void TryCodebook(const std::vector<uint8_t>& bytes) {
  const auto codebook = ParseCodebook(bytes);
  if (!codebook) {
    FUZZ_CHECK(!codebook.error().message.empty());
    return;
  }
  FUZZ_CHECK(std::all_of(codebook->halves.begin(), codebook->halves.end(), HalfIsFinite));
  const auto written = EncodeCodebook(*codebook);
  FUZZ_CHECK(written.has_value() && ParseCodebook(*written)->halves == codebook->halves);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  std::vector<uint8_t> bytes(data, data + size);
  TryPack(bytes);
  TryCodebook(bytes);
  if (size < 64) return 0;
  // The size and the checksum would stop nearly every mutation.
  StoreLittle32(&bytes[16], static_cast<uint32_t>(size));
  StoreLittle32(&bytes[24], 0);
  StoreLittle32(&bytes[24], Crc32(bytes));
  TryPack(bytes);
  TryCodebook(bytes);
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  test::Random random(1);
  std::vector<std::vector<uint8_t>> seeds;
  test::PackOptions options;
  options.nside = 2;
  options.entries = 5;
  options.index_bits = 3;
  IndexPack pack = test::RandomPack(random, options);
  seeds.push_back(EncodeIndexPack(pack).value());
  seeds.push_back(EncodeIndexPack(pack, 3).value());
  seeds.push_back(EncodeCodebook({pack.primitive_size, pack.codebook}).value());
  seeds.push_back(EncodeCodebook({pack.primitive_size, pack.codebook}, 3).value());
  pack.codebook.clear();
  pack.codebook_file = "shared.hpc";
  pack.codebook_sha256 = std::string(64, 'a');
  seeds.push_back(EncodeIndexPack(pack).value());
  for (const auto& seed : seeds)
    FUZZ_CHECK(ParseIndexPack(seed).has_value() || ParseCodebook(seed).has_value());
  return seeds;
}
