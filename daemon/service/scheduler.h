// Decides what runs: starts attempts within the core budget, follows them, ends those that were
// cancelled or take too long, and writes into the queue what became of them. All in Step(), which
// never waits; who calls it decides about threads and time.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "daemon/base/clock.h"
#include "daemon/base/file_calls.h"
#include "daemon/base/log.h"
#include "daemon/config/config.h"
#include "daemon/execute/executor.h"
#include "daemon/queue/job_store.h"
#include "daemon/service/attempt_outcome.h"
#include "daemon/service/board.h"
#include "daemon/service/event_hub.h"
#include "daemon/service/job_folders.h"
#include "daemon/service/roots.h"

namespace patina::daemon {

inline constexpr int64_t kLeaseMs = 60000;

// All must outlive the scheduler.
struct SchedulerParts {
  JobStore& store;
  Executor& executor;
  FileCalls& files;
  Clock& clock;
  Logger& log;
  EventHub& events;
  Board& board;
};

class Scheduler {
 public:
  // random_seed: of the jitter of waits.
  Scheduler(const SchedulerParts& parts, std::shared_ptr<const Config> config,
            uint64_t random_seed);

  // Takes over what an earlier daemon left: attempts that ran, folders without jobs. Call once,
  // before Step.
  Status Recover();

  // One round. Returns after how many milliseconds the next is due at the latest; -1: when
  // something happens.
  int Step();

  // Nothing that would have to be waited for when the daemon stops: nothing runs and nothing waits
  // to be written. What runs on a farm goes on, and the next daemon takes it over.
  bool idle() const { return active_.empty() || OnFarm(*config()); }

  // Thread-safe; what they ask for is done by the next Step.
  void Poke();  // the queue has changed
  void RequestCancel(int64_t id);
  void SetConfig(std::shared_ptr<const Config> config);
  std::shared_ptr<const Config> config() const;
  // Starts no more jobs. Those that still run at hand_back_ms (Clock::SteadyMs) are ended and
  // queued again, but for those on a farm.
  void Drain(int64_t hand_back_ms);
  bool draining() const;

 private:
  struct Active {
    JobRecord job;  // without its texts
    AttemptSpec spec;
    bool known = true;  // to the executor; false: it has not found out yet what became of it
    StopReason stop = StopReason::kNone;
    bool killed = false;
    int64_t started_steady_ms = 0;
    int64_t kill_ms = 0;                 // steady; when patience ends after a stop
    std::optional<AttemptReport> ended;  // not in the store yet
  };

  void TakeReports();
  void AdoptLate();
  void TakeCancels();
  void StopWhatMust();
  void WriteEnds();
  void WakeWaiting(bool queue_changed);
  void KeepLeases();
  void StartJobs(const Config& config);
  void Retain();
  int NextWaitMs();

  // False: nothing more can be started now.
  bool StartJob(const JobRecord& queued, int threads, const Config& config);
  void EndBeforeStart(const JobRecord& job, const AttemptEnd& end);
  AttemptSpec SpecOf(const JobRecord& job) const;
  void FollowEvents(Active* active, const std::vector<std::string>& lines);
  // False: the store could not take it.
  bool WriteEnd(Active* active);
  void AfterEnd(const Active& active, const AttemptOutcome& outcome);
  // Old revisions, and what dead bakes left. A bake that runs meanwhile is left alone.
  void PruneAsset(const std::string& out, const std::string& asset);
  void SettleFailedFile(int64_t job, bool only_missing);
  void BeginStop(Active* active, StopReason reason);
  int PlacesUsed() const;
  void StoreFailed(const char* what, const Error& error);
  uint64_t Random();

  SchedulerParts parts_;
  JobFolders folders_;
  uint64_t random_state_;
  std::map<int64_t, Active> active_;  // by job
  // All steady. After an error of the store, or of starting, nothing is tried before these.
  int64_t store_retry_ms_ = 0, start_retry_ms_ = 0;
  int64_t start_wait_ms_ = 0;
  int64_t next_lease_ms_ = 0, next_retention_ms_ = 0;
  std::optional<int64_t> next_due_ms_;  // wall

  mutable std::mutex mutex_;  // of what follows
  std::shared_ptr<const Config> config_;
  std::set<int64_t> cancels_;
  bool queue_changed_ = true;
  bool draining_ = false;
  int64_t hand_back_ms_ = 0;
};

Roots RootsOf(const Config& config);

// The threads that a job gets: what it asks for, else the configuration's, within the cores.
int ThreadsOf(int wanted, const Config& config);

}  // namespace patina::daemon
