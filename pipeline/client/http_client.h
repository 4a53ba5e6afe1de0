// A small HTTP/1.1 client for the daemon's Unix socket: one connection for each request, answers of
// known length or in chunks, server-sent events.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"

namespace patina {

using HttpHeaders = std::vector<std::pair<std::string, std::string>>;

struct HttpAnswer {
  int status = 0;
  HttpHeaders headers;
  std::string body;
  // The first header of a name, in any case; "" if there is none.
  std::string Header(const std::string& name) const;
};

// One event of a stream.
struct ServerEvent {
  std::string id;  // empty: it has none
  std::string type;
  std::string data;
};

// The type of an event that HttpClient::Stream makes up when the daemon has begun to listen for us.
inline constexpr const char* kStreamOpened = "opened";

// Takes bytes of a stream of events as they come, and gives events when they are complete.
class EventParser {
 public:
  // False if a line is longer than any that the daemon sends.
  bool Feed(std::string_view bytes, const std::function<bool(const ServerEvent&)>& on_event);
  // Whether on_event returned false: nothing more is wanted.
  bool stopped() const { return stopped_; }

 private:
  void Line(std::string_view line, const std::function<bool(const ServerEvent&)>& on_event);
  std::string rest_;
  ServerEvent event_;
  bool has_data_ = false;
  bool stopped_ = false;
};

// How a stream came to its end.
enum class StreamEnd { kStopped, kClosed, kCancelled };

class HttpClient {
 public:
  // socket_path: of a Unix socket. cancel must outlive the client; while it is set every call ends
  // with kCancelled.
  HttpClient(std::string socket_path, const CancelToken& cancel)
      : socket_path_(std::move(socket_path)), cancel_(cancel) {}

  // Errors: kNotFound (nobody listens, with what to do about it), kIo, kTimeout (30 s without a
  // byte), kCorruptData (no HTTP), kOutOfRange (more than 64 MiB), kCancelled.
  Result<HttpAnswer> Request(const std::string& method, const std::string& target,
                             const std::string& body = "", const HttpHeaders& headers = {});

  // Reads events, of which the first is of type kStreamOpened, until on_event returns false or the
  // stream ends; a minute without a byte ends it,
  // as the daemon gives a sign of life four times in that. An answer that is no stream is an error
  // (see ErrorOfAnswer). Errors also as above.
  Result<StreamEnd> Stream(const std::string& target, const HttpHeaders& headers,
                           const std::function<bool(const ServerEvent&)>& on_event);

  const std::string& socket_path() const { return socket_path_; }

 private:
  std::string socket_path_;
  const CancelToken& cancel_;
};

// The error that a problem document tells of; by the status if it is none.
Error ErrorOfAnswer(const HttpAnswer& answer);

}  // namespace patina
