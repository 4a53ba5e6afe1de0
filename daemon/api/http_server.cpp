// The only file that knows cpp-httplib; its exceptions stop here.
#include "daemon/api/http_server.h"

#include <httplib.h>
#include <poll.h>
#include <strings.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <set>
#include <thread>

namespace patina::daemon {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr size_t kFilePieceBytes = 65536;
// After a refusal the rest of the request is read for so long: closing a socket with unread bytes
// would take back the answer.
constexpr milliseconds kLinger{500};
constexpr size_t kLingerBytes = size_t{1} << 20;

bool WaitFor(int fd, short events, Clock::time_point deadline) {
  for (;;) {
    const auto left = std::chrono::ceil<milliseconds>(deadline - Clock::now()).count();
    pollfd waiting{fd, events, 0};
    const int ready = poll(&waiting, 1, static_cast<int>(std::clamp<int64_t>(left, 0, 1 << 30)));
    if (ready > 0) return true;
    if (ready == 0 || errno != EINTR) return false;
  }
}

// One connection as cpp-httplib sees it, with a budget of bytes and time for each request.
class Connection : public httplib::Stream {
 public:
  enum class Trouble { kNone, kTooLarge, kTooSlow, kClosed };

  Connection(int fd, bool tcp, const HttpLimits& limits) : fd_(fd), tcp_(tcp), limits_(limits) {}

  // Waits for the first byte of a request.
  bool WaitForRequest(milliseconds idle) {
    if (begin_ < end_) return true;
    if (!WaitFor(fd_, POLLIN, Clock::now() + idle)) return false;
    return Fill() > 0;
  }

  void BeginRequest() {
    deadline_ = Clock::now() + limits_.request;
    budget_ = limits_.max_head_bytes;
    in_head_ = true;
    must_close = false;
    trouble = Trouble::kNone;
  }
  void BeginBody() {
    in_head_ = false;
    // The framing of a chunked body is of its sender's choice.
    budget_ = 2 * limits_.max_body_bytes + 65536;
  }

  bool is_readable() const override { return begin_ < end_ || WaitFor(fd_, POLLIN, Clock::now()); }
  bool is_writable() const override { return !broken_; }

  ssize_t read(char* bytes, size_t size) override {
    if (budget_ == 0) {
      trouble = Trouble::kTooLarge;
      return -1;
    }
    if (begin_ == end_) {
      if (!WaitFor(fd_, POLLIN, deadline_)) {
        trouble = Trouble::kTooSlow;
        return -1;
      }
      const ssize_t got = Fill();
      if (got <= 0) {
        trouble = Trouble::kClosed;
        return got;
      }
    }
    const size_t count = std::min({size, end_ - begin_, budget_});
    std::memcpy(bytes, buffer_ + begin_, count);
    begin_ += count;
    budget_ -= count;
    return static_cast<ssize_t>(count);
  }

  ssize_t write(const char* bytes, size_t size) override {
    size_t done = 0;
    while (done < size && !broken_) {
      const ssize_t sent = send(fd_, bytes + done, size - done, MSG_NOSIGNAL | MSG_DONTWAIT);
      if (sent > 0) {
        done += static_cast<size_t>(sent);
      } else if (sent < 0 && errno == EINTR) {
        continue;
      } else if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
        broken_ = !WaitFor(fd_, POLLOUT, Clock::now() + limits_.answer);
      } else {
        broken_ = true;
      }
    }
    return broken_ ? -1 : static_cast<ssize_t>(done);
  }

  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    ip.clear();
    port = 0;
  }
  void get_local_ip_and_port(std::string& ip, int& port) const override {
    ip.clear();
    port = 0;
  }
  socket_t socket() const override { return fd_; }

  // Whether the other side has closed, for those who only write.
  bool HasLeft() const {
    pollfd waiting{fd_, POLLRDHUP, 0};
    return broken_ ||
           (poll(&waiting, 1, 0) > 0 && (waiting.revents & (POLLRDHUP | POLLHUP | POLLERR)) != 0);
  }

  void Linger() {
    shutdown(fd_, SHUT_WR);
    const Clock::time_point deadline = Clock::now() + kLinger;
    size_t read = 0;
    while (read < kLingerBytes && WaitFor(fd_, POLLIN, deadline)) {
      const ssize_t got = recv(fd_, buffer_, sizeof buffer_, MSG_DONTWAIT);
      if (got <= 0) return;
      read += static_cast<size_t>(got);
    }
  }

  bool tcp() const { return tcp_; }
  bool in_head() const { return in_head_; }

  bool must_close = false;  // what follows on the connection may be no request
  bool answered = false;    // something was
  Trouble trouble = Trouble::kNone;

 private:
  ssize_t Fill() {
    for (;;) {
      const ssize_t got = recv(fd_, buffer_, sizeof buffer_, MSG_DONTWAIT);
      if (got < 0 && errno == EINTR) continue;
      begin_ = 0;
      end_ = got > 0 ? static_cast<size_t>(got) : 0;
      return got;
    }
  }

  int fd_;
  bool tcp_;
  const HttpLimits& limits_;
  Clock::time_point deadline_{};
  size_t budget_ = 0;
  bool in_head_ = true;
  bool broken_ = false;
  char buffer_[8192];
  size_t begin_ = 0, end_ = 0;
};

