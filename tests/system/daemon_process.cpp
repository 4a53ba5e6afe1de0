#include "tests/system/daemon_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>

extern char** environ;

namespace patina::testing_support {

std::optional<HttpAnswer> Request(const std::string& socket, const std::string& method,
                                  const std::string& target, const std::string& body,
                                  const std::string& headers) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (socket.size() >= sizeof address.sun_path) return std::nullopt;
  std::memcpy(address.sun_path, socket.data(), socket.size());
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  std::string text = method + " " + target +
                     " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + headers +
                     "Content-Length: " + std::to_string(body.size()) + "\r\n" +
                     (body.empty() ? "" : "Content-Type: application/json\r\n") + "\r\n" + body;
  std::string answer;
  bool sent = fd >= 0 && ::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  for (size_t done = 0; sent && done < text.size();) {
    const ssize_t n = ::send(fd, text.data() + done, text.size() - done, MSG_NOSIGNAL);
    if (n <= 0) sent = false;
    if (n > 0) done += static_cast<size_t>(n);
  }
  char buffer[65536];
  for (ssize_t n; sent && (n = ::read(fd, buffer, sizeof buffer)) > 0;)
    answer.append(buffer, static_cast<size_t>(n));
  if (fd >= 0) ::close(fd);
  const size_t head = answer.find("\r\n\r\n");
  if (head == std::string::npos || answer.rfind("HTTP/1.1 ", 0) != 0) return std::nullopt;
  return HttpAnswer{std::atoi(answer.c_str() + 9), answer.substr(head + 4)};
}

DaemonProcess::DaemonProcess(const std::string& program, const std::vector<std::string>& arguments,
                             const std::string& log, const std::vector<std::string>& environment) {
  std::vector<std::string> words{std::string(PATINA_BIN_DIR) + "/" + program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv, envp;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  // Of two entries of a name the first counts.
  for (const std::string& entry : environment) envp.push_back(const_cast<char*>(entry.c_str()));
  for (char** entry = environ; *entry != nullptr; ++entry) envp.push_back(*entry);
  envp.push_back(nullptr);
  pid_ = ::fork();
  if (pid_ == 0) {
    const int file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    if (file < 0 || ::dup2(file, 1) < 0 || ::dup2(file, 2) < 0) ::_exit(126);
    ::execve(argv[0], argv.data(), envp.data());
    ::_exit(127);
  }
  pidfd_ = static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0));
}

DaemonProcess::~DaemonProcess() {
  if (exit_code_ < 0 && pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  if (pidfd_ >= 0) ::close(pidfd_);
}

void DaemonProcess::Signal(int signal) const { ::kill(pid_, signal); }

bool DaemonProcess::Ended(int timeout_ms) {
  if (exit_code_ >= 0) return true;
  pollfd ready{pidfd_, POLLIN, 0};
  if (::poll(&ready, 1, timeout_ms) <= 0) return false;
  int status = 0;
  ::waitpid(pid_, &status, 0);
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return true;
}

}  // namespace patina::testing_support
