// Sockets that the API listens on.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/base/unique_fd.h"
#include "formats/base/result.h"

namespace patina::daemon {

// A Unix socket of mode 0600, listening. What an earlier process left of one is replaced; a lock
// beside it (<path>.lock) keeps two from replacing each other's. The file is removed with the
// object.
class UnixListener {
 public:
  // Errors: kConflict (another process listens there, or the path is no socket), kInvalidArgument
  // (the path is too long for a socket), and those of FailErrno.
  static Result<UnixListener> Open(const std::string& path);
  ~UnixListener();
  UnixListener(UnixListener&&) noexcept = default;
  UnixListener& operator=(UnixListener&&) = delete;

  int fd() const { return fd_.get(); }

 private:
  UnixListener(UniqueFd lock, UniqueFd fd, std::string path)
      : lock_(std::move(lock)), fd_(std::move(fd)), path_(std::move(path)) {}
  UniqueFd lock_, fd_;
  std::string path_;
};

struct TcpListener {
  UniqueFd fd;
  int port = 0;
};

// Listens on a loopback address ("127.0.0.1", "::1", "localhost" for the former; port 0 takes any).
// A port that somebody else has is an error: no port is shared. Errors: kInvalidArgument (not a
// loopback address), kConflict (in use), kIo.
Result<TcpListener> OpenTcpListener(const std::string& name, int port);

}  // namespace patina::daemon
