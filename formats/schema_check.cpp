#include "formats/schema_check.h"

#include <algorithm>
#include <exception>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

// valijson's headers do not compile without warnings at our level.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>
#pragma GCC diagnostic pop

#include "formats/base/strict_json.h"
#include "formats/embedded_schemas.h"

namespace patina {
namespace {

constexpr int kMaxDepth = 64;
constexpr size_t kMaxStringBytes = size_t{1} << 13;
constexpr size_t kMaxFindings = 20;

// The validator recurses over the document, and std::regex over a string.
Status CheckLimits(const nlohmann::json& value, int depth) {
  if (depth > kMaxDepth) {
    return Fail(ErrorCode::kOutOfRange,
                "the document nests deeper than " + std::to_string(kMaxDepth) + " levels");
  }
  if (value.is_string() && value.get_ref<const std::string&>().size() > kMaxStringBytes) {
    return Fail(ErrorCode::kOutOfRange, "the document has a string of more than 8 KiB");
  }
  if (value.is_structured()) {
    for (const auto& child : value) PATINA_TRY(CheckLimits(child, depth + 1));
  }
  return {};
}

// valijson's context {"<root>", "[source]", "[0]"} as "/source/0".
std::string PointerOf(const std::vector<std::string>& context) {
  std::string pointer;
  for (size_t i = 1; i < context.size(); ++i) {
    const std::string& part = context[i];
    const bool bracketed = part.size() >= 2 && part.front() == '[' && part.back() == ']';
    pointer += "/" + EscapePointer(bracketed ? part.substr(1, part.size() - 2) : part);
  }
  return pointer;
}

bool IsBelow(const std::string& pointer, const std::string& ancestor) {
  return pointer.size() > ancestor.size() && pointer.compare(0, ancestor.size(), ancestor) == 0 &&
         pointer[ancestor.size()] == '/';
}

// Keeps the findings that are nearest to the cause: an object that fails only because of a member
// is not reported.
std::vector<SchemaFinding> MostSpecific(const std::vector<SchemaFinding>& all) {
  std::vector<SchemaFinding> kept;
  for (const SchemaFinding& finding : all) {
    const bool has_deeper = std::any_of(all.begin(), all.end(), [&](const SchemaFinding& other) {
      return IsBelow(other.pointer, finding.pointer);
    });
    if (!has_deeper && kept.size() < kMaxFindings) kept.push_back(finding);
  }
  return kept;
}

// A schema takes longer to parse than a document to check. Validation writes into a parsed schema's
// caches, hence one for each thread.
Result<const valijson::Schema*> ParsedSchema(const std::string& schema_name) {
  thread_local std::map<std::string, valijson::Schema> schemas;
  const auto known = schemas.find(schema_name);
  if (known != schemas.end()) return &known->second;
  PATINA_ASSIGN(const std::string_view text, SchemaText(schema_name));
  const nlohmann::json document = nlohmann::json::parse(text);
  valijson::SchemaParser().populateSchema(valijson::adapters::NlohmannJsonAdapter(document),
                                          schemas[schema_name]);
  return &schemas[schema_name];
}

}  // namespace

std::vector<std::string> SchemaNames() {
  std::vector<std::string> names;
  for (int i = 0; i < kEmbeddedSchemaCount; ++i) names.emplace_back(kEmbeddedSchemas[i].name);
  return names;
}

Result<std::string_view> SchemaText(const std::string& schema_name) {
  for (int i = 0; i < kEmbeddedSchemaCount; ++i) {
    if (schema_name == kEmbeddedSchemas[i].name) return std::string_view(kEmbeddedSchemas[i].text);
  }
  return Fail(ErrorCode::kNotFound, "there is no schema \"" + schema_name + "\"");
}

Result<std::vector<SchemaFinding>> FindSchemaProblems(const std::string& schema_name,
                                                      const nlohmann::json& document) {
  PATINA_TRY(CheckLimits(document, 0));
  try {
    PATINA_ASSIGN(const valijson::Schema* parsed, ParsedSchema(schema_name));
    const valijson::Schema& schema = *parsed;
    valijson::Validator validator;
    valijson::ValidationResults results;
    std::vector<SchemaFinding> findings;
    if (!validator.validate(schema, valijson::adapters::NlohmannJsonAdapter(document), &results)) {
      valijson::ValidationResults::Error error;
      // A wrong document of a million elements has a million errors; a few hundred are enough to
      // choose from.
      while (findings.size() < 400 && results.popError(error)) {
        findings.push_back({PointerOf(error.context), error.description});
      }
    }
    return MostSpecific(findings);
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kInternal, "schema \"" + schema_name + "\": " + error.what());
  }
}

Status CheckAgainstSchema(const std::string& schema_name, const nlohmann::json& document) {
  PATINA_ASSIGN(const std::vector<SchemaFinding> findings,
                FindSchemaProblems(schema_name, document));
  if (findings.empty()) return {};
  std::string text;
  for (const SchemaFinding& finding : findings) {
    text += (text.empty() ? "" : "; ") +
            (finding.pointer.empty() ? "document root" : finding.pointer) + ": " + finding.message;
  }
  return Fail(ErrorCode::kInvalidArgument, text);
}

}  // namespace patina
