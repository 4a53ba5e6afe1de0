#include "daemon/service/scheduler.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "daemon/service/roots.h"
#include "formats/container.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::json;

constexpr int64_t kLeaseRenewMs = kLeaseMs / 3;
constexpr int64_t kRetentionMs = 600000;
constexpr int64_t kStoreRetryMs = 1000;
constexpr int64_t kMostStartWaitMs = 60000;
constexpr int64_t kAdoptRetryMs = 50;
constexpr int kCandidates = 64;
constexpr int kStartsAtOnce = 4;  // in one step, so that much to start does not hold up the rest

std::string ShortText(const Json& json, const char* key, size_t max_bytes) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_string()) return "";
  const auto& text = found->get_ref<const std::string&>();
  return text.size() <= max_bytes ? text : text.substr(0, max_bytes);
}

double NumberOr(const Json& json, const char* key, double otherwise) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : otherwise;
}

// What may be in use at once: cores of this machine, or jobs on a farm.
int PlacesOf(const Config& config) { return OnFarm(config) ? config.executor.jobs : config.cores; }
int PlacesFor(int threads, const Config& config) { return OnFarm(config) ? 1 : threads; }

OutcomePolicy PolicyOf(const Config& config) {
  OutcomePolicy policy;
  policy.backoff = {config.retry.base_ms, config.retry.max_ms, config.retry.jitter};
  policy.max_attempts = config.retry.max_attempts;
  policy.max_memory_mb = config.limits.max_memory_mb;
  return policy;
}

}  // namespace

Roots RootsOf(const Config& config) {
  Roots roots;
  for (const WatchConfig& watch : config.watch) roots.input.push_back(watch.path);
  roots.input.insert(roots.input.end(), config.input_roots.begin(), config.input_roots.end());
  roots.input.push_back(UploadFolderOf(config));
  roots.output = config.output_roots;
  roots.output.push_back(config.out);
  return roots;
}

int ThreadsOf(int wanted, const Config& config) {
  if (wanted <= 0) wanted = config.limits.threads;
  return wanted <= 0 ? config.cores : std::min(wanted, config.cores);
}

Scheduler::Scheduler(const SchedulerParts& parts, std::shared_ptr<const Config> config,
                     uint64_t random_seed)
    : parts_(parts),
      folders_(WorkFolderOf(*config), parts.files),
      random_state_(random_seed),
      config_(std::move(config)) {}

// SplitMix64.
uint64_t Scheduler::Random() {
  uint64_t z = random_state_ += 0x9E3779B97F4A7C15ull;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
  return z ^ (z >> 31);
}

void Scheduler::Poke() {
  const std::lock_guard lock(mutex_);
  queue_changed_ = true;
}

void Scheduler::RequestCancel(int64_t id) {
  const std::lock_guard lock(mutex_);
  cancels_.insert(id);
}

void Scheduler::SetConfig(std::shared_ptr<const Config> config) {
  const std::lock_guard lock(mutex_);
  config_ = std::move(config);
  queue_changed_ = true;
}

std::shared_ptr<const Config> Scheduler::config() const {
  const std::lock_guard lock(mutex_);
  return config_;
}

void Scheduler::Drain(int64_t hand_back_ms) {
  const std::lock_guard lock(mutex_);
  draining_ = true;
  hand_back_ms_ = hand_back_ms;
}

bool Scheduler::draining() const {
  const std::lock_guard lock(mutex_);
  return draining_;
}

AttemptSpec Scheduler::SpecOf(const JobRecord& job) const {
  AttemptSpec spec;
  spec.job = job.id;
  spec.attempt = job.attempt;
  spec.folder = folders_.AttemptFolder(job.id, job.attempt);
  spec.fence = folders_.FenceOf(job.id);
  spec.log = folders_.LogOf(job.id);
  spec.out = job.out;
  spec.asset = job.asset;
  // A forced job bakes once; if that was published and not reported, it is found again.
  spec.skip_unchanged = !job.force || job.attempt > 1;
  if (job.force) spec.force_past = job.base_revision;
  spec.threads = job.limits.threads;
  spec.memory_mb = job.limits.memory_mb;
  spec.cpu_s = job.limits.cpu_s;
  spec.wall_s = job.limits.wall_s;
  return spec;
}

