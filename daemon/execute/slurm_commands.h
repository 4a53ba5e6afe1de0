// Slurm (checked with 22.05). One squeue answers for all jobs and all names: the user's jobs, also
// those that ended not long ago, with name and working directory. The directory tells a job from
// one of another daemon that has the same name.
#pragma once

#include <memory>

#include "daemon/execute/farm_commands.h"

namespace patina::daemon {

struct SlurmOptions {
  std::string partition, account, qos;  // empty: the farm's own choice
  Words arguments;                      // more arguments of sbatch
};

std::unique_ptr<FarmCommands> MakeSlurmCommands(const SlurmOptions& options);

// What asks the farm whether it would take a job, and does not submit it. Its answer stands on
// standard error.
Words SlurmDryRun(const SlurmOptions& options, int cpus, int64_t memory_mb, int64_t wall_s);

// Whether an argument of sbatch would break what is said to it otherwise: "--array", "-J" ... The
// option's name; nothing if it may be given.
std::optional<std::string> SlurmOwnOption(const std::string& argument);

}  // namespace patina::daemon
