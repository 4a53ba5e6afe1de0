// ParseUtia takes any bytes, and tables of the right size made of them: the bytes, over and over.
#include <algorithm>

#include "formats/brdf/utia.h"
#include "tests/fuzz/brdf_properties.h"

using namespace patina;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  brdf::CheckSource(brdf::ParseUtia({data, size}, "fuzz.bin"));
  if (size == 0) return 0;
  static std::vector<uint8_t> table;
  table.resize(brdf::kUtiaFileBytes);
  const size_t begin = 0;
  // Whole numbers of doubles, so that each of them stands at its place again and again.
  const size_t period = std::max<size_t>(8, size / 8 * 8);
  std::vector<uint8_t> piece(period);
  std::copy_n(data, std::min(size, period), piece.begin());
  for (size_t at = begin; at < table.size(); at += period)
    std::copy_n(piece.data(), std::min(period, table.size() - at), table.data() + at);
  brdf::CheckSource(brdf::ParseUtia(table, "fuzz.bin"));
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  const double values[] = {0.5, 0, -1, 1e-310, 1e30, 2e30, 150, 1e308};
  const auto* bytes = reinterpret_cast<const uint8_t*>(values);
  return {{bytes, bytes + 8}, {bytes + 16, bytes + 24}, {bytes, bytes + sizeof values}};
}
