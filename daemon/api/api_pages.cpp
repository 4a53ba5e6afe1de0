// The handlers of what the dashboard shows: its own files, containers of all revisions, and how a
// job learns.
#include "daemon/api/answers.h"
#include "daemon/api/api_json.h"
#include "daemon/api/api_parts.h"
#include "daemon/api/container_files.h"
#include "daemon/api/dashboard.h"
#include "daemon/api/submit_body.h"
#include "formats/base/names.h"

namespace patina::daemon {
namespace {

// The folder of one of the revisions that are there: a name is never made into a path.
Result<std::string> ContainerOf(Service* service, const std::string& name,
                                const std::string& wanted) {
  PATINA_ASSIGN(const AssetView asset, service->GetAsset(name));
  PATINA_ASSIGN(const std::vector<AssetRevision> revisions,
                RevisionsOf(asset.out + "/" + asset.name));
  for (const AssetRevision& revision : revisions) {
    if (revision.name == wanted) return revision.container;
  }
  return Fail(ErrorCode::kNotFound, "the asset has no revision " + QuoteForMessage(wanted));
}

}  // namespace

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
  const auto container = ContainerOf(service_, call.arguments[0], call.arguments[1]);
  return container ? ContainerFileAnswer(call.request, *container, call.arguments[2])
                   : ProblemResponse(container.error());
}

HttpResponse Api::GetRevisionShader(const Call& call) {
  const auto container = ContainerOf(service_, call.arguments[0], call.arguments[1]);
  return container ? ShaderFileAnswer(&shaders_, call.request, *container, call.arguments[2])
                   : ProblemResponse(container.error());
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
