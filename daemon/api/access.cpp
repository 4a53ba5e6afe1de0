#include "daemon/api/access.h"

#include <fcntl.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "daemon/api/tickets.h"
#include "daemon/base/unique_fd.h"
#include "formats/base/file_io.h"
#include "formats/base/names.h"

namespace patina::daemon {
namespace {

constexpr size_t kMinTokenBytes = 16;
constexpr size_t kMaxTokenBytes = 1024;
constexpr size_t kMadeTokenBytes = 24;
constexpr std::string_view kTokenCharacters =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~+/=";

tl::unexpected<Error> Unfit(const std::string& path, const std::string& why) {
  return Fail(ErrorCode::kInvalidArgument,
              "the token file " + QuoteForMessage(path) + " " + why +
                  "; make one with: (umask 077; head -c 32 /dev/urandom | base64 > FILE)");
}

}  // namespace

Result<std::string> ReadTokenFile(const std::string& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0) {
    if (errno == ENOENT) return Unfit(path, "is not there");
    return FailErrno(errno, "cannot look at the token file", path);
  }
  if ((info.st_mode & 077) != 0) return Unfit(path, "can be read by others than its owner");
  PATINA_ASSIGN(std::string token, ReadTextFile(path, kMaxTokenBytes));
  while (!token.empty() && (token.back() == '\n' || token.back() == '\r' || token.back() == ' '))
    token.pop_back();
  if (token.size() < kMinTokenBytes) return Unfit(path, "holds fewer than 16 characters");
  if (token.find_first_not_of(kTokenCharacters) != std::string::npos)
    return Unfit(path, "holds characters other than A-Z a-z 0-9 - . _ ~ + / =");
  return token;
}

Result<std::string> ReadOrMakeTokenFile(const std::string& path) {
  struct stat info {};
  if (lstat(path.c_str(), &info) == 0 || errno != ENOENT) return ReadTokenFile(path);
  PATINA_ASSIGN(const std::string token, RandomName(kMadeTokenBytes));
  // Under another name first: half a token would be refused at every start from then on.
  const std::string fresh = path + ".new";
  unlink(fresh.c_str());
  const UniqueFd fd(
      open(fresh.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!fd) return FailErrno(errno, "cannot make the token file", fresh);
  const std::string line = token + "\n";
  if (write(fd.get(), line.data(), line.size()) != static_cast<ssize_t>(line.size()) ||
      fsync(fd.get()) != 0 || rename(fresh.c_str(), path.c_str()) != 0) {
    const int error = errno;
    unlink(fresh.c_str());
    return FailErrno(error, "cannot write the token file", path);
  }
  return token;
}

bool CarriesToken(std::string_view authorization, std::string_view token) {
  constexpr std::string_view kScheme = "bearer ";
  if (authorization.size() < kScheme.size() ||
      strncasecmp(authorization.data(), kScheme.data(), kScheme.size()) != 0)
    return false;
  authorization.remove_prefix(kScheme.size());
  unsigned difference = authorization.size() == token.size() ? 0 : 1;
  for (size_t i = 0; i < authorization.size(); ++i) {
    difference |= static_cast<unsigned char>(authorization[i]) ^
                  static_cast<unsigned char>(token[i % token.size()]);
  }
  return difference == 0;
}

bool IsLocalHost(std::string_view host) {
  const size_t bracket = host.rfind(']');
  const size_t colon = host.rfind(':');
  if (colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket)) {
    const std::string_view port = host.substr(colon + 1);
    if (port.find_first_not_of("0123456789") != std::string_view::npos) return false;
    host = host.substr(0, colon);
  }
  if (host == "[::1]") return true;
  if (host.size() == 9 && strncasecmp(host.data(), "localhost", 9) == 0) return true;
  return host.size() <= 15 && host.substr(0, 4) == "127." &&
         host.find_first_not_of("0123456789.") == std::string_view::npos;
}

bool IsCrossSite(const HttpRequest& request) {
  const std::string_view origin = request.Header("Origin");
  if (!origin.empty()) {
    const size_t scheme = origin.find("://");
    const std::string_view host = request.Header("Host");
    if (scheme == std::string_view::npos) return true;  // "null": a sandboxed page, or a file
    const std::string_view from = origin.substr(scheme + 3);
    if (from.size() != host.size() || strncasecmp(from.data(), host.data(), host.size()) != 0)
      return true;
  }
  if (request.method == "GET") return false;
  const std::string_view site = request.Header("Sec-Fetch-Site");
  if (!site.empty() && site != "same-origin" && site != "none") return true;
  const std::string_view type = request.Header("Content-Type");
  for (const std::string_view form :
       {"application/x-www-form-urlencoded", "multipart/form-data", "text/plain"}) {
    if (type.size() >= form.size() && strncasecmp(type.data(), form.data(), form.size()) == 0)
      return true;
  }
  return false;
}

}  // namespace patina::daemon
