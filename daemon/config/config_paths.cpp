#include "daemon/config/config_paths.h"

#include <arpa/inet.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

namespace patina::daemon {

namespace fs = std::filesystem;

std::string AbsolutePath(const std::string& path, const std::string& base) {
  std::error_code error;
  fs::path whole = path;
  if (whole.is_relative()) {
    const fs::path from = base.empty() ? fs::current_path(error) : fs::path(base);
    whole = (from.is_relative() ? fs::current_path(error) / from : from) / whole;
  }
  std::string text = whole.lexically_normal().string();
  while (text.size() > 1 && text.back() == '/') text.pop_back();
  return text;
}

std::string FolderOf(const std::string& file) {
  const std::string folder = fs::path(file).parent_path().string();
  return folder.empty() ? "." : folder;
}

bool IsWithin(const std::string& path, const std::string& folder) {
  std::error_code error;
  const std::string inner = fs::weakly_canonical(path, error).string();
  if (error) return false;
  const std::string outer = fs::weakly_canonical(folder, error).string();
  if (error) return false;
  return inner == outer || outer == "/" ||
         (inner.size() > outer.size() && inner.compare(0, outer.size(), outer) == 0 &&
          inner[outer.size()] == '/');
}

bool IsLoopback(const std::string& host) {
  if (host == "localhost") return true;
  in_addr v4{};
  if (::inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  in6_addr v6{};
  return ::inet_pton(AF_INET6, host.c_str(), &v6) == 1 && IN6_IS_ADDR_LOOPBACK(&v6);
}

std::string FindWorker(const std::string* path) {
  char program[4096];
  const ssize_t size = ::readlink("/proc/self/exe", program, sizeof program);
  if (size > 0 && size < static_cast<ssize_t>(sizeof program)) {
    const std::string beside =
        FolderOf(std::string(program, static_cast<size_t>(size))) + "/patina";
    if (::access(beside.c_str(), X_OK) == 0) return beside;
  }
  if (path == nullptr) return "";
  for (size_t at = 0; at <= path->size();) {
    const size_t end = std::min(path->find(':', at), path->size());
    const std::string candidate = path->substr(at, end - at) + "/patina";
    if (candidate.front() == '/' && ::access(candidate.c_str(), X_OK) == 0) return candidate;
    at = end + 1;
  }
  return "";
}

}  // namespace patina::daemon
