// The handlers of uploads.
#include "daemon/api/api_json.h"
#include "daemon/api/api_parts.h"
#include "daemon/api/submit_body.h"
#include "daemon/api/upload_plan.h"

namespace patina::daemon {
namespace {

HttpResponse NoUploads() {
  return ProblemResponse(409, "conflict", "uploads are not taken here; use a drop folder");
}

}  // namespace

HttpResponse Api::BeginUpload(const Call& call) {
  if (uploads_ == nullptr) return NoUploads();
  if (call.request.Header("Content-Type").substr(0, 16) != "application/json")
    return TransportProblem(415);
  const ParsedUpload parsed = ParseUpload(call.request.body);
  if (!parsed.problems.empty()) return FieldsRefused(parsed.problems);
  const auto now = Uploads::Clock::now();
  uploads_->CleanUp(
      [this](int64_t job) {
        const auto known = service_->Get(job);
        return known || known.error().code != ErrorCode::kNotFound;
      },
      now);
  const auto id = uploads_->Begin(parsed.name, parsed.files, now);
  if (!id) return ProblemResponse(id.error());
  HttpResponse response = JsonResponse(201, UploadJson(*id, options_.max_body_bytes));
  response.headers.emplace_back("Location", "/v1/uploads/" + *id);
  return response;
}

HttpResponse Api::WriteUpload(const Call& call) {
  if (uploads_ == nullptr) return NoUploads();
  if (call.request.Header("Content-Type") != "application/octet-stream") {
    return ProblemResponse(415, "unsupported_media_type",
                           "send a piece of a file as application/octet-stream");
  }
  Query query(call.request);
  const int64_t offset = query.Integer("offset", 0, INT64_MAX, 0);
  const std::vector<FieldProblem> problems = query.Problems();
  if (!problems.empty()) return FieldsRefused(problems);
  const auto bytes =
      uploads_->Write(call.arguments[0], call.arguments[1], static_cast<uint64_t>(offset),
                      call.request.body, Uploads::Clock::now());
  return bytes ? JsonResponse(200, PieceJson(*bytes)) : ProblemResponse(bytes.error());
}

HttpResponse Api::SubmitUpload(const Call& call) {
  if (uploads_ == nullptr) return NoUploads();
  if (call.request.Header("Content-Type").substr(0, 16) != "application/json")
    return TransportProblem(415);
  const ParsedUploadSubmit parsed = ParseUploadSubmit(call.request.body);
  if (!parsed.problems.empty()) return FieldsRefused(parsed.problems);
  const std::string& id = call.arguments[0];
  const auto folder = uploads_->Close(id);
  if (!folder) return ProblemResponse(folder.error());

  std::vector<UploadedJob> made;
  std::vector<int64_t> jobs;
  std::optional<Error> stopped;  // by what is not the files' fault
  for (Job& planned : PlanUpload(*folder)) {
    UploadedJob entry;
    entry.asset = planned.asset;
    SubmitRequest request;
    request.job = std::move(planned);
    request.job.quality = parsed.quality;
    request.priority = parsed.priority;
    request.force = parsed.force;
    const auto submitted = service_->Submit(request);
    if (submitted) {
      entry.job = submitted->id;
      jobs.push_back(submitted->id);
    } else {
      entry.problem = submitted.error().message;
      if (submitted.error().code != ErrorCode::kInvalidArgument) stopped = submitted.error();
    }
    made.push_back(std::move(entry));
  }
  const Status noted = uploads_->NoteJobs(id, jobs);
  if (jobs.empty() && stopped) return ProblemResponse(*stopped);
  if (jobs.empty()) {
    std::string detail = "there is nothing to bake in what was sent";
    for (const UploadedJob& entry : made) detail += "\n" + entry.asset + ": " + entry.problem;
    return ProblemResponse(400, "invalid_argument", detail);
  }
  if (!noted) {
    log_->Warning("upload_not_noted", {{"upload", id}, {"reason", noted.error().message}});
  }
  return JsonResponse(202, UploadedJson(made));
}

HttpResponse Api::DropUpload(const Call& call) {
  if (uploads_ == nullptr) return NoUploads();
  const std::vector<FieldProblem> problems = CheckEmptyBody(call.request.body);
  if (!problems.empty()) return FieldsRefused(problems);
  const Status dropped = uploads_->Drop(call.arguments[0]);
  return dropped ? JsonResponse(200, "{\"dropped\":true}\n") : ProblemResponse(dropped.error());
}

}  // namespace patina::daemon
