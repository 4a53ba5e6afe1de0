// Where jobs run: the part "executor" of the configuration.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace patina::daemon {

enum class ExecutorKind { kLocal, kSlurm, kCommand };
const char* ExecutorKindName(ExecutorKind kind);  // "local", "slurm", "command"

// Fields of one kind are empty in the others.
struct ExecutorConfig {
  ExecutorKind kind = ExecutorKind::kLocal;
  int jobs = 100;          // on the farm at once, waiting ones there included
  std::string shared_dir;  // absolute; for the folders of jobs. Empty: the state folder
  double poll_s = 5;       // between looks at the farm
  double command_timeout_s = 30;
  double result_wait_s = 180;                             // for a result that comes late
  std::string partition, account, qos;                    // slurm
  std::vector<std::string> sbatch_arguments;              // slurm
  std::vector<std::string> submit, status, find, cancel;  // command
};

// Takes from a configuration file what has the right type; the schema complains about the rest.
// `base`: of relative paths.
void ReadExecutor(const nlohmann::json& file, const std::string& base, ExecutorConfig* executor);

// What does not fit together: "/executor/submit is missing ...".
std::vector<std::string> ExecutorProblems(const ExecutorConfig& executor);

nlohmann::ordered_json ExecutorToJson(const ExecutorConfig& executor);

}  // namespace patina::daemon
