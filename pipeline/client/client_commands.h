// The commands of `patina` that talk to a daemon. Each prints what it has to say and returns the
// exit code (ExitCode in job_result.h): of `submit --wait` and `watch ID` that of the job, the
// worst if there are several; else kExitFailed if the daemon cannot be reached or fails,
// kExitBadInput if it refuses what is asked.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/progress.h"
#include "pipeline/client/submit_plan.h"

namespace patina {

struct ClientOptions {
  std::string socket;  // empty: see DefaultSocketPath
  bool json = false;
  bool quiet = false;
  std::vector<int64_t> ids;                      // cancel, retry; watch: at most one; logs: one
  std::vector<std::string> inputs;               // submit: job files, folders, BRDF files
  bool wait = false;                             // submit
  bool force = false;                            // submit
  int priority = 0;                              // submit
  std::string out;                               // submit; empty: the job's, else the daemon's
  std::string working_space, color_space, ocio;  // submit; empty: the job's
  std::string as;                                // submit; empty: the job's or the drop folder's
  std::string idempotency_key;                   // submit; of one input
  std::string state, asset;                      // jobs: only these; empty: all
  int limit = 20;                                // jobs
  bool follow = false;                           // logs
  int64_t tail_bytes = 0;                        // logs: only the last ones; 0: all
};

// $PATINA_SOCKET; else patinad.sock in the state folder that patinad takes by default:
// $XDG_STATE_HOME/patina, ~/.local/state/patina; else, if there is none, that of the system's
// service: /var/lib/patina.
std::string DefaultSocketPath();

// `planner` is PlanSubmit: handed in, as it reads images and the other commands must not load the
// library for them.
int SubmitCommand(const ClientOptions& options, SubmitPlanner planner, const CancelToken& cancel);
int JobsCommand(const ClientOptions& options, const CancelToken& cancel);
int WatchCommand(const ClientOptions& options, const CancelToken& cancel);
int CancelCommand(const ClientOptions& options, const CancelToken& cancel);
int RetryCommand(const ClientOptions& options, const CancelToken& cancel);
int LogsCommand(const ClientOptions& options, const CancelToken& cancel);
int StatusCommand(const ClientOptions& options, const CancelToken& cancel);

}  // namespace patina
