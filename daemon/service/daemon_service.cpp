#include "daemon/service/daemon_service.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <shared_mutex>
#include <thread>

#include "daemon/base/unique_fd.h"
#include "daemon/service/board.h"
#include "daemon/service/event_hub.h"
#include "daemon/service/job_folders.h"
#include "daemon/service/scheduler.h"
#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/svbrdf_job.h"

namespace patina::daemon {
namespace {

constexpr size_t kMostPendingShown = 100;

Result<UniqueFd> MakeEventFd() {
  UniqueFd fd(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!fd) return FailErrno(errno, "cannot make", "an event descriptor");
  return fd;
}

void Raise(const UniqueFd& fd) {
  const uint64_t one = 1;
  const ssize_t ignored = ::write(fd.get(), &one, sizeof one);
  static_cast<void>(ignored);
}

void Clear(const UniqueFd& fd) {
  uint64_t value = 0;
  const ssize_t ignored = ::read(fd.get(), &value, sizeof value);
  static_cast<void>(ignored);
}

Status CheckLimit(const char* name, std::optional<int64_t> value) {
  constexpr int64_t kMost = int64_t{1} << 40;
  if (!value || (*value >= 0 && *value <= kMost)) return {};
  return Fail(ErrorCode::kInvalidArgument, std::string("/limits/") + name +
                                               ": must be between 0 and 2^40; is " +
                                               std::to_string(*value));
}

// What decides the result besides the source's files.
std::string RecipeTag(const Job& job) {
  const int version = job.kind == JobKind::kBrdf     ? kBrdfRecipeVersion
                      : job.kind == JobKind::kSvbrdf ? kSvbrdfRecipeVersion
                                                     : kRecipeVersion;
  return std::string(JobKindName(job.kind)) + " recipe " + std::to_string(version) + "\n" +
         CanonicalJob(job) + "\n" + job.folder + "\n" + job.set + "\n" + job.file + "\n" +
         (job.scene.empty() ? "" : job.scene + "\n" + job.scene_material + "\n") +
         (job.ocio.empty() ? "" : job.ocio + "\n");
}

std::string SourceOf(const Job& job) {
  if (!job.file.empty()) return job.file;
  if (!job.scene.empty()) return job.scene;
  return job.folder.empty() && !job.maps.empty() ? job.maps[0].file : job.folder;
}

class RealService : public DaemonService {
 public:
  RealService(const ServiceParts& parts, const Config& config, uint64_t random_seed, UniqueFd wake,
              UniqueFd stopped)
      : parts_(parts),
        hub_(std::make_shared<EventHub>(parts.store)),
        folders_(WorkFolderOf(config), parts.files),
        started_ms_(parts.clock.WallMs()),
        wake_(std::move(wake)),
        stopped_(std::move(stopped)),
        scheduler_(
            {parts.store, parts.executor, parts.files, parts.clock, parts.log, *hub_, board_},
            std::make_shared<const Config>(config), random_seed) {}

  ~RealService() override {
    if (thread_.joinable()) {
      BeginStop();
      HandBackNow();
      Join();
    }
    hub_->Close();
  }

  Status Recover() { return scheduler_.Recover(); }

  // ---- DaemonService

  void StartThread() override {
    thread_ = std::thread([this] { RunThread(); });
  }
  int Step() override { return scheduler_.Step(); }

  void BeginStop() override {
    draining_ = true;
    scheduler_.Drain(parts_.clock.SteadyMs() + scheduler_.config()->stop_grace_s * int64_t{1000});
    Wake();
  }
  void HandBackNow() override {
    scheduler_.Drain(parts_.clock.SteadyMs());
    Wake();
  }
  void Join() override {
    if (thread_.joinable()) thread_.join();
  }
  int stopped_fd() const override { return stopped_.get(); }

  void Reconfigure(const Config& config) override {
    scheduler_.SetConfig(std::make_shared<const Config>(config));
    Wake();
  }

  // ---- Service

