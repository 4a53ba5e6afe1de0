// The daemon as its API and its watcher see it. All members are thread-safe and none waits for a
// job; those that change something have it on disk when they return.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/queue/job_store.h"
#include "formats/base/result.h"
#include "pipeline/jobs/job.h"

namespace patina::daemon {

struct SubmitRequest {
  Job job;           // absolute paths, all within the configured roots; job.out may be empty: the
                     // daemon's own
  int priority = 0;  // kMinPriority..kMaxPriority
  bool force = false;
  std::string idempotency_key;
  // Absent: the configuration's.
  std::optional<int64_t> memory_mb, cpu_s, wall_s;
};

// How far a running job is; from its events.
struct JobProgress {
  std::string stage;     // "ingest", "train" ...
  double fraction = -1;  // of the stage; -1: not known
  double eta_s = -1;
  double psnr_db = 0;      // 0: not known
  double gain_10s_db = 0;  // what the next 10 seconds will likely add; 0: not known
  std::string message;
};

struct JobView {
  JobRecord record;
  std::optional<JobProgress> progress;  // of a running job
  // Why it does not run yet, in words; empty if it runs or has ended. "waits for 1 core: 2 of 2 are
  // in use", "waits for a place on the farm: 100 of 100 jobs are there", "paused", "the queue is
  // paused", "another job of this asset runs", "attempt 2 is due at 2026-..."
  std::string waiting_reason;
};

struct JobViewPage {
  std::vector<JobView> jobs;
  int64_t next = 0;  // as in JobPage
};

struct LogChunk {
  std::string text;         // bytes of the worker's output, as they are
  int64_t next_offset = 0;  // where to go on
  bool complete = false;    // nothing will follow: the job is final and this reaches the end
};

// How good a job was after so long: one point of accuracy against time.
struct CurvePoint {
  double time_s = 0;  // since the attempt began
  double psnr_db = 0;
};

// For subscribers. Types: those of StoredEvent, which have an id, and "progress", which is not kept
// and has id 0.
using Event = StoredEvent;

// One listener's queue. It may be read by one thread at a time.
class Subscription {
 public:
  enum class Next { kEvent, kTimeout, kGap, kClosed };
  virtual ~Subscription() = default;
  // Waits for the next event. kGap: events were lost (the listener was too slow, or asked for ones
  // that are no longer kept); what follows is complete again. kClosed: the daemon stops.
  virtual Next Wait(std::chrono::milliseconds timeout, Event* event) = 0;
};

// An asset that a watcher takes for ready.
struct AssetOffer {
  // What to bake: kind, asset, and folder (with set) or file, absolute. All else is the
  // configuration's.
  Job job;
  // Of the source as it is: changes when and only when a file that may matter is added, removed,
  // renamed or written (names, sizes, times, inodes).
  std::string signature;
  // Folder in which <asset>.failed.json is put: the one that holds the asset's folder or file.
  std::string failed_folder;
};

enum class OfferOutcome {
  kQueued,     // a job was made, or the waiting one will take the new content
  kUnchanged,  // nothing to do: this signature was baked, or failed and is not tried again
};

// A source of assets that a watcher sees but has not offered yet.
struct PendingAsset {
  std::string name;
  std::string path;
  std::string reason;  // "still being written: last change 0.4 s ago", "two assets have this name"
  int64_t since_ms = 0;
};

struct WatchedRoot {
  std::string path;
  std::string mode;         // "inotify" or "polling"
  std::string mode_reason;  // "ext4", "nfs: changes by others are not announced" ...
  int64_t folders = 0, assets = 0;
  bool as_svbrdf = false;  // its texture sets become reflectance
};

struct WatchHealth {
  bool healthy = true;  // false: it cannot vouch for what it sees
  std::string reason;   // why not
  std::string cure;     // what to do about it
  std::vector<WatchedRoot> roots;
  int64_t events = 0, overflows = 0, rescans = 0;
};

// What the service asks of a watcher. Thread-safe.
class AssetSource {
 public:
  virtual ~AssetSource() = default;
  virtual WatchHealth Health() const = 0;
  virtual std::vector<PendingAsset> Pending() const = 0;
  // Looks at everything again, soon.
  virtual void RequestRescan() = 0;
};

struct AssetView {
  std::string name;
  std::string out;
  std::string source;  // folder or file; empty: came by the API
  // "pending" (the watcher waits), "queued", "running", "baked", "failed", "gone" (source removed)
  std::string state;
  std::string reason;     // why it is not baked, in words; empty if it is
  int64_t job = 0;        // the last one; 0: none
  std::string revision;   // that `current` points at; empty: none
  std::string container;  // <out>/<asset>/<revision>
  int64_t updated_ms = 0;
};

struct ServiceStatus {
  std::string version;
  int64_t pid = 0;
  int64_t started_ms = 0;
  std::string state;  // "running", "draining"
  std::string state_dir, out;
  bool queue_paused = false;
  std::string executor = "local";  // "slurm", "command"
  int cores = 0, cores_used = 0;   // on a farm: jobs
  JobCounts counts;
  WatchHealth watch;                  // without roots if nothing is watched
  std::vector<PendingAsset> pending;  // at most 100
  std::vector<std::string> problems;  // what is degraded, and the cure; empty: all is well
};

// Counters since the start of the daemon.
struct Histogram {
  std::vector<double> bounds;   // upper bounds, rising; the last bucket is without bound
  std::vector<int64_t> counts;  // bounds.size() + 1
  double sum = 0;
  int64_t count = 0;
};

struct ServiceMetrics {
  JobCounts counts;
  int64_t submitted_api = 0, submitted_watch = 0, offers_unchanged = 0;
  int64_t attempts_started = 0, attempts_adopted = 0;
  int64_t succeeded = 0, found_unchanged = 0, failed = 0, cancelled = 0, retried = 0, buried = 0;
  int64_t stale_reports = 0;    // refused by their fencing token
  int64_t bytes_published = 0;  // of what an engine loads
  int64_t revisions_pruned = 0, jobs_pruned = 0;
  int64_t store_errors = 0;  // calls of the queue's database that failed
  int cores = 0, cores_used = 0;
  int64_t subscribers = 0, subscriber_gaps = 0;
  Histogram queue_seconds;  // from submission to the first attempt
  Histogram job_seconds;    // of attempts that succeeded
  WatchHealth watch;
};

class Service {
 public:
  virtual ~Service() = default;

