// The handlers of what the dashboard shows: its own files, containers of all revisions, and how a
// job learns.
#include "daemon/api/api_json.h"
#include "daemon/api/api_parts.h"
#include "daemon/api/container_files.h"
#include "daemon/api/dashboard.h"
#include "daemon/api/submit_body.h"
#include "formats/base/names.h"

namespace patina::daemon {

bool Api::AdmitsTicket(const HttpRequest& request) {
  if (request.query.size() != 1 || request.query[0].first != "ticket") return false;
  return tickets_.Admits(request.query[0].second, request.path, Tickets::Clock::now());
}

HttpResponse Api::IssueTicket(const Call& call) {
  const ParsedTicket parsed = ParseTicket(call.request.body);
  if (!parsed.problems.empty()) return FieldsRefused(parsed.problems);
  const auto ticket = tickets_.Issue(parsed.path, Tickets::Clock::now());
  if (!ticket) return ProblemResponse(ticket.error());
  return JsonResponse(200, TicketJson("?ticket=" + *ticket, Tickets::kLifetime.count()));
}

HttpResponse Api::SendContainerFile(const HttpRequest& request, const std::string& container,
                                    const std::string& name) const {
  auto file = OpenBelow(container, name);
  if (!file) return ProblemResponse(file.error());
  HttpResponse response;
  const std::string tag = Revised(container + "/" + name + " " + std::to_string(file->mtime_ns) +
                                  " " + std::to_string(file->bytes));
  response.headers.emplace_back("ETag", tag);
  if (NamesTag(request.Header("If-None-Match"), tag)) {
    response.status = 304;
    return response;
  }
  response.content_type = ContentTypeOf(name);
  // A report is a page of its own and runs nothing.
  response.headers.emplace_back("Content-Security-Policy",
                                "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
                                "frame-ancestors 'none'; sandbox");
  if (file->bytes == 0) return response;
  response.file = std::move(file->fd);
  response.file_bytes = file->bytes;
  return response;
}

HttpResponse Api::ListRevisions(const Call& call) {
  const auto asset = service_->GetAsset(call.arguments[0]);
  if (!asset) return ProblemResponse(asset.error());
  const auto revisions = RevisionsOf(asset->out + "/" + asset->name);
  std::vector<ListedRevision> listed;
  if (!revisions && revisions.error().code != ErrorCode::kNotFound)
    return ProblemResponse(revisions.error());
  if (revisions) {
    for (const AssetRevision& revision : *revisions) {
      const auto files = FilesBelow(revision.container);
      if (!files) continue;  // removed meanwhile
      uint64_t bytes = 0;
      for (const ContainerFile& file : *files) bytes += file.bytes;
      listed.push_back(
          {revision.name, revision.published_ms, bytes, revision.name == asset->revision});
    }
  }
  return WithTag(call.request, RevisionListJson(*asset, listed));
}

HttpResponse Api::GetRevisionFile(const Call& call) {
  const auto asset = service_->GetAsset(call.arguments[0]);
  if (!asset) return ProblemResponse(asset.error());
  const auto revisions = RevisionsOf(asset->out + "/" + asset->name);
  if (!revisions) return ProblemResponse(revisions.error());
  // One of those that are there: a name is never made into a path.
  for (const AssetRevision& revision : *revisions) {
    if (revision.name == call.arguments[1])
      return SendContainerFile(call.request, revision.container, call.arguments[2]);
  }
  return ProblemResponse(404, "not_found",
                         "the asset has no revision " + QuoteForMessage(call.arguments[1]));
}

HttpResponse Api::GetJobCurve(const Call& call) {
  const auto curve = service_->Curve(call.id);
  return curve ? WithTag(call.request, CurveJson(*curve)) : ProblemResponse(curve.error());
}

HttpResponse Api::GetDashboard(const Call&) { return DashboardResponse("index.html"); }

HttpResponse Api::GetDashboardFile(const Call& call) {
  return DashboardResponse(call.arguments[0]);
}

}  // namespace patina::daemon