  Result<Submitted> Submit(const SubmitRequest& request) override {
    if (draining_) return Fail(ErrorCode::kCancelled, "the daemon stops; submit again later");
    const auto config = scheduler_.config();
    Job job = request.job;
    if (job.out.empty()) job.out = config->out;
    if (!IsAssetName(job.asset))
      return Fail(ErrorCode::kInvalidArgument, "/asset: is not a name for an asset");
    PATINA_TRY(ConfineJob(RootsOf(*config), &job));
    if (request.priority < kMinPriority || request.priority > kMaxPriority) {
      return Fail(ErrorCode::kInvalidArgument,
                  "/priority: must be between " + std::to_string(kMinPriority) + " and " +
                      std::to_string(kMaxPriority) + "; is " + std::to_string(request.priority));
    }
    PATINA_TRY(CheckLimit("memory_mb", request.memory_mb));
    PATINA_TRY(CheckLimit("cpu_s", request.cpu_s));
    PATINA_TRY(CheckLimit("wall_s", request.wall_s));
    if (request.idempotency_key.size() > kMaxIdempotencyKeyBytes)
      return Fail(ErrorCode::kInvalidArgument, "the idempotency key is too long");
    NewJob fresh = Describe(job, *config, JobOrigin::kApi);
    fresh.priority = request.priority;
    fresh.force = request.force;
    fresh.idempotency_key = request.idempotency_key;
    fresh.limits.memory_mb = request.memory_mb.value_or(fresh.limits.memory_mb);
    fresh.limits.cpu_s = request.cpu_s.value_or(fresh.limits.cpu_s);
    fresh.limits.wall_s = request.wall_s.value_or(fresh.limits.wall_s);
    PATINA_ASSIGN(const Submitted submitted, parts_.store.Submit(fresh, parts_.clock.WallMs()));
    if (submitted.created) {
      board_.Count([](ServiceMetrics& m) { ++m.submitted_api; });
      QueueChanged();
    }
    return submitted;
  }

  Result<JobView> Get(int64_t id) override {
    PATINA_ASSIGN(JobRecord job, parts_.store.Get(id));
    const auto paused = parts_.store.QueuePaused();
    return ViewOf(std::move(job), paused && *paused);
  }

  Result<JobViewPage> List(const JobFilter& filter) override {
    PATINA_ASSIGN(JobPage page, parts_.store.List(filter));
    const auto paused = parts_.store.QueuePaused();
    JobViewPage views;
    views.next = page.next;
    for (JobRecord& job : page.jobs)
      views.jobs.push_back(ViewOf(std::move(job), paused && *paused));
    return views;
  }

  Result<JobState> Cancel(int64_t id) override {
    PATINA_ASSIGN(const JobState state, parts_.store.Cancel(id, parts_.clock.WallMs()));
    if (state == JobState::kRunning) {
      scheduler_.RequestCancel(id);
    } else {
      board_.Count([](ServiceMetrics& m) { ++m.cancelled; });
    }
    QueueChanged();
    return state;
  }

  Status Retry(int64_t id) override {
    PATINA_TRY(parts_.store.Retry(id, parts_.clock.WallMs()));
    QueueChanged();
    return {};
  }

  Status SetHeld(int64_t id, bool held) override {
    PATINA_TRY(parts_.store.SetHeld(id, held, parts_.clock.WallMs()));
    QueueChanged();
    return {};
  }

  Status SetPriority(int64_t id, int priority) override {
    PATINA_TRY(parts_.store.SetPriority(id, priority, parts_.clock.WallMs()));
    QueueChanged();
    return {};
  }

  Status SetQueuePaused(bool paused) override {
    PATINA_TRY(parts_.store.SetQueuePaused(paused, parts_.clock.WallMs()));
    QueueChanged();
    return {};
  }

  Result<LogChunk> ReadLog(int64_t id, int64_t offset, size_t max_bytes) override {
    PATINA_ASSIGN(const JobRecord job, parts_.store.Get(id));
    LogChunk chunk;
    bool at_end = false;
    PATINA_ASSIGN(chunk.text, folders_.ReadLog(id, &offset, max_bytes, &at_end));
    chunk.next_offset = offset;
    chunk.complete = at_end && IsFinal(job.state);
    return chunk;
  }

  Result<std::vector<CurvePoint>> Curve(int64_t id) override {
    PATINA_ASSIGN(const JobRecord job, parts_.store.Get(id));
    return folders_.ReadCurve(id, job.attempt);
  }

  Result<std::unique_ptr<Subscription>> Subscribe(std::optional<int64_t> after,
                                                  int64_t job) override {
    return hub_->Subscribe(after, job);
  }

