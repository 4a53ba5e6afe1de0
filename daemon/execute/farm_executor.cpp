#include "daemon/execute/farm_executor.h"

#include <algorithm>
#include <map>
#include <unordered_map>
#include <utility>

#include "daemon/execute/command_runner.h"
#include "daemon/execute/farm_attempt.h"
#include "daemon/execute/worker_command.h"
#include "pipeline/jobs/run_guards.h"

namespace patina::daemon {
namespace {

constexpr int kSubmissionsAtOnce = 8;
constexpr int kCancelsAtOnce = 4;
constexpr int kMostRefusals = 3;
constexpr int kLooksAtOnce = 100;              // at files of attempts, in one Poll
constexpr int64_t kMsPerLook = 2;              // so that 10,000 of them are seen in 20 s
constexpr int64_t kWaitingShare = 8;           // so much seldomer, while a job waits
constexpr int64_t kLookUpMs = 250;             // between rounds that submissions wait for
constexpr int64_t kResultLookMs = 250;         // between looks for a result that is due
constexpr int64_t kCancelAgainMs = 10000;      // if it is still there then
constexpr int64_t kRoundShare = 4;             // after a round, so many times as long without one
constexpr int64_t kMostWaitMs = 60000;         // between two looks at anything
constexpr int64_t kMostFailingWaitMs = 20000;  // between rounds, while the farm does not answer

using Key = std::pair<int64_t, int64_t>;  // job, attempt

class FarmExecutor : public Executor {
 public:
  FarmExecutor(const FarmOptions& options, std::unique_ptr<FarmCommands> commands,
               CommandRunner runner, FileCalls& files, Clock& clock, Logger& log)
      : options_(options),
        commands_(std::move(commands)),
        runner_(std::move(runner)),
        files_(files),
        clock_(clock),
        log_(log) {}

  Result<std::string> Start(const AttemptSpec& spec) override {
    PATINA_TRY(WriteFileDurably(ScriptOf(spec),
                                WorkerScript(options_.worker, options_.environment, spec), files_));
    FarmAttempt attempt(spec);
    attempt.phase = commands_->finds_names() ? FarmPhase::kLookUp : FarmPhase::kSubmit;
    Add(std::move(attempt));
    // It is found by its name, which follows from the attempt.
    return std::string();
  }

  // What is not known yet, the next rounds tell: none of it is reported lost meanwhile.
  Result<bool> Adopt(const AttemptSpec& spec, const std::string&) override {
    FarmAttempt attempt(spec);
    attempt.ids = ReadFarmIds(spec);
    attempt.asked_farm = true;
    if (!FileIsThere(ScriptOf(spec), files_)) {
      // Nothing was submitted, and will not be.
      attempt.phase = FarmPhase::kEnding;
      attempt.give_up_ms = clock_.SteadyMs();
    } else if (!attempt.ids.empty()) {
      attempt.phase = FarmPhase::kOnFarm;
    } else if (!commands_->finds_names()) {
      AwaitResult(&attempt);
    }
    Add(std::move(attempt));
    return true;
  }

  void Stop(int64_t job, int64_t number, StopMode) override {
    const auto found = attempts_.find({job, number});
    if (found == attempts_.end()) return;
    FarmAttempt& attempt = found->second;
    attempt.stop = true;
    attempt.next_cancel_ms = 0;
    const bool never_there = !attempt.asked_farm && (attempt.phase == FarmPhase::kLookUp ||
                                                     attempt.phase == FarmPhase::kSubmit);
    if (never_there) attempt.phase = FarmPhase::kEnding;
    // The farm's own way to end a job is to ask, wait and kill: there is nothing beyond it to do,
    // and nothing to wait for once it has ended.
    if (attempt.phase == FarmPhase::kEnding) attempt.give_up_ms = clock_.SteadyMs();
    attempt.next_look_ms = 0;
  }

  std::vector<AttemptReport> Poll() override {
    for (CommandOutcome& outcome : runner_.Poll()) Take(std::move(outcome));
    BeginRound();
    Submit();
    Cancel();
    Look();
    if (attempts_.empty()) SetProblem("");
    return std::exchange(reports_, {});
  }

