// The durable queue: jobs, their attempts, what happened (events), and the assets they made. One
// SQLite file, WAL, synchronous=FULL: what a call has reported as done outlives a power cut.
//
// Each attempt at a job has a number, 1, 2, 3 ...: its fencing token. Calls that speak for an
// attempt name it and are refused (kConflict) unless it is the current one of a running job.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/queue/job_state.h"
#include "formats/base/result.h"

namespace patina::daemon {

// "No limit" is 0 in each.
struct JobLimits {
  int threads = 1;  // of the core budget; also what the job is told to use
  int64_t memory_mb = 0;
  int64_t cpu_s = 0;
  int64_t wall_s = 0;
};

enum class JobOrigin : int { kApi = 1, kWatch = 2 };
const char* JobOriginName(JobOrigin origin);  // "api", "watch"

inline constexpr int kMinPriority = -100;
inline constexpr int kMaxPriority = 100;  // the higher is run first; 0 is the default
inline constexpr size_t kMaxIdempotencyKeyBytes = 255;

struct NewJob {
  std::string asset;
  std::string kind;  // "material", "brdf"
  std::string out;   // absolute; containers go to <out>/<asset>
  JobOrigin origin = JobOrigin::kApi;
  int priority = 0;
  JobLimits limits;
  bool force = false;           // bake even if nothing changed
  std::string job_json;         // the job file, with absolute paths
  std::string idempotency_key;  // empty: none
  // The asset's, as in AssetRecord; of kWatch all three, of kApi the first.
  std::string source;
  std::string signature;
  std::string failed_file;
};

// One job. `job_json` and `result_json` are left empty by List.
struct JobRecord {
  int64_t id = 0;  // 1, 2, 3 ... in order of submission
  std::string asset;
  std::string kind;
  std::string out;
  JobOrigin origin = JobOrigin::kApi;
  JobState state = JobState::kQueued;
  int priority = 0;
  JobLimits limits;  // the memory limit grows after an attempt that ran out of it
  bool force = false;
  bool held = false;              // paused: not started
  bool cancel_requested = false;  // running, and being stopped
  int64_t attempt = 0;            // the current or last one; 0: none yet
  int failures = 0;               // attempts lost to the machine since it was last asked for
  int64_t created_ms = 0, updated_ms = 0;
  int64_t started_ms = 0;     // of the last attempt; 0: never
  int64_t finished_ms = 0;    // 0: not yet
  int64_t due_ms = 0;         // of kRetryWaiting
  int64_t lease_ms = 0;       // until when the running attempt counts as alive
  std::string handle;         // the executor's, of the running attempt; empty: not known
  std::string base_revision;  // what `current` was before the first attempt; for force
  std::string error_code;     // ErrorCodeName, "quality_gate", "killed", "lost"; empty: no error
  std::string error_message;  // of the last attempt
  std::string revision;       // of kSucceeded
  std::string container;      // its folder
  std::string signature;      // as submitted
  std::string job_json;
  std::string result_json;  // content of the last attempt's result.json; empty: it wrote none
};

struct AttemptKey {
  int64_t job = 0;
  int64_t attempt = 0;
};

struct Submitted {
  int64_t id = 0;
  bool created = true;  // false: the idempotency key names this earlier job
};

// What became of an attempt.
struct AttemptEnd {
  // kSucceeded, kFailed, kCancelled, kRetryWaiting, kBuried, or kQueued (handed back: does not
  // count as a failure).
  JobState state = JobState::kFailed;
  int exit_code = -1;  // -1: none, or not known
  int signal = 0;      // 0: none, or not known
  std::string error_code, error_message;
  std::string result_json;
  std::string revision, container;
  int64_t due_ms = 0;     // of kRetryWaiting
  int64_t memory_mb = 0;  // the limit for the next attempt; 0: as it was
};

struct JobFilter {
  std::vector<JobState> states;  // empty: all
  std::string asset;             // empty: all
  int limit = 100;               // 1..1000
  int64_t before = 0;            // cursor: ids below this; 0: from the newest
};

struct JobPage {
  std::vector<JobRecord> jobs;  // newest first
  int64_t next = 0;             // the cursor for what follows; 0: nothing does
};

// Something that happened and is kept. Ids grow by at least 1 and are never reused.
//   type: "submitted", "started", "succeeded", "failed", "cancelled", "retry_waiting", "buried",
//         "requeued", "priority", "held", "released", "cancel_requested", "queue_paused",
//         "queue_resumed"
struct StoredEvent {
  int64_t id = 0;
  int64_t time_ms = 0;
  int64_t job = 0;  // 0: of the queue
  std::string type;
  std::string data;  // a JSON object, e.g. {"asset":"wall","state":"running","attempt":1}
};

// What is known of an asset, by (out, name).
struct AssetRecord {
  std::string name;
  std::string out;
  std::string source;  // folder or file; empty: came by the API
  // Of what was last baked or tried: the source's files as the watcher saw them, the job and the
  // recipe's version. Empty: came by the API.
  std::string signature;
  std::string failed_file;  // where it is put in writing that it failed; empty: nowhere
  int64_t last_job = 0;
  int64_t updated_ms = 0;
  bool gone = false;  // the source has disappeared; the containers stay
};

struct JobCounts {
  std::map<JobState, int64_t> by_state;  // every state has an entry
  int64_t of(JobState state) const { return by_state.at(state); }
};

struct StoreRetention {
  int64_t finished_before_ms = 0;  // final jobs that ended earlier are removed
  int64_t keep_finished = 0;       // and all but so many of the newest
  int64_t keep_events = 10000;
};

// Thread-safe. Errors of every call: kIo, kResourceExhausted (disk full: nothing has changed, try
// again), kCorruptData.
class JobStore {
 public:
  // Opens or creates the file and brings its schema up to date. Errors also: kUnsupported (written
  // by a newer version).
  static Result<std::unique_ptr<JobStore>> Open(const std::string& path);
  virtual ~JobStore() = default;

