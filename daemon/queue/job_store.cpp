#include "daemon/queue/job_store.h"

#include <algorithm>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "daemon/queue/migrations.h"
#include "daemon/queue/sqlite.h"
#include "formats/base/check.h"
#include "formats/base/file_io.h"
#include "formats/base/sha256.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::ordered_json;

// In the order that ReadJob reads; the two long ones stand last.
#define PATINA_JOB_COLUMNS                                                                       \
  "id, asset, kind, out, origin, state, priority, threads, memory_mb, cpu_s, wall_s, force, "    \
  "held, cancel_requested, attempt, failures, created_ms, updated_ms, started_ms, finished_ms, " \
  "due_ms, lease_ms, handle, base_revision, error_code, error_message, revision, container, "    \
  "signature"
constexpr const char* kSelectJob =
    "SELECT " PATINA_JOB_COLUMNS ", job, result FROM jobs WHERE id = ?1";

Result<JobRecord> ReadJob(const Statement& row) {
  JobRecord job;
  int column = 0;
  const auto integer = [&] { return row.Int(column++); };
  const auto text = [&] { return row.Text(column++); };
  job.id = integer();
  job.asset = text();
  job.kind = text();
  job.out = text();
  job.origin = static_cast<JobOrigin>(integer());
  job.state = static_cast<JobState>(integer());
  job.priority = static_cast<int>(integer());
  job.limits.threads = static_cast<int>(integer());
  job.limits.memory_mb = integer();
  job.limits.cpu_s = integer();
  job.limits.wall_s = integer();
  job.force = integer() != 0;
  job.held = integer() != 0;
  job.cancel_requested = integer() != 0;
  job.attempt = integer();
  job.failures = static_cast<int>(integer());
  job.created_ms = integer();
  job.updated_ms = integer();
  job.started_ms = integer();
  job.finished_ms = integer();
  job.due_ms = integer();
  job.lease_ms = integer();
  job.handle = text();
  job.base_revision = text();
  job.error_code = text();
  job.error_message = text();
  job.revision = text();
  job.container = text();
  job.signature = text();
  if (std::find(kJobStates.begin(), kJobStates.end(), job.state) == kJobStates.end() ||
      job.limits.threads < 1) {
    return Fail(ErrorCode::kCorruptData,
                "job " + std::to_string(job.id) + " in the queue's file makes no sense");
  }
  return job;
}

std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// What an idempotency key stands for.
std::string RequestSha256(const NewJob& job) {
  const std::string text = Dump(Json{{"asset", job.asset},
                                     {"out", job.out},
                                     {"priority", job.priority},
                                     {"threads", job.limits.threads},
                                     {"memory_mb", job.limits.memory_mb},
                                     {"cpu_s", job.limits.cpu_s},
                                     {"wall_s", job.limits.wall_s},
                                     {"force", job.force},
                                     {"job", job.job_json}});
  return Sha256Hex(AsBytes(text));
}

AssetRecord ReadAsset(const Statement& row) {
  AssetRecord asset;
  asset.out = row.Text(0);
  asset.name = row.Text(1);
  asset.source = row.Text(2);
  asset.signature = row.Text(3);
  asset.failed_file = row.Text(4);
  asset.last_job = row.Int(5);
  asset.updated_ms = row.Int(6);
  asset.gone = row.Int(7) != 0;
  return asset;
}
constexpr const char* kSelectAsset =
    "SELECT out, name, source, signature, failed_file, last_job, updated_ms, gone FROM assets "
    "WHERE out = ?1 AND name = ?2";
constexpr const char* kSelectAssets =
    "SELECT out, name, source, signature, failed_file, last_job, updated_ms, gone FROM assets "
    "WHERE name > ?1 ORDER BY name, out LIMIT ?2";

tl::unexpected<Error> NoSuchJob(int64_t id) {
  return Fail(ErrorCode::kNotFound, "there is no job " + std::to_string(id));
}