  bool IsAlive(int64_t job, int64_t attempt) const override {
    return attempts_.count({job, attempt}) != 0;
  }

  int poll_fd() const override { return runner_.poll_fd(); }

  int poll_timeout_ms() const override {
    if (attempts_.empty() && runner_.timeout_ms() < 0) return -1;
    const int64_t now = clock_.SteadyMs();
    int64_t wait = kMostWaitMs;
    const auto at = [&](int64_t ms) { wait = std::min(wait, std::max<int64_t>(0, ms - now)); };
    if (const int64_t command = runner_.timeout_ms(); command >= 0) at(now + command);
    if (!round_running_) at(NextRoundMs());
    for (const auto& [key, attempt] : attempts_) {
      if (attempt.phase == FarmPhase::kSubmit && Running(Kind::kSubmit) < kSubmissionsAtOnce)
        at(attempt.not_before_ms);
      if (LooksAtFiles(attempt)) at(attempt.next_look_ms);
      if (WantsCancel(attempt) && Running(Kind::kCancel) == 0) at(attempt.next_cancel_ms);
      if (wait == 0) break;
    }
    return static_cast<int>(wait);
  }

  std::string problem() const override { return problem_; }

 private:
  enum class Kind { kStatus, kSubmit, kCancel };
  struct Call {
    Kind kind = Kind::kStatus;
    Key key;                // of kSubmit
    bool excluded = false;  // the same: nodes were left out
    std::string program;
  };

  static std::string ScriptOf(const AttemptSpec& spec) { return spec.folder + "/submit.sh"; }

  void Add(FarmAttempt attempt) {
    attempt.after_round = rounds_begun_;
    const Key key{attempt.spec.job, attempt.spec.attempt};
    by_name_[FarmNameOf(attempt.spec)] = key;
    for (const std::string& id : attempt.ids) by_id_[id] = key;
    attempts_.insert_or_assign(key, std::move(attempt));
  }

  void Run(Call call, const Words& words) {
    call.program = words[0];
    ++running_[call.kind];
    const uint64_t id = runner_.Start(words, options_.command_timeout_ms);
    calls_.emplace(id, std::move(call));
  }
  int Running(Kind kind) const {
    const auto found = running_.find(kind);
    return found == running_.end() ? 0 : found->second;
  }

  void Take(CommandOutcome outcome) {
    const auto found = calls_.find(outcome.id);
    const Call call = std::move(found->second);
    calls_.erase(found);
    --running_[call.kind];
    switch (call.kind) {
      case Kind::kStatus:
        return TakeStatus(outcome);
      case Kind::kSubmit:
        return TakeSubmitted(call, outcome);
      case Kind::kCancel:
        // Whether it worked, the next rounds show.
        if (outcome.exit_code != 0)
          log_.Warning("farm_cancel_failed", {{"reason", FailureOf(call.program, outcome)}});
    }
  }

  // ---- Rounds

  bool Asks(const FarmAttempt& attempt) const {
    return attempt.phase == FarmPhase::kLookUp || attempt.phase == FarmPhase::kOnFarm;
  }

  int64_t NextRoundMs() const {
    bool any = false, hurry = false;
    for (const auto& [key, attempt] : attempts_) {
      any = any || Asks(attempt);
      hurry = hurry || attempt.phase == FarmPhase::kLookUp || (attempt.stop && Asks(attempt));
      if (hurry) break;
    }
    if (!any) return clock_.SteadyMs() + kMostWaitMs;
    const int64_t wait = hurry ? std::min(options_.poll_ms, kLookUpMs) : options_.poll_ms;
    return last_round_end_ms_ + std::max({wait, last_round_ms_ * kRoundShare, failing_wait_ms_});
  }

