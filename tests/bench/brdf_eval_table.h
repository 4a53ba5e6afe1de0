// The rows of an evaluation of BRDF models, as CSV and as Markdown.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace patina::bench {

// What is measured; see brdf_eval_measures.h.
enum Column : int {
  kMae,  // of the image, linear, over the sphere's pixels
  kRmse,
  kMaeSrgb,
  kRmseSrgb,
  kMaeFrame,  // over the whole frame
  kRmseFrame,
  kMaeSrgbFrame,
  kRmseSrgbFrame,
  kSsim,
  kLog1pMseTable,
  kLog1pMseDirections,
  kLog1pMaeDirections,
  kGhostMax,
  kGhostMean,
  kPeak,
  kReciprocity,
  kAlbedo0,
  kAlbedo30,
  kAlbedo60,
  kAlbedo80,
  kAlbedo89,
  kTrueAlbedo0,
  kTrueAlbedo30,
  kTrueAlbedo60,
  kTrueAlbedo80,
  kTrueAlbedo89,
  kAlbedoError,
  kAlbedoAboveOne,
  kTrueAlbedoAboveOne,
  kMinimum,
  kFinite,
  kGrazingRatio,
  kBytes,
  kTrainSeconds,
  kNanoseconds,
  kTimesTable,
  kColumnCount
};
using Values = std::array<double, kColumnCount>;

struct Row {
  std::string material, system;
  uint64_t seed = 0;
  std::string env;
  int side = 0, map_columns = 0;
  Values values{};  // NaN: not measured, an empty field
};

std::string CsvHeader();              // without the end of the line
std::string CsvLine(const Row& row);  // likewise; names must be free of commas and line ends

// Rows of a CSV file's text, whatever their order. An incomplete last line, of a run that was
// stopped, is left out: *good_bytes is where to go on writing. Errors: kCorruptData (another
// header, a line that does not parse), with `name` and the line.
Result<std::vector<Row>> ParseCsv(std::string_view text, const std::string& name,
                                  size_t* good_bytes);

// Statistics over materials of the means over seeds.
struct Statistics {
  std::string system, env;  // "mean": over the environments of each material
  int materials = 0, runs = 0;
  Values mean{}, deviation{};  // standard deviation over materials, n - 1
  Values worst{};              // by the column's own direction
  std::array<std::string, kColumnCount> worst_material;
  Values seed_deviation{};  // mean over materials of the deviation over seeds; NaN for one seed
};

// In the order of `systems`; for each, the environments in order of first appearance, then "mean"
// if there are several.
std::vector<Statistics> Summarize(std::span<const Row> rows, std::span<const std::string> systems);

// One line for each system, environment and statistic (mean, std, worst, worst_material, seed_std).
std::string SummaryCsv(std::span<const Statistics> statistics);
// Tables for a person.
std::string SummaryMarkdown(std::span<const Statistics> statistics);

}  // namespace patina::bench