Status Scheduler::Recover() {
  PATINA_ASSIGN(const std::vector<JobRecord> running, parts_.store.Running());
  const int64_t now = parts_.clock.SteadyMs();
  const int64_t wall = parts_.clock.WallMs();
  for (const JobRecord& job : running) {
    Active active;
    active.job = job;
    active.spec = SpecOf(job);
    active.known = false;
    active.started_steady_ms = now - std::max<int64_t>(0, wall - job.started_ms);
    if (job.cancel_requested) {
      active.stop = StopReason::kCancel;
      active.kill_ms = now + config()->limits.grace_s * int64_t{1000};
    }
    active_.emplace(job.id, std::move(active));
  }
  AdoptLate();
  for (const int64_t id : folders_.Existing()) {
    const auto job = parts_.store.Get(id);
    if (!job && job.error().code == ErrorCode::kNotFound) folders_.Remove(id);
  }
  // A crash may have come between the end of a job and what follows from it.
  std::string after;
  for (;;) {
    PATINA_ASSIGN(const std::vector<AssetRecord> assets, parts_.store.Assets(after, 1000));
    for (const AssetRecord& asset : assets) {
      SettleFailedFile(asset.last_job, true);
      PruneAsset(asset.out, asset.name);
    }
    if (assets.size() < 1000) break;
    after = assets.back().name;
  }
  return {};
}

int Scheduler::Step() {
  const std::shared_ptr<const Config> config = this->config();
  bool queue_changed = false;
  {
    const std::lock_guard lock(mutex_);
    std::swap(queue_changed, queue_changed_);
  }
  const size_t before = active_.size();
  AdoptLate();
  TakeReports();
  TakeCancels();
  StopWhatMust();
  WriteEnds();
  queue_changed = queue_changed || active_.size() != before;
  WakeWaiting(queue_changed);
  KeepLeases();
  const int64_t now = parts_.clock.SteadyMs();
  if (!draining() && (queue_changed || start_retry_ms_ != 0) && now >= start_retry_ms_)
    StartJobs(*config);
  parts_.board.SetCores(PlacesUsed(), PlacesOf(*config));
  parts_.board.SetProblem("executor", parts_.executor.problem());
  if (now >= next_retention_ms_) Retain();
  return NextWaitMs();
}

void Scheduler::AdoptLate() {
  for (auto& [id, active] : active_) {
    if (active.known || active.ended) continue;
    auto adopted = parts_.executor.Adopt(active.spec, active.job.handle);
    if (adopted && *adopted) {
      active.known = true;
      parts_.board.Count([](ServiceMetrics& m) { ++m.attempts_adopted; });
      parts_.log.Info("job_adopted", {{"job", id}, {"attempt", active.job.attempt}});
      if (active.stop != StopReason::kNone)
        parts_.executor.Stop(id, active.job.attempt, StopMode::kTerminate);
    } else if (parts_.clock.WallMs() > active.job.lease_ms) {
      AttemptReport lost;
      lost.job = id;
      lost.attempt = active.job.attempt;
      lost.ended = true;
      active.ended = std::move(lost);
    }
  }
}

void Scheduler::TakeReports() {
  for (AttemptReport& report : parts_.executor.Poll()) {
    const auto found = active_.find(report.job);
    if (found == active_.end() || found->second.job.attempt != report.attempt) {
      parts_.board.Count([](ServiceMetrics& m) { ++m.stale_reports; });
      continue;
    }
    FollowEvents(&found->second, report.events);
    if (report.ended) found->second.ended = std::move(report);
  }
}

