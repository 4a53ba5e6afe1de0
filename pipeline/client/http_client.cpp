#include "pipeline/client/http_client.h"

#include <poll.h>
#include <strings.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>

#include "formats/base/names.h"

namespace patina {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds kAnswerWait{30000};
constexpr milliseconds kStreamWait{60000};
constexpr milliseconds kCancelLook{100};
constexpr size_t kMaxHeadBytes = 65536;
constexpr size_t kMaxBodyBytes = size_t{64} << 20;
constexpr size_t kMaxLineBytes = size_t{16} << 20;

class Socket {
 public:
  Socket(const CancelToken& cancel, milliseconds patience) : cancel_(cancel), patience_(patience) {}
  ~Socket() {
    if (fd_ >= 0) close(fd_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  Status Connect(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path) {
      return Fail(ErrorCode::kInvalidArgument,
                  "the path of the socket is too long for one: " + QuoteForMessage(path));
    }
    std::memcpy(address.sun_path, path.data(), path.size());
    fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd_ < 0) return Fail(ErrorCode::kIo, std::string("no socket: ") + std::strerror(errno));
    if (connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return {};
    const int error = errno;
    if (error == ENOENT || error == ECONNREFUSED || error == ENOTSOCK) {
      return Fail(ErrorCode::kNotFound,
                  "no daemon listens on " + QuoteForMessage(path) +
                      "; start one with `patinad --watch DIR --out DIR`, or name its socket with "
                      "--socket or $PATINA_SOCKET");
    }
    if (error == EACCES) {
      return Fail(ErrorCode::kIo, "the daemon on " + QuoteForMessage(path) +
                                      " is another user's; ask as that user, or start your own");
    }
    return Fail(ErrorCode::kIo, "cannot reach the daemon on " + QuoteForMessage(path) + ": " +
                                    std::strerror(error));
  }

  Status Send(const std::string& bytes) {
    for (size_t at = 0; at < bytes.size();) {
      const ssize_t sent = send(fd_, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL);
      if (sent > 0) {
        at += static_cast<size_t>(sent);
      } else if (errno == EPIPE || errno == ECONNRESET) {
        return {};  // it has refused the request and says why
      } else if (errno != EINTR) {
        return Fail(ErrorCode::kIo, std::string("the daemon went away: ") + std::strerror(errno));
      }
    }
    return {};
  }

  // Appends what comes; false at the end of the connection.
  Result<bool> Read(std::string* bytes) {
    const Clock::time_point deadline = Clock::now() + patience_;
    while (!cancel_.cancelled()) {
      pollfd waiting{fd_, POLLIN, 0};
      const int ready = poll(&waiting, 1, static_cast<int>(kCancelLook.count()));
      if (ready == 0 && Clock::now() >= deadline)
        return Fail(ErrorCode::kTimeout,
                    "the daemon does not answer; is it stopped or overloaded?");
      if (ready <= 0) continue;
      char piece[16384];
      const ssize_t got = recv(fd_, piece, sizeof piece, 0);
      if (got > 0) bytes->append(piece, static_cast<size_t>(got));
      if (got >= 0 || errno == ECONNRESET) return got > 0;
      if (errno != EINTR)
        return Fail(ErrorCode::kIo, std::string("the daemon went away: ") + std::strerror(errno));
    }
    return Fail(ErrorCode::kCancelled, "interrupted");
  }

 private:
  const CancelToken& cancel_;
  milliseconds patience_;
  int fd_ = -1;
};

tl::unexpected<Error> Garbled(const std::string& what) {
  return Fail(ErrorCode::kCorruptData,
              "what answers on the socket is no patinad, or an odd one: " + what);
}

// Reads an answer in pieces, whatever way its length is given.
class AnswerReader {
 public:
  explicit AnswerReader(Socket* socket) : socket_(socket) {}