class SqliteJobStore : public JobStore {
 public:
  explicit SqliteJobStore(std::unique_ptr<Database> database) : database_(std::move(database)) {}

  Status Migrate() {
    int64_t version = 0;
    {
      PATINA_ASSIGN(Statement ask, database_->Prepare("PRAGMA user_version"));
      PATINA_TRY(ask.Step());
      version = ask.Int(0);
    }
    if (version > kMigrationCount) {
      return Fail(ErrorCode::kUnsupported, "the queue is of version " + std::to_string(version) +
                                               ", and this program knows versions up to " +
                                               std::to_string(kMigrationCount) +
                                               "; use a newer patinad");
    }
    for (int i = static_cast<int>(version); i < kMigrationCount; ++i) {
      PATINA_CHECK(kMigrations[i].version == i + 1);
      PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
      PATINA_TRY(database_->Execute(kMigrations[i].sql));
      PATINA_TRY(database_->Execute(("PRAGMA user_version = " + std::to_string(i + 1)).c_str()));
      PATINA_TRY(transaction.Commit());
    }
    return {};
  }

  Result<Submitted> Submit(const NewJob& job, int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    const std::string sha256 = RequestSha256(job);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    if (!job.idempotency_key.empty()) {
      PATINA_ASSIGN(
          Statement find,
          database_->Prepare("SELECT id, request_sha256 FROM jobs WHERE idempotency_key = ?1"));
      PATINA_ASSIGN(const bool found, find.Bind(job.idempotency_key).Step());
      if (found) {
        if (find.Text(1) == sha256) return Submitted{find.Int(0), false};
        return Fail(ErrorCode::kConflict,
                    "the idempotency key was used for another request, which made job " +
                        std::to_string(find.Int(0)) + "; use a new key");
      }
    }
    PATINA_ASSIGN(
        Statement insert,
        database_->Prepare(
            "INSERT INTO jobs (asset, kind, out, origin, state, priority, threads, memory_mb, "
            "cpu_s, wall_s, force, created_ms, updated_ms, signature, request_sha256, job, "
            "idempotency_key) VALUES (?1, ?2, ?3, ?4, 1, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, "
            "?14, ?15, ?16)"));
    insert.Bind(job.asset).Bind(job.kind).Bind(job.out).Bind(static_cast<int64_t>(job.origin));
    insert.Bind(job.priority).Bind(job.limits.threads).Bind(job.limits.memory_mb);
    insert.Bind(job.limits.cpu_s).Bind(job.limits.wall_s).Bind(job.force ? 1 : 0);
    insert.Bind(now_ms).Bind(now_ms).Bind(job.signature).Bind(sha256).Bind(job.job_json);
    if (job.idempotency_key.empty()) {
      insert.BindNull();
    } else {
      insert.Bind(job.idempotency_key);
    }
    PATINA_TRY(database_->Run(insert));
    const int64_t id = database_->LastInsertId();
    PATINA_TRY(NoteLastJob(id, job, now_ms));
    PATINA_TRY(AddEvent(id, "submitted", now_ms,
                        Json{{"asset", job.asset},
                             {"state", "queued"},
                             {"attempt", 0},
                             {"origin", JobOriginName(job.origin)}}));
    PATINA_TRY(transaction.Commit());
    return Submitted{id, true};
  }

  Result<JobRecord> Get(int64_t id) override {
    const std::lock_guard lock(mutex_);
    return Load(id);
  }

