// Where attempts at jobs run: as child processes of this machine (local_executor.h), or on a farm
// (farm_executor.h). An executor knows folders, limits and processes, and nothing of the queue.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina::daemon {

// One attempt. Everything it needs lies in `folder`, which the caller has made and filled:
//   job.json     what to do                events.ndjson   written by `patina run`
//   result.json  written last, at once: the truth about how it ended
struct AttemptSpec {
  int64_t job = 0;
  int64_t attempt = 0;  // the fencing token
  std::string folder;
  std::string fence;  // file that names the current attempt (pipeline/jobs/fence.h)
  std::string log;    // standard output and error are appended to it
  std::string out;    // <out>/<asset> is written, <out> is only looked at
  std::string asset;
  std::vector<std::string> inputs;   // files and folders that are read
  bool skip_unchanged = false;       // see `patina run --help`
  std::string force_past;            // a revision, for a retry of a forced job; may be empty
  int threads = 1;                   // that it will use
  int64_t memory_mb = 0, cpu_s = 0;  // 0: no limit
  int64_t wall_s = 0;                // the same; kept by a farm, by the caller of a local executor
};

// What an executor knows of why an attempt ended, if it was not the program's doing.
enum class EndCause {
  kNone,
  kNodeFailed,   // also: could not be started there
  kOutOfMemory,  // ended by the farm for it
  kTimeLimit,
  kPreempted,
  kAskedToEnd,  // and did; as before a time limit
  kCancelled,   // on the farm, by somebody else
  kRefused      // the farm does not take it
};

// What happened to an attempt since the last look.
struct AttemptReport {
  int64_t job = 0;
  int64_t attempt = 0;
  std::vector<std::string> events;  // complete new lines of events.ndjson
  // All its processes are dead and nothing of it writes any more; or, where that cannot be known,
  // it cannot publish any more.
  bool ended = false;
  // Of an attempt that ended:
  int exit_code = -1;       // -1: it was killed, or nobody knows
  int signal = 0;           // 0: it was not, or nobody knows
  std::string result_json;  // content of result.json; empty: there is none
  EndCause cause = EndCause::kNone;
  std::string detail;  // of the cause, for people; may be empty
};

enum class StopMode { kTerminate, kKill };

// Used by one thread.
class Executor {
 public:
  virtual ~Executor() = default;

  // Starts an attempt and returns a handle that finds it again after a crash of the daemon; empty
  // if none is needed. An error means that nothing runs.
  virtual Result<std::string> Start(const AttemptSpec& spec) = 0;
  // Takes over an attempt of an earlier daemon; the handle may be empty if that died before it was
  // stored. True: from now on Poll reports on it, be it alive or ended. False: not known yet, ask
  // again later.
  virtual Result<bool> Adopt(const AttemptSpec& spec, const std::string& handle) = 0;
  // Asks all processes of an attempt to end, or ends them. Poll says when they have. An attempt
  // that is not known is no error.
  virtual void Stop(int64_t job, int64_t attempt, StopMode mode) = 0;
  // What is new, without waiting. An attempt that ended is reported once and then forgotten.
  virtual std::vector<AttemptReport> Poll() = 0;
  // Whether the attempt was alive at the last look. For leases.
  virtual bool IsAlive(int64_t job, int64_t attempt) const = 0;
  // A descriptor that becomes readable when Poll has something to say; -1: there is none.
  virtual int poll_fd() const = 0;
  // When Poll wants to be called at the latest though the descriptor says nothing: milliseconds
  // from now, -1: never.
  virtual int poll_timeout_ms() const = 0;
  // What keeps all attempts from going on at present, and the cure; empty: nothing.
  virtual std::string problem() const { return ""; }
};

}  // namespace patina::daemon
