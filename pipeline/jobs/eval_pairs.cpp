#include "pipeline/jobs/eval_pairs.h"

#include <charconv>
#include <cmath>
#include <cstdio>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/container.h"
#include "pipeline/jobs/load_brdf_decoder.h"

namespace patina {
namespace {

constexpr std::string_view kColumns[] = {"wix", "wiy", "wiz", "wox", "woy", "woz"};
constexpr size_t kColumnCount = 6;
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
    if (comma == std::string_view::npos || fields.size() > kColumnCount) return fields;
    line.remove_prefix(comma + 1);
  }
}

bool IsHeader(const std::vector<std::string_view>& fields) {
  if (fields.size() != kColumnCount) return false;
  for (size_t i = 0; i < kColumnCount; ++i) {
    if (fields[i] != kColumns[i]) return false;
  }
  return true;
}

// Normalises; false if the length is not near 1.
bool UnitVector(const double in[3], float out[3]) {
  const double length = std::sqrt(in[0] * in[0] + in[1] * in[1] + in[2] * in[2]);
  if (!(std::abs(length - 1) <= kLengthTolerance)) return false;
  for (int d = 0; d < 3; ++d) out[d] = static_cast<float>(in[d] / length);
  return true;
}

// What is wrong with a line; empty if nothing.
std::string ReadPair(const std::vector<std::string_view>& fields, DirectionPair* pair) {
  if (fields.size() != kColumnCount) {
    return (fields.size() > kColumnCount ? "more than six values"
                                         : std::to_string(fields.size()) + " values") +
           std::string("; a line is wix,wiy,wiz,wox,woy,woz");
  }
  double values[kColumnCount];
  for (size_t i = 0; i < kColumnCount; ++i) {
    const char* end = fields[i].data() + fields[i].size();
    const auto [rest, error] = std::from_chars(fields[i].data(), end, values[i]);
    if (error != std::errc() || rest != end || !std::isfinite(values[i])) {
      return std::string(kColumns[i]) + " is " + QuoteForMessage(fields[i]) +
             ", which is not a number";
    }
  }
  if (!UnitVector(values, pair->wi) || !UnitVector(values + 3, pair->wo))
    return "not two unit vectors; divide each by its length";
  return "";
}

}  // namespace

Result<std::vector<DirectionPair>> ParsePairs(std::string_view text, const std::string& name) {
  std::vector<DirectionPair> pairs;
  bool may_be_header = true;
  for (size_t number = 1; !text.empty(); ++number) {
    const size_t end = text.find('\n');
    const std::string_view line = Trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line[0] == '#') continue;
    const std::vector<std::string_view> fields = Fields(line);
    const bool header = may_be_header && IsHeader(fields);
    may_be_header = false;
    if (header) continue;
    DirectionPair pair;
    const std::string problem = ReadPair(fields, &pair);
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
  if (opened.manifest.kind == "svbrdf") {
    return Fail(ErrorCode::kUnsupported,
                opened.directory +
                    ": holds a spatially varying BRDF, which has values at places as well as at "
                    "pairs of directions; report.html shows some");
  }
  if (opened.manifest.kind != "brdf") {
    return Fail(ErrorCode::kUnsupported,
                opened.directory +
                    ": holds a material, which has maps and no pairs of directions; "
                    "`patina unpack` writes its maps");
  }
  PATINA_TRY(VerifyPayloads(opened));
  PATINA_ASSIGN(const BrdfDecoder decoder, LoadBrdfDecoder(opened.directory));
  PATINA_ASSIGN(const std::string text, ReadTextFile(pairs_file, kMaxPairsBytes));
  PATINA_ASSIGN(const std::vector<DirectionPair> pairs, ParsePairs(text, pairs_file));
  std::string lines;
  for (const DirectionPair& pair : pairs) {
    float rgb[3];
    decoder.Evaluate(pair.wi, pair.wo, rgb);
    char line[80];
    std::snprintf(line, sizeof line, "%.9g,%.9g,%.9g\n", static_cast<double>(rgb[0]),
                  static_cast<double>(rgb[1]), static_cast<double>(rgb[2]));
    lines += line;
  }
  return lines;
}

}  // namespace patina