  Result<JobPage> List(const JobFilter& filter) override {
    const std::lock_guard lock(mutex_);
    const int limit = std::clamp(filter.limit, 1, 1000);
    const int64_t before = filter.before > 0 ? filter.before : INT64_MAX;
    // One query for each state keeps to the index; the pages are then merged.
    std::vector<int> states;
    for (const JobState state : filter.states) states.push_back(static_cast<int>(state));
    std::sort(states.begin(), states.end());
    states.erase(std::unique(states.begin(), states.end()), states.end());
    JobPage page;
    if (states.empty()) {
      PATINA_TRY(AddPage(
          filter.asset.empty()
              ? "SELECT " PATINA_JOB_COLUMNS " FROM jobs WHERE id < ?1 AND ?2 = ?2 AND ?3 = ?3 "
                "ORDER BY id DESC LIMIT ?4"
              : "SELECT " PATINA_JOB_COLUMNS " FROM jobs WHERE id < ?1 AND ?2 = ?2 AND asset = ?3 "
                "ORDER BY id DESC LIMIT ?4",
          before, 0, filter.asset, limit + 1, &page.jobs));
    }
    for (const int state : states) {
      PATINA_TRY(AddPage(filter.asset.empty()
                             ? "SELECT " PATINA_JOB_COLUMNS
                               " FROM jobs WHERE id < ?1 AND state = ?2 AND ?3 = ?3 "
                               "ORDER BY id DESC LIMIT ?4"
                             : "SELECT " PATINA_JOB_COLUMNS
                               " FROM jobs WHERE id < ?1 AND state = ?2 AND asset = ?3 "
                               "ORDER BY id DESC LIMIT ?4",
                         before, state, filter.asset, limit + 1, &page.jobs));
    }
    std::sort(page.jobs.begin(), page.jobs.end(),
              [](const JobRecord& a, const JobRecord& b) { return a.id > b.id; });
    if (page.jobs.size() > static_cast<size_t>(limit)) {
      page.jobs.resize(static_cast<size_t>(limit));
      page.next = page.jobs.back().id;
    }
    return page;
  }

  Result<JobCounts> Counts() override {
    const std::lock_guard lock(mutex_);
    JobCounts counts;
    for (const JobState state : kJobStates) counts.by_state[state] = 0;
    PATINA_ASSIGN(Statement query,
                  database_->Prepare("SELECT state, count(*) FROM jobs GROUP BY state"));
    for (;;) {
      PATINA_ASSIGN(const bool row, query.Step());
      if (!row) return counts;
      counts.by_state[static_cast<JobState>(query.Int(0))] = query.Int(1);
    }
  }

