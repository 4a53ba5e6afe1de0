#include "tests/daemon/api/raw_client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <strings.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

namespace patina::daemon {
namespace {

constexpr int kPatienceMs = 30000;

}  // namespace

std::string RawAnswer::Header(const std::string& name) const {
  for (size_t at = head.find("\r\n"); at != std::string::npos; at = head.find("\r\n", at + 2)) {
    const char* line = head.c_str() + at + 2;
    if (strncasecmp(line, (name + ": ").c_str(), name.size() + 2) != 0) continue;
    const std::string rest = line + name.size() + 2;
    return rest.substr(0, rest.find("\r\n"));
  }
  return "";
}

RawClient::RawClient(const std::string& socket_path) {
  fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, socket_path.c_str(), sizeof address.sun_path - 1);
  if (connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return;
  close(fd_);
  fd_ = -1;
}

RawClient::RawClient(int tcp_port) {
  fd_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(tcp_port));
  if (connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return;
  close(fd_);
  fd_ = -1;
}

RawClient::~RawClient() {
  if (fd_ >= 0) close(fd_);
}

bool RawClient::Send(const std::string& bytes) {
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t sent = send(fd_, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL);
    if (sent <= 0) return false;
    at += static_cast<size_t>(sent);
  }
  return true;
}

void RawClient::EndSending() { shutdown(fd_, SHUT_WR); }

bool RawClient::Read() {
  pollfd waiting{fd_, POLLIN, 0};
  if (fd_ < 0 || poll(&waiting, 1, kPatienceMs) <= 0) return false;
  char bytes[4096];
  const ssize_t got = recv(fd_, bytes, sizeof bytes, 0);
  if (got <= 0) return false;
  received_.append(bytes, static_cast<size_t>(got));
  return true;
}

bool RawClient::WaitFor(const std::string& text) {
  while (received_.find(text) == std::string::npos) {
    if (!Read()) return false;
  }
  return true;
}

std::string RawClient::ReadAll() {
  while (Read()) {
  }
  return received_;
}

RawAnswer RawClient::ReadAnswer() {
  RawAnswer answer;
  if (!WaitFor("\r\n\r\n")) return answer;
  const size_t end = received_.find("\r\n\r\n");
  answer.head = received_.substr(0, end + 2);
  answer.status = std::atoi(answer.head.c_str() + 9);
  const size_t length = std::strtoul(answer.Header("Content-Length").c_str(), nullptr, 10);
  while (received_.size() < end + 4 + length) {
    if (!Read()) break;
  }
  answer.body = received_.substr(end + 4, length);
  received_.erase(0, end + 4 + length);
  return answer;
}

RawAnswer Ask(const std::string& socket_path, const std::string& method, const std::string& target,
              const std::string& body, const std::string& extra) {
  RawClient client(socket_path);
  std::string request = method + " " + target + " HTTP/1.1\r\nHost: localhost\r\n" + extra;
  if (!body.empty()) {
    request +=
        "Content-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) + "\r\n";
  }
  client.Send(request + "\r\n" + body);
  return client.ReadAnswer();
}

}  // namespace patina::daemon
