// From how a process ended to what becomes of its job.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/execute/executor.h"
#include "daemon/queue/backoff.h"
#include "daemon/queue/job_store.h"

namespace patina::daemon {

// Why the daemon itself was ending the attempt, if it was.
enum class StopReason { kNone, kCancel, kHandBack, kWallTime };

struct OutcomePolicy {
  BackoffPolicy backoff;
  int max_attempts = 5;       // lost to the machine, before a job is buried
  int64_t max_memory_mb = 0;  // what a limit may grow to; 0: without bound
};

struct AttemptOutcome {
  AttemptEnd end;
  bool unchanged = false;       // succeeded without baking
  int64_t bytes_published = 0;  // of what an engine loads
};

// What counts is, in this order: a result file that says "done" with a revision that is there
// (`revision_exists` is asked for its folder); that somebody wanted it to end; what the
// result file says; how the process ended.
//   failed         exit code 3 (bad input) and 4 (quality gate), and any other error that another
//                  attempt would meet again; the limit of CPU time.
//   retry_waiting  the machine's failures: killed by a signal, out of memory, disk or descriptors,
//                  I/O errors, the limit of wall time, another bake of the asset, gone without a
//                  trace, and what a farm says lost it (EndCause). With more memory next time when
//                  it ran out of it, or was killed, under a limit.
//   buried         the same for the max_attempts-th time.
AttemptOutcome DecideOutcome(const JobRecord& job, const AttemptReport& report, StopReason stop,
                             const OutcomePolicy& policy, int64_t now_ms, uint64_t random,
                             const std::function<bool(const std::string&)>& revision_exists);

}  // namespace patina::daemon