  Result<OfferOutcome> OfferAsset(const AssetOffer& offer) override {
    if (draining_) return Fail(ErrorCode::kCancelled, "the daemon stops");
    const auto config = scheduler_.config();
    Job job;
    job.kind = offer.job.kind;
    job.asset = offer.job.asset;
    job.folder = offer.job.folder;
    job.set = offer.job.set;
    job.file = offer.job.file;
    job.scene = offer.job.scene;
    job.scene_material = offer.job.scene_material;
    job.out = config->out;
    job.quality = config->job.quality;
    job.recipe = config->job.recipe;
    job.seed = config->job.seed;
    if (job.kind == JobKind::kMaterial) job.profile = config->job.profile;
    PATINA_TRY(ConfineJob(RootsOf(*config), &job));
    NewJob fresh = Describe(job, *config, JobOrigin::kWatch);
    fresh.priority = config->job.priority;
    fresh.signature = Sha256Hex(AsBytes(offer.signature + "\n" + RecipeTag(job)));
    const std::string folder =
        config->failed_dir.empty() ? offer.failed_folder : config->failed_dir;
    if (!folder.empty()) fresh.failed_file = folder + "/" + job.asset + ".failed.json";

    // Offers come from one watcher; the lock is for the sake of the two steps below.
    const std::lock_guard lock(offers_);
    PATINA_ASSIGN(const auto known, parts_.store.GetAsset(job.out, job.asset));
    if (known && known->signature == fresh.signature) {
      PATINA_ASSIGN(const bool settled, IsSettled(*known));
      if (settled) {
        board_.Count([](ServiceMetrics& m) { ++m.offers_unchanged; });
        if (known->gone) {
          AssetRecord back = *known;
          back.gone = false;
          PATINA_TRY(parts_.store.PutAsset(back));
        }
        return OfferOutcome::kUnchanged;
      }
    }
    const int64_t now = parts_.clock.WallMs();
    PATINA_ASSIGN(const auto waiting, parts_.store.WaitingFor(job.out, job.asset));
    if (waiting && waiting->origin == JobOrigin::kWatch) {
      const Status replaced = parts_.store.ReplaceWaiting(waiting->id, fresh, now);
      if (replaced) return OfferOutcome::kQueued;
      // It has begun meanwhile, and may have read the old content.
      if (replaced.error().code != ErrorCode::kConflict) return Fail(replaced.error());
    }
    PATINA_TRY(parts_.store.Submit(fresh, now));
    board_.Count([](ServiceMetrics& m) { ++m.submitted_watch; });
    QueueChanged();
    return OfferOutcome::kQueued;
  }

  Status WithdrawAsset(const std::string& name) override {
    const std::string out = scheduler_.config()->out;
    const std::lock_guard lock(offers_);
    PATINA_ASSIGN(const auto known, parts_.store.GetAsset(out, name));
    if (!known || known->gone) return {};
    PATINA_ASSIGN(const auto waiting, parts_.store.WaitingFor(out, name));
    if (waiting && waiting->origin == JobOrigin::kWatch) {
      const auto cancelled = parts_.store.Cancel(waiting->id, parts_.clock.WallMs());
      if (!cancelled && cancelled.error().code != ErrorCode::kConflict)
        return Fail(cancelled.error());
      QueueChanged();
    }
    AssetRecord gone = *known;
    gone.gone = true;
    gone.updated_ms = parts_.clock.WallMs();
    PATINA_TRY(parts_.store.PutAsset(gone));
    if (!gone.failed_file.empty()) parts_.files.RemoveFile(gone.failed_file);
    return {};
  }

  Result<std::vector<AssetView>> Assets(const std::string& after_name, int limit) override {
    limit = std::clamp(limit, 1, 1000);
    PATINA_ASSIGN(const std::vector<AssetRecord> records, parts_.store.Assets(after_name, limit));
    std::map<std::pair<std::string, std::string>, AssetView> views;
    for (const AssetRecord& record : records) {
      PATINA_ASSIGN(AssetView view, ViewOf(record));
      views.emplace(std::pair(record.name, record.out), std::move(view));
    }
    for (const PendingAsset& pending : Pending()) {
      if (pending.name > after_name) AddPending(pending, &views);
    }
    std::vector<AssetView> list;
    for (auto& [key, view] : views) {
      // Beyond the last record that was read, others may come before a pending one.
      const bool complete =
          records.size() < static_cast<size_t>(limit) || key.first <= records.back().name;
      if (complete && list.size() < static_cast<size_t>(limit)) list.push_back(std::move(view));
    }
    return list;
  }

