// What the handlers of the API share.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/api/api.h"
#include "daemon/api/problem.h"

namespace patina::daemon {

// A request on the way to its handler.
struct Api::Call {
  const HttpRequest& request;
  std::vector<std::string> arguments;  // what stands for each {name} of the route
  int64_t id = 0;                      // of {id}
};

bool ParseInteger(std::string_view text, int64_t least, int64_t most, int64_t* value);

HttpResponse JsonResponse(int status, std::string body);
HttpResponse FieldsRefused(const std::vector<FieldProblem>& problems);

// A tag for If-None-Match that changes with the text.
std::string Revised(const std::string& text);
// Whether an If-None-Match header names the tag.
bool NamesTag(std::string_view header, const std::string& tag);
// The body with its tag; without, if the client has it.
HttpResponse WithTag(const HttpRequest& request, std::string body);

// The parameters of a query; notes what is wrong with them.
class Query {
 public:
  explicit Query(const HttpRequest& request) : request_(request) {}

  const std::string* Find(const std::string& name);  // nullptr if it is absent
  int64_t Integer(const std::string& name, int64_t least, int64_t most, int64_t absent);
  void Complain(const std::string& name, const std::string& detail);
  // After all that is known was asked for.
  std::vector<FieldProblem> Problems();

 private:
  const HttpRequest& request_;
  std::vector<std::string> known_;
  std::vector<FieldProblem> problems_;
};

}  // namespace patina::daemon
