#include "tests/daemon/api/fake_service.h"

#include <algorithm>

namespace patina::daemon {

class FakeService::Listener : public Subscription {
 public:
  Listener(FakeService* service, size_t next, int64_t job, bool gap)
      : service_(service), next_(next), job_(job), gap_(gap) {}
  ~Listener() override {
    const std::lock_guard<std::mutex> lock(service_->mutex_);
    --service_->subscribers_;
  }
  Next Wait(std::chrono::milliseconds timeout, Event* event) override {
    std::unique_lock<std::mutex> lock(service_->mutex_);
    if (gap_) {
      gap_ = false;
      return Next::kGap;
    }
    const auto skip = [&] {
      while (next_ < service_->events_.size() && job_ != 0 && service_->events_[next_].job != job_)
        ++next_;
      return service_->closed_ || next_ < service_->events_.size();
    };
    if (!service_->changed_.wait_for(lock, timeout, skip)) return Next::kTimeout;
    if (service_->closed_) return Next::kClosed;
    *event = service_->events_[next_++];
    return Next::kEvent;
  }

 private:
  FakeService* service_;
  size_t next_;
  int64_t job_;
  bool gap_;
};

FakeService::FakeService() {
  for (int64_t id = 1; id <= 3; ++id) {
    JobView& job = jobs[id];
    job.record.id = id;
    job.record.asset = "wall" + std::to_string(id);
    job.record.kind = "material";
    job.record.out = "/out";
    job.record.created_ms = 1700000000000;
    job.record.job_json = "{\"version\": 1}";
  }
  jobs[2].record.state = JobState::kRunning;
  jobs[2].progress = JobProgress{"train", 0.5, 12, 31, 0, "on its way"};
  jobs[3].record.state = JobState::kFailed;
  jobs[3].record.error_code = "corrupt_data";
  jobs[3].record.error_message = "albedo.png is cut off";
  jobs[3].record.result_json = "{\"version\": 1}";
  jobs[1].waiting_reason = "waits for 1 core";
}

void FakeService::Publish(const std::string& type, int64_t job, const std::string& data,
                          bool keep) {
  const std::lock_guard<std::mutex> lock(mutex_);
  Event event;
  if (keep) event.id = ++last_id_;
  event.time_ms = 1700000000000;
  event.type = type;
  event.job = job;
  event.data = data;
  events_.push_back(event);
  changed_.notify_all();
}

void FakeService::Forget(int64_t id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  forgotten_ = id;
}

void FakeService::Add(int64_t id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  jobs[id].record.id = id;
  jobs[id].record.asset = "wall" + std::to_string(id);
}

void FakeService::Change(int64_t id, JobState state) {
  const std::lock_guard<std::mutex> lock(mutex_);
  jobs[id].record.state = state;
  jobs[id].progress.reset();
}

void FakeService::Close() {
  const std::lock_guard<std::mutex> lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

int FakeService::subscribers() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return subscribers_;
}

Result<Submitted> FakeService::Submit(const SubmitRequest& request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (failure) return Fail(*failure);
  for (size_t i = 0; i < submitted.size(); ++i) {
    if (request.idempotency_key.empty() || submitted[i].idempotency_key != request.idempotency_key)
      continue;
    if (submitted[i].job.asset != request.job.asset)
      return Fail(ErrorCode::kConflict, "the key was used for another request");
    return Submitted{100 + static_cast<int64_t>(i), false};
  }
  submitted.push_back(request);
  return Submitted{99 + static_cast<int64_t>(submitted.size()), true};
}

Result<JobView> FakeService::Get(int64_t id) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (failure) return Fail(*failure);
  const auto found = jobs.find(id);
  if (found == jobs.end())
    return Fail(ErrorCode::kNotFound, "there is no job " + std::to_string(id));
  return found->second;
}

Result<JobViewPage> FakeService::List(const JobFilter& filter) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (failure) return Fail(*failure);
  JobViewPage page;
  for (auto job = jobs.rbegin(); job != jobs.rend(); ++job) {
    const JobRecord& record = job->second.record;
    if (filter.before > 0 && record.id >= filter.before) continue;
    if (!filter.asset.empty() && record.asset != filter.asset) continue;
    if (!filter.states.empty() &&
        std::find(filter.states.begin(), filter.states.end(), record.state) == filter.states.end())
      continue;
    if (static_cast<int>(page.jobs.size()) == filter.limit) {
      page.next = page.jobs.back().record.id;
      break;
    }
    page.jobs.push_back(job->second);
  }
  return page;
}

