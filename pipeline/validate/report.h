// A validation's outcome as text, JSON, JUnit XML and SARIF. No times, no paths of the machine: the
// same findings give the same bytes.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "pipeline/validate/validate.h"

namespace patina::validate {

enum class ReportFormat { kText, kJson, kJunit, kSarif };
std::optional<ReportFormat> ParseReportFormat(std::string_view name);  // "text", "json", ...

std::string ReportText(const ValidationReport& report);
std::string ReportJson(const ValidationReport& report);   // schemas/validate-report.schema.json
std::string ReportJunit(const ValidationReport& report);  // one test case for each target
std::string ReportSarif(const ValidationReport& report);  // 2.1.0, with the catalogue as rules
std::string FormatReport(const ValidationReport& report, ReportFormat format);

}  // namespace patina::validate
