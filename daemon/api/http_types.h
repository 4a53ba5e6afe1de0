// Requests and answers of the HTTP API, without a library's types.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/base/unique_fd.h"

namespace patina::daemon {

struct HttpRequest {
  std::string method;                                      // "GET", "POST" ...; HEAD comes as "GET"
  std::string path;                                        // percent-decoded; any bytes
  std::vector<std::pair<std::string, std::string>> query;  // decoded, in order
  std::vector<std::pair<std::string, std::string>> headers;  // as sent
  std::string body;
  bool over_tcp = false;

  // The first header of a name, in any case; "" if there is none.
  std::string_view Header(std::string_view name) const;
};

// Where an answer that does not end is written to.
class EventWriter {
 public:
  virtual ~EventWriter() = default;
  // False if the client has gone or does not read: nothing more can be written.
  virtual bool Write(std::string_view text) = 0;
  // False if the client has gone or the server stops.
  virtual bool IsOpen() const = 0;
};

struct HttpResponse {
  int status = 200;
  std::string content_type = "application/json";
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
  // In place of the body: so many bytes of a file, from where it stands.
  UniqueFd file;
  uint64_t file_bytes = 0;
  // In place of the body: writes until it returns. Runs on the connection's thread.
  std::function<void(EventWriter*)> stream;
};

class HttpHandler {
 public:
  virtual ~HttpHandler() = default;
  // Answers a request; called by many threads at once.
  virtual HttpResponse Handle(const HttpRequest& request) = 0;
  // The answer to what is no request, or too large or slow a one: a status of 400 and above.
  virtual HttpResponse Refuse(int status) = 0;
};

}  // namespace patina::daemon