  void BeginRound() {
    const int64_t now = clock_.SteadyMs();
    if (round_running_ || now < NextRoundMs()) return;
    std::vector<std::string> ids, names;
    for (const auto& [key, attempt] : attempts_) {
      if (attempt.phase == FarmPhase::kOnFarm)
        ids.insert(ids.end(), attempt.ids.begin(), attempt.ids.end());
      if (attempt.phase == FarmPhase::kLookUp) names.push_back(FarmNameOf(attempt.spec));
    }
    round_ = commands_->Status(ids, names);
    if (round_.empty()) return;
    ++rounds_begun_;
    round_running_ = true;
    round_begin_ms_ = now;
    round_at_ = 0;
    round_jobs_.clear();
    Run({Kind::kStatus, {}, false, {}}, round_[0].words);
  }

  void TakeStatus(const CommandOutcome& outcome) {
    const StatusCall& call = round_[round_at_];
    std::string trouble;
    if (outcome.exit_code != 0) {
      trouble = FailureOf(call.words[0], outcome);
    } else if (auto jobs = commands_->ParseStatus(call, outcome.out)) {
      std::move(jobs->begin(), jobs->end(), std::back_inserter(round_jobs_));
    } else {
      trouble = jobs.error().message;
    }
    if (trouble.empty() && ++round_at_ < round_.size())
      return Run({Kind::kStatus, {}, false, {}}, round_[round_at_].words);
    round_running_ = false;
    last_round_end_ms_ = clock_.SteadyMs();
    last_round_ms_ = last_round_end_ms_ - round_begin_ms_;
    if (!trouble.empty()) {
      last_round_ms_ = 0;  // It was not the farm's work that took so long.
      failing_wait_ms_ = std::clamp<int64_t>(
          failing_wait_ms_ * 2, std::min<int64_t>(options_.poll_ms, 1000), kMostFailingWaitMs);
      return SetProblem(commands_->name() + " does not say how its jobs are: " + trouble +
                        "; they go on, and none is taken for failed. Look at its controller");
    }
    failing_wait_ms_ = 0;
    if (refused_.empty()) SetProblem("");
    ApplyRound();
  }

  void ApplyRound() {
    std::map<Key, std::vector<FarmJob>> said;
    for (FarmJob& job : round_jobs_) {
      const auto& known = job.name.empty() ? by_id_ : by_name_;
      const auto found = known.find(job.name.empty() ? job.id : job.name);
      if (found == known.end()) continue;
      const FarmAttempt& attempt = attempts_.at(found->second);
      // Of another daemon that counts its jobs as this one does.
      if (!job.folder.empty() && job.folder != attempt.spec.folder) continue;
      said[found->second].push_back(std::move(job));
    }
    round_jobs_.clear();
    for (auto& [key, attempt] : attempts_) {
      if (!Asks(attempt) || attempt.after_round >= rounds_begun_) continue;
      const auto jobs = said.find(key);
      if (jobs != said.end()) {
        Hear(&attempt, jobs->second);
      } else if (attempt.phase == FarmPhase::kLookUp) {
        NotFound(&attempt);
      } else {
        // It was there once. Forgotten jobs are over.
        AwaitResult(&attempt);
      }
    }
  }

  void Hear(FarmAttempt* attempt, const std::vector<FarmJob>& jobs) {
    // Should it be there more than once, one of them runs, and the others end by themselves.
    const FarmJob* best = &jobs[0];
    bool news = false;
    for (const FarmJob& job : jobs) {
      if (IsOver(best->state) && (!IsOver(job.state) || job.exit_code == 0)) best = &job;
      if (std::find(attempt->ids.begin(), attempt->ids.end(), job.id) == attempt->ids.end()) {
        attempt->ids.push_back(job.id);
        by_id_[job.id] = {attempt->spec.job, attempt->spec.attempt};
        news = true;
      }
    }
    if (news) NoteIds(*attempt);
    attempt->phase = FarmPhase::kOnFarm;
    attempt->asked_farm = true;
    attempt->confirmed = true;
    if (attempt->last.state != best->state) attempt->next_look_ms = 0;
    attempt->last = *best;
    std::string text = "job " + best->id;
    if (best->state == FarmState::kWaiting) {
      text += " waits on the farm";
      if (!best->reason.empty() && best->reason != "None") text += ": " + best->reason;
    } else if (!best->node.empty()) {
      text += " on " + best->node;
    }
    if (text != attempt->told && !IsOver(best->state)) {
      attempt->told = text;
      attempt->events.push_back(FarmEventLine(text));
    }
    if (IsOver(best->state)) AwaitResult(attempt);
  }

