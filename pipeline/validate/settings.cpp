#include "pipeline/validate/settings.h"

#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/schema_check.h"

namespace patina::validate {
namespace {

using nlohmann::json;

constexpr uint64_t kMaxSettingsBytes = uint64_t{32} << 20;

Result<json> ReadChecked(const std::string& path, const char* schema) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxSettingsBytes));
  auto document = ParseStrictJson(text, 16);
  if (!document) return Fail(std::move(document).error(), path);
  const Status legal = CheckAgainstSchema(schema, *document);
  if (!legal) return Fail(legal.error(), path);
  return document;
}

Result<int> CodeOf(const std::string& text) {
  const auto number = ParseCode(text);
  if (number) return *number;
  return Fail(ErrorCode::kInvalidArgument, QuoteForMessage(text) +
                                               " is no code of a finding; `patina validate "
                                               "--list-codes` prints them");
}

}  // namespace

Status ReadSeverity(std::string_view text, std::map<int, Severity>* severities) {
  const size_t equals = text.find('=');
  const std::string code(text.substr(0, equals));
  const std::string_view name = equals == std::string_view::npos ? "" : text.substr(equals + 1);
  PATINA_ASSIGN(const int number, CodeOf(code));
  const auto severity = ParseSeverity(name);
  if (!severity) {
    return Fail(ErrorCode::kInvalidArgument,
                QuoteForMessage(text) + " is not CODE=error, warning, note or off");
  }
  (*severities)[number] = *severity;
  return {};
}

Status ReadSettings(const std::string& path, ValidateOptions* options) {
  PATINA_ASSIGN(const json document, ReadChecked(path, "validate-config"));
  if (document.contains("fail_on"))
    options->fail_on = *ParseSeverity(document["fail_on"].get<std::string>());
  if (!document.contains("severity")) return {};
  for (const auto& [code, severity] : document["severity"].items()) {
    const Status read =
        ReadSeverity(code + "=" + severity.get<std::string>(), &options->severities);
    if (!read) return Fail(read.error(), path + ": /severity");
  }
  return {};
}

Result<Baseline> ReadBaseline(const std::string& path) {
  PATINA_ASSIGN(const json document, ReadChecked(path, "validate-baseline"));
  Baseline baseline;
  for (const json& entry : document["accepted"]) {
    const auto number = CodeOf(entry["code"].get<std::string>());
    if (!number) return Fail(number.error(), path);
    baseline.insert({*number, entry["file"].get<std::string>(), entry.value("pointer", "")});
  }
  return baseline;
}

std::string BaselineText(const ValidationReport& report) {
  Baseline baseline;
  for (const PlacedFinding& placed : report.findings)
    baseline.insert({placed.finding.number, placed.finding.file, placed.finding.pointer});
  nlohmann::ordered_json document;
  document["version"] = 1;
  document["accepted"] = nlohmann::ordered_json::array();
  for (const AcceptedFinding& accepted : baseline) {
    nlohmann::ordered_json entry = {{"code", CodeText(accepted.number)}, {"file", accepted.file}};
    if (!accepted.pointer.empty()) entry["pointer"] = accepted.pointer;
    document["accepted"].push_back(std::move(entry));
  }
  return document.dump(2, ' ', false, json::error_handler_t::replace) + "\n";
}

}  // namespace patina::validate
