#include "daemon/api/dashboard.h"

#include "daemon/api/problem.h"

namespace patina::daemon {
namespace {

constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

}  // namespace

bool IsDashboardPath(std::string_view path) { return path == "/" || path.substr(0, 5) == "/web/"; }

HttpResponse DashboardResponse(std::string_view name) {
  for (int i = 0; i < kDashboardFileCount; ++i) {
    if (name != kDashboardFiles[i].name) continue;
    HttpResponse response;
    response.content_type = EndsWith(name, ".html")  ? "text/html; charset=utf-8"
                            : EndsWith(name, ".css") ? "text/css; charset=utf-8"
                            : EndsWith(name, ".svg") ? "image/svg+xml"
                                                     : "text/javascript; charset=utf-8";
    response.headers.emplace_back("Content-Security-Policy", kPolicy);
    response.headers.emplace_back("X-Frame-Options", "DENY");
    response.headers.emplace_back("Cross-Origin-Opener-Policy", "same-origin");
    response.headers.emplace_back("Cross-Origin-Resource-Policy", "same-origin");
    response.body = kDashboardFiles[i].text;
    return response;
  }
  return TransportProblem(404);
}

}  // namespace patina::daemon