  // The farm does not have it.
  void NotFound(FarmAttempt* attempt) {
    if (attempt->stop) {
      attempt->phase = FarmPhase::kEnding;
      attempt->give_up_ms = clock_.SteadyMs();
      attempt->next_look_ms = 0;
    } else if (FileIsThere(attempt->spec.folder + "/" + kStartedName, files_)) {
      AwaitResult(attempt);
    } else if (attempt->refusals >= kMostRefusals) {
      attempt->cause = EndCause::kRefused;
      attempt->phase = FarmPhase::kEnding;
      attempt->give_up_ms = clock_.SteadyMs();
      attempt->next_look_ms = 0;
    } else {
      attempt->phase = FarmPhase::kSubmit;
    }
  }

  // ---- Submitting and cancelling

  void Submit() {
    const int64_t now = clock_.SteadyMs();
    for (auto& [key, attempt] : attempts_) {
      if (Running(Kind::kSubmit) >= kSubmissionsAtOnce) return;
      if (attempt.phase != FarmPhase::kSubmit || now < attempt.not_before_ms) continue;
      FarmSubmission submission;
      submission.name = FarmNameOf(attempt.spec);
      submission.folder = attempt.spec.folder;
      submission.script = ScriptOf(attempt.spec);
      submission.log = attempt.spec.log;
      submission.cpus = attempt.spec.threads;
      submission.memory_mb = attempt.spec.memory_mb;
      submission.wall_s = attempt.spec.wall_s;
      if (attempt.use_excluded) submission.excluded = ReadFailedNodes(attempt.spec);
      attempt.phase = FarmPhase::kSubmitting;
      attempt.asked_farm = true;
      Run({Kind::kSubmit, key, !submission.excluded.empty(), {}}, commands_->Submit(submission));
    }
  }

  void TakeSubmitted(const Call& call, const CommandOutcome& outcome) {
    const auto found = attempts_.find(call.key);
    if (found == attempts_.end()) return;
    FarmAttempt& attempt = found->second;
    const auto id = outcome.exit_code == 0 ? commands_->ParseSubmitted(outcome.out) : std::nullopt;
    attempt.after_round = rounds_begun_;
    if (id) {
      attempt.ids.push_back(*id);
      by_id_[*id] = call.key;
      NoteIds(attempt);
      attempt.phase = FarmPhase::kOnFarm;
      attempt.confirmed = true;
      attempt.told = "job " + *id + " waits on the farm";
      attempt.events.push_back(FarmEventLine(attempt.told));
      attempt.next_look_ms = 0;
      refused_.clear();
      log_.Info("farm_submitted",
                {{"job", attempt.spec.job}, {"attempt", attempt.spec.attempt}, {"farm_id", *id}});
      return;
    }
    const std::string trouble = outcome.exit_code == 0
                                    ? call.program + ": its answer holds no job id"
                                    : FailureOf(call.program, outcome);
    log_.Warning(
        "farm_not_submitted",
        {{"job", attempt.spec.job}, {"attempt", attempt.spec.attempt}, {"reason", trouble}});
    // A nonzero code is a no. Anything else may be a yes that was lost on its way.
    const bool is_no = outcome.exit_code > 0 || outcome.not_started;
    if (is_no && call.excluded) {
      attempt.use_excluded = false;  // That left none.
    } else if (is_no) {
      attempt.detail = trouble;
      ++attempt.refusals;
      refused_ = trouble;
      SetProblem(commands_->name() + " refused the last job: " + trouble);
    }
    attempt.not_before_ms = clock_.SteadyMs() + std::min<int64_t>(options_.poll_ms, 5000);
    if (commands_->finds_names()) {
      attempt.phase = FarmPhase::kLookUp;
    } else if (!is_no) {
      AwaitResult(&attempt);
    } else {
      NotFound(&attempt);
    }
  }