thread_local Connection* t_connection = nullptr;

class ChunkWriter : public EventWriter {
 public:
  ChunkWriter(httplib::DataSink* sink, const Connection* connection,
              const std::atomic<bool>* stopping)
      : sink_(sink), connection_(connection), stopping_(stopping) {}
  bool Write(std::string_view text) override {
    return IsOpen() && sink_->write(text.data(), text.size());
  }
  bool IsOpen() const override { return !*stopping_ && !connection_->HasLeft(); }

 private:
  httplib::DataSink* sink_;
  const Connection* connection_;
  const std::atomic<bool>* stopping_;
};

bool IsDigits(const std::string& text) {
  return !text.empty() && text.size() <= 18 &&
         text.find_first_not_of("0123456789") == std::string::npos;
}

// The status with which a request's headers are refused; 0 if they are not.
int StatusOfHead(const httplib::Request& request, const HttpLimits& limits) {
  const bool chunked = request.has_header("Transfer-Encoding");
  const size_t lengths = request.get_header_value_count("Content-Length");
  if (request.version == "HTTP/1.1" && request.get_header_value_count("Host") != 1) return 400;
  if (chunked &&
      (lengths > 0 || request.get_header_value_count("Transfer-Encoding") > 1 ||
       strcasecmp(request.get_header_value("Transfer-Encoding").c_str(), "chunked") != 0))
    return 400;
  if (lengths > 1) return 400;
  if (lengths == 1) {
    const std::string length = request.get_header_value("Content-Length");
    if (!IsDigits(length)) return 400;
    if (std::stoull(length) > limits.max_body_bytes) return 413;
  }
  // Unpacking would make much of little.
  if (request.has_header("Content-Encoding") &&
      strcasecmp(request.get_header_value("Content-Encoding").c_str(), "identity") != 0)
    return 415;
  if (request.is_multipart_form_data()) return 415;
  return 0;
}

bool HasBody(const httplib::Request& request) {
  return request.has_header("Transfer-Encoding") ||
         (request.has_header("Content-Length") &&
          request.get_header_value("Content-Length") != "0");
}

