#include "daemon/api/api.h"

#include <algorithm>

#include "daemon/api/access.h"
#include "daemon/api/answers.h"
#include "daemon/api/api_json.h"
#include "daemon/api/api_parts.h"
#include "daemon/api/container_files.h"
#include "daemon/api/dashboard.h"
#include "daemon/api/metrics_text.h"
#include "daemon/api/openapi_text.h"
#include "daemon/api/problem.h"
#include "daemon/api/submit_body.h"
#include "formats/base/names.h"
#include "pipeline/jobs/job.h"

namespace patina::daemon {
namespace {

constexpr int kDefaultLimit = 100;
constexpr int kMaxLimit = 1000;
constexpr int64_t kDefaultLogBytes = 65536;
constexpr int64_t kMaxLogBytes = 1 << 20;
// Between two looks at whether an event client is still there.
constexpr std::chrono::milliseconds kEventWait{1000};

constexpr ApiRoute kRoutes[] = {
    {"POST", "/v1/jobs", "submitJob"},
    {"GET", "/v1/jobs", "listJobs"},
    {"GET", "/v1/jobs/{id}", "getJob"},
    {"POST", "/v1/jobs/{id}/cancel", "cancelJob"},
    {"POST", "/v1/jobs/{id}/retry", "retryJob"},
    {"POST", "/v1/jobs/{id}/hold", "holdJob"},
    {"POST", "/v1/jobs/{id}/release", "releaseJob"},
    {"POST", "/v1/jobs/{id}/priority", "setJobPriority"},
    {"GET", "/v1/jobs/{id}/log", "getJobLog"},
    {"GET", "/v1/jobs/{id}/curve", "getJobCurve"},
    {"GET", "/v1/events", "streamEvents"},
    {"GET", "/v1/assets", "listAssets"},
    {"GET", "/v1/assets/{name}", "getAsset"},
    {"GET", "/v1/assets/{name}/files", "listAssetFiles"},
    {"GET", "/v1/assets/{name}/files/{file}", "getAssetFile"},
    {"GET", "/v1/assets/{name}/revisions", "listRevisions"},
    {"GET", "/v1/assets/{name}/revisions/{revision}/files/{file}", "getRevisionFile"},
    {"GET", "/v1/assets/{name}/revisions/{revision}/shader/{file}", "getRevisionShader"},
    {"POST", "/v1/uploads", "beginUpload"},
    {"POST", "/v1/uploads/{upload}/files/{file}", "writeUpload"},
    {"POST", "/v1/uploads/{upload}/submit", "submitUpload"},
    {"POST", "/v1/uploads/{upload}/drop", "dropUpload"},
    {"POST", "/v1/tickets", "issueTicket"},
    {"GET", "/v1/status", "getStatus"},
    {"POST", "/v1/queue/pause", "pauseQueue"},
    {"POST", "/v1/queue/resume", "resumeQueue"},
    {"POST", "/v1/watch/rescan", "rescan"},
    {"GET", "/v1/openapi.json", "getDescription"},
    {"GET", "/healthz", "getHealth"},
    {"GET", "/readyz", "getReadiness"},
    {"GET", "/metrics", "getMetrics"},
    {"GET", "/", "getDashboard"},
    {"GET", "/web/{file}", "getDashboardFile"},
};

// The parts between slashes; "/a/b" gives a, b.
std::vector<std::string_view> Split(std::string_view path) {
  std::vector<std::string_view> parts;
  for (size_t at = 1; at <= path.size();) {
    const size_t slash = std::min(path.find('/', at), path.size());
    parts.push_back(path.substr(at, slash - at));
    at = slash + 1;
  }
  return parts;
}

// Whether a path fits a pattern; what stands for {names} goes to `arguments`. {file} takes all that
// is left.
bool Fits(const std::string& path, const char* pattern, std::vector<std::string>* arguments) {
  if (path.empty() || path[0] != '/') return false;
  const std::vector<std::string_view> parts = Split(path), wanted = Split(pattern);
  arguments->clear();
  for (size_t i = 0; i < wanted.size(); ++i) {
    if (i >= parts.size()) return false;
    if (wanted[i] == "{file}") {
      arguments->push_back(path.substr(static_cast<size_t>(parts[i].data() - path.data())));
      return true;
    }
    if (wanted[i][0] == '{') {
      arguments->emplace_back(parts[i]);
    } else if (parts[i] != wanted[i]) {
      return false;
    }
  }
  return parts.size() == wanted.size();
}

}  // namespace

std::span<const ApiRoute> ApiRoutes() { return kRoutes; }

Api::Handler Api::HandlerOf(size_t route) {
  constexpr Handler kHandlers[] = {
      &Api::SubmitJob,        &Api::ListJobs,          &Api::GetJob,       &Api::CancelJob,
      &Api::RetryJob,         &Api::HoldJob,           &Api::ReleaseJob,   &Api::SetJobPriority,
      &Api::GetJobLog,        &Api::GetJobCurve,       &Api::StreamEvents, &Api::ListAssets,
      &Api::GetAsset,         &Api::ListAssetFiles,    &Api::GetAssetFile, &Api::ListRevisions,
      &Api::GetRevisionFile,  &Api::GetRevisionShader, &Api::BeginUpload,  &Api::WriteUpload,
      &Api::SubmitUpload,     &Api::DropUpload,        &Api::IssueTicket,  &Api::GetStatus,
      &Api::PauseQueue,       &Api::ResumeQueue,       &Api::Rescan,       &Api::GetDescription,
      &Api::GetHealth,        &Api::GetReadiness,      &Api::GetMetrics,   &Api::GetDashboard,
      &Api::GetDashboardFile,
  };
  static_assert(std::size(kHandlers) == std::size(kRoutes));
  return kHandlers[route];
}

Api::Api(const ApiOptions& options, Service* service, AssetSource* source, Logger* log)
    : options_(options), service_(service), source_(source), log_(log) {
  if (!options.uploads.folder.empty()) uploads_ = std::make_unique<Uploads>(options.uploads);
}

HttpResponse Api::Refuse(int status) {
  ++requests_;
  ++refused_;
  return TransportProblem(status);
}

HttpResponse Api::Handle(const HttpRequest& request) {
  HttpResponse response = CheckAccess(request);
  if (response.status == 200) response = Route(request);
  AddProtection(&response);
  ++requests_;
  if (response.status >= 400) ++refused_;
  if (response.status >= 500) {
    log_->Warning("request_failed", {{"method", request.method},
                                     {"path", request.path},
                                     {"status", response.status},
                                     {"detail", response.body}});
  }
  return response;
}

HttpResponse Api::CheckAccess(const HttpRequest& request) {
  // A reverse proxy before the Unix socket may know its users by what browsers send by themselves.
  if (IsCrossSite(request)) {
    return ProblemResponse(403, "forbidden",
                           "a page of another site asks, or a reverse proxy does not pass the Host "
                           "header on, which must be that of the Origin header");
  }
  if (!request.over_tcp) return {};
  if (!IsLocalHost(request.Header("Host"))) return TransportProblem(403);
  if (request.path == "/healthz" || IsDashboardPath(request.path)) return {};
  if (request.method == "GET" && AdmitsTicket(request)) return {};
  if (options_.token.empty() || !CarriesToken(request.Header("Authorization"), options_.token))
    return TransportProblem(401);
  return {};
}

HttpResponse Api::Route(const HttpRequest& request) {
  std::string allowed;
  Call call{request, {}, 0};
  for (size_t i = 0; i < std::size(kRoutes); ++i) {
    if (!Fits(request.path, kRoutes[i].path, &call.arguments)) continue;
    if (request.method != kRoutes[i].method) {
      allowed += (allowed.empty() ? "" : ", ") + std::string(kRoutes[i].method);
      if (std::string_view(kRoutes[i].method) == "GET") allowed += ", HEAD";
      continue;
    }
    if (std::string_view(kRoutes[i].path).substr(0, 13) == "/v1/jobs/{id}" &&
        !ParseInteger(call.arguments[0], 1, INT64_MAX, &call.id)) {
      return ProblemResponse(404, "not_found",
                             "there is no job " + QuoteForMessage(call.arguments[0]) +
                                 "; its number is a whole one, as `patina jobs` shows it");
    }
    return (this->*HandlerOf(i))(call);
  }
  HttpResponse response = TransportProblem(allowed.empty() ? 404 : 405);
  if (!allowed.empty()) response.headers.emplace_back("Allow", allowed);
  return response;
}

// ---- jobs ------------------------------------------------------------------------------------

HttpResponse Api::SubmitJob(const Call& call) {
  const std::string_view type = call.request.Header("Content-Type");
  if (type.substr(0, 16) != "application/json") return TransportProblem(415);
  Query query(call.request);
  const std::vector<FieldProblem> of_query = query.Problems();
  if (!of_query.empty()) return FieldsRefused(of_query);
  ParsedSubmit parsed = ParseSubmit(call.request.body, options_.default_out);
  const std::string_view key = call.request.Header("Idempotency-Key");
  const bool printable =
      std::all_of(key.begin(), key.end(), [](char c) { return c > ' ' && c < 0x7F; });
  if (key.size() > kMaxIdempotencyKeyBytes || !printable) {
    parsed.problems.push_back({"Idempotency-Key", "must be at most 255 printable characters"});
  }
  if (!parsed.problems.empty()) return FieldsRefused(parsed.problems);
  parsed.request.idempotency_key = key;
  const auto submitted = service_->Submit(parsed.request);
  if (!submitted) {
    if (submitted.error().code == ErrorCode::kInvalidArgument) {
      // Its pointers are those of the job.
      std::vector<FieldProblem> problems = FieldProblemsOf(submitted.error().message, "/job");
      return ProblemResponse(400, "invalid_argument", submitted.error().message, problems);
    }
    return ProblemResponse(submitted.error());
  }
  HttpResponse response = JsonResponse(202, SubmittedJson(*submitted));
  response.headers.emplace_back("Location", "/v1/jobs/" + std::to_string(submitted->id));
  return response;
}

HttpResponse Api::ListJobs(const Call& call) {
  Query query(call.request);
  JobFilter filter;
  filter.limit = static_cast<int>(query.Integer("limit", 1, kMaxLimit, kDefaultLimit));
  filter.before = query.Integer("cursor", 1, INT64_MAX, 0);
  if (const std::string* asset = query.Find("asset")) filter.asset = *asset;
  if (const std::string* states = query.Find("state")) {
    for (size_t at = 0; at <= states->size();) {
      const size_t comma = std::min(states->find(',', at), states->size());
      const std::string name = states->substr(at, comma - at);
      at = comma + 1;
      if (const auto state = ParseJobState(name)) {
        if (std::find(filter.states.begin(), filter.states.end(), *state) == filter.states.end())
          filter.states.push_back(*state);
        continue;
      }
      std::string known;
      for (const JobState state : kJobStates)
        known += (known.empty() ? "" : ", ") + std::string(JobStateName(state));
      query.Complain("state", QuoteForMessage(name) + " is no state; known are " + known);
      break;
    }
  }
  const std::vector<FieldProblem> problems = query.Problems();
  if (!problems.empty()) return FieldsRefused(problems);
  const auto page = service_->List(filter);
  return page ? JsonResponse(200, JobListJson(*page)) : ProblemResponse(page.error());
}

HttpResponse Api::GetJob(const Call& call) {
  const auto job = service_->Get(call.id);
  return job ? WithTag(call.request, JobJson(*job)) : ProblemResponse(job.error());
}

HttpResponse Api::AfterChange(int64_t id, const Status& status) {
  if (!status) return ProblemResponse(status.error());
  const auto job = service_->Get(id);
  return job ? JsonResponse(200, JobJson(*job)) : ProblemResponse(job.error());
}

HttpResponse Api::CancelJob(const Call& call) {
  const std::vector<FieldProblem> problems = CheckEmptyBody(call.request.body);
  if (!problems.empty()) return FieldsRefused(problems);
  const auto state = service_->Cancel(call.id);
  if (!state) return ProblemResponse(state.error());
  // A running job is cancelled when its processes are dead.
  return JsonResponse(*state == JobState::kRunning ? 202 : 200, StateJson(call.id, *state));
}

HttpResponse Api::RetryJob(const Call& call) {
  const std::vector<FieldProblem> problems = CheckEmptyBody(call.request.body);
  if (!problems.empty()) return FieldsRefused(problems);
  return AfterChange(call.id, service_->Retry(call.id));
}

HttpResponse Api::HoldJob(const Call& call) {
  const std::vector<FieldProblem> problems = CheckEmptyBody(call.request.body);
  if (!problems.empty()) return FieldsRefused(problems);
  return AfterChange(call.id, service_->SetHeld(call.id, true));
}

HttpResponse Api::ReleaseJob(const Call& call) {
  const std::vector<FieldProblem> problems = CheckEmptyBody(call.request.body);
  if (!problems.empty()) return FieldsRefused(problems);
  return AfterChange(call.id, service_->SetHeld(call.id, false));
}

HttpResponse Api::SetJobPriority(const Call& call) {
  const ParsedPriority parsed = ParsePriority(call.request.body);
  if (!parsed.problems.empty()) return FieldsRefused(parsed.problems);
  return AfterChange(call.id, service_->SetPriority(call.id, parsed.priority));
}

HttpResponse Api::GetJobLog(const Call& call) {
  Query query(call.request);
  const int64_t offset = query.Integer("offset", INT64_MIN, INT64_MAX, 0);
  const int64_t limit = query.Integer("limit", 1, kMaxLogBytes, kDefaultLogBytes);
  const std::vector<FieldProblem> problems = query.Problems();
  if (!problems.empty()) return FieldsRefused(problems);
  auto log = service_->ReadLog(call.id, offset, static_cast<size_t>(limit));
  if (!log) return ProblemResponse(log.error());
  HttpResponse response;
  response.content_type = "text/plain; charset=utf-8";
  response.headers.emplace_back("Patina-Next-Offset", std::to_string(log->next_offset));
  response.headers.emplace_back("Patina-Log-Complete", log->complete ? "true" : "false");
  response.body = std::move(log->text);
  return response;
}

// ---- events ----------------------------------------------------------------------------------

HttpResponse Api::StreamEvents(const Call& call) {
  Query query(call.request);
  const int64_t job = query.Integer("job", 1, INT64_MAX, 0);
  std::optional<int64_t> after;
  if (query.Find("after") != nullptr) after = query.Integer("after", 0, INT64_MAX, 0);
  const std::string_view last = call.request.Header("Last-Event-ID");
  int64_t id = 0;
  // A client that comes again knows best.
  if (ParseInteger(last, 0, INT64_MAX, &id)) {
    after = id;
  } else if (!last.empty()) {
    query.Complain("Last-Event-ID", "must be the id of an event, a whole number");
  }
  const std::vector<FieldProblem> problems = query.Problems();
  if (!problems.empty()) return FieldsRefused(problems);

  if (event_clients_.fetch_add(1) >= options_.max_event_clients) {
    --event_clients_;
    return ProblemResponse(503, "busy",
                           "there are " + std::to_string(options_.max_event_clients) +
                               " event clients already; close one, or ask for a job's state "
                               "with GET /v1/jobs/{id}");
  }
  // Given back when the last copy of the answer is.
  const std::shared_ptr<void> place(nullptr, [this](void*) { --event_clients_; });
  auto subscribed = service_->Subscribe(after, job);
  if (!subscribed) return ProblemResponse(subscribed.error());
  HttpResponse response;
  response.content_type = "text/event-stream";
  response.stream = [this, place, events = std::shared_ptr<Subscription>(std::move(*subscribed))](
                        EventWriter* out) { WriteEvents(events.get(), out); };
  return response;
}

void Api::WriteEvents(Subscription* events, EventWriter* out) const {
  using Clock = std::chrono::steady_clock;
  if (!out->Write("retry: 2000\n\n")) return;
  Clock::time_point written = Clock::now();
  while (out->IsOpen()) {
    Event event;
    std::string text;
    switch (events->Wait(std::min(kEventWait, options_.ping), &event)) {
      case Subscription::Next::kEvent:
        if (event.id > 0) text = "id: " + std::to_string(event.id) + "\n";
        text += "event: " + event.type + "\ndata: " + EventJson(event) + "\n\n";
        break;
      case Subscription::Next::kGap:
        text = "event: reset\ndata: {}\n\n";
        break;
      case Subscription::Next::kTimeout:
        if (Clock::now() - written >= options_.ping) text = ": ping\n\n";
        break;
      case Subscription::Next::kClosed:
        return;
    }
    if (text.empty()) continue;
    if (!out->Write(text)) return;
    written = Clock::now();
  }
}

// ---- assets ----------------------------------------------------------------------------------

HttpResponse Api::ListAssets(const Call& call) {
  Query query(call.request);
  const int limit = static_cast<int>(query.Integer("limit", 1, kMaxLimit, kDefaultLimit));
  std::string after;
  if (const std::string* cursor = query.Find("cursor")) {
    after = *cursor;
    if (!IsAssetName(after)) query.Complain("cursor", "is none that was given out");
  }
  const std::vector<FieldProblem> problems = query.Problems();
  if (!problems.empty()) return FieldsRefused(problems);
  const auto assets = service_->Assets(after, limit);
  if (!assets) return ProblemResponse(assets.error());
  const bool full = static_cast<int>(assets->size()) >= limit;
  return JsonResponse(200, AssetListJson(*assets, full ? assets->back().name : ""));
}

HttpResponse Api::GetAsset(const Call& call) {
  const auto asset = service_->GetAsset(call.arguments[0]);
  return asset ? WithTag(call.request, AssetJson(*asset)) : ProblemResponse(asset.error());
}

HttpResponse Api::ListAssetFiles(const Call& call) {
  const auto asset = service_->GetAsset(call.arguments[0]);
  if (!asset) return ProblemResponse(asset.error());
  if (asset->container.empty())
    return ProblemResponse(404, "not_found", "the asset has no container yet");
  const auto files = FilesBelow(asset->container);
  return files ? WithTag(call.request, FileListJson(*asset, *files))
               : ProblemResponse(files.error());
}

HttpResponse Api::GetAssetFile(const Call& call) {
  const auto asset = service_->GetAsset(call.arguments[0]);
  if (!asset) return ProblemResponse(asset.error());
  if (asset->container.empty())
    return ProblemResponse(404, "not_found", "the asset has no container yet");
  return ContainerFileAnswer(call.request, asset->container, call.arguments[1]);
}

// ---- the service -----------------------------------------------------------------------------

HttpResponse Api::GetStatus(const Call&) {
  const auto status = service_->GetStatus();
  return status ? JsonResponse(200, StatusJson(*status)) : ProblemResponse(status.error());
}

HttpResponse Api::PauseQueue(const Call& call) {
  const std::vector<FieldProblem> problems = CheckEmptyBody(call.request.body);
  if (!problems.empty()) return FieldsRefused(problems);
  const Status paused = service_->SetQueuePaused(true);
  return paused ? JsonResponse(200, "{\"queue_paused\":true}\n") : ProblemResponse(paused.error());
}

HttpResponse Api::ResumeQueue(const Call& call) {
  const std::vector<FieldProblem> problems = CheckEmptyBody(call.request.body);
  if (!problems.empty()) return FieldsRefused(problems);
  const Status resumed = service_->SetQueuePaused(false);
  return resumed ? JsonResponse(200, "{\"queue_paused\":false}\n")
                 : ProblemResponse(resumed.error());
}

HttpResponse Api::Rescan(const Call& call) {
  const std::vector<FieldProblem> problems = CheckEmptyBody(call.request.body);
  if (!problems.empty()) return FieldsRefused(problems);
  if (source_ == nullptr)
    return ProblemResponse(409, "conflict", "no folder is watched; start patinad with --watch DIR");
  source_->RequestRescan();
  return JsonResponse(202, "{\"rescan\":\"requested\"}\n");
}

HttpResponse Api::GetDescription(const Call& call) { return WithTag(call.request, kOpenApiText); }

HttpResponse Api::GetHealth(const Call&) {
  // Asks nobody who may be waiting for a disk.
  return JsonResponse(200, HealthJson(source_ != nullptr ? source_->Health() : WatchHealth()));
}

HttpResponse Api::GetReadiness(const Call&) {
  const Status ready = service_->Ready();
  if (ready) return JsonResponse(200, "{\"status\":\"ready\"}\n");
  return ProblemResponse(503, ErrorCodeName(ready.error().code), ready.error().message);
}

HttpResponse Api::GetMetrics(const Call&) {
  const auto metrics = service_->GetMetrics();
  if (!metrics) return ProblemResponse(metrics.error());
  HttpResponse response;
  response.content_type = kMetricsContentType;
  response.body = MetricsText(*metrics, {requests_, refused_, event_clients_});
  return response;
}

}  // namespace patina::daemon
