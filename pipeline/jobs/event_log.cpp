#include "pipeline/jobs/event_log.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <utility>

#include "formats/base/file_io.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

// The members of an object without its braces, after a comma.
std::string Members(const Json& object) {
  const std::string text = object.dump(-1, ' ', false, Json::error_handler_t::replace);
  return "," + text.substr(1, text.size() - 2);
}

}  // namespace

void ObserverList::OnProgress(const ProgressEvent& event) {
  for (JobObserver* o : observers_) o->OnProgress(event);
}
void ObserverList::OnWarning(const std::string& message) {
  for (JobObserver* o : observers_) o->OnWarning(message);
}
void ObserverList::OnStageStarted(const std::string& stage) {
  for (JobObserver* o : observers_) o->OnStageStarted(stage);
}
void ObserverList::OnNote(const std::string& status, const std::string& message) {
  for (JobObserver* o : observers_) o->OnNote(status, message);
}
void ObserverList::OnStageFinished(const std::string& stage, double seconds) {
  for (JobObserver* o : observers_) o->OnStageFinished(stage, seconds);
}
void ObserverList::OnResult(const JobResult& result) {
  for (JobObserver* o : observers_) o->OnResult(result);
}

Result<EventLog> EventLog::Open(const std::string& path) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0644);
  if (fd < 0) return FailErrno(errno, "cannot write events to", path);
  return EventLog(fd);
}

EventLog::EventLog(EventLog&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      failed_(other.failed_),
      seq_(other.seq_),
      start_(other.start_),
      last_progress_(other.last_progress_) {}

EventLog::~EventLog() {
  if (fd_ >= 0) ::close(fd_);
}

void EventLog::Write(const char* type, const std::string& fields) {
  if (failed_) return;
  const double time_s = std::chrono::duration<double>(Clock::now() - start_).count();
  std::string line = Json{{"seq", seq_++}, {"time_s", time_s}, {"type", type}}.dump();
  line.pop_back();
  line += fields + "}\n";
  size_t done = 0;
  while (done < line.size()) {
    const ssize_t n = ::write(fd_, line.data() + done, line.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      failed_ = true;
      return;
    }
    done += static_cast<size_t>(n);
  }
}

void EventLog::OnProgress(const ProgressEvent& event) {
  const Clock::time_point now = Clock::now();
  if (now - last_progress_ < std::chrono::milliseconds(100) && event.fraction < 1) return;
  last_progress_ = now;
  Json json{{"stage", event.stage}};
  if (event.fraction >= 0) json["fraction"] = std::clamp(event.fraction, 0.0, 1.0);
  json["elapsed_s"] = std::max(0.0, event.elapsed_s);
  if (event.eta_s >= 0) json["eta_s"] = event.eta_s;
  if (event.samples > 0) json["samples"] = event.samples;
  if (event.samples_per_s > 0) json["samples_per_s"] = event.samples_per_s;
  if (event.psnr_db > 0) json["psnr_db"] = event.psnr_db;
  if (event.gain_10s_db > 0) json["gain_10s_db"] = event.gain_10s_db;
  if (!event.message.empty()) json["message"] = event.message;
  Write("progress", Members(json));
}

void EventLog::OnWarning(const std::string& message) {
  Write("warning", Members(Json{{"message", message}}));
}

void EventLog::OnStageStarted(const std::string& stage) {
  Write("stage_started", Members(Json{{"stage", stage}}));
}

void EventLog::OnNote(const std::string& status, const std::string& message) {
  Write("note", Members(Json{{"status", status}, {"message", message}}));
}

void EventLog::OnStageFinished(const std::string& stage, double seconds) {
  Write("stage_finished", Members(Json{{"stage", stage}, {"seconds", seconds}}));
}

void EventLog::OnResult(const JobResult& result) {
  const std::string body = JobResultToJson(result, -1);
  if (!result.error) return Write("result", ",\"result\":" + body);
  const bool gate = result.exit_code == kExitQualityGate;
  const Json json{{"code", gate ? "quality_gate" : ErrorCodeName(result.error->code)},
                  {"message", result.error->message},
                  {"exit_code", result.exit_code}};
  Write("error", Members(json) + ",\"result\":" + body);
}

}  // namespace patina
