// What a sweep leaves behind for people and programs.
#pragma once

#include <string>
#include <vector>

#include "pipeline/tradeoff/sweep.h"

namespace patina {

// One line for each row, a head line first: asset (empty of a mean), kind, variant, quality_db,
// encode_s, encode_cpu_s, bytes, decode_ns, on the three fronts or not, problem.
std::string SweepCsv(const std::vector<SweepRow>& rows, const std::vector<SweepRow>& means);

// {version, cpu, threads, rows[], means[]}; see schemas/tradeoff.schema.json.
std::string SweepJson(const std::vector<SweepRow>& rows, const std::vector<SweepRow>& means);

// A page with three plots for each kind (quality against encode time, bytes and decode time, with
// their fronts) and tables.
std::string SweepPage(const std::vector<SweepRow>& rows, const std::vector<SweepRow>& means);

}  // namespace patina