  Result<std::vector<JobRecord>> Runnable(int limit) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(
        Statement query,
        database_->Prepare(
            "SELECT " PATINA_JOB_COLUMNS
            " FROM jobs q INDEXED BY jobs_to_run WHERE state = 1 AND held = 0 AND NOT EXISTS "
            "(SELECT 1 FROM jobs r WHERE r.out = q.out AND r.asset = q.asset AND r.state = 2) "
            "ORDER BY priority DESC, id"));
    std::vector<JobRecord> jobs;
    std::set<std::pair<std::string, std::string>> assets;
    while (jobs.size() < static_cast<size_t>(std::max(limit, 0))) {
      PATINA_ASSIGN(const bool row, query.Step());
      if (!row) break;
      PATINA_ASSIGN(JobRecord job, ReadJob(query));
      if (assets.emplace(job.out, job.asset).second) jobs.push_back(std::move(job));
    }
    return jobs;
  }

  Result<std::vector<JobRecord>> Running() override {
    const std::lock_guard lock(mutex_);
    std::vector<JobRecord> jobs;
    PATINA_TRY(AddPage("SELECT " PATINA_JOB_COLUMNS
                       " FROM jobs WHERE id < ?1 AND state = ?2 AND ?3 = ?3 ORDER BY id LIMIT ?4",
                       INT64_MAX, static_cast<int>(JobState::kRunning), "", 100000, &jobs));
    return jobs;
  }

  Result<std::optional<JobRecord>> WaitingFor(const std::string& out,
                                              const std::string& asset) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Statement query,
                  database_->Prepare("SELECT " PATINA_JOB_COLUMNS
                                     ", job FROM jobs WHERE out = ?1 AND asset = ?2 AND state "
                                     "IN (1, 6) ORDER BY id DESC LIMIT 1"));
    PATINA_ASSIGN(const bool row, query.Bind(out).Bind(asset).Step());
    if (!row) return std::optional<JobRecord>();
    PATINA_ASSIGN(JobRecord job, ReadJob(query));
    job.job_json = query.Text(29);
    return std::optional<JobRecord>(std::move(job));
  }

  Result<JobRecord> Start(int64_t id, const std::string& base_revision, int64_t lease_ms,
                          int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    PATINA_ASSIGN(JobRecord job, Load(id));
    PATINA_TRY(CheckTransition(job, JobState::kRunning));
    if (job.held) {
      return Fail(ErrorCode::kConflict, "job " + std::to_string(id) + " is paused");
    }
    if (job.attempt == 0) job.base_revision = base_revision;
    ++job.attempt;
    PATINA_ASSIGN(Statement update,
                  database_->Prepare(
                      "UPDATE jobs SET state = 2, attempt = ?2, base_revision = ?3, lease_ms = ?4, "
                      "started_ms = ?5, updated_ms = ?5, finished_ms = 0, due_ms = 0, handle = '', "
                      "error_code = '', error_message = '', result = '' WHERE id = ?1"));
    update.Bind(id).Bind(job.attempt).Bind(job.base_revision).Bind(lease_ms).Bind(now_ms);
    PATINA_TRY(database_->Run(update));
    PATINA_TRY(
        AddEvent(id, "started", now_ms,
                 Json{{"asset", job.asset}, {"state", "running"}, {"attempt", job.attempt}}));
    PATINA_ASSIGN(JobRecord started, Load(id));
    PATINA_TRY(transaction.Commit());
    return started;
  }

  Status SetHandle(const AttemptKey& attempt, const std::string& handle) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Statement update,
                  database_->Prepare("UPDATE jobs SET handle = ?3 WHERE id = ?1 AND attempt = ?2 "
                                     "AND state = 2"));
    PATINA_TRY(database_->Run(update.Bind(attempt.job).Bind(attempt.attempt).Bind(handle)));
    return database_->ChangedRows() == 1 ? Status() : Stale(attempt);
  }

  Status Heartbeat(const std::vector<AttemptKey>& attempts, int64_t lease_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    for (const AttemptKey& attempt : attempts) {
      PATINA_ASSIGN(Statement update,
                    database_->Prepare("UPDATE jobs SET lease_ms = ?3 WHERE id = ?1 AND attempt "
                                       "= ?2 AND state = 2"));
      PATINA_TRY(database_->Run(update.Bind(attempt.job).Bind(attempt.attempt).Bind(lease_ms)));
      if (database_->ChangedRows() != 1) return Stale(attempt);
    }
    return transaction.Commit();
  }

  Status Finish(const AttemptKey& attempt, const AttemptEnd& end, int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    PATINA_ASSIGN(const JobRecord job, Load(attempt.job));
    if (job.attempt != attempt.attempt || job.state != JobState::kRunning) return Stale(attempt);
    const bool lost = end.state == JobState::kRetryWaiting || end.state == JobState::kBuried;
    const bool cancelled = job.cancel_requested && (lost || end.state == JobState::kQueued);
    const JobState state = cancelled ? JobState::kCancelled : end.state;
    PATINA_TRY(CheckTransition(job, state));
    PATINA_ASSIGN(
        Statement update,
        database_->Prepare(
            "UPDATE jobs SET state = ?2, updated_ms = ?3, finished_ms = ?4, due_ms = ?5, "
            "lease_ms = 0, handle = '', cancel_requested = 0, failures = failures + ?6, "
            "error_code = ?7, error_message = ?8, result = ?9, revision = ?10, container = ?11, "
            "memory_mb = ?12 WHERE id = ?1"));
    update.Bind(attempt.job).Bind(static_cast<int64_t>(state)).Bind(now_ms);
    update.Bind(IsFinal(state) ? now_ms : 0);
    update.Bind(state == JobState::kRetryWaiting ? end.due_ms : 0).Bind(lost ? 1 : 0);
    update.Bind(end.error_code).Bind(end.error_message).Bind(end.result_json);
    update.Bind(end.revision).Bind(end.container);
    update.Bind(end.memory_mb > 0 ? end.memory_mb : job.limits.memory_mb);
    PATINA_TRY(database_->Run(update));
    Json data{
        {"asset", job.asset}, {"state", JobStateName(state)}, {"attempt", attempt.attempt}};
    if (end.exit_code >= 0) data["exit_code"] = end.exit_code;
    if (end.signal > 0) data["signal"] = end.signal;
    if (!end.error_code.empty()) data["error"] = end.error_code;
    if (!end.error_message.empty()) data["message"] = end.error_message;
    if (!end.revision.empty()) data["revision"] = end.revision;
    if (state == JobState::kRetryWaiting) data["due_ms"] = end.due_ms;
    const char* type = state == JobState::kQueued ? "requeued" : JobStateName(state);
    PATINA_TRY(AddEvent(attempt.job, type, now_ms, data));
    return transaction.Commit();
  }

  Result<JobState> Cancel(int64_t id, int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    PATINA_ASSIGN(const JobRecord job, Load(id));
    PATINA_TRY(CheckTransition(job, JobState::kCancelled));
    if (job.state == JobState::kRunning) {
      if (job.cancel_requested) return JobState::kRunning;
      PATINA_TRY(
          Set("UPDATE jobs SET cancel_requested = 1, updated_ms = ?2 WHERE id = ?1", id, now_ms));
      PATINA_TRY(AddEvent(id, "cancel_requested", now_ms, Described(job, JobState::kRunning)));
      PATINA_TRY(transaction.Commit());
      return JobState::kRunning;
    }
    PATINA_TRY(
        Set("UPDATE jobs SET state = 5, held = 0, due_ms = 0, updated_ms = ?2, "
            "finished_ms = ?2 WHERE id = ?1",
            id, now_ms));
    PATINA_TRY(AddEvent(id, "cancelled", now_ms, Described(job, JobState::kCancelled)));
    PATINA_TRY(transaction.Commit());
    return JobState::kCancelled;
  }

  Status Retry(int64_t id, int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    PATINA_ASSIGN(const JobRecord job, Load(id));
    if (job.state == JobState::kRunning) return NoTransition(job, JobState::kQueued);
    PATINA_TRY(CheckTransition(job, JobState::kQueued));
    PATINA_TRY(
        Set("UPDATE jobs SET state = 1, failures = 0, due_ms = 0, finished_ms = 0, "
            "cancel_requested = 0, updated_ms = ?2 WHERE id = ?1",
            id, now_ms));
    PATINA_TRY(AddEvent(id, "requeued", now_ms, Described(job, JobState::kQueued)));
    return transaction.Commit();
  }

  Result<int> WakeDue(int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    std::vector<JobRecord> due;
    {
      PATINA_ASSIGN(Statement query,
                    database_->Prepare("SELECT " PATINA_JOB_COLUMNS
                                       " FROM jobs WHERE state = 6 AND due_ms <= ?1 "
                                       "ORDER BY due_ms LIMIT 1000"));
      query.Bind(now_ms);
      for (;;) {
        PATINA_ASSIGN(const bool row, query.Step());
        if (!row) break;
        PATINA_ASSIGN(JobRecord job, ReadJob(query));
        due.push_back(std::move(job));
      }
    }
    for (const JobRecord& job : due) {
      PATINA_TRY(Set("UPDATE jobs SET state = 1, due_ms = 0, updated_ms = ?2 WHERE id = ?1", job.id,
                     now_ms));
      PATINA_TRY(AddEvent(job.id, "requeued", now_ms, Described(job, JobState::kQueued)));
    }
    PATINA_TRY(transaction.Commit());
    return static_cast<int>(due.size());
  }

  Result<std::optional<int64_t>> NextDue() override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Statement query, database_->Prepare("SELECT due_ms FROM jobs WHERE state = 6 "
                                                      "ORDER BY due_ms LIMIT 1"));
    PATINA_ASSIGN(const bool row, query.Step());
    return row ? std::optional<int64_t>(query.Int(0)) : std::nullopt;
  }

  Status SetHeld(int64_t id, bool held, int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    PATINA_ASSIGN(const JobRecord job, Load(id));
    if (job.state != JobState::kQueued && job.state != JobState::kRetryWaiting) {
      return Fail(ErrorCode::kConflict, "job " + std::to_string(id) + " is " +
                                            JobStateName(job.state) +
                                            "; only waiting jobs can be paused");
    }
    if (job.held == held) return {};
    PATINA_TRY(Set(held ? "UPDATE jobs SET held = 1, updated_ms = ?2 WHERE id = ?1"
                        : "UPDATE jobs SET held = 0, updated_ms = ?2 WHERE id = ?1",
                   id, now_ms));
    PATINA_TRY(AddEvent(id, held ? "held" : "released", now_ms, Described(job, job.state)));
    return transaction.Commit();
  }

  Status SetPriority(int64_t id, int priority, int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    if (priority < kMinPriority || priority > kMaxPriority) {
      return Fail(ErrorCode::kInvalidArgument,
                  "a priority is between " + std::to_string(kMinPriority) + " and " +
                      std::to_string(kMaxPriority) + "; this is " + std::to_string(priority));
    }
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    PATINA_ASSIGN(const JobRecord job, Load(id));
    if (IsFinal(job.state)) {
      return Fail(ErrorCode::kConflict, "job " + std::to_string(id) + " is " +
                                            JobStateName(job.state) + " and does not wait");
    }
    PATINA_ASSIGN(
        Statement update,
        database_->Prepare("UPDATE jobs SET priority = ?2, updated_ms = ?3 WHERE id = ?1"));
    PATINA_TRY(database_->Run(update.Bind(id).Bind(priority).Bind(now_ms)));
    Json data = Described(job, job.state);
    data["priority"] = priority;
    PATINA_TRY(AddEvent(id, "priority", now_ms, data));
    return transaction.Commit();
  }

  Status SetQueuePaused(bool paused, int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    PATINA_ASSIGN(const bool before, LoadPaused());
    if (before == paused) return {};
    PATINA_ASSIGN(
        Statement put,
        database_->Prepare("INSERT OR REPLACE INTO settings (name, value) VALUES ('paused', ?1)"));
    PATINA_TRY(database_->Run(put.Bind(paused ? "1" : "0")));
    PATINA_TRY(AddEvent(0, paused ? "queue_paused" : "queue_resumed", now_ms, Json::object()));
    return transaction.Commit();
  }

  Result<bool> QueuePaused() override {
    const std::lock_guard lock(mutex_);
    return LoadPaused();
  }

  Status ReplaceWaiting(int64_t id, const NewJob& job, int64_t now_ms) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    PATINA_ASSIGN(Statement update,
                  database_->Prepare("UPDATE jobs SET job = ?2, signature = ?3, updated_ms = ?4 "
                                     "WHERE id = ?1 AND state IN (1, 6)"));
    PATINA_TRY(database_->Run(update.Bind(id).Bind(job.job_json).Bind(job.signature).Bind(now_ms)));
    if (database_->ChangedRows() != 1)
      return Fail(ErrorCode::kConflict, "job " + std::to_string(id) + " does not wait any more");
    PATINA_TRY(NoteLastJob(id, job, now_ms));
    return transaction.Commit();
  }

  Result<std::vector<StoredEvent>> EventsAfter(int64_t id, int limit) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Statement query,
                  database_->Prepare("SELECT id, time_ms, job, type, data FROM events WHERE id > "
                                     "?1 ORDER BY id LIMIT ?2"));
    query.Bind(id).Bind(limit);
    std::vector<StoredEvent> events;
    for (;;) {
      PATINA_ASSIGN(const bool row, query.Step());
      if (!row) return events;
      events.push_back({query.Int(0), query.Int(1), query.Int(2), query.Text(3), query.Text(4)});
    }
  }

  Result<std::pair<int64_t, int64_t>> EventRange() override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Statement query,
                  database_->Prepare("SELECT (SELECT min(id) FROM events), (SELECT seq FROM "
                                     "sqlite_sequence WHERE name = 'events')"));
    PATINA_TRY(query.Step());
    const int64_t newest = query.Int(1);
    return std::pair<int64_t, int64_t>(query.Int(0) > 0 ? query.Int(0) : newest + 1, newest);
  }

  Result<std::optional<AssetRecord>> GetAsset(const std::string& out,
                                              const std::string& name) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Statement query, database_->Prepare(kSelectAsset));
    PATINA_ASSIGN(const bool row, query.Bind(out).Bind(name).Step());
    return row ? std::optional<AssetRecord>(ReadAsset(query)) : std::nullopt;
  }

  Status PutAsset(const AssetRecord& asset) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(
        Statement put,
        database_->Prepare("INSERT OR REPLACE INTO assets (out, name, source, signature, "
                           "failed_file, last_job, updated_ms, gone) VALUES (?1, ?2, ?3, ?4, ?5, "
                           "?6, ?7, ?8)"));
    put.Bind(asset.out).Bind(asset.name).Bind(asset.source).Bind(asset.signature);
    put.Bind(asset.failed_file).Bind(asset.last_job).Bind(asset.updated_ms);
    return database_->Run(put.Bind(asset.gone ? 1 : 0));
  }

  Result<std::vector<AssetRecord>> Assets(const std::string& after_name, int limit) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Statement query, database_->Prepare(kSelectAssets));
    query.Bind(after_name).Bind(limit);
    std::vector<AssetRecord> assets;
    for (;;) {
      PATINA_ASSIGN(const bool row, query.Step());
      if (!row) return assets;
      assets.push_back(ReadAsset(query));
    }
  }

  Result<std::vector<int64_t>> Prune(const StoreRetention& retention) override {
    const std::lock_guard lock(mutex_);
    PATINA_ASSIGN(Transaction transaction, Transaction::Begin(*database_));
    // The last job of an asset says what became of it, and stays.
    PATINA_ASSIGN(
        Statement choose,
        database_->Prepare(
            "SELECT id FROM jobs WHERE state IN (3, 4, 5, 7) AND id NOT IN (SELECT last_job FROM "
            "assets) AND (finished_ms < ?1 OR id <= coalesce((SELECT id FROM jobs WHERE state IN "
            "(3, 4, 5, 7) ORDER BY id DESC LIMIT 1 OFFSET ?2), 0)) ORDER BY id LIMIT 1000"));
    choose.Bind(retention.finished_before_ms).Bind(retention.keep_finished);
    std::vector<int64_t> removed;
    for (;;) {
      PATINA_ASSIGN(const bool row, choose.Step());
      if (!row) break;
      removed.push_back(choose.Int(0));
    }
    for (const int64_t id : removed) {
      PATINA_ASSIGN(Statement remove, database_->Prepare("DELETE FROM jobs WHERE id = ?1"));
      PATINA_TRY(database_->Run(remove.Bind(id)));
    }
    PATINA_ASSIGN(Statement events,
                  database_->Prepare("DELETE FROM events WHERE id <= (SELECT max(id) FROM events) "
                                     "- ?1"));
    PATINA_TRY(database_->Run(events.Bind(retention.keep_events)));
    if (!removed.empty() || database_->ChangedRows() > 0) PATINA_TRY(transaction.Commit());
    return removed;
  }

 private:
  Result<JobRecord> Load(int64_t id) {
    PATINA_ASSIGN(Statement query, database_->Prepare(kSelectJob));
    PATINA_ASSIGN(const bool row, query.Bind(id).Step());
    if (!row) return NoSuchJob(id);
    PATINA_ASSIGN(JobRecord job, ReadJob(query));
    job.job_json = query.Text(29);
    job.result_json = query.Text(30);
    return job;
  }

  Status AddPage(const char* sql, int64_t before, int state, const std::string& asset, int limit,
                 std::vector<JobRecord>* jobs) {
    PATINA_ASSIGN(Statement query, database_->Prepare(sql));
    query.Bind(before).Bind(state).Bind(asset).Bind(limit);
    for (;;) {
      PATINA_ASSIGN(const bool row, query.Step());
      if (!row) return {};
      PATINA_ASSIGN(JobRecord job, ReadJob(query));
      jobs->push_back(std::move(job));
    }
  }

  Result<bool> LoadPaused() {
    PATINA_ASSIGN(Statement query,
                  database_->Prepare("SELECT value FROM settings WHERE name = 'paused'"));
    PATINA_ASSIGN(const bool row, query.Step());
    return row && query.Text(0) == "1";
  }

  // What the API knows of an asset does not replace what the watcher knows.
  Status NoteLastJob(int64_t id, const NewJob& job, int64_t now_ms) {
    PATINA_ASSIGN(
        Statement put,
        database_->Prepare(
            job.origin == JobOrigin::kWatch
                ? "INSERT INTO assets (out, name, source, signature, failed_file, last_job, "
                  "updated_ms, gone) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, 0) ON CONFLICT (name, "
                  "out) DO UPDATE SET source = ?3, signature = ?4, failed_file = ?5, last_job = "
                  "?6, updated_ms = ?7, gone = 0"
                : "INSERT INTO assets (out, name, source, signature, failed_file, last_job, "
                  "updated_ms, gone) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, 0) ON CONFLICT (name, "
                  "out) DO UPDATE SET last_job = ?6, updated_ms = ?7"));
    put.Bind(job.out).Bind(job.asset).Bind(job.source).Bind(job.signature).Bind(job.failed_file);
    return database_->Run(put.Bind(id).Bind(now_ms));
  }

  // For statements with an id and a time.
  Status Set(const char* sql, int64_t id, int64_t now_ms) {
    PATINA_ASSIGN(Statement update, database_->Prepare(sql));
    return database_->Run(update.Bind(id).Bind(now_ms));
  }

  Status AddEvent(int64_t job, const char* type, int64_t now_ms, const Json& data) {
    PATINA_ASSIGN(Statement insert,
                  database_->Prepare(
                      "INSERT INTO events (time_ms, job, type, data) VALUES (?1, ?2, ?3, ?4)"));
    return database_->Run(insert.Bind(now_ms).Bind(job).Bind(type).Bind(Dump(data)));
  }

  static Json Described(const JobRecord& job, JobState state) {
    return {{"asset", job.asset}, {"state", JobStateName(state)}, {"attempt", job.attempt}};
  }

  static Status NoTransition(const JobRecord& job, JobState to) {
    return Fail(ErrorCode::kConflict, "job " + std::to_string(job.id) + " is " +
                                          JobStateName(job.state) + " and cannot become " +
                                          JobStateName(to));
  }

  static Status CheckTransition(const JobRecord& job, JobState to) {
    if (IsLegalTransition(job.state, to)) return {};
    return NoTransition(job, to);
  }

  static Status Stale(const AttemptKey& attempt) {
    return Fail(ErrorCode::kConflict, "attempt " + std::to_string(attempt.attempt) + " of job " +
                                          std::to_string(attempt.job) +
                                          " is not the current one of a running job");
  }

  std::mutex mutex_;
  std::unique_ptr<Database> database_;
};

}  // namespace

const char* JobOriginName(JobOrigin origin) {
  return origin == JobOrigin::kWatch ? "watch" : "api";
}

Result<std::unique_ptr<JobStore>> JobStore::Open(const std::string& path) {
  PATINA_ASSIGN(std::unique_ptr<Database> database, Database::Open(path));
  auto store = std::make_unique<SqliteJobStore>(std::move(database));
  PATINA_TRY(store->Migrate());
  return store;
}

}  // namespace patina::daemon
