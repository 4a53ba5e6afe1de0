// Job files, bodies of submissions' jobs and lists of pairs: any text. A job that is accepted is
// written as one that is accepted, with the same meaning.
#include <string>
#include <string_view>

#include "pipeline/jobs/eval_pairs.h"
#include "pipeline/jobs/job.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto job = ParseJob(text, "", "job.json");
  if (job) {
    const std::string written = JobToJson(*job);
    const auto again = ParseJob(written, "", "job.json");
    FUZZ_CHECK(again.has_value() && JobToJson(*again) == written &&
               CanonicalJob(*again) == CanonicalJob(*job));
  } else {
    FUZZ_CHECK(!job.error().message.empty() && job.error().code != ErrorCode::kInternal);
  }
  for (const PairColumns columns : {PairColumns::kDirections, PairColumns::kPlaces}) {
    const auto pairs = ParsePairs(text, columns, "pairs.csv");
    FUZZ_CHECK(pairs.has_value() || !pairs.error().message.empty());
  }
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  const std::string texts[] = {
      R"({"version": 1, "kind": "material", "asset": "a", "folder": "f", "out": "o"})",
      R"({"version": 1, "kind": "material", "asset": "a", "out": "o", "maps": [{"role": "albedo", "file": "a.png",
          "color_space": "srgb"}, {"role": "normal", "file": "n.png", "convention": "directx"},
          {"role": "roughness", "file": "g.png", "channels": "g", "invert": true}], "profile": "bcf-2k",
          "quality": "reference", "seed": 7, "threads": 2, "target_psnr_db": 36.5, "address": "clamp"})",
      R"({"version": 1, "kind": "brdf", "asset": "a", "file": "f.binary", "out": "o", "model": {"nside": 8}})",
      "0,0,1,0.6,0,0.8\n# note\n0.6,0,0.8,0,0,1\n",
      "wix,wiy,wiz,wox,woy,woz,u,v,level\n0,0,1,0.6,0,0.8,0.25,-3,1.5\n"};
  return SeedsOf(texts, [](std::string_view text) {
    return ParseJob(text, "", "seed").has_value() ||
           ParsePairs(text, PairColumns::kDirections, "seed").has_value() ||
           ParsePairs(text, PairColumns::kPlaces, "seed").has_value();
  });
}
