#include "daemon/queue/job_state.h"

namespace patina::daemon {
namespace {

struct Transition {
  JobState from, to;
};

constexpr Transition kTransitions[] = {
    {JobState::kQueued, JobState::kRunning},      {JobState::kQueued, JobState::kCancelled},
    {JobState::kRunning, JobState::kSucceeded},   {JobState::kRunning, JobState::kFailed},
    {JobState::kRunning, JobState::kCancelled},   {JobState::kRunning, JobState::kRetryWaiting},
    {JobState::kRunning, JobState::kBuried},      {JobState::kRunning, JobState::kQueued},
    {JobState::kRetryWaiting, JobState::kQueued}, {JobState::kRetryWaiting, JobState::kCancelled},
    {JobState::kFailed, JobState::kQueued},       {JobState::kCancelled, JobState::kQueued},
    {JobState::kBuried, JobState::kQueued},
};

}  // namespace

const char* JobStateName(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return "queued";
    case JobState::kRunning:
      return "running";
    case JobState::kSucceeded:
      return "succeeded";
    case JobState::kFailed:
      return "failed";
    case JobState::kCancelled:
      return "cancelled";
    case JobState::kRetryWaiting:
      return "retry_waiting";
    case JobState::kBuried:
      return "buried";
  }
  return "unknown";
}

std::optional<JobState> ParseJobState(std::string_view name) {
  for (const JobState state : kJobStates) {
    if (name == JobStateName(state)) return state;
  }
  return std::nullopt;
}

bool IsLegalTransition(JobState from, JobState to) {
  for (const Transition& legal : kTransitions) {
    if (legal.from == from && legal.to == to) return true;
  }
  return false;
}

bool IsFinal(JobState state) {
  return state == JobState::kSucceeded || state == JobState::kFailed ||
         state == JobState::kCancelled || state == JobState::kBuried;
}

}  // namespace patina::daemon
