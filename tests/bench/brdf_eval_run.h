// An evaluation from files to files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina::bench {

struct EvalOptions {
  std::string tables;             // a folder of BRDF files, or one of them
  std::string truth;              // a table that all are measured against; empty: each its own
  std::vector<std::string> envs;  // latitude-longitude maps; empty: a procedural studio
  std::vector<std::string> only;  // materials by file name without extension; empty: all
  std::vector<std::string> systems = {"default"};
  std::vector<uint64_t> seeds = {
      1};  // for the systems that depend on one; the others take the first
  int side = 256;
  // Texels of a map's longest row; columns / 2 rows of them (ReduceEnvironmentEvenly).
  int map_columns = 96;
  std::string nbrdf;  // published networks (nbrdf_networks.py); needed for the system nbrdf
  std::string out = "out/brdf_eval";
  int threads = 0;  // 0: one a CPU
};

// Writes OUT/rows.csv, a line for each material, system, seed and environment, as they are done;
// lines that are there already are not measured again. Then OUT/summary.csv and OUT/table.md, of
// the lines that the options ask for. Progress goes to stderr. Errors name the file and the remedy.
Status RunEvaluation(const EvalOptions& options);

}  // namespace patina::bench
