#include "daemon/service/event_hub.h"

#include <algorithm>
#include <deque>
#include <utility>

namespace patina::daemon {
namespace {
constexpr int kBatch = 256;
}

class HubSubscription : public Subscription {
 public:
  HubSubscription(std::shared_ptr<EventHub> hub, int64_t last, uint64_t serial, int64_t job)
      : hub_(std::move(hub)), last_(last), serial_(serial), job_(job) {}

  ~HubSubscription() override {
    const std::lock_guard lock(hub_->mutex_);
    --hub_->subscribers_;
  }

  Next Wait(std::chrono::milliseconds timeout, Event* event) override {
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    std::unique_lock lock(hub_->mutex_);
    for (;;) {
      if (hub_->closed_) return Next::kClosed;
      if (!waiting_.empty()) {
        *event = std::move(waiting_.front());
        waiting_.pop_front();
        return Next::kEvent;
      }
      const uint64_t generation = hub_->generation_;
      if (generation != seen_) {
        ++hub_->reading_;
        lock.unlock();
        const Found found = ReadStored();
        lock.lock();
        --hub_->reading_;
        hub_->changed_.notify_all();
        if (found == Found::kGap) {
          ++hub_->gaps_;
          return Next::kGap;
        }
        TakeProgress();
        if (found == Found::kAll) seen_ = generation;
        // After an error it is asked for again, but not at once.
        if (found != Found::kError || !waiting_.empty() || hub_->closed_) continue;
      }
      if (hub_->changed_.wait_until(lock, deadline) == std::cv_status::timeout && !hub_->closed_ &&
          hub_->generation_ == seen_) {
        return Next::kTimeout;
      }
      if (std::chrono::steady_clock::now() >= deadline && !hub_->closed_) return Next::kTimeout;
    }
  }

 private:
  enum class Found { kAll, kMore, kGap, kError };

  // Without the lock.
  Found ReadStored() {
    const auto range = hub_->store_.EventRange();
    if (!range) return Found::kError;
    if (last_ + 1 < range->first || last_ > range->second) {
      last_ = range->second;
      return Found::kGap;
    }
    auto events = hub_->store_.EventsAfter(last_, kBatch);
    if (!events) return Found::kError;
    for (Event& event : *events) {
      last_ = event.id;
      if (job_ == 0 || event.job == job_) waiting_.push_back(std::move(event));
    }
    return events->size() < kBatch ? Found::kAll : Found::kMore;
  }

  // With the lock.
  void TakeProgress() {
    uint64_t newest = serial_;
    for (const auto& [job, report] : hub_->progress_) {
      if (report.serial <= serial_ || (job_ != 0 && job != job_)) continue;
      newest = std::max(newest, report.serial);
      waiting_.push_back(report.event);
    }
    serial_ = newest;
  }

  std::shared_ptr<EventHub> hub_;
  int64_t last_;       // id of the last stored event that was read
  uint64_t serial_;    // of the last progress that was taken
  const int64_t job_;  // 0: all
  uint64_t seen_ = 0;  // generation up to which everything was read
  std::deque<Event> waiting_;
};

void EventHub::Notify() {
  const std::lock_guard lock(mutex_);
  ++generation_;
  changed_.notify_all();
}

void EventHub::Progress(int64_t job, int64_t time_ms, std::string data) {
  const std::lock_guard lock(mutex_);
  Report& report = progress_[job];
  report.serial = ++serial_;
  report.event = {0, time_ms, job, "progress", std::move(data)};
  ++generation_;
  changed_.notify_all();
}

void EventHub::ForgetProgress(int64_t job) {
  const std::lock_guard lock(mutex_);
  progress_.erase(job);
}

void EventHub::Close() {
  std::unique_lock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
  changed_.wait(lock, [this] { return reading_ == 0; });
}

Result<std::unique_ptr<Subscription>> EventHub::Subscribe(std::optional<int64_t> after,
                                                          int64_t job) {
  PATINA_ASSIGN(const auto range, store_.EventRange());
  const std::lock_guard lock(mutex_);
  if (closed_) return Fail(ErrorCode::kCancelled, "the daemon stops");
  ++subscribers_;
  // Generation 0 is never seen: the first Wait looks.
  if (generation_ == 0) generation_ = 1;
  return std::make_unique<HubSubscription>(shared_from_this(), after.value_or(range.second),
                                           after ? 0 : serial_, job);
}

int64_t EventHub::subscribers() const {
  const std::lock_guard lock(mutex_);
  return subscribers_;
}

int64_t EventHub::gaps() const {
  const std::lock_guard lock(mutex_);
  return gaps_;
}

}  // namespace patina::daemon
