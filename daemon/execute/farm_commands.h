// How to talk to a farm: which programs to call for what, and what their answers mean. Nothing here
// runs anything; farm_executor.h does.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina::daemon {

using Words = std::vector<std::string>;  // a program and its arguments; no shell reads them

// What a farm is asked to run.
struct FarmSubmission {
  std::string name;    // patina-<job>-a<attempt>
  std::string folder;  // of the attempt; the job's working directory
  std::string script;
  std::string log;
  int cpus = 1;
  int64_t memory_mb = 0, wall_s = 0;  // 0: no limit
  std::vector<std::string> excluded;  // nodes on which earlier attempts were lost
};

// kUnknown: some state between or beyond the others; the job may well be alive.
enum class FarmState {
  kUnknown,
  kWaiting,
  kRunning,
  kCompleted,
  kFailed,
  kCancelled,
  kTimeLimit,
  kOutOfMemory,
  kNodeFailed,
  kPreempted
};

// Whether nothing of it runs any more, as far as the farm knows.
inline bool IsOver(FarmState state) {
  return state != FarmState::kUnknown && state != FarmState::kWaiting &&
         state != FarmState::kRunning;
}

// What a farm says of one job.
struct FarmJob {
  std::string id;
  std::string name, folder;  // empty: it does not say
  FarmState state = FarmState::kUnknown;
  std::string node;    // where it runs or ran; may be empty
  std::string reason;  // why it waits, in the farm's words; may be empty
  int exit_code = -1;  // of the program, if it ended by itself and the farm says; else -1
  int signal = 0;      // that ended it, if the farm says; else 0
};

// One call of those that together answer for all jobs.
struct StatusCall {
  Words words;
  std::string name;  // the answer is about jobs of this name; empty: about any
};

class FarmCommands {
 public:
  virtual ~FarmCommands() = default;

  // What this farm is called in messages.
  virtual std::string name() const = 0;
  virtual Words Submit(const FarmSubmission& submission) const = 0;
  // The id from what the submission wrote; nothing if there is none in it.
  virtual std::optional<std::string> ParseSubmitted(const std::string& out) const = 0;
  // Whether Status answers for names whose id is not known.
  virtual bool finds_names() const = 0;
  // The calls that tell of these jobs; a job that no answer names is not on the farm (any more).
  virtual std::vector<StatusCall> Status(const std::vector<std::string>& ids,
                                         const std::vector<std::string>& names) const = 0;
  // Errors: kCorruptData (a line that is none).
  virtual Result<std::vector<FarmJob>> ParseStatus(const StatusCall& call,
                                                   const std::string& out) const = 0;
  virtual std::vector<Words> Cancel(const std::vector<std::string>& ids) const = 0;
};

// Whether a text can be a job's id: letters, digits and ._:[]@- , not beginning with '-'. So an id
// that a farm's program wrote cannot become an option of another one.
bool IsFarmId(const std::string& text);

}  // namespace patina::daemon