void Scheduler::FollowEvents(Active* active, const std::vector<std::string>& lines) {
  std::optional<JobProgress> progress;
  for (const std::string& line : lines) {
    const Json json = Json::parse(line, nullptr, false);
    if (!json.is_object()) continue;
    const std::string type = ShortText(json, "type", 32);
    if (type != "progress" && type != "stage_started") continue;
    progress.emplace();
    progress->stage = ShortText(json, "stage", 64);
    progress->fraction = NumberOr(json, "fraction", -1);
    progress->eta_s = NumberOr(json, "eta_s", -1);
    progress->psnr_db = NumberOr(json, "psnr_db", 0);
    progress->gain_10s_db = NumberOr(json, "gain_10s_db", 0);
    progress->message = ShortText(json, "message", 500);
  }
  if (!progress) return;
  const int64_t id = active->job.id;
  parts_.board.SetProgress(id, *progress);
  nlohmann::ordered_json data{{"asset", active->job.asset},
                              {"state", "running"},
                              {"attempt", active->job.attempt},
                              {"stage", progress->stage}};
  if (progress->fraction >= 0) data["fraction"] = progress->fraction;
  if (progress->eta_s >= 0) data["eta_s"] = progress->eta_s;
  if (progress->psnr_db > 0) data["psnr_db"] = progress->psnr_db;
  if (progress->gain_10s_db > 0) data["gain_10s_db"] = progress->gain_10s_db;
  if (!progress->message.empty()) data["message"] = progress->message;
  parts_.events.Progress(
      id, parts_.clock.WallMs(),
      data.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

void Scheduler::BeginStop(Active* active, StopReason reason) {
  active->stop = reason;
  active->kill_ms = parts_.clock.SteadyMs() + config()->limits.grace_s * int64_t{1000};
  parts_.executor.Stop(active->job.id, active->job.attempt, StopMode::kTerminate);
}

void Scheduler::TakeCancels() {
  std::set<int64_t> cancels;
  {
    const std::lock_guard lock(mutex_);
    cancels.swap(cancels_);
  }
  for (const int64_t id : cancels) {
    const auto found = active_.find(id);
    // One that is being handed back or is over its time is cancelled instead.
    if (found != active_.end() && found->second.stop != StopReason::kCancel)
      BeginStop(&found->second, StopReason::kCancel);
  }
}

void Scheduler::StopWhatMust() {
  const int64_t now = parts_.clock.SteadyMs();
  bool hand_back = false, on_farm = false;
  {
    const std::lock_guard lock(mutex_);
    // A farm keeps the limit itself, of the time that a job runs there.
    on_farm = OnFarm(*config_);
    hand_back = draining_ && now >= hand_back_ms_ && !on_farm;
  }
  for (auto& [id, active] : active_) {
    if (active.ended) continue;
    if (active.stop == StopReason::kNone) {
      const int64_t wall_ms = active.job.limits.wall_s * 1000;
      if (wall_ms > 0 && !on_farm && now - active.started_steady_ms >= wall_ms) {
        BeginStop(&active, StopReason::kWallTime);
      } else if (hand_back) {
        BeginStop(&active, StopReason::kHandBack);
      }
    } else if (!active.killed && now >= active.kill_ms) {
      active.killed = true;
      parts_.log.Warning("job_killed", {{"job", id}, {"attempt", active.job.attempt}});
      parts_.executor.Stop(id, active.job.attempt, StopMode::kKill);
    }
  }
}

void Scheduler::WriteEnds() {
  if (parts_.clock.SteadyMs() < store_retry_ms_) return;
  for (auto it = active_.begin(); it != active_.end();) {
    if (!it->second.ended) {
      ++it;
    } else if (WriteEnd(&it->second)) {
      it = active_.erase(it);
    } else {
      return;
    }
  }
}

bool Scheduler::WriteEnd(Active* active) {
  const int64_t now = parts_.clock.WallMs();
  const AttemptOutcome outcome =
      DecideOutcome(active->job, *active->ended, active->stop, PolicyOf(*config()), now, Random(),
                    [this](const std::string& container) {
                      struct stat info;
                      return parts_.files.Stat(container + "/" + kManifestName, true, &info) == 0;
                    });
  const AttemptKey key{active->job.id, active->job.attempt};
  const Status written = parts_.store.Finish(key, outcome.end, now);
  if (!written && written.error().code != ErrorCode::kConflict &&
      written.error().code != ErrorCode::kNotFound) {
    StoreFailed("finish", written.error());
    return false;
  }
  parts_.board.ForgetProgress(key.job);
  parts_.events.ForgetProgress(key.job);
  if (!written) {
    parts_.board.Count([](ServiceMetrics& m) { ++m.stale_reports; });
    parts_.log.Warning(
        "stale_report",
        {{"job", key.job}, {"attempt", key.attempt}, {"reason", written.error().message}});
    return true;
  }
  parts_.events.Notify();
  AfterEnd(*active, outcome);
  return true;
}

void Scheduler::AfterEnd(const Active& active, const AttemptOutcome& outcome) {
  const AttemptEnd& end = outcome.end;
  const JobRecord& job = active.job;
  const double seconds =
      static_cast<double>(parts_.clock.SteadyMs() - active.started_steady_ms) / 1000;
  parts_.board.Count([&](ServiceMetrics& m) {
    switch (end.state) {
      case JobState::kSucceeded:
        ++m.succeeded;
        m.found_unchanged += outcome.unchanged ? 1 : 0;
        m.bytes_published += outcome.bytes_published;
        Observe(seconds, &m.job_seconds);
        break;
      case JobState::kFailed:
        ++m.failed;
        break;
      case JobState::kCancelled:
        ++m.cancelled;
        break;
      case JobState::kRetryWaiting:
        ++m.retried;
        break;
      case JobState::kBuried:
        ++m.buried;
        break;
      case JobState::kQueued:
      case JobState::kRunning:
        break;
    }
  });
  parts_.log.Info("job_ended", {{"job", job.id},
                                {"attempt", job.attempt},
                                {"asset", job.asset},
                                {"state", JobStateName(end.state)},
                                {"seconds", seconds},
                                {"unchanged", outcome.unchanged},
                                {"error", end.error_code},
                                {"message", end.error_message}});
  std::string note = "attempt " + std::to_string(job.attempt) + ": " + JobStateName(end.state);
  if (outcome.unchanged) note += ", unchanged since " + end.revision;
  if (!end.error_message.empty()) note += ": " + end.error_message;
  folders_.NoteInLog(job.id, note);
  SettleFailedFile(job.id, false);
  if (!IsFinal(end.state)) return;
  PruneAsset(job.out, job.asset);
  // The sandbox keeps a job from removing the folder of an asset that it did not make. ENOTEMPTY
  // is the usual case.
  if (end.state != JobState::kSucceeded &&
      CurrentRevision(parts_.files, job.out, job.asset).empty()) {
    parts_.files.RemoveFile(job.out + "/" + job.asset + "/.lock");
    parts_.files.RemoveDirectory(job.out + "/" + job.asset);
  }
}

void Scheduler::PruneAsset(const std::string& out, const std::string& asset) {
  auto pruned = PruneRevisions(out, asset, config()->retention.revisions);
  if (pruned) {
    parts_.board.Count([&](ServiceMetrics& m) { m.revisions_pruned += *pruned; });
  } else if (pruned.error().code != ErrorCode::kNotFound &&
             pruned.error().code != ErrorCode::kConflict) {
    parts_.log.Warning("prune_failed", {{"asset", asset}, {"reason", pruned.error().message}});
  }
}

void Scheduler::SettleFailedFile(int64_t id, bool only_missing) {
  const auto job = parts_.store.Get(id);
  if (!job || !IsFinal(job->state)) return;
  const auto asset = parts_.store.GetAsset(job->out, job->asset);
  if (!asset || !*asset || (*asset)->failed_file.empty() || (*asset)->last_job != id) return;
  const std::string& path = (*asset)->failed_file;
  const bool failed = job->state == JobState::kFailed || job->state == JobState::kBuried;
  if (!failed || (*asset)->gone) {
    parts_.files.RemoveFile(path);
    return;
  }
  struct stat info;
  if (only_missing && parts_.files.Stat(path, false, &info) == 0) return;
  const Status written = WriteFileDurably(
      path, FailedFileText(*job, (*asset)->source, folders_.LogOf(id)), parts_.files);
  parts_.board.SetProblem(
      "failed_files",
      written ? ""
              : "cannot say beside the assets which failed: " + written.error().message +
                    "; give the daemon the right to write there, or set "
                    "\"failed_dir\"");
}

void Scheduler::WakeWaiting(bool queue_changed) {
  const int64_t wall = parts_.clock.WallMs();
  if (parts_.clock.SteadyMs() < store_retry_ms_) return;
  if (queue_changed) {
    auto due = parts_.store.NextDue();
    if (!due) return StoreFailed("next_due", due.error());
    next_due_ms_ = *due;
  }
  if (!next_due_ms_ || *next_due_ms_ > wall) return;
  auto woken = parts_.store.WakeDue(wall);
  if (!woken) return StoreFailed("wake_due", woken.error());
  parts_.events.Notify();
  Poke();
}

void Scheduler::KeepLeases() {
  const int64_t now = parts_.clock.SteadyMs();
  if (active_.empty() || now < next_lease_ms_ || now < store_retry_ms_) return;
  std::vector<AttemptKey> alive;
  for (const auto& [id, active] : active_) {
    if (parts_.executor.IsAlive(id, active.job.attempt)) alive.push_back({id, active.job.attempt});
  }
  if (!alive.empty()) {
    const Status kept = parts_.store.Heartbeat(alive, parts_.clock.WallMs() + kLeaseMs);
    if (!kept && kept.error().code != ErrorCode::kConflict)
      return StoreFailed("heartbeat", kept.error());
  }
  next_lease_ms_ = now + kLeaseRenewMs;
}

int Scheduler::PlacesUsed() const {
  const std::shared_ptr<const Config> config = this->config();
  int used = 0;
  for (const auto& [id, active] : active_) used += PlacesFor(active.job.limits.threads, *config);
  return used;
}

void Scheduler::StartJobs(const Config& config) {
  start_retry_ms_ = 0;
  auto paused = parts_.store.QueuePaused();
  if (!paused) return StoreFailed("paused", paused.error());
  if (*paused) return;
  for (int starts = 0;;) {
    const int free = PlacesOf(config) - PlacesUsed();
    if (free <= 0) return;
    auto candidates = parts_.store.Runnable(kCandidates);
    if (!candidates) return StoreFailed("runnable", candidates.error());
    bool started = false;
    int left = free;
    for (const JobRecord& job : *candidates) {
      const int threads = ThreadsOf(job.limits.threads, config);
      // Strictly in order: a large job must not wait for ever behind small ones.
      if (PlacesFor(threads, config) > left) break;
      if (++starts > kStartsAtOnce) return Poke();
      if (!StartJob(job, threads, config)) return;
      left = PlacesOf(config) - PlacesUsed();
      started = true;
    }
    if (!started || left <= 0) return;
  }
}

void Scheduler::EndBeforeStart(const JobRecord& job, const AttemptEnd& end) {
  const Status written = parts_.store.Finish({job.id, job.attempt}, end, parts_.clock.WallMs());
  if (!written) {
    // It stays a running job without a process; as such it is found, and written, again.
    StoreFailed("finish", written.error());
    Active active;
    active.job = job;
    active.spec = SpecOf(job);
    active.known = false;
    active.started_steady_ms = parts_.clock.SteadyMs();
    active_.emplace(job.id, std::move(active));
    return;
  }
  parts_.events.Notify();
  parts_.board.Count([&](ServiceMetrics& m) {
    m.failed += end.state == JobState::kFailed ? 1 : 0;
    m.buried += end.state == JobState::kBuried ? 1 : 0;
    m.retried += end.state == JobState::kRetryWaiting ? 1 : 0;
  });
  parts_.log.Warning("job_not_started", {{"job", job.id},
                                         {"attempt", job.attempt},
                                         {"state", JobStateName(end.state)},
                                         {"message", end.error_message}});
  SettleFailedFile(job.id, false);
}

bool Scheduler::StartJob(const JobRecord& queued, int threads, const Config& config) {
  const int64_t wall = parts_.clock.WallMs();
  auto started = parts_.store.Start(
      queued.id, CurrentRevision(parts_.files, queued.out, queued.asset), wall + kLeaseMs, wall);
  if (!started) {
    // Somebody cancelled or paused it meanwhile; that is not a failure.
    if (started.error().code == ErrorCode::kConflict) return true;
    StoreFailed("start", started.error());
    return false;
  }
  JobRecord job = std::move(*started);
  parts_.events.Notify();

  AttemptEnd end;
  end.state = JobState::kFailed;
  auto description = ParseJob(job.job_json, "", "job " + std::to_string(job.id));
  if (description) {
    const Status confined = ConfineJob(RootsOf(config), &*description);
    if (!confined) description = Fail(confined.error());
  }
  if (!description) {
    end.error_code = ErrorCodeName(description.error().code);
    end.error_message = description.error().message;
    EndBeforeStart(job, end);
    return true;
  }
  description->threads = threads;
  job.limits.threads = threads;
  AttemptSpec spec = SpecOf(job);
  spec.inputs = InputsOf(*description, RootsOf(config));
  job.job_json.clear();

  const Status prepared = folders_.Prepare(job, JobToJson(*description), wall);
  Result<std::string> handle = prepared ? parts_.executor.Start(spec) : Fail(prepared.error());
  if (!handle) {
    const Error& error = handle.error();
    end.error_code = ErrorCodeName(error.code);
    end.error_message = error.message;
    const bool exhausted = error.code == ErrorCode::kResourceExhausted;
    if (exhausted) {
      // Not the job's fault, and no other would do better: none is started for a while.
      end.state = JobState::kQueued;
      start_wait_ms_ = std::clamp<int64_t>(start_wait_ms_ * 2, 1000, kMostStartWaitMs);
      start_retry_ms_ = parts_.clock.SteadyMs() + start_wait_ms_;
      parts_.board.SetProblem("start", "no job can be started: " + error.message);
    } else if (job.failures + 1 >= config.retry.max_attempts) {
      end.state = JobState::kBuried;
    } else {
      end.state = JobState::kRetryWaiting;
      end.due_ms = wall + BackoffMs(PolicyOf(config).backoff, job.failures + 1, Random());
    }
    EndBeforeStart(job, end);
    Poke();
    return !exhausted;
  }
  start_wait_ms_ = 0;
  parts_.board.SetProblem("start", "");
  parts_.board.Count([&](ServiceMetrics& m) {
    ++m.attempts_started;
    if (job.attempt == 1)
      Observe(static_cast<double>(wall - job.created_ms) / 1000, &m.queue_seconds);
  });
  parts_.log.Info("job_started", {{"job", job.id},
                                  {"attempt", job.attempt},
                                  {"asset", job.asset},
                                  {"threads", threads},
                                  {"handle", *handle}});
  // Without a handle a later daemon finds it all the same, by its lock or its name.
  if (!handle->empty()) {
    const Status noted = parts_.store.SetHandle({job.id, job.attempt}, *handle);
    if (!noted) StoreFailed("set_handle", noted.error());
  }
  Active active;
  active.job = std::move(job);
  active.spec = std::move(spec);
  active.started_steady_ms = parts_.clock.SteadyMs();
  const int64_t id = active.job.id;
  active_.emplace(id, std::move(active));
  return true;
}

void Scheduler::Retain() {
  const int64_t now = parts_.clock.SteadyMs();
  next_retention_ms_ = now + kRetentionMs;
  const RetentionConfig config = this->config()->retention;
  StoreRetention retention;
  retention.finished_before_ms = parts_.clock.WallMs() - config.finished_days * int64_t{86400000};
  retention.keep_finished = config.finished_jobs;
  retention.keep_events = config.events;
  auto removed = parts_.store.Prune(retention);
  if (!removed) return StoreFailed("prune", removed.error());
  for (const int64_t id : *removed) folders_.Remove(id);
  parts_.board.Count(
      [&](ServiceMetrics& m) { m.jobs_pruned += static_cast<int64_t>(removed->size()); });
  // There may be more; other work comes first.
  if (removed->size() >= 1000) next_retention_ms_ = now + 100;
}

void Scheduler::StoreFailed(const char* what, const Error& error) {
  store_retry_ms_ = parts_.clock.SteadyMs() + kStoreRetryMs;
  start_retry_ms_ = std::max(start_retry_ms_, store_retry_ms_);
  parts_.board.Count([](ServiceMetrics& m) { ++m.store_errors; });
  parts_.board.SetProblem("store", error.message);
  parts_.log.Error("queue_failed", {{"call", what}, {"reason", error.message}});
  Poke();
}

int Scheduler::NextWaitMs() {
  const int64_t now = parts_.clock.SteadyMs();
  if (store_retry_ms_ != 0 && now >= store_retry_ms_) {
    store_retry_ms_ = 0;
    parts_.board.SetProblem("store", "");
  }
  int64_t wait = next_retention_ms_ - now;
  const auto sooner = [&wait](int64_t candidate) { wait = std::min(wait, candidate); };
  if (store_retry_ms_ != 0) sooner(store_retry_ms_ - now);
  if (start_retry_ms_ != 0) sooner(start_retry_ms_ - now);
  if (next_due_ms_) sooner(std::max<int64_t>(*next_due_ms_ - parts_.clock.WallMs(), 0));
  if (!active_.empty()) sooner(next_lease_ms_ - now);
  bool on_farm = false;
  {
    const std::lock_guard lock(mutex_);
    const bool blocked = store_retry_ms_ != 0 || start_retry_ms_ != 0;
    if ((queue_changed_ && !blocked) || !cancels_.empty()) sooner(0);
    if (draining_ && !active_.empty() && hand_back_ms_ > now) sooner(hand_back_ms_ - now);
    on_farm = OnFarm(*config_);
  }
  for (const auto& [id, active] : active_) {
    if (active.ended) continue;
    if (!active.known) sooner(kAdoptRetryMs);
    if (active.stop != StopReason::kNone && !active.killed) sooner(active.kill_ms - now);
    if (active.stop == StopReason::kNone && active.job.limits.wall_s > 0 && !on_farm)
      sooner(active.started_steady_ms + active.job.limits.wall_s * 1000 - now);
  }
  const int executor_ms = parts_.executor.poll_timeout_ms();
  if (executor_ms >= 0) sooner(executor_ms);
  return static_cast<int>(std::clamp<int64_t>(wait, 0, kRetentionMs));
}

}  // namespace patina::daemon
