// The states of a job in the queue, and which may follow which.
#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace patina::daemon {

// The numbers are in the database and the names in the API: neither is ever reused.
enum class JobState : int {
  kQueued = 1,        // waits for its turn
  kRunning = 2,       // has an attempt
  kSucceeded = 3,     // published, or found unchanged
  kFailed = 4,        // would fail again: bad input, below the quality gate, over its CPU limit ...
  kCancelled = 5,     // somebody asked for it
  kRetryWaiting = 6,  // an attempt was lost to the machine; the next is due later
  kBuried = 7         // lost to the machine too often; only a person brings it back
};

inline constexpr std::array<JobState, 7> kJobStates = {
    JobState::kQueued,    JobState::kRunning,      JobState::kSucceeded, JobState::kFailed,
    JobState::kCancelled, JobState::kRetryWaiting, JobState::kBuried};

// "queued", "running", "succeeded", "failed", "cancelled", "retry_waiting", "buried".
const char* JobStateName(JobState state);
std::optional<JobState> ParseJobState(std::string_view name);

// The table:
//   queued        -> running, cancelled
//   running       -> succeeded, failed, cancelled, retry_waiting, buried, queued (handed back)
//   retry_waiting -> queued (due, or asked for), cancelled
//   failed, cancelled, buried -> queued (asked for)
//   succeeded     -> nothing
bool IsLegalTransition(JobState from, JobState to);

// Whether nothing more happens to it unless somebody asks.
bool IsFinal(JobState state);

}  // namespace patina::daemon
