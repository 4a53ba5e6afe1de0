// JSON documents against the project's JSON Schemas (schemas/*.schema.json, draft-07), which are
// compiled into the library.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace patina {

struct SchemaFinding {
  std::string pointer;  // JSON pointer of the offending value; "" is the document
  std::string message;
};

// Names that can be asked for: "manifest" for schemas/manifest.schema.json, in alphabetical order.
std::vector<std::string> SchemaNames();

// The text of a schema. Errors: kNotFound.
Result<std::string_view> SchemaText(const std::string& schema_name);

// What is wrong with a document; empty if nothing. At most 20 findings, in document order as the
// validator meets them. Errors: kNotFound for an unknown schema, kOutOfRange for a document too
// deep (64) or with a string too long (8 KiB) to be looked at.
Result<std::vector<SchemaFinding>> FindSchemaProblems(const std::string& schema_name,
                                                      const nlohmann::json& document);

// The same as one Status: kInvalidArgument with "<pointer>: <message>" for each finding, separated
// by "; ".
Status CheckAgainstSchema(const std::string& schema_name, const nlohmann::json& document);

}  // namespace patina
