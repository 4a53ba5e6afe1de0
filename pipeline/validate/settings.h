// Files that say how findings are judged.
#pragma once

#include <string>
#include <string_view>

#include "formats/base/result.h"
#include "pipeline/validate/validate.h"

namespace patina::validate {

// "PAT-1104=note". Errors: kInvalidArgument for an unknown code or severity.
Status ReadSeverity(std::string_view text, std::map<int, Severity>* severities);

// Adds what a configuration says (schemas/validate-config.schema.json). Errors: those of
// ReadTextFile; kInvalidArgument with the JSON pointers of what is wrong.
Status ReadSettings(const std::string& path, ValidateOptions* options);

// schemas/validate-baseline.schema.json. Errors as ReadSettings.
Result<Baseline> ReadBaseline(const std::string& path);
// The baseline that accepts every finding of a report, sorted.
std::string BaselineText(const ValidationReport& report);

}  // namespace patina::validate
