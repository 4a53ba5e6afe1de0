// A Unix socket on which prepared bytes answer each connection.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <string>
#include <thread>
#include <vector>

namespace patina::testing_support {

class CannedServer {
 public:
  CannedServer(const std::string& path, std::vector<std::string> answers) {
    fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    listen(fd_, 16);
    thread_ = std::thread([this, answers = std::move(answers)] {
      for (const std::string& answer : answers) Serve(answer);
    });
  }
  ~CannedServer() {
    // Ends an accept that nobody came for.
    shutdown(fd_, SHUT_RDWR);
    thread_.join();
    close(fd_);
  }
  CannedServer(const CannedServer&) = delete;
  CannedServer& operator=(const CannedServer&) = delete;

 private:
  void Serve(const std::string& answer) {
    const int client = accept(fd_, nullptr, nullptr);
    if (client < 0) return;
    std::string request;
    char bytes[4096];
    while (request.find("\r\n\r\n") == std::string::npos) {
      const ssize_t got = recv(client, bytes, sizeof bytes, 0);
      if (got <= 0) break;
      request.append(bytes, static_cast<size_t>(got));
    }
    send(client, answer.data(), answer.size(), MSG_NOSIGNAL);
    close(client);
  }

  int fd_ = -1;
  std::thread thread_;
};

}  // namespace patina::testing_support