  Result<HttpAnswer> ReadHead() {
    HttpAnswer answer;
    size_t end = std::string::npos;
    while ((end = buffer_.find("\r\n\r\n")) == std::string::npos) {
      if (buffer_.size() > kMaxHeadBytes) return Garbled("its headers do not end");
      PATINA_ASSIGN(const bool more, socket_->Read(&buffer_));
      if (!more) return Garbled("it ended before its answer did");
    }
    const std::string head = buffer_.substr(0, end + 2);
    buffer_.erase(0, end + 4);
    if (head.compare(0, 7, "HTTP/1.") != 0 || head.size() < 12)
      return Garbled(QuoteForMessage(head.substr(0, 40)));
    answer.status = std::atoi(head.c_str() + 9);
    for (size_t at = head.find("\r\n") + 2; at < head.size();) {
      const size_t line_end = head.find("\r\n", at);
      const size_t colon = head.find(':', at);
      if (colon < line_end) {
        const size_t value = std::min(head.find_first_not_of(' ', colon + 1), line_end);
        answer.headers.emplace_back(head.substr(at, colon - at),
                                    head.substr(value, line_end - value));
      }
      at = line_end + 2;
    }
    const std::string length = answer.Header("Content-Length");
    chunked_ = strcasecmp(answer.Header("Transfer-Encoding").c_str(), "chunked") == 0;
    to_end_ = !chunked_ && length.empty();
    left_ = length.empty() ? 0 : std::strtoull(length.c_str(), nullptr, 10);
    if (answer.status == 304 || answer.status == 204) {
      chunked_ = to_end_ = false;
      left_ = 0;
    }
    return answer;
  }

  // The next piece of the body; empty at its end.
  Result<std::string> ReadBody() {
    if (done_) return std::string();
    if (chunked_ && left_ == 0) {
      PATINA_TRY(ReadChunkSize());
      if (done_) return std::string();
    }
    if (!chunked_ && !to_end_ && left_ == 0) {
      done_ = true;
      return std::string();
    }
    if (buffer_.empty()) {
      PATINA_ASSIGN(const bool more, socket_->Read(&buffer_));
      if (!more) {
        if (!to_end_) return Garbled("it ended before its answer did");
        done_ = true;
        return std::string();
      }
    }
    const size_t take = to_end_ ? buffer_.size() : std::min<size_t>(left_, buffer_.size());
    std::string piece = buffer_.substr(0, take);
    buffer_.erase(0, take);
    if (!to_end_) left_ -= take;
    if (chunked_ && left_ == 0) PATINA_TRY(ReadLineEnd());
    return piece;
  }

 private:
  Result<std::string> ReadLine() {
    size_t end = std::string::npos;
    while ((end = buffer_.find("\r\n")) == std::string::npos) {
      if (buffer_.size() > kMaxHeadBytes) return Garbled("a chunk without a size");
      PATINA_ASSIGN(const bool more, socket_->Read(&buffer_));
      if (!more) return Garbled("it ended before its answer did");
    }
    std::string line = buffer_.substr(0, end);
    buffer_.erase(0, end + 2);
    return line;
  }

  Status ReadLineEnd() {
    PATINA_ASSIGN(const std::string line, ReadLine());
    if (!line.empty()) return Garbled("a chunk longer than its size");
    return {};
  }

  Status ReadChunkSize() {
    PATINA_ASSIGN(const std::string line, ReadLine());
    char* end = nullptr;
    left_ = std::strtoull(line.c_str(), &end, 16);
    if (end == line.c_str() || left_ > kMaxBodyBytes) return Garbled("a chunk without a size");
    done_ = left_ == 0;
    return {};
  }

