#include "daemon/view/view_handler.h"

#include <algorithm>

#include "daemon/api/access.h"
#include "daemon/api/dashboard.h"
#include "daemon/api/problem.h"
#include "formats/base/names.h"

namespace patina::daemon {
namespace {

constexpr std::string_view kFiles = "/v1/container/files/";
constexpr std::string_view kShader = "/v1/container/shader/";
constexpr std::string_view kSource = "/v1/container/source/";
// What the viewer has in common with the dashboard.
constexpr std::string_view kSharedPages[] = {"api.js",   "dashboard.css", "dom.js",
                                             "icon.svg", "page.css",      "token.js"};

// Whether `path` begins with `prefix`; what follows goes to `rest`.
bool TakePrefix(std::string_view path, std::string_view prefix, std::string* rest) {
  if (path.substr(0, prefix.size()) != prefix) return false;
  *rest = path.substr(prefix.size());
  return true;
}

bool IsViewerPage(std::string_view name) {
  return name.substr(0, 4) == "view" || std::find(std::begin(kSharedPages), std::end(kSharedPages),
                                                  name) != std::end(kSharedPages);
}

HttpResponse NotServed() {
  return ProblemResponse(404, "not_found",
                         "`patina view` serves the viewer and the files that the container's "
                         "manifest lists; there is nothing else at this address");
}

}  // namespace

HttpResponse ViewHandler::Refuse(int status) { return TransportProblem(status); }

HttpResponse ViewHandler::Handle(const HttpRequest& request) {
  HttpResponse response = Route(request);
  AddProtection(&response);
  return response;
}

HttpResponse ViewHandler::Route(const HttpRequest& request) {
  if (!IsLocalHost(request.Header("Host"))) return TransportProblem(403);
  if (IsCrossSite(request))
    return ProblemResponse(403, "forbidden", "a page of another site asks for this");
  if (request.method != "GET") {
    HttpResponse response = TransportProblem(405);
    response.headers.emplace_back("Allow", "GET, HEAD");
    return response;
  }
  std::string name;
  if (request.path == "/") return DashboardResponse("viewer.html");
  if (TakePrefix(request.path, "/web/", &name))
    return IsViewerPage(name) ? DashboardResponse(name) : NotServed();
  if (!CarriesToken(request.Header("Authorization"), token_)) {
    return ProblemResponse(401, "unauthorized",
                           "open the address that `patina view` printed, with all that follows "
                           "the #; it changes with every start");
  }
  if (TakePrefix(request.path, kFiles, &name)) return SendFile(request, name);
  if (TakePrefix(request.path, kShader, &name))
    return ShaderFileAnswer(&shaders_, request, container_.directory, name);
  if (TakePrefix(request.path, kSource, &name)) {
    if (source_ != nullptr) return source_->Answer(name);
    HttpResponse none;
    none.body = "null\n";
    return name == "source.json" ? std::move(none) : NotServed();
  }
  return NotServed();
}

HttpResponse ViewHandler::SendFile(const HttpRequest& request, const std::string& name) const {
  const auto& payloads = container_.manifest.payloads;
  const bool listed = name == kManifestName || std::any_of(payloads.begin(), payloads.end(),
                                                           [&name](const ManifestPayload& payload) {
                                                             return payload.name == name;
                                                           });
  return listed ? ContainerFileAnswer(request, container_.directory, name) : NotServed();
}

}  // namespace patina::daemon
