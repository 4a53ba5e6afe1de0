// Quality of neural BRDFs and of their peers over a folder of tables, by the frozen protocol: a
// sphere of radius 0.5 seen from (0, 0, -2) with 30 degrees field of view, 256 x 256 pixels,
// exposure 2, lit by whole environment maps (reduced to texels of equal area, deterministic). What
// is measured stands in brdf_eval_measures.h, the systems in brdf_eval_systems.h.
//
// usage: patina_brdf_eval --tables DIR|FILE [--env MAP,...] [--systems NAME,...] [--seeds N,...]
//          [--only MATERIAL,...] [--truth FILE] [--nbrdf FILE] [--side N] [--map-columns N]
//          [--out DIR] [--threads N]
//
// --env may be given several times; without it a procedural studio lights the sphere. --variants is
// another name of --systems. DIR/rows.csv is extended by what it lacks, so that an interrupted run
// goes on; DIR/table.md and DIR/summary.csv are written at the end.
//
// --map-columns: the texels of a map's longest row, on a sphere of 2 / pi times columns^2 / 2
// texels; 96 if not given. What it costs and changes, measured on 64^2 pixels under four light
// probes, MAE sRGB of the default model / of published NBRDF:
//
//   columns   chrome            alum-bronze       blue-fabric
//   32        .00359 / .0180    .00149 / .0114    .00059 / .00343
//   64        .00380 / .0228    .00128 / .0114    .00051 / .00340
//   96        .00444 / .0260    .00121 / .0116    .00050 / .00341
//   128       .00436 / .0265    .00114 / .0115    .00049 / .00340
//   256       .00382 / .0273    .00105 / .0115    .00049 / .00341
//
// Against 256 columns, 96 are right within 2 % for matte materials and within 5 % for the peer; of
// lobes narrower than a texel, which have no converged image at any of these sizes, they overstate
// small errors by 15 %. 128 columns take 1.8 times as long.
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "tests/bench/brdf_eval_run.h"
#include "tests/bench/brdf_eval_systems.h"

namespace patina::bench {
namespace {

void AddWords(std::string_view text, std::vector<std::string>* words) {
  while (!text.empty()) {
    const size_t comma = std::min(text.find(','), text.size());
    if (comma > 0) words->emplace_back(text.substr(0, comma));
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
}

template <class T>
bool ParseNumber(const std::string& text, T min, T max, T* value) {
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, *value);
  return parsed.ec == std::errc() && parsed.ptr == end && *value >= min && *value <= max;
}

bool ParseSeeds(const std::string& text, std::vector<uint64_t>* seeds) {
  std::vector<std::string> words;
  AddWords(text, &words);
  seeds->clear();
  for (const std::string& word : words) {
    uint64_t seed = 0;
    if (!ParseNumber<uint64_t>(word, 0, UINT64_MAX, &seed)) return false;
    seeds->push_back(seed);
  }
  return !seeds->empty();
}

// False for an unknown option or a value that is none.
bool TakeOption(const std::string& option, const std::string& value, EvalOptions* options) {
  const auto words = [&](std::vector<std::string>* list) {
    list->clear();
    AddWords(value, list);
    return !list->empty();
  };
  if (option == "--tables")
    options->tables = value;
  else if (option == "--truth")
    options->truth = value;
  else if (option == "--nbrdf")
    options->nbrdf = value;
  else if (option == "--out")
    options->out = value;
  else if (option == "--env")
    AddWords(value, &options->envs);
  else if (option == "--only")
    return words(&options->only);
  else if (option == "--systems" || option == "--variants")
    return words(&options->systems);
  else if (option == "--seeds")
    return ParseSeeds(value, &options->seeds);
  else if (option == "--side")
    return ParseNumber(value, 16, 4096, &options->side);
  else if (option == "--threads")
    return ParseNumber(value, 0, 256, &options->threads);
  else if (option == "--map-columns")
    return ParseNumber(value, 8, 1024, &options->map_columns) && options->map_columns % 2 == 0;
  else
    return false;
  return true;
}

int Usage() {
  std::fprintf(stderr,
               "usage: patina_brdf_eval --tables DIR|FILE [--env MAP,...] [--systems NAME,...] "
               "[--seeds N,...] [--only MATERIAL,...] [--truth FILE] [--nbrdf FILE] [--side N] "
               "[--map-columns N] [--out DIR] [--threads N]\nsystems:");
  for (const std::string& name : SystemNames()) std::fprintf(stderr, " %s", name.c_str());
  std::fprintf(stderr, "\n");
  return 2;
}

}  // namespace
}  // namespace patina::bench

int main(int argc, char** argv) {
  patina::bench::EvalOptions options;
  for (int i = 1; i < argc; i += 2) {
    if (i + 1 == argc || !patina::bench::TakeOption(argv[i], argv[i + 1], &options)) {
      std::fprintf(stderr, "patina_brdf_eval: %s: no such option, or not its value\n", argv[i]);
      return patina::bench::Usage();
    }
  }
  if (options.tables.empty()) return patina::bench::Usage();
  const patina::Status status = patina::bench::RunEvaluation(options);
  if (status) return 0;
  std::fprintf(stderr, "patina_brdf_eval: %s\n", status.error().message.c_str());
  return 1;
}
