// ParseMerl takes any bytes, and tables of the right size made of them: a header and then the
// bytes, over and over.
#include <algorithm>

#include "formats/base/little_endian.h"
#include "formats/brdf/merl.h"
#include "tests/fuzz/brdf_properties.h"

using namespace patina;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  brdf::CheckSource(brdf::ParseMerl({data, size}, "fuzz.binary"));
  if (size == 0) return 0;
  static std::vector<uint8_t> table;
  table.resize(brdf::kMerlFileBytes);
  const uint32_t sides[3] = {brdf::kMerlThetaH, brdf::kMerlThetaD, brdf::kMerlPhiD};
  for (int i = 0; i < 3; ++i) StoreLittle32(&table[4 * i], sides[i]);
  const size_t begin = brdf::kMerlHeaderBytes;
  // Whole numbers of doubles, so that each of them stands at its place again and again.
  const size_t period = std::max<size_t>(8, size / 8 * 8);
  std::vector<uint8_t> piece(period);
  std::copy_n(data, std::min(size, period), piece.begin());
  for (size_t at = begin; at < table.size(); at += period)
    std::copy_n(piece.data(), std::min(period, table.size() - at), table.data() + at);
  brdf::CheckSource(brdf::ParseMerl(table, "fuzz.binary"));
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  const double values[] = {0.5, 0, -1, 1e-310, 1e30, 2e30, 150, 1e308};
  const auto* bytes = reinterpret_cast<const uint8_t*>(values);
  return {{bytes, bytes + 8}, {bytes + 16, bytes + 24}, {bytes, bytes + sizeof values}};
}
