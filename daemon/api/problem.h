// Problem documents (RFC 9457): the body of every answer that is an error.
#pragma once

#include <string>
#include <vector>

#include "daemon/api/http_types.h"
#include "formats/base/result.h"

namespace patina::daemon {

// One thing that is wrong with a request.
struct FieldProblem {
  std::string pointer;  // JSON pointer into the body; for a query, "?name"
  std::string detail;
};

// The document is {"type", "title", "status", "detail", "code"} and "errors" where fields are to
// blame. type is a URI that ends in the code, one of ErrorCodeName or of those for the transport
// ("unauthorized", "too_large" ...), which never change their meaning.
HttpResponse ProblemResponse(int status, const std::string& code, const std::string& detail,
                             const std::vector<FieldProblem>& errors = {});

// An error of the service. What begins with a JSON pointer ("/job/folder: ...") is taken apart.
HttpResponse ProblemResponse(const Error& error);

// What the transport refused, by its status.
HttpResponse TransportProblem(int status);

// Takes messages of ParseJob ("source: 2 problems ...\n  /a: ...\n  /b: ...") and single ones
// ("/a: ...") apart; empty if there are no pointers in it. prefix is put before each.
std::vector<FieldProblem> FieldProblemsOf(const std::string& message, const std::string& prefix);

}  // namespace patina::daemon