  Socket* socket_;
  std::string buffer_;
  bool chunked_ = false, to_end_ = false, done_ = false;
  uint64_t left_ = 0;
};

std::string RequestText(const std::string& method, const std::string& target,
                        const std::string& body, const HttpHeaders& headers) {
  std::string text =
      method + " " + target + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n";
  for (const auto& [name, value] : headers) text += name + ": " + value + "\r\n";
  if (!body.empty()) text += "Content-Type: application/json\r\n";
  if (method != "GET") text += "Content-Length: " + std::to_string(body.size()) + "\r\n";
  return text + "\r\n" + body;
}

Result<std::string> ReadWhole(AnswerReader* reader) {
  std::string body;
  for (;;) {
    PATINA_ASSIGN(const std::string piece, reader->ReadBody());
    if (piece.empty()) return body;
    body += piece;
    if (body.size() > kMaxBodyBytes)
      return Fail(ErrorCode::kOutOfRange, "the daemon's answer is larger than 64 MiB");
  }
}

}  // namespace

std::string HttpAnswer::Header(const std::string& name) const {
  for (const auto& [key, value] : headers) {
    if (strcasecmp(key.c_str(), name.c_str()) == 0) return value;
  }
  return "";
}

bool EventParser::Feed(std::string_view bytes,
                       const std::function<bool(const ServerEvent&)>& on_event) {
  rest_ += bytes;
  size_t at = 0;
  for (size_t end = 0; !stopped_ && (end = rest_.find('\n', at)) != std::string::npos;) {
    size_t length = end - at;
    if (length > 0 && rest_[end - 1] == '\r') --length;
    Line(std::string_view(rest_).substr(at, length), on_event);
    at = end + 1;
  }
  rest_.erase(0, at);
  return rest_.size() + event_.data.size() <= kMaxLineBytes;
}

void EventParser::Line(std::string_view line,
                       const std::function<bool(const ServerEvent&)>& on_event) {
  if (line.empty()) {
    if (has_data_) {
      if (event_.type.empty()) event_.type = "message";
      stopped_ = !on_event(event_);
    }
    event_ = {};
    has_data_ = false;
    return;
  }
  if (line[0] == ':') return;
  const size_t colon = std::min(line.find(':'), line.size());
  const std::string_view field = line.substr(0, colon);
  std::string_view value = line.substr(std::min(colon + 1, line.size()));
  if (!value.empty() && value[0] == ' ') value.remove_prefix(1);
  if (field == "id") {
    event_.id = value;
  } else if (field == "event") {
    event_.type = value;
  } else if (field == "data") {
    if (has_data_) event_.data += '\n';
    event_.data += value;
    has_data_ = true;
  }
}

Result<HttpAnswer> HttpClient::Request(const std::string& method, const std::string& target,
                                       const std::string& body, const HttpHeaders& headers) {
  Socket socket(cancel_, kAnswerWait);
  PATINA_TRY(socket.Connect(socket_path_));
  PATINA_TRY(socket.Send(RequestText(method, target, body, headers)));
  AnswerReader reader(&socket);
  PATINA_ASSIGN(HttpAnswer answer, reader.ReadHead());
  PATINA_ASSIGN(answer.body, ReadWhole(&reader));
  return answer;
}

Result<StreamEnd> HttpClient::Stream(const std::string& target, const HttpHeaders& headers,
                                     const std::function<bool(const ServerEvent&)>& on_event) {
  Socket socket(cancel_, kStreamWait);
  PATINA_TRY(socket.Connect(socket_path_));
  PATINA_TRY(socket.Send(RequestText("GET", target, "", headers)));
  AnswerReader reader(&socket);
  PATINA_ASSIGN(HttpAnswer answer, reader.ReadHead());
  if (answer.status != 200) {
    PATINA_ASSIGN(answer.body, ReadWhole(&reader));
    return Fail(ErrorOfAnswer(answer));
  }
  if (!on_event({"", kStreamOpened, ""})) return StreamEnd::kStopped;
  EventParser parser;
  while (!parser.stopped()) {
    const auto piece = reader.ReadBody();
    if (!piece && piece.error().code == ErrorCode::kCancelled) return StreamEnd::kCancelled;
    // However it broke off: the client comes again and says what it has.
    if (!piece || piece->empty()) return StreamEnd::kClosed;
    if (!parser.Feed(*piece, on_event)) return Garbled("an event without an end");
  }
  return StreamEnd::kStopped;
}

Error ErrorOfAnswer(const HttpAnswer& answer) {
  Error error;
  error.code = answer.status == 404   ? ErrorCode::kNotFound
               : answer.status == 409 ? ErrorCode::kConflict
               : answer.status < 500  ? ErrorCode::kInvalidArgument
               : answer.status == 507 ? ErrorCode::kResourceExhausted
                                      : ErrorCode::kIo;
  const nlohmann::json problem = nlohmann::json::parse(answer.body, nullptr, false);
  if (problem.is_object() && problem.contains("detail") && problem["detail"].is_string()) {
    error.message = problem["detail"];
  } else {
    error.message = "the daemon answered with status " + std::to_string(answer.status);
  }
  return error;
}

}  // namespace patina