  void NoteIds(const FarmAttempt& attempt) {
    const Status noted = WriteFarmIds(attempt.spec, attempt.ids, files_);
    if (noted) return;
    log_.Warning("farm_id_not_noted",
                 {{"job", attempt.spec.job}, {"reason", noted.error().message}});
  }

  static bool WantsCancel(const FarmAttempt& attempt) {
    // Ids of an earlier daemon may be another's by now, on a farm that began to count again.
    return attempt.stop && attempt.phase == FarmPhase::kOnFarm && attempt.confirmed;
  }

  void Cancel() {
    if (Running(Kind::kCancel) > 0) return;
    const int64_t now = clock_.SteadyMs();
    std::vector<std::string> ids;
    for (auto& [key, attempt] : attempts_) {
      if (!WantsCancel(attempt) || now < attempt.next_cancel_ms) continue;
      ids.insert(ids.end(), attempt.ids.begin(), attempt.ids.end());
      attempt.next_cancel_ms = now + kCancelAgainMs;
    }
    for (const Words& words : commands_->Cancel(ids)) Run({Kind::kCancel, {}, false, {}}, words);
  }

  // ---- Files

  static bool LooksAtFiles(const FarmAttempt& attempt) {
    return attempt.phase == FarmPhase::kEnding ||
           (attempt.phase == FarmPhase::kOnFarm && !attempt.ids.empty());
  }

  void AwaitResult(FarmAttempt* attempt) {
    attempt->phase = FarmPhase::kEnding;
    attempt->give_up_ms = clock_.SteadyMs() + (attempt->stop ? 0 : options_.result_wait_ms);
    attempt->next_look_ms = 0;
  }

  // In turns, so that the first ones do not get all the looks.
  void Look() {
    const int64_t now = clock_.SteadyMs();
    const int64_t between =
        std::max(options_.poll_ms, static_cast<int64_t>(attempts_.size()) * kMsPerLook);
    auto it = attempts_.upper_bound(last_looked_);
    int looks = 0;
    for (size_t seen = attempts_.size(); seen > 0 && looks < kLooksAtOnce; --seen) {
      if (it == attempts_.end()) it = attempts_.begin();
      FarmAttempt& attempt = it->second;
      last_looked_ = it->first;
      bool ended = false;
      if (LooksAtFiles(attempt) && now >= attempt.next_look_ms) {
        ++looks;
        const bool ending = attempt.phase == FarmPhase::kEnding;
        // One that waits may have begun since the farm last answered, but that is rare.
        const int64_t patience = attempt.last.state == FarmState::kWaiting ? kWaitingShare : 1;
        attempt.next_look_ms =
            now + (ending ? std::min(options_.poll_ms, kResultLookMs) : between * patience);
        ended = LookAt(&attempt);
      } else if (!attempt.events.empty()) {
        ReportEvents(&attempt);
      }
      it = ended ? Forget(it) : std::next(it);
    }
  }

  using Attempts = std::map<Key, FarmAttempt>;

  Attempts::iterator Forget(Attempts::iterator it) {
    by_name_.erase(FarmNameOf(it->second.spec));
    for (const std::string& id : it->second.ids) by_id_.erase(id);
    return attempts_.erase(it);
  }

  void ReportEvents(FarmAttempt* attempt) {
    AttemptReport report;
    report.job = attempt->spec.job;
    report.attempt = attempt->spec.attempt;
    report.events = std::exchange(attempt->events, {});
    reports_.push_back(std::move(report));
  }