  Result<AssetView> GetAsset(const std::string& name) override {
    const std::string out = scheduler_.config()->out;
    PATINA_ASSIGN(const auto record, parts_.store.GetAsset(out, name));
    std::map<std::pair<std::string, std::string>, AssetView> views;
    if (record) {
      PATINA_ASSIGN(AssetView view, ViewOf(*record));
      views.emplace(std::pair(name, out), std::move(view));
    }
    for (const PendingAsset& pending : Pending()) {
      if (pending.name == name) AddPending(pending, &views);
    }
    if (views.empty())
      return Fail(ErrorCode::kNotFound, "there is no asset " + QuoteForMessage(name));
    return std::move(views.begin()->second);
  }

  void AttachSource(AssetSource* source) override {
    const std::lock_guard lock(source_mutex_);
    source_ = source;
  }

  Result<ServiceStatus> GetStatus() override {
    const auto config = scheduler_.config();
    ServiceStatus status;
    status.version = PATINA_VERSION;
    status.pid = ::getpid();
    status.started_ms = started_ms_;
    status.state = draining_ ? "draining" : "running";
    status.state_dir = config->state_dir;
    status.out = config->out;
    PATINA_ASSIGN(status.queue_paused, parts_.store.QueuePaused());
    PATINA_ASSIGN(status.counts, parts_.store.Counts());
    std::tie(status.cores_used, status.cores) = board_.cores();
    if (status.cores == 0) status.cores = config->cores;
    status.executor = ExecutorKindName(config->executor.kind);
    status.problems = board_.problems();
    status.pending = Pending();
    if (status.pending.size() > kMostPendingShown) status.pending.resize(kMostPendingShown);
    status.watch = Health();
    if (!status.watch.healthy)
      status.problems.push_back(status.watch.reason + "; " + status.watch.cure);
    return status;
  }

  Result<ServiceMetrics> GetMetrics() override {
    ServiceMetrics metrics = board_.metrics();
    PATINA_ASSIGN(metrics.counts, parts_.store.Counts());
    metrics.subscribers = hub_->subscribers();
    metrics.subscriber_gaps = hub_->gaps();
    metrics.watch = Health();
    return metrics;
  }

  Status Ready() override {
    if (draining_) return Fail(ErrorCode::kCancelled, "the daemon stops");
    PATINA_TRY(parts_.store.QueuePaused());
    return {};
  }

 private:
  void Wake() { Raise(wake_); }

  void QueueChanged() {
    hub_->Notify();
    scheduler_.Poke();
    Wake();
  }

  void RunThread() {
    for (;;) {
      const int wait_ms = scheduler_.Step();
      if (scheduler_.draining() && scheduler_.idle()) break;
      pollfd ready[2] = {{wake_.get(), POLLIN, 0}, {parts_.executor.poll_fd(), POLLIN, 0}};
      ::poll(ready, 2, wait_ms);
      if ((ready[0].revents & POLLIN) != 0) Clear(wake_);
    }
    hub_->Close();
    Raise(stopped_);
  }

  NewJob Describe(const Job& job, const Config& config, JobOrigin origin) const {
    NewJob fresh;
    fresh.asset = job.asset;
    fresh.kind = JobKindName(job.kind);
    fresh.out = job.out;
    fresh.origin = origin;
    fresh.limits.threads = ThreadsOf(job.threads, config);
    fresh.limits.memory_mb = config.limits.memory_mb;
    fresh.limits.cpu_s = config.limits.cpu_s;
    fresh.limits.wall_s = config.limits.wall_s;
    fresh.job_json = JobToJson(job);
    fresh.source = SourceOf(job);
    return fresh;
  }

  // Whether an asset whose source is as it was needs nothing: it is baked, failed, or on its way.
  Result<bool> IsSettled(const AssetRecord& asset) {
    auto job = parts_.store.Get(asset.last_job);
    if (!job) {
      if (job.error().code == ErrorCode::kNotFound) return false;
      return Fail(job.error());
    }
    // One that came back after its job was cancelled with it.
    if (asset.gone && job->state == JobState::kCancelled) return false;
    return job->state != JobState::kSucceeded ||
           !CurrentRevision(parts_.files, asset.out, asset.name).empty();
  }

