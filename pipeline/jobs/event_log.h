// What a running job tells: to a person, and to a file of events. Described by
// schemas/events.schema.json.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/jobs/job_result.h"

namespace patina {

// Told about everything in a job's life, on the thread that runs the job: for each stage a start,
// reports, notes, warnings and, unless it fails, an end; at last the result.
class JobObserver : public ProgressSink {
 public:
  virtual void OnStageStarted(const std::string& stage) = 0;
  // A file of the input; status is "found", "guessed" or "ignored".
  virtual void OnNote(const std::string& status, const std::string& message) = 0;
  virtual void OnStageFinished(const std::string& stage, double seconds) = 0;
  virtual void OnResult(const JobResult& result) = 0;
};

// Passes everything on to several observers, which must outlive it.
class ObserverList : public JobObserver {
 public:
  void Add(JobObserver* observer) { observers_.push_back(observer); }

  void OnProgress(const ProgressEvent& event) override;
  void OnWarning(const std::string& message) override;
  void OnStageStarted(const std::string& stage) override;
  void OnNote(const std::string& status, const std::string& message) override;
  void OnStageFinished(const std::string& stage, double seconds) override;
  void OnResult(const JobResult& result) override;

 private:
  std::vector<JobObserver*> observers_;
};

// Writes events to a file, one JSON object a line, each with a single write so that a reader never
// sees half a line that will not be completed. Reports of progress are thinned to ten a second. A
// write that fails is not tried again and does not disturb the job; see failed().
class EventLog : public JobObserver {
 public:
  // Creates or empties the file. Errors: kIo, kNotFound, kResourceExhausted.
  static Result<EventLog> Open(const std::string& path);
  ~EventLog() override;
  EventLog(EventLog&& other) noexcept;
  EventLog& operator=(EventLog&&) = delete;

  // Whether some event could not be written.
  bool failed() const { return failed_; }

  void OnProgress(const ProgressEvent& event) override;
  void OnWarning(const std::string& message) override;
  void OnStageStarted(const std::string& stage) override;
  void OnNote(const std::string& status, const std::string& message) override;
  void OnStageFinished(const std::string& stage, double seconds) override;
  void OnResult(const JobResult& result) override;

 private:
  using Clock = std::chrono::steady_clock;
  explicit EventLog(int fd) : fd_(fd), start_(Clock::now()) {}
  // fields: the members of the event after "type", as JSON text that starts with a comma, or
  // nothing.
  void Write(const char* type, const std::string& fields);

  int fd_ = -1;
  bool failed_ = false;
  int64_t seq_ = 0;
  Clock::time_point start_;
  Clock::time_point last_progress_{};
};

}  // namespace patina