Result<JobState> FakeService::Cancel(int64_t id) {
  const auto job = Get(id);
  if (!job) return Fail(job.error());
  if (IsFinal(job->record.state)) return Fail(ErrorCode::kConflict, "the job has ended");
  return job->record.state == JobState::kRunning ? JobState::kRunning : JobState::kCancelled;
}

Status FakeService::Retry(int64_t id) {
  const auto job = Get(id);
  if (!job) return Fail(job.error());
  if (job->record.state != JobState::kFailed) return Fail(ErrorCode::kConflict, "it did not fail");
  return {};
}

Status FakeService::SetHeld(int64_t id, bool held) {
  if (const auto job = Get(id); !job) return Fail(job.error());
  const std::lock_guard<std::mutex> lock(mutex_);
  jobs[id].record.held = held;
  return {};
}

Status FakeService::SetPriority(int64_t id, int priority) {
  if (const auto job = Get(id); !job) return Fail(job.error());
  const std::lock_guard<std::mutex> lock(mutex_);
  jobs[id].record.priority = priority;
  return {};
}

Status FakeService::SetQueuePaused(bool) {
  if (failure) return Fail(*failure);
  return {};
}

Result<LogChunk> FakeService::ReadLog(int64_t id, int64_t offset, size_t max_bytes) {
  if (const auto job = Get(id); !job) return Fail(job.error());
  const auto size = static_cast<int64_t>(log.size());
  const int64_t at =
      offset < 0 ? std::max<int64_t>(0, size + std::max(offset, -size)) : std::min(offset, size);
  LogChunk chunk;
  chunk.text = log.substr(static_cast<size_t>(at), max_bytes);
  chunk.next_offset = at + static_cast<int64_t>(chunk.text.size());
  chunk.complete = chunk.next_offset == size;
  return chunk;
}

Result<std::unique_ptr<Subscription>> FakeService::Subscribe(std::optional<int64_t> after,
                                                             int64_t job) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (failure) return Fail(*failure);
  size_t next = events_.size();
  if (after) {
    next = 0;
    while (next < events_.size() && events_[next].id <= std::max(*after, forgotten_)) ++next;
  }
  ++subscribers_;
  return std::unique_ptr<Subscription>(
      std::make_unique<Listener>(this, next, job, after && *after < forgotten_));
}

Result<OfferOutcome> FakeService::OfferAsset(const AssetOffer&) { return OfferOutcome::kQueued; }
Status FakeService::WithdrawAsset(const std::string&) { return {}; }

Result<std::vector<CurvePoint>> FakeService::Curve(int64_t id) {
  const auto job = Get(id);
  if (!job) return Fail(job.error());
  return std::vector<CurvePoint>{{1, 20.5}, {2, 24}};
}

Result<std::vector<AssetView>> FakeService::Assets(const std::string& after_name, int limit) {
  if (failure) return Fail(*failure);
  std::vector<AssetView> page;
  for (auto asset = assets.upper_bound(after_name);
       asset != assets.end() && static_cast<int>(page.size()) < limit; ++asset)
    page.push_back(asset->second);
  return page;
}

Result<AssetView> FakeService::GetAsset(const std::string& name) {
  const auto found = assets.find(name);
  if (found == assets.end()) return Fail(ErrorCode::kNotFound, "there is no such asset");
  return found->second;
}

void FakeService::AttachSource(AssetSource*) {}

Result<ServiceStatus> FakeService::GetStatus() {
  if (failure) return Fail(*failure);
  ServiceStatus status;
  status.version = "0.1.0";
  status.pid = 1;
  status.started_ms = 1700000000000;
  status.state = "running";
  status.state_dir = "/state";
  status.out = "/out";
  for (const JobState state : kJobStates) status.counts.by_state[state] = 1;
  status.watch.roots = roots;
  status.pending.push_back({"wall", "/drop/wall", "still being written", 1700000000000});
  status.problems = {"the disk is nearly full; make room"};
  return status;
}

Result<ServiceMetrics> FakeService::GetMetrics() {
  if (failure) return Fail(*failure);
  ServiceMetrics metrics;
  for (const JobState state : kJobStates) metrics.counts.by_state[state] = 1;
  metrics.queue_seconds = {{0.1, 1}, {1, 2, 3}, 42.5, 6};
  metrics.job_seconds = {{1}, {0, 0}, 0, 0};
  metrics.watch.roots.push_back({"/dr\"op\\\n", "polling", "nfs", 3, 4});
  return metrics;
}

Status FakeService::Ready() {
  if (failure) return Fail(*failure);
  return {};
}

}  // namespace patina::daemon