  // Also notes it as the last job of its asset. kConflict: the idempotency key was used for another
  // request.
  virtual Result<Submitted> Submit(const NewJob& job, int64_t now_ms) = 0;

  virtual Result<JobRecord> Get(int64_t id) = 0;  // kNotFound
  virtual Result<JobPage> List(const JobFilter& filter) = 0;
  virtual Result<JobCounts> Counts() = 0;

  // The first queued jobs by priority and age that are not held and whose asset has no running job;
  // at most one for each asset.
  virtual Result<std::vector<JobRecord>> Runnable(int limit) = 0;
  virtual Result<std::vector<JobRecord>> Running() = 0;
  // The newest job of an asset that waits (queued or retry_waiting); nothing if there is none.
  virtual Result<std::optional<JobRecord>> WaitingFor(const std::string& out,
                                                      const std::string& asset) = 0;

  // Transitions. Errors also: kNotFound; kConflict when the table forbids it or the attempt is not
  // the current one.
  // queued -> running with the next attempt. base_revision is kept from the first attempt.
  virtual Result<JobRecord> Start(int64_t id, const std::string& base_revision, int64_t lease_ms,
                                  int64_t now_ms) = 0;
  virtual Status SetHandle(const AttemptKey& attempt, const std::string& handle) = 0;
  virtual Status Heartbeat(const std::vector<AttemptKey>& attempts, int64_t lease_ms) = 0;
  // A job that is to be cancelled becomes kCancelled in place of kRetryWaiting, kBuried or kQueued.
  virtual Status Finish(const AttemptKey& attempt, const AttemptEnd& end, int64_t now_ms) = 0;
  // A waiting job is cancelled at once; a running one is marked and its new state is kRunning.
  virtual Result<JobState> Cancel(int64_t id, int64_t now_ms) = 0;
  // failed, cancelled, buried, retry_waiting -> queued.
  virtual Status Retry(int64_t id, int64_t now_ms) = 0;
  // Every retry_waiting job that is due -> queued. Returns how many.
  virtual Result<int> WakeDue(int64_t now_ms) = 0;
  // When the next retry_waiting job is due; nothing if none waits.
  virtual Result<std::optional<int64_t>> NextDue() = 0;

  // kConflict: only waiting jobs can be held; only jobs that are not final have a priority.
  virtual Status SetHeld(int64_t id, bool held, int64_t now_ms) = 0;
  virtual Status SetPriority(int64_t id, int priority, int64_t now_ms) = 0;
  virtual Status SetQueuePaused(bool paused, int64_t now_ms) = 0;
  virtual Result<bool> QueuePaused() = 0;
  // Gives a waiting job and its asset a newer description of the same. kConflict: it no longer
  // waits.
  virtual Status ReplaceWaiting(int64_t id, const NewJob& job, int64_t now_ms) = 0;

  // Oldest first.
  virtual Result<std::vector<StoredEvent>> EventsAfter(int64_t id, int limit) = 0;
  // {oldest kept, newest}; {1, 0} if there is none.
  virtual Result<std::pair<int64_t, int64_t>> EventRange() = 0;

  virtual Result<std::optional<AssetRecord>> GetAsset(const std::string& out,
                                                      const std::string& name) = 0;
  virtual Status PutAsset(const AssetRecord& asset) = 0;
  virtual Result<std::vector<AssetRecord>> Assets(const std::string& after_name, int limit) = 0;

  // Removes what retention no longer keeps; returns the ids of removed jobs, at most 1000 a call.
  virtual Result<std::vector<int64_t>> Prune(const StoreRetention& retention) = 0;
};

}  // namespace patina::daemon
