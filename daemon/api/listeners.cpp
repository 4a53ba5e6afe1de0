#include "daemon/api/listeners.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "formats/base/file_io.h"
#include "formats/base/names.h"

namespace patina::daemon {
namespace {

constexpr int kBacklog = 128;

sockaddr_un UnixAddress(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

template <class Address>
int BindTo(int fd, const Address& address) {
  return bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ? 0 : errno;
}

Result<UniqueFd> Listen(UniqueFd fd, int bind_error, const std::string& where) {
  if (bind_error == EADDRINUSE) {
    return Fail(ErrorCode::kConflict,
                "another program listens on " + where + "; stop it, or choose another port");
  }
  if (bind_error != 0)
    return Fail(ErrorCode::kIo, "cannot listen on " + where + ": " + std::strerror(bind_error));
  if (listen(fd.get(), kBacklog) != 0) {
    const int error = errno;
    return Fail(ErrorCode::kIo, "cannot listen on " + where + ": " + std::strerror(error));
  }
  return fd;
}

}  // namespace

Result<UnixListener> UnixListener::Open(const std::string& path) {
  const std::string fresh = path + ".new";
  if (fresh.size() >= sizeof(sockaddr_un::sun_path)) {
    return Fail(ErrorCode::kInvalidArgument,
                "the path of the socket has " + std::to_string(path.size()) +
                    " bytes, and a socket's may have " +
                    std::to_string(sizeof(sockaddr_un::sun_path) - 5) + ": " +
                    QuoteForMessage(path) + "; choose a shorter one with --socket");
  }
  const std::string lock_path = path + ".lock";
  UniqueFd lock(open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!lock) return FailErrno(errno, "cannot open", lock_path);
  if (flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    return Fail(ErrorCode::kConflict, "another patinad listens on " + QuoteForMessage(path) +
                                          "; stop it, or choose another socket with --socket");
  }
  struct stat info {};
  if (lstat(path.c_str(), &info) == 0 && !S_ISSOCK(info.st_mode)) {
    return Fail(ErrorCode::kConflict, QuoteForMessage(path) +
                                          " is there and no socket; choose another path with "
                                          "--socket, or remove it");
  }
  // Nobody can connect before it listens, and then its mode and its place are final.
  UniqueFd fd(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!fd) return FailErrno(errno, "cannot make the socket", path);
  unlink(fresh.c_str());
  const int bound = BindTo(fd.get(), UnixAddress(fresh));
  if (bound != 0) return FailErrno(bound, "cannot make the socket", path);
  if (chmod(fresh.c_str(), 0600) != 0) return FailErrno(errno, "cannot make the socket", path);
  PATINA_ASSIGN(UniqueFd listening, Listen(std::move(fd), 0, path));
  if (rename(fresh.c_str(), path.c_str()) != 0) {
    const int error = errno;
    unlink(fresh.c_str());
    return FailErrno(error, "cannot make the socket", path);
  }
  return UnixListener(std::move(lock), std::move(listening), path);
}

UnixListener::~UnixListener() {
  if (fd_) unlink(path_.c_str());
}

Result<TcpListener> OpenTcpListener(const std::string& name, int port) {
  const std::string host = name == "localhost" ? "127.0.0.1" : name;
  const std::string where = host + ":" + std::to_string(port);
  in_addr v4{};
  in6_addr v6{};
  const bool is_v4 = inet_pton(AF_INET, host.c_str(), &v4) == 1;
  const bool is_v6 = !is_v4 && inet_pton(AF_INET6, host.c_str(), &v6) == 1;
  const bool is_loopback =
      (is_v4 && (ntohl(v4.s_addr) >> 24) == 127) || (is_v6 && IN6_IS_ADDR_LOOPBACK(&v6));
  if (!is_loopback || port < 0 || port > 65535) {
    return Fail(ErrorCode::kInvalidArgument,
                QuoteForMessage(where) +
                    " is no loopback address with a port; the API is offered to this machine "
                    "only, on 127.0.0.1 or ::1");
  }
  UniqueFd fd(socket(is_v4 ? AF_INET : AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!fd)
    return Fail(ErrorCode::kIo, std::string("cannot make a socket: ") + std::strerror(errno));
  // A port whose last connections are still being closed may be taken; one that is in use may not,
  // which SO_REUSEPORT would allow.
  const int on = 1;
  setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  int bound = 0;
  if (is_v4) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr = v4;
    address.sin_port = htons(static_cast<uint16_t>(port));
    bound = BindTo(fd.get(), address);
  } else {
    sockaddr_in6 address{};
    address.sin6_family = AF_INET6;
    address.sin6_addr = v6;
    address.sin6_port = htons(static_cast<uint16_t>(port));
    bound = BindTo(fd.get(), address);
  }
  TcpListener listener;
  PATINA_ASSIGN(listener.fd, Listen(std::move(fd), bound, where));
  sockaddr_in6 bound_to{};
  socklen_t size = sizeof bound_to;
  getsockname(listener.fd.get(), reinterpret_cast<sockaddr*>(&bound_to), &size);
  // The port stands at the same place in both kinds of address.
  listener.port = ntohs(bound_to.sin6_port);
  return listener;
}

}  // namespace patina::daemon