  // True: it has ended, and has been reported.
  bool LookAt(FarmAttempt* attempt) {
    std::string result = ReadResultFile(attempt->spec);
    // Lines are read after the result: then all that came before it are there.
    for (std::vector<std::string> lines = attempt->tail.Read(files_); !lines.empty();
         lines = attempt->tail.Read(files_)) {
      std::move(lines.begin(), lines.end(), std::back_inserter(attempt->events));
    }
    const bool ending = attempt->phase == FarmPhase::kEnding;
    // A result that does not say "done" waits for the farm, which knows why it is so.
    bool ended = SaysDone(result) || (ending && !result.empty());
    if (!ended && ending && clock_.SteadyMs() >= attempt->give_up_ms) {
      ended = CloseFence(*attempt);
      if (ended) result = ReadResultFile(attempt->spec);
    }
    if (!ended) {
      if (!attempt->events.empty()) ReportEvents(attempt);
      return false;
    }
    AttemptReport report;
    report.job = attempt->spec.job;
    report.attempt = attempt->spec.attempt;
    report.events = std::exchange(attempt->events, {});
    report.ended = true;
    Explain(attempt, SaysDone(result), &report);
    report.result_json = std::move(result);
    reports_.push_back(std::move(report));
    return true;
  }

  // False: not yet; the disk may come back.
  bool CloseFence(const FarmAttempt& attempt) {
    const Status moved = MoveFence(attempt.spec.fence, attempt.spec.attempt + 1);
    // A later attempt is current, or the job's folder has gone with the job.
    if (moved || moved.error().code == ErrorCode::kConflict ||
        moved.error().code == ErrorCode::kNotFound) {
      return true;
    }
    SetProblem("cannot write on the shared disk: " + moved.error().message);
    return false;
  }

  void Explain(FarmAttempt* attempt, bool done, AttemptReport* report) {
    const FarmJob& job = attempt->last;
    report->exit_code = job.exit_code;
    report->signal = job.signal;
    if (done) return;
    const bool started = FileIsThere(attempt->spec.folder + "/" + kStartedName, files_);
    if (attempt->cause == EndCause::kNone && !attempt->stop) attempt->cause = CauseOf(job, started);
    report->cause = attempt->cause;
    report->detail = attempt->detail;
    if (report->detail.empty() && !job.id.empty())
      report->detail = "job " + job.id + (job.node.empty() ? "" : " on " + job.node);
    if (attempt->cause != EndCause::kNodeFailed || job.node.empty()) return;
    const Status noted = AddFailedNode(attempt->spec, job.node, files_);
    log_.Warning("farm_node_failed", {{"job", attempt->spec.job},
                                      {"attempt", attempt->spec.attempt},
                                      {"node", job.node},
                                      {"excluded", static_cast<bool>(noted)}});
  }

  void SetProblem(std::string text) {
    if (text == problem_) return;
    if (text.empty()) {
      log_.Info("farm_answers_again");
    } else {
      log_.Warning("farm_trouble", {{"reason", text}});
    }
    problem_ = std::move(text);
  }

  const FarmOptions options_;
  const std::unique_ptr<FarmCommands> commands_;
  CommandRunner runner_;
  FileCalls& files_;
  Clock& clock_;
  Logger& log_;
  Attempts attempts_;
  std::unordered_map<std::string, Key> by_name_, by_id_;
  std::map<uint64_t, Call> calls_;
  std::map<Kind, int> running_;
  std::vector<AttemptReport> reports_;
  Key last_looked_{0, 0};
  std::string problem_;
  std::string refused_;  // why the last submission was refused; empty: it was not

  // The round that runs.
  std::vector<StatusCall> round_;
  size_t round_at_ = 0;
  std::vector<FarmJob> round_jobs_;
  bool round_running_ = false;
  uint64_t rounds_begun_ = 0;
  int64_t round_begin_ms_ = 0, last_round_ms_ = 0;
  int64_t last_round_end_ms_ = -kMostWaitMs;
  int64_t failing_wait_ms_ = 0;
};

}  // namespace

Result<std::unique_ptr<Executor>> MakeFarmExecutor(const FarmOptions& options,
                                                   std::unique_ptr<FarmCommands> commands,
                                                   FileCalls& files, Clock& clock, Logger& log) {
  PATINA_ASSIGN(CommandRunner runner, CommandRunner::Create(clock));
  return std::make_unique<FarmExecutor>(options, std::move(commands), std::move(runner), files,
                                        clock, log);
}

}  // namespace patina::daemon
