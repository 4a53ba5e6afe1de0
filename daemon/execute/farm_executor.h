// Attempts on a farm, whose nodes share the disk with this machine under the same paths.
//
//   look up  Is a job of this attempt's name there? Only then it is known not to be, and submitted.
//   submit   The attempt's folder holds all: job.json, then, written last, submit.sh (temporary,
//            synced, renamed), which becomes `patina run`. The job's id is noted in farm_id.
//   on farm  One round of status calls tells of all jobs. No answer, or an error, means that
//   nothing
//            is known, never that a job has failed.
//   ending   The farm says that it is over, or knows it no more. The truth is result.json, which
//   may
//            come late over a shared disk, so it is waited for. An attempt that leaves none is
//            lost: then the fence is moved past it first, so that nothing of it publishes later.
//
// An attempt runs at most once, however often it was submitted: its script makes a folder before
// all else, and ends if it is there already. Nodes on which attempts of a job were lost are noted
// beside its fence, and left out in later attempts as long as the farm then takes the job.
//
// Attempts go on without the daemon, and are adopted by the next.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/base/clock.h"
#include "daemon/base/file_calls.h"
#include "daemon/base/log.h"
#include "daemon/execute/executor.h"
#include "daemon/execute/farm_commands.h"

namespace patina::daemon {

struct FarmOptions {
  std::string worker;                    // absolute path of `patina`, also on the nodes
  std::vector<std::string> environment;  // of the worker, complete: "NAME=value"
  int64_t poll_ms = 5000;                // between two rounds
  int64_t command_timeout_ms = 30000;    // of each call of the farm's programs
  int64_t result_wait_ms = 180000;       // for a result file after the end of a job
};

// Errors: kResourceExhausted. The references must outlive it.
Result<std::unique_ptr<Executor>> MakeFarmExecutor(const FarmOptions& options,
                                                   std::unique_ptr<FarmCommands> commands,
                                                   FileCalls& files, Clock& clock, Logger& log);

}  // namespace patina::daemon
