#include "daemon/api/api_parts.h"

#include <algorithm>
#include <charconv>

#include "formats/base/names.h"
#include "formats/base/sha256.h"

namespace patina::daemon {

bool ParseInteger(std::string_view text, int64_t least, int64_t most, int64_t* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty() &&
         *value >= least && *value <= most;
}

HttpResponse JsonResponse(int status, std::string body) {
  HttpResponse response;
  response.status = status;
  response.body = std::move(body);
  return response;
}

HttpResponse FieldsRefused(const std::vector<FieldProblem>& problems) {
  std::string detail = std::to_string(problems.size()) +
                       (problems.size() == 1 ? " thing is wrong" : " things are wrong");
  for (const FieldProblem& problem : problems)
    detail += (&problem == problems.data() ? ": " : "; ") +
              (problem.pointer.empty() ? "the body" : problem.pointer) + " " + problem.detail;
  return ProblemResponse(400, "invalid_argument", detail, problems);
}

std::string Revised(const std::string& text) {
  return "\"" + Sha256Hex(std::string_view(text)).substr(0, 32) + "\"";
}

bool NamesTag(std::string_view header, const std::string& tag) {
  if (header == "*") return true;
  for (size_t at = header.find(tag); at != std::string_view::npos; at = header.find(tag, at + 1)) {
    const size_t end = at + tag.size();
    const bool begins = at == 0 || header[at - 1] == ' ' || header[at - 1] == ',' ||
                        header[at - 1] == '/';  // W/"..." is as good here
    if (begins && (end == header.size() || header[end] == ',' || header[end] == ' ')) return true;
  }
  return false;
}

HttpResponse WithTag(const HttpRequest& request, std::string body) {
  const std::string tag = Revised(body);
  HttpResponse response;
  if (NamesTag(request.Header("If-None-Match"), tag)) {
    response.status = 304;
  } else {
    response.body = std::move(body);
  }
  response.headers.emplace_back("ETag", tag);
  return response;
}

const std::string* Query::Find(const std::string& name) {
  known_.push_back(name);
  const std::string* found = nullptr;
  for (const auto& [key, value] : request_.query) {
    if (key != name) continue;
    if (found != nullptr) Complain(name, "stands twice");
    found = &value;
  }
  return found;
}

int64_t Query::Integer(const std::string& name, int64_t least, int64_t most, int64_t absent) {
  const std::string* text = Find(name);
  int64_t value = absent;
  if (text == nullptr || ParseInteger(*text, least, most, &value)) return value;
  Complain(name, "must be a whole number from " + std::to_string(least) + " to " +
                     std::to_string(most) + "; is " + QuoteForMessage(*text));
  return absent;
}

void Query::Complain(const std::string& name, const std::string& detail) {
  problems_.push_back({"?" + name, detail});
}

std::vector<FieldProblem> Query::Problems() {
  for (const auto& [key, value] : request_.query) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    std::string list;
    for (const std::string& name : known_) list += (list.empty() ? "" : ", ") + name;
    problems_.push_back(
        {"?" + QuoteForMessage(key), list.empty() ? "is not known; this path takes no parameters"
                                                  : "is not known; known are " + list});
    if (problems_.size() >= 20) break;
  }
  return problems_;
}

}  // namespace patina::daemon
