// A client that sends whatever it is told to.
#pragma once

#include <string>

namespace patina::daemon {

struct RawAnswer {
  int status = 0;  // 0: none came
  std::string head, body;
  std::string Header(const std::string& name) const;  // "" if absent
};

class RawClient {
 public:
  explicit RawClient(const std::string& socket_path);  // a Unix socket
  explicit RawClient(int tcp_port);                    // 127.0.0.1
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  bool connected() const { return fd_ >= 0; }
  // False if the other side has closed.
  bool Send(const std::string& bytes);
  void EndSending();
  // Reads until `text` was received; false if the connection ends, or half a minute goes by, first.
  bool WaitFor(const std::string& text);
  // Reads to the end of the connection.
  std::string ReadAll();
  // Reads one answer with a Content-Length.
  RawAnswer ReadAnswer();
  const std::string& received() const { return received_; }

 private:
  bool Read();
  int fd_ = -1;
  std::string received_;
};

// One request on a connection of its own. extra: more header lines, each with "\r\n".
RawAnswer Ask(const std::string& socket_path, const std::string& method, const std::string& target,
              const std::string& body = "", const std::string& extra = "");

}  // namespace patina::daemon
