#include "daemon/service/attempt_outcome.h"

#include <algorithm>
#include <csignal>
#include <cstring>
#include <nlohmann/json.hpp>

#include "formats/base/names.h"
#include "pipeline/jobs/job_result.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxMessageBytes = 4000;
constexpr size_t kMaxStoredResultBytes = size_t{256} << 10;

// What of a result file matters here. The process that wrote it read hostile files: nothing of it
// is believed that can be checked.
struct ResultFile {
  bool valid = false;
  int exit_code = -1;
  std::string code, message, revision, stopped_by;
  int64_t bytes = 0;
};

std::string TextOf(const Json& object, const char* key, size_t max_bytes) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_string()) return "";
  std::string text = found->get<std::string>();
  if (text.size() > max_bytes) text.resize(max_bytes);
  return text;
}

ResultFile ReadResult(const std::string& text) {
  ResultFile result;
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return result;
  const auto exit_code = json.find("exit_code");
  if (exit_code == json.end() || !exit_code->is_number_integer()) return result;
  result.exit_code = exit_code->get<int>();
  result.revision = TextOf(json, "revision", kMaxNameBytes + 1);
  result.stopped_by = TextOf(json, "stopped_by", 64);
  if (const auto error = json.find("error"); error != json.end() && error->is_object()) {
    result.code = TextOf(*error, "code", 64);
    result.message = TextOf(*error, "message", kMaxMessageBytes);
  }
  if (const auto bytes = json.find("bytes"); bytes != json.end() && bytes->is_number_unsigned())
    result.bytes = bytes->get<int64_t>();
  result.valid = result.exit_code == kExitDone || !result.code.empty();
  return result;
}

std::string SignalText(int signal) {
  const char* name = ::sigabbrev_np(signal);
  return name != nullptr ? "SIG" + std::string(name) : "signal " + std::to_string(signal);
}

struct LostTo {
  const char* code;
  const char* message;
};

// Of attempts that a farm lost.
LostTo WhatLostIt(EndCause cause) {
  switch (cause) {
    case EndCause::kNodeFailed:
      return {"node_failed", "the node failed it"};
    case EndCause::kOutOfMemory:
      return {"out_of_memory", "it needed more memory than it was given"};
    case EndCause::kTimeLimit:
      return {"timeout", "it took longer than the farm allows"};
    case EndCause::kPreempted:
      return {"preempted", "the farm gave its place to another job"};
    case EndCause::kAskedToEnd:
      return {"interrupted", "the farm asked it to end, as at its limit of time"};
    case EndCause::kCancelled:
      return {"killed", "it was cancelled on the farm, and not by `patina cancel`"};
    case EndCause::kRefused:
      return {"refused", "the farm does not take it"};
    case EndCause::kNone:
      break;
  }
  return {"lost", "its process is gone and left no result"};
}

// Whether an error that `patina run` reported may be gone next time.
bool IsOfTheMachine(const ResultFile& result) {
  return result.exit_code == kExitInterrupted ||
         (result.exit_code == kExitFailed &&
          (result.code == "resource_exhausted" || result.code == "io" || result.code == "timeout" ||
           result.code == "conflict" || result.code == "cancelled"));
}

}  // namespace

AttemptOutcome DecideOutcome(const JobRecord& job, const AttemptReport& report, StopReason stop,
                             const OutcomePolicy& policy, int64_t now_ms, uint64_t random,
                             const std::function<bool(const std::string&)>& revision_exists) {
  AttemptOutcome outcome;
  AttemptEnd& end = outcome.end;
  end.exit_code = report.exit_code;
  end.signal = report.signal;
  const ResultFile result = ReadResult(report.result_json);
  if (result.valid) {
    end.exit_code = result.exit_code;
    if (report.result_json.size() <= kMaxStoredResultBytes) end.result_json = report.result_json;
  }

  if (result.valid && result.exit_code == kExitDone) {
    const std::string container = job.out + "/" + job.asset + "/" + result.revision;
    if (CheckPlainName(result.revision, "revision") && revision_exists(container)) {
      end.state = JobState::kSucceeded;
      end.revision = result.revision;
      end.container = container;
      outcome.unchanged = result.stopped_by == "unchanged";
      outcome.bytes_published = outcome.unchanged ? 0 : result.bytes;
      return outcome;
    }
  }
  if (stop == StopReason::kCancel) {
    end.state = JobState::kCancelled;
    return outcome;
  }
  if (stop == StopReason::kHandBack) {
    end.state = JobState::kQueued;
    return outcome;
  }

  bool lost = true;
  bool wants_memory = false;
  if (stop == StopReason::kWallTime) {
    end.error_code = "timeout";
    end.error_message = "it took longer than its limit of " + std::to_string(job.limits.wall_s) +
                        " s; give it more, or a lower quality";
  } else if (result.valid && result.exit_code == kExitDone) {
    end.error_code = "lost";
    end.error_message = "it says that it published " + QuoteForMessage(result.revision) +
                        ", and there is no such revision";
  } else if (report.cause != EndCause::kNone && (!result.valid || IsOfTheMachine(result))) {
    const LostTo lost_to = WhatLostIt(report.cause);
    end.error_code = lost_to.code;
    end.error_message = lost_to.message;
    if (!report.detail.empty()) end.error_message += " (" + report.detail + ")";
    wants_memory = report.cause == EndCause::kOutOfMemory;
    if (wants_memory && job.limits.memory_mb == 0)
      end.error_message += "; with a limit (limits.memory_mb) the next attempt would get more";
  } else if (result.valid) {
    end.error_code = result.code;
    end.error_message = result.message;
    lost = IsOfTheMachine(result);
    wants_memory = result.code == "resource_exhausted";
  } else if (report.signal == SIGXCPU) {
    end.error_code = "cpu_limit";
    end.error_message = "it used more CPU time than its limit of " +
                        std::to_string(job.limits.cpu_s) + " s; give it more, or a lower quality";
    lost = false;
  } else if (report.signal != 0) {
    end.error_code = "killed";
    end.error_message = "its process was ended by " + SignalText(report.signal);
    wants_memory = report.signal == SIGKILL;
  } else if (report.exit_code == kExitUsage) {
    end.error_code = ErrorCodeName(ErrorCode::kInternal);
    end.error_message = "`patina run` refused its command line; its log says why";
    lost = false;
  } else {
    end.error_code = "lost";
    end.error_message = report.exit_code >= 0
                            ? "its process ended with exit code " +
                                  std::to_string(report.exit_code) + " and left no result"
                            : std::string("its process is gone and left no result");
  }

  if (!lost) {
    end.state = JobState::kFailed;
    return outcome;
  }
  if (job.failures + 1 >= policy.max_attempts) {
    end.state = JobState::kBuried;
    return outcome;
  }
  end.state = JobState::kRetryWaiting;
  end.due_ms = now_ms + BackoffMs(policy.backoff, job.failures + 1, random);
  if (wants_memory && job.limits.memory_mb > 0) {
    end.memory_mb = job.limits.memory_mb * 2;
    if (policy.max_memory_mb > 0) end.memory_mb = std::min(end.memory_mb, policy.max_memory_mb);
    end.memory_mb = std::max(end.memory_mb, job.limits.memory_mb);
  }
  return outcome;
}

}  // namespace patina::daemon
