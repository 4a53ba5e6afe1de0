// Sparse lists as CSV and as JSON: any text; what is accepted holds usable samples only.
#include <string>
#include <string_view>
#include <utility>

#include "formats/brdf/sparse.h"
#include "formats/brdf/write_brdf.h"
#include "tests/fuzz/brdf_properties.h"

using namespace patina;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  brdf::CheckSource(brdf::ParseSparseCsv(text, "fuzz.csv"));
  brdf::CheckSource(brdf::ParseSparseJson(text, "fuzz.json"));
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  const std::pair<brdf::Direction, brdf::Direction> pairs[] = {
      {brdf::FromDegrees(10, 0), brdf::FromDegrees(50, 120)},
      {brdf::FromDegrees(89, 3), brdf::FromDegrees(0, 0)}};
  const std::string texts[] = {brdf::EncodeSparseCsv(brdf::SmoothBrdf, pairs, true),
                               brdf::EncodeSparseCsv(brdf::SkewBrdf, pairs, false),
                               brdf::EncodeSparseJson(brdf::SmoothBrdf, pairs, false),
                               "theta_i, phi_i, theta_o, phi_o, r, g, b, weight\n# "
                               "note\n10,0,50,120,1,2,3,0.5\n\n"};
  return SeedsOf(texts, [](std::string_view text) {
    return brdf::ParseSparseCsv(text, "seed").has_value() ||
           brdf::ParseSparseJson(text, "seed").has_value();
  });
}