  JobView ViewOf(JobRecord job, bool queue_paused) {
    JobView view;
    if (job.state == JobState::kRunning) {
      view.progress = board_.progress(job.id);
    } else if (!IsFinal(job.state)) {
      view.waiting_reason = WaitingReason(job, queue_paused);
    }
    view.record = std::move(job);
    return view;
  }

  std::string WaitingReason(const JobRecord& job, bool queue_paused) {
    if (job.held) return "paused";
    if (job.state == JobState::kRetryWaiting) {
      return "attempt " + std::to_string(job.attempt + 1) + " is due at " + Rfc3339(job.due_ms) +
             ": " + job.error_message;
    }
    if (queue_paused) return "the queue is paused";
    const auto [used, budget] = board_.cores();
    const auto config = scheduler_.config();
    if (OnFarm(*config)) {
      return used < budget ? "waits for its turn"
                           : "waits for a place on the farm: " + std::to_string(used) + " of " +
                                 std::to_string(budget) + " jobs are there";
    }
    if (budget > 0 && used + job.limits.threads > budget) {
      return "waits for " + std::to_string(job.limits.threads) +
             (job.limits.threads == 1 ? " core: " : " cores: ") + std::to_string(used) + " of " +
             std::to_string(budget) + " are in use";
    }
    return "waits for its turn";
  }

  Result<AssetView> ViewOf(const AssetRecord& record) {
    AssetView view;
    view.name = record.name;
    view.out = record.out;
    view.source = record.source;
    view.job = record.last_job;
    view.updated_ms = record.updated_ms;
    view.revision = CurrentRevision(parts_.files, record.out, record.name);
    if (!view.revision.empty())
      view.container = record.out + "/" + record.name + "/" + view.revision;
    auto job = parts_.store.Get(record.last_job);
    if (!job && job.error().code != ErrorCode::kNotFound) return Fail(job.error());
    if (record.gone) {
      view.state = "gone";
      view.reason = "its source is no longer there";
    } else if (!job) {
      view.state = view.revision.empty() ? "failed" : "baked";
    } else if (job->state == JobState::kSucceeded) {
      view.state = "baked";
    } else if (job->state == JobState::kRunning) {
      view.state = "running";
    } else if (IsFinal(job->state)) {
      view.state = "failed";
      view.reason = job->state == JobState::kCancelled ? "cancelled" : job->error_message;
    } else {
      view.state = "queued";
      const auto paused = parts_.store.QueuePaused();
      view.reason = WaitingReason(*job, paused && *paused);
    }
    if (job) view.updated_ms = std::max(view.updated_ms, job->updated_ms);
    return view;
  }

  void AddPending(const PendingAsset& pending,
                  std::map<std::pair<std::string, std::string>, AssetView>* views) {
    const std::string out = scheduler_.config()->out;
    AssetView& view = (*views)[{pending.name, out}];
    view.name = pending.name;
    view.out = out;
    view.source = pending.path;
    view.state = "pending";
    view.reason = pending.reason;
    view.updated_ms = std::max(view.updated_ms, pending.since_ms);
  }

  std::vector<PendingAsset> Pending() {
    const std::shared_lock lock(source_mutex_);
    return source_ != nullptr ? source_->Pending() : std::vector<PendingAsset>();
  }

  WatchHealth Health() {
    const std::shared_lock lock(source_mutex_);
    return source_ != nullptr ? source_->Health() : WatchHealth();
  }

  ServiceParts parts_;
  std::shared_ptr<EventHub> hub_;
  Board board_;
  JobFolders folders_;
  const int64_t started_ms_;
  UniqueFd wake_, stopped_;
  Scheduler scheduler_;
  std::atomic<bool> draining_{false};
  std::mutex offers_;
  // Shared by those who ask, as a list of assets may wait for a disk.
  std::shared_mutex source_mutex_;
  AssetSource* source_ = nullptr;
  std::thread thread_;
};

}  // namespace

Result<std::unique_ptr<DaemonService>> DaemonService::Create(const ServiceParts& parts,
                                                             const Config& config,
                                                             uint64_t random_seed) {
  PATINA_ASSIGN(UniqueFd wake, MakeEventFd());
  PATINA_ASSIGN(UniqueFd stopped, MakeEventFd());
  auto service = std::make_unique<RealService>(parts, config, random_seed, std::move(wake),
                                               std::move(stopped));
  PATINA_TRY(service->Recover());
  return service;
}

}  // namespace patina::daemon
