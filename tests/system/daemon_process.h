// A patinad of its own, and requests to it.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace patina::testing_support {

struct HttpAnswer {
  int status = 0;
  std::string body;
};

// One request over a Unix socket; nothing if nobody answers completely.
std::optional<HttpAnswer> Request(const std::string& socket, const std::string& method,
                                  const std::string& target, const std::string& body = "",
                                  const std::string& headers = "");

// Runs a program of the build with its output in a file.
class DaemonProcess {
 public:
  // environment: "NAME=value", besides this process's.
  DaemonProcess(const std::string& program, const std::vector<std::string>& arguments,
                const std::string& log, const std::vector<std::string>& environment = {});
  ~DaemonProcess();
  DaemonProcess(const DaemonProcess&) = delete;
  DaemonProcess& operator=(const DaemonProcess&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal) const;
  // Whether it has ended; waits for that at most so long.
  bool Ended(int timeout_ms);
  // Of one that has ended: its exit code, or 128 + signal.
  int exit_code() const { return exit_code_; }

 private:
  pid_t pid_ = -1;
  int pidfd_ = -1;
  int exit_code_ = -1;
};

}  // namespace patina::testing_support