  // kInvalidArgument: a path outside the roots, or a limit out of range; the message names the JSON
  // pointer. kConflict: idempotency key of another request. kCancelled: the daemon stops.
  virtual Result<Submitted> Submit(const SubmitRequest& request) = 0;
  virtual Result<JobView> Get(int64_t id) = 0;  // kNotFound
  virtual Result<JobViewPage> List(const JobFilter& filter) = 0;

  // As the members of JobStore. Cancel of a running job returns before it is dead: kRunning.
  virtual Result<JobState> Cancel(int64_t id) = 0;
  virtual Status Retry(int64_t id) = 0;
  virtual Status SetHeld(int64_t id, bool held) = 0;
  virtual Status SetPriority(int64_t id, int priority) = 0;
  virtual Status SetQueuePaused(bool paused) = 0;

  // From `offset` on, at most max_bytes; a negative offset counts from the end. kNotFound: no such
  // job. A job that never ran has an empty log.
  virtual Result<LogChunk> ReadLog(int64_t id, int64_t offset, size_t max_bytes) = 0;

  // Accuracy against time of the last attempt as far as it is, thinned to at most 500 points.
  // kNotFound: no such job.
  virtual Result<std::vector<CurvePoint>> Curve(int64_t id) = 0;

  // after: the last event id the listener has; absent: only what happens from now on. job: events
  // of that job only; 0: all.
  virtual Result<std::unique_ptr<Subscription>> Subscribe(std::optional<int64_t> after,
                                                          int64_t job) = 0;

  virtual Result<OfferOutcome> OfferAsset(const AssetOffer& offer) = 0;
  // The source is no longer there: a waiting job of it is cancelled, containers stay.
  virtual Status WithdrawAsset(const std::string& name) = 0;
  // By name, in order; what the watcher waits for included. after_name: cursor.
  virtual Result<std::vector<AssetView>> Assets(const std::string& after_name, int limit) = 0;
  virtual Result<AssetView> GetAsset(const std::string& name) = 0;  // kNotFound

  // The source must outlive the service, or be taken away with nullptr.
  virtual void AttachSource(AssetSource* source) = 0;
  virtual Result<ServiceStatus> GetStatus() = 0;
  virtual Result<ServiceMetrics> GetMetrics() = 0;
  // Whether requests can be served: the queue answers and the daemon is not stopping. The error
  // says why not.
  virtual Status Ready() = 0;
};

}  // namespace patina::daemon
