// Brings events to those who listen. Stored events are read from the queue when a listener asks, so
// a slow one costs nothing and loses only what is no longer kept; progress is not stored, and of
// each job only the newest waits.
#pragma once

#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "daemon/queue/job_store.h"
#include "daemon/service/service.h"

namespace patina::daemon {

// Thread-safe. Subscriptions keep it alive.
class EventHub : public std::enable_shared_from_this<EventHub> {
 public:
  explicit EventHub(JobStore& store) : store_(store) {}

  // Something was stored.
  void Notify();
  // data: as StoredEvent::data.
  void Progress(int64_t job, int64_t time_ms, std::string data);
  // The job runs no longer.
  void ForgetProgress(int64_t job);
  // Every Wait returns kClosed from now on; the store is not used any more.
  void Close();

  Result<std::unique_ptr<Subscription>> Subscribe(std::optional<int64_t> after, int64_t job);
  int64_t subscribers() const;
  int64_t gaps() const;

 private:
  friend class HubSubscription;
  struct Report {
    uint64_t serial = 0;  // grows with every report
    Event event;
  };

  JobStore& store_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  uint64_t generation_ = 0;  // grows when something was stored or reported
  uint64_t serial_ = 0;
  std::map<int64_t, Report> progress_;  // by job
  int64_t subscribers_ = 0, gaps_ = 0;
  bool closed_ = false;
  // Readers of the store that Close has to wait for.
  int reading_ = 0;
};

}  // namespace patina::daemon
