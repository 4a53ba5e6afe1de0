// The HTTP/JSON API: routes, checks and answers. Described by schemas/openapi.json, which a test
// compares with Routes() in both directions.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "daemon/api/answers.h"
#include "daemon/api/http_types.h"
#include "daemon/api/tickets.h"
#include "daemon/api/uploads.h"
#include "daemon/base/log.h"
#include "daemon/service/service.h"

namespace patina::daemon {

struct ApiOptions {
  std::string default_out;                      // of jobs that name none
  std::string token;                            // asked for over TCP
  UploadOptions uploads;                        // without a folder: none are taken
  uint64_t max_body_bytes = uint64_t{4} << 20;  // of one request, and so of a piece of an upload
  int max_event_clients = 64;
  std::chrono::milliseconds ping{15000};  // between two signs of life to an event client
};

// "GET", "/v1/jobs/{id}", "getJob".
struct ApiRoute {
  const char* method;
  const char* path;
  const char* operation;
};
std::span<const ApiRoute> ApiRoutes();

class Api : public HttpHandler {
 public:
  // The service, the source (may be null) and the log must outlive the API.
  Api(const ApiOptions& options, Service* service, AssetSource* source, Logger* log);

  HttpResponse Handle(const HttpRequest& request) override;
  HttpResponse Refuse(int status) override;

  int event_clients() const { return event_clients_; }

 private:
  struct Call;
  using Handler = HttpResponse (Api::*)(const Call&);
  static Handler HandlerOf(size_t route);

  HttpResponse Route(const HttpRequest& request);
  HttpResponse CheckAccess(const HttpRequest& request);

  HttpResponse SubmitJob(const Call& call);
  HttpResponse ListJobs(const Call& call);
  HttpResponse GetJob(const Call& call);
  HttpResponse CancelJob(const Call& call);
  HttpResponse RetryJob(const Call& call);
  HttpResponse HoldJob(const Call& call);
  HttpResponse ReleaseJob(const Call& call);
  HttpResponse SetJobPriority(const Call& call);
  HttpResponse GetJobLog(const Call& call);
  HttpResponse GetJobCurve(const Call& call);
  HttpResponse StreamEvents(const Call& call);
  HttpResponse ListAssets(const Call& call);
  HttpResponse GetAsset(const Call& call);
  HttpResponse ListAssetFiles(const Call& call);
  HttpResponse GetAssetFile(const Call& call);
  HttpResponse ListRevisions(const Call& call);
  HttpResponse GetRevisionFile(const Call& call);
  HttpResponse GetRevisionShader(const Call& call);
  HttpResponse BeginUpload(const Call& call);
  HttpResponse WriteUpload(const Call& call);
  HttpResponse SubmitUpload(const Call& call);
  HttpResponse DropUpload(const Call& call);
  HttpResponse IssueTicket(const Call& call);
  HttpResponse GetStatus(const Call& call);
  HttpResponse PauseQueue(const Call& call);
  HttpResponse ResumeQueue(const Call& call);
  HttpResponse Rescan(const Call& call);
  HttpResponse GetDescription(const Call& call);
  HttpResponse GetHealth(const Call& call);
  HttpResponse GetReadiness(const Call& call);
  HttpResponse GetMetrics(const Call& call);
  HttpResponse GetDashboard(const Call& call);
  HttpResponse GetDashboardFile(const Call& call);

  // Whether a request carries a ticket that was issued for its path.
  bool AdmitsTicket(const HttpRequest& request);
  HttpResponse AfterChange(int64_t id, const Status& status);
  void WriteEvents(Subscription* events, EventWriter* out) const;

  ApiOptions options_;
  Service* service_;
  AssetSource* source_;
  Logger* log_;
  std::unique_ptr<Uploads> uploads_;  // null: none are taken
  Tickets tickets_;
  ShaderPackages shaders_;
  std::atomic<int> event_clients_{0};
  std::atomic<int64_t> requests_{0}, refused_{0};
};

}  // namespace patina::daemon
