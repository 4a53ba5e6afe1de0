// HTTP/1.1 over sockets that listen. cpp-httplib reads requests and writes answers; sockets,
// limits and time-outs are ours, as its own let a client hold a thread for as long as it likes, and
// its header lines, chunked bodies and compressed bodies are unlimited.
//
// One thread for each connection, made when it comes; beyond max_connections a client is told to
// come again.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/api/http_types.h"
#include "formats/base/result.h"

namespace patina::daemon {

struct HttpLimits {
  int max_connections = 128;
  size_t max_head_bytes = 32768;  // request line and headers together
  size_t max_body_bytes = size_t{4} << 20;
  std::chrono::milliseconds request{10000};  // from the first byte of a request to its last
  std::chrono::milliseconds answer{10000};   // without the client taking a byte
  std::chrono::milliseconds idle{5000};      // between two requests of a connection
};

class HttpServer {
 public:
  struct Listening {
    int fd = -1;  // not owned
    bool tcp = false;
  };

  // The handler must outlive the server. Errors: kResourceExhausted.
  static Result<std::unique_ptr<HttpServer>> Start(const HttpLimits& limits,
                                                   const std::vector<Listening>& listening,
                                                   HttpHandler* handler);
  // Ends all connections; answers that are being made are finished as far as their time allows.
  virtual ~HttpServer() = default;

  virtual int connections() const = 0;
};

}  // namespace patina::daemon
