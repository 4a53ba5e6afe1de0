#include "pipeline/jobs/eval_pairs.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/container.h"
#include "pipeline/jobs/load_brdf_decoder.h"
#include "pipeline/jobs/load_svbrdf_decoder.h"

namespace patina {
namespace {

constexpr std::string_view kNames[] = {"wix", "wiy", "wiz", "wox", "woy", "woz", "u", "v", "level"};
constexpr size_t kMostColumns = std::size(kNames);
constexpr size_t kOfDirections = 6, kOfPlaces = 8;
constexpr double kLengthTolerance = 1e-3;

std::string_view Trimmed(std::string_view text) {
  constexpr const char* kBlank = " \t\r";
  const size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string_view> Fields(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const size_t comma = line.find(',');
    fields.push_back(Trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos || fields.size() > kMostColumns) return fields;
    line.remove_prefix(comma + 1);
  }
}

bool IsHeader(const std::vector<std::string_view>& fields) {
  return std::equal(fields.begin(), fields.end(), kNames,
                    kNames + std::min(fields.size(), kMostColumns));
}

// Normalises; false if the length is not near 1.
bool UnitVector(const double in[3], float out[3]) {
  const double length = std::sqrt(in[0] * in[0] + in[1] * in[1] + in[2] * in[2]);
  if (!(std::abs(length - 1) <= kLengthTolerance)) return false;
  for (int d = 0; d < 3; ++d) out[d] = static_cast<float>(in[d] / length);
  return true;
}

// What is wrong with the number of a line's values; empty if nothing.
std::string CountProblem(size_t count, PairColumns columns) {
  const std::string names = "wix,wiy,wiz,wox,woy,woz";
  const std::string given =
      count > kMostColumns ? "more than nine values" : std::to_string(count) + " values";
  if (columns == PairColumns::kDirections) {
    if (count == kOfDirections) return "";
    const bool places = count == kOfPlaces || count == kMostColumns;
    return given + "; a line is " + names +
           (places ? ", as this BRDF is the same at every place: leave out u, v and level" : "");
  }
  if (count == kOfPlaces || count == kMostColumns) return "";
  return given + "; this BRDF varies over its texture, and a line is " + names + ",u,v or " +
         names + ",u,v,level" +
         (count == kOfDirections ? ": add the columns u and v, texture coordinates" : "");
}

// What is wrong with a line; empty if nothing.
std::string ReadPair(const std::vector<std::string_view>& fields, DirectionPair* pair) {
  double values[kMostColumns] = {};
  for (size_t i = 0; i < fields.size(); ++i) {
    const char* end = fields[i].data() + fields[i].size();
    const auto [rest, error] = std::from_chars(fields[i].data(), end, values[i]);
    if (error != std::errc() || rest != end || !std::isfinite(values[i])) {
      return std::string(kNames[i]) + " is " + QuoteForMessage(fields[i]) +
             ", which is not a number";
    }
  }
  if (!UnitVector(values, pair->wi) || !UnitVector(values + 3, pair->wo))
    return "not two unit vectors; divide each by its length";
  pair->u = values[6];
  pair->v = values[7];
  pair->level = values[8];
  return "";
}

// A line for each pair, by a function that fills rgb.
template <class Evaluate>
std::string Lines(const std::vector<DirectionPair>& pairs, const Evaluate& evaluate) {
  std::string lines;
  for (const DirectionPair& pair : pairs) {
    float rgb[3];
    evaluate(pair, rgb);
    char line[80];
    std::snprintf(line, sizeof line, "%.9g,%.9g,%.9g\n", static_cast<double>(rgb[0]),
                  static_cast<double>(rgb[1]), static_cast<double>(rgb[2]));
    lines += line;
  }
  return lines;
}

Result<std::vector<DirectionPair>> ReadPairs(const std::string& file, PairColumns columns) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(file, kMaxPairsBytes));
  return ParsePairs(text, columns, file);
}

}  // namespace

Result<std::vector<DirectionPair>> ParsePairs(std::string_view text, PairColumns columns,
                                              const std::string& name) {
  std::vector<DirectionPair> pairs;
  size_t count = 0;  // values of the first line
  for (size_t number = 1; !text.empty(); ++number) {
    const size_t end = text.find('\n');
    const std::string_view line = Trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line[0] == '#') continue;
    const std::vector<std::string_view> fields = Fields(line);
    const bool first = count == 0;
    if (first) count = fields.size();
    std::string problem = CountProblem(fields.size(), columns);
    if (problem.empty() && fields.size() != count) {
      problem = std::to_string(fields.size()) + " values, and the first line has " +
                std::to_string(count) + "; give all lines a level, or none";
    }
    if (problem.empty() && first && IsHeader(fields)) continue;
    DirectionPair pair;
    if (problem.empty()) problem = ReadPair(fields, &pair);
    if (!problem.empty()) {
      return Fail(ErrorCode::kInvalidArgument,
                  name + ": line " + std::to_string(number) + ": " + problem);
    }
    pairs.push_back(pair);
  }
  return pairs;
}

Result<std::string> EvaluatePairsFile(const std::string& container, const std::string& pairs_file) {
  PATINA_ASSIGN(const Container opened, OpenContainer(container));
  if (opened.manifest.kind != "brdf" && opened.manifest.kind != "svbrdf") {
    return Fail(ErrorCode::kUnsupported,
                opened.directory +
                    ": holds a material, which has maps and no pairs of directions; "
                    "`patina unpack` writes its maps");
  }
  PATINA_TRY(VerifyPayloads(opened));
  if (opened.manifest.kind == "svbrdf") {
    PATINA_ASSIGN(const SvbrdfDecoder decoder, LoadSvbrdfDecoder(opened.directory));
    PATINA_ASSIGN(const auto pairs, ReadPairs(pairs_file, PairColumns::kPlaces));
    return Lines(pairs, [&decoder](const DirectionPair& pair, float rgb[3]) {
      decoder.Evaluate(pair.wi, pair.wo, pair.u, pair.v, pair.level, rgb);
    });
  }
  PATINA_ASSIGN(const BrdfDecoder decoder, LoadBrdfDecoder(opened.directory));
  PATINA_ASSIGN(const auto pairs, ReadPairs(pairs_file, PairColumns::kDirections));
  return Lines(pairs, [&decoder](const DirectionPair& pair, float rgb[3]) {
    decoder.Evaluate(pair.wi, pair.wo, rgb);
  });
}

}  // namespace patina
