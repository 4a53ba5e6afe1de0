#include "daemon/api/problem.h"

#include <nlohmann/json.hpp>

namespace patina::daemon {
namespace {

struct TransportText {
  int status;
  const char* code;
  const char* title;
  const char* detail;
};

constexpr TransportText kTransport[] = {
    {400, "malformed", "Not a request",
     "the bytes are no HTTP/1.1 request, or its headers are at odds"},
    {401, "unauthorized", "Who is asking?",
     "send the content of the daemon's token file as `Authorization: Bearer TOKEN`"},
    {403, "forbidden", "Not for this host", "the Host header names no address of this machine"},
    {404, "not_found", "Not found", "there is nothing at this path; see /v1/openapi.json"},
    {405, "method_not_allowed", "Method not allowed",
     "the Allow header lists what this path knows"},
    {408, "too_slow", "Too slow", "the request was not complete in time; send it faster"},
    {413, "too_large", "Too large", "the body is larger than the daemon accepts"},
    {414, "too_large", "Too large", "the path is longer than 8 KiB"},
    {415, "unsupported_media_type", "Not JSON",
     "send the body as application/json, neither compressed nor in parts"},
    {417, "malformed", "Not a request", "the Expect header asks for something unknown"},
    {431, "too_large", "Too large", "the request line and headers are larger than 32 KiB"},
    {500, "internal", "Failed", "something went wrong that should not; see the daemon's log"},
    {503, "busy", "Busy", "there are too many connections; come again"},
};

struct ServiceText {
  ErrorCode code;
  int status;
  const char* title;
};

constexpr ServiceText kService[] = {
    {ErrorCode::kInvalidArgument, 400, "The request is wrong"},
    {ErrorCode::kNotFound, 404, "Not found"},
    {ErrorCode::kConflict, 409, "Not in this state"},
    {ErrorCode::kCorruptData, 500, "Damaged data"},
    {ErrorCode::kUnsupported, 400, "Not supported"},
    {ErrorCode::kOutOfRange, 400, "Out of range"},
    {ErrorCode::kResourceExhausted, 507, "Out of resources"},
    {ErrorCode::kIo, 500, "Input or output failed"},
    {ErrorCode::kCancelled, 503, "Stopping"},
    {ErrorCode::kTimeout, 503, "Took too long"},
    {ErrorCode::kInternal, 500, "Failed"},
};

HttpResponse Make(int status, const std::string& code, const std::string& title,
                  const std::string& detail, const std::vector<FieldProblem>& errors) {
  nlohmann::ordered_json body;
  body["type"] = "https://patina.invalid/problems/" + code;
  body["title"] = title;
  body["status"] = status;
  body["detail"] = detail;
  body["code"] = code;
  for (const FieldProblem& error : errors)
    body["errors"].push_back({{"pointer", error.pointer}, {"detail", error.detail}});
  HttpResponse response;
  response.status = status;
  response.content_type = "application/problem+json";
  response.body =
      body.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  if (status == 503 || status == 507) response.headers.emplace_back("Retry-After", "5");
  if (status == 401) response.headers.emplace_back("WWW-Authenticate", "Bearer");
  return response;
}

const TransportText* FindTransport(int status) {
  for (const TransportText& text : kTransport) {
    if (text.status == status) return &text;
  }
  return nullptr;
}

}  // namespace

HttpResponse ProblemResponse(int status, const std::string& code, const std::string& detail,
                             const std::vector<FieldProblem>& errors) {
  std::string title = "The request is wrong";
  for (const TransportText& text : kTransport) {
    if (code == text.code) title = text.title;
  }
  for (const ServiceText& text : kService) {
    if (code == ErrorCodeName(text.code)) title = text.title;
  }
  return Make(status, code, title, detail, errors);
}

HttpResponse ProblemResponse(const Error& error) {
  for (const ServiceText& text : kService) {
    if (text.code != error.code) continue;
    return Make(
        text.status, ErrorCodeName(error.code), text.title, error.message,
        text.status == 400 ? FieldProblemsOf(error.message, "") : std::vector<FieldProblem>());
  }
  return TransportProblem(500);
}

HttpResponse TransportProblem(int status) {
  const TransportText* text = FindTransport(status);
  if (text == nullptr) text = FindTransport(status < 500 ? 400 : 500);
  return Make(status, text->code, text->title, text->detail, {});
}

std::vector<FieldProblem> FieldProblemsOf(const std::string& message, const std::string& prefix) {
  std::vector<FieldProblem> problems;
  for (size_t at = 0; at < message.size();) {
    const size_t end = std::min(message.find('\n', at), message.size());
    std::string line = message.substr(at, end - at);
    at = end + 1;
    line.erase(0, std::min(line.find_first_not_of(' '), line.size()));
    const size_t colon = line.find(": ");
    const bool has_pointer = !line.empty() && line[0] == '/' && colon != std::string::npos &&
                             line.substr(0, colon).find_first_of(" \"") == std::string::npos;
    if (has_pointer) problems.push_back({prefix + line.substr(0, colon), line.substr(colon + 2)});
  }
  return problems;
}

}  // namespace patina::daemon
