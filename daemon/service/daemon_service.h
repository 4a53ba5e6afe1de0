// The service itself: the queue behind the API and the watcher, and the thread that runs jobs.
#pragma once

#include <cstdint>
#include <memory>

#include "daemon/base/clock.h"
#include "daemon/base/file_calls.h"
#include "daemon/base/log.h"
#include "daemon/config/config.h"
#include "daemon/execute/executor.h"
#include "daemon/queue/job_store.h"
#include "daemon/service/service.h"

namespace patina::daemon {

// All must outlive the service.
struct ServiceParts {
  JobStore& store;
  Executor& executor;
  FileCalls& files;
  Clock& clock;
  Logger& log;
};

class DaemonService : public Service {
 public:
  // Takes over what an earlier daemon left in the queue. random_seed: see Scheduler. Errors: those
  // of the store.
  static Result<std::unique_ptr<DaemonService>> Create(const ServiceParts& parts,
                                                       const Config& config, uint64_t random_seed);

  // Runs jobs on a thread of its own from now on. Without it, nothing runs but by Step().
  virtual void StartThread() = 0;
  // One round of the scheduler; see there. Only without the thread.
  virtual int Step() = 0;

  // Takes no more requests and starts no more jobs; those that run have Config::stop_grace_s. What
  // is on a farm stays there.
  virtual void BeginStop() = 0;
  // No more grace: those that still run are handed back now.
  virtual void HandBackNow() = 0;
  // Waits until nothing runs any more. Only after BeginStop, with the thread running.
  virtual void Join() = 0;
  // Becomes readable when, after BeginStop, nothing runs any more.
  virtual int stopped_fd() const = 0;

  // For what may change without a restart; see RestartOnlyChanges.
  virtual void Reconfigure(const Config& config) = 0;
};

}  // namespace patina::daemon