class Server : public HttpServer, private httplib::Server {
 public:
  Server(const HttpLimits& limits, const std::vector<Listening>& listening, HttpHandler* handler)
      : limits_(limits), listening_(listening), handler_(handler) {
    // What cpp-httplib takes for its own socket: it ends answers when there is none.
    svr_sock_ = listening.empty() ? 0 : listening[0].fd;
    set_payload_max_length(limits.max_body_bytes);
    set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      return BeforeBody(request, response);
    });
    Post(".*", [this](const httplib::Request& request, httplib::Response& response,
                      const httplib::ContentReader& read) { WithBody(request, response, read); });
    set_error_handler(
        HandlerWithResponse([this](const httplib::Request&, httplib::Response& response) {
          return OnError(response);
        }));
    set_exception_handler([](const httplib::Request&, httplib::Response& response,
                             std::exception_ptr) { response.status = 500; });
  }

  ~Server() override {
    stopping_ = true;
    svr_sock_ = INVALID_SOCKET;
    Wake();
    if (accepting_.joinable()) accepting_.join();
    std::unique_lock<std::mutex> lock(mutex_);
    for (const int fd : open_) shutdown(fd, SHUT_RD);
    const bool all_ended =
        ended_.wait_for(lock, std::chrono::seconds(3), [this] { return open_.empty(); });
    if (all_ended) return;
    for (const int fd : open_) shutdown(fd, SHUT_RDWR);
    ended_.wait(lock, [this] { return open_.empty(); });
  }

  Status Begin() {
    wake_ = UniqueFd(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
    if (!wake_) {
      return Fail(ErrorCode::kResourceExhausted,
                  std::string("cannot start the API: ") + std::strerror(errno));
    }
    accepting_ = std::thread([this] { Accept(); });
    return {};
  }

  int connections() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return static_cast<int>(open_.size());
  }

 private:
  void Wake() {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(wake_.get(), &one, sizeof one);
  }

  // ---- connections ----

  void Accept() {
    std::vector<pollfd> waiting;
    for (const Listening& listening : listening_) waiting.push_back({listening.fd, POLLIN, 0});
    waiting.push_back({wake_.get(), POLLIN, 0});
    while (!stopping_) {
      if (poll(waiting.data(), waiting.size(), -1) < 0 && errno != EINTR) return;
      for (size_t i = 0; i < listening_.size() && !stopping_; ++i) {
        if ((waiting[i].revents & POLLIN) == 0) continue;
        const int fd = accept4(waiting[i].fd, nullptr, nullptr, SOCK_CLOEXEC);
        if (fd >= 0) {
          Begin(fd, listening_[i].tcp);
        } else if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS) {
          // It would be ready again at once; a connection that ends makes room.
          poll(&waiting.back(), 1, 100);
        }
      }
    }
  }

  void Begin(int fd, bool tcp) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (static_cast<int>(open_.size()) < limits_.max_connections) {
        open_.insert(fd);
        try {
          std::thread([this, fd, tcp] { Serve(fd, tcp); }).detach();
          return;
        } catch (const std::system_error&) {
          open_.erase(fd);
        }
      }
    }
    // Small enough for any socket's buffer.
    const std::string text = RawAnswer(503);
    send(fd, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    close(fd);
  }

  void Serve(int fd, bool tcp) {
    {
      Connection connection(fd, tcp, limits_);
      t_connection = &connection;
      try {
        ServeRequests(&connection);
      } catch (const std::exception&) {
        // Out of memory, most likely: this client is dropped, the others go on.
      }
      t_connection = nullptr;
      if (connection.must_close) connection.Linger();
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    close(fd);
    open_.erase(fd);
    if (open_.empty() || stopping_) ended_.notify_all();
  }

  void ServeRequests(Connection* connection) {
    while (!stopping_) {
      // Where there are many, none is kept for later.
      const bool crowded = connections() > limits_.max_connections / 2;
      const bool first = !connection->answered;
      if (!connection->WaitForRequest(first     ? limits_.request
                                      : crowded ? milliseconds(0)
                                                : limits_.idle))
        return;
      connection->BeginRequest();
      bool closed = false;
      const bool last = crowded || stopping_;
      const auto prepare = [](httplib::Request& request) { Prepare(&request); };
      connection->answered = false;
      const bool going = process_request(*connection, last, closed, prepare);
      if (!connection->answered && connection->trouble != Connection::Trouble::kClosed) {
        connection->must_close = true;
        const std::string text =
            RawAnswer(connection->trouble == Connection::Trouble::kTooSlow ? 408 : 431);
        connection->write(text.data(), text.size());
      }
      if (!going || last || closed || connection->must_close) return;
    }
  }

  std::string RawAnswer(int status) {
    const HttpResponse answer = handler_->Refuse(status);
    return "HTTP/1.1 " + std::to_string(answer.status) +
           " Refused\r\nConnection: close\r\nContent-Type: " + answer.content_type +
           "\r\nContent-Length: " + std::to_string(answer.body.size()) + "\r\n\r\n" + answer.body;
  }

  // ---- requests ----

  // Called when the headers are read.
  static void Prepare(httplib::Request* request) {
    t_connection->BeginBody();
    request->ranges.clear();  // whole answers only
    // A request that says nothing of a body has none; cpp-httplib would read to the end.
    if (!HasBody(*request) && !request->has_header("Content-Length"))
      request->headers.emplace("Content-Length", "0");
    // Answers are small or packed already.
    request->headers.erase("Accept-Encoding");
  }

  HandlerResponse BeforeBody(const httplib::Request& request, httplib::Response& response) {
    const int refused = StatusOfHead(request, limits_);
    if (refused != 0) {
      t_connection->must_close = true;
      response.status = refused;
      return HandlerResponse::Handled;
    }
    if (request.method == "POST") return HandlerResponse::Unhandled;
    if (HasBody(request)) t_connection->must_close = true;
    Answer(request, "", &response);
    return HandlerResponse::Handled;
  }

  void WithBody(const httplib::Request& request, httplib::Response& response,
                const httplib::ContentReader& read) {
    std::string body;
    bool too_large = false;
    const bool whole = read([&](const char* bytes, size_t count) {
      too_large = body.size() + count > limits_.max_body_bytes;
      if (!too_large) body.append(bytes, count);
      return !too_large;
    });
    if (whole && !too_large) return Answer(request, std::move(body), &response);
    t_connection->must_close = true;
    response.status = too_large || t_connection->trouble == Connection::Trouble::kTooLarge ? 413
                      : t_connection->trouble == Connection::Trouble::kTooSlow             ? 408
                                                                                           : 400;
  }

  void Answer(const httplib::Request& request, std::string body, httplib::Response* response) {
    HttpRequest in;
    in.method = request.method == "HEAD" ? "GET" : request.method;
    in.path = request.path;
    for (const auto& [name, value] : request.params) in.query.emplace_back(name, value);
    for (const auto& [name, value] : request.headers) in.headers.emplace_back(name, value);
    in.body = std::move(body);
    in.over_tcp = t_connection->tcp();
    HttpResponse out;
    try {
      out = handler_->Handle(in);
    } catch (const std::exception&) {
      out = handler_->Refuse(500);
    }
    Put(std::move(out), response);
  }

  void Put(HttpResponse answer, httplib::Response* response) {
    response->status = answer.status;
    for (const auto& [name, value] : answer.headers) response->set_header(name, value);
    if (answer.stream) {
      response->set_chunked_content_provider(
          answer.content_type,
          [this, write = std::move(answer.stream)](size_t, httplib::DataSink& sink) {
            ChunkWriter writer(&sink, t_connection, &stopping_);
            write(&writer);
            sink.done();
            return true;
          });
      // Nothing that a client sends while it listens is a request.
      t_connection->must_close = true;
    } else if (answer.file) {
      const auto file = std::make_shared<UniqueFd>(std::move(answer.file));
      response->set_content_provider(
          answer.file_bytes, answer.content_type,
          [file](size_t, size_t left, httplib::DataSink& sink) {
            char piece[kFilePieceBytes];
            const ssize_t got = ::read(file->get(), piece, std::min(left, sizeof piece));
            // A file that has become shorter leaves the answer short, which the client sees.
            return got > 0 && sink.write(piece, static_cast<size_t>(got));
          });
    } else {
      response->set_content(answer.body, answer.content_type);
    }
    t_connection->answered = true;
  }

  HandlerResponse OnError(httplib::Response& response) {
    if (t_connection->answered) return HandlerResponse::Unhandled;  // the body says why
    t_connection->must_close = true;
    if (t_connection->in_head()) {
      if (t_connection->trouble == Connection::Trouble::kTooLarge) response.status = 431;
      if (t_connection->trouble == Connection::Trouble::kTooSlow) response.status = 408;
    }
    Put(handler_->Refuse(response.status), &response);
    return HandlerResponse::Handled;
  }

  HttpLimits limits_;
  std::vector<Listening> listening_;
  HttpHandler* handler_;
  UniqueFd wake_;
  std::atomic<bool> stopping_{false};
  std::thread accepting_;
  mutable std::mutex mutex_;
  std::condition_variable ended_;
  std::set<int> open_;
};

}  // namespace

std::string_view HttpRequest::Header(std::string_view name) const {
  for (const auto& [key, value] : headers) {
    if (key.size() == name.size() && strncasecmp(key.data(), name.data(), name.size()) == 0)
      return value;
  }
  return {};
}

Result<std::unique_ptr<HttpServer>> HttpServer::Start(const HttpLimits& limits,
                                                      const std::vector<Listening>& listening,
                                                      HttpHandler* handler) {
  auto server = std::make_unique<Server>(limits, listening, handler);
  PATINA_TRY(server->Begin());
  return std::unique_ptr<HttpServer>(std::move(server));
}

}  // namespace patina::daemon
