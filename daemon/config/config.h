// The daemon's configuration: defaults, then a JSON file (schemas/config.schema.json), then the
// environment, then flags.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/base/log.h"
#include "daemon/config/executor_config.h"
#include "formats/base/result.h"
#include "pipeline/material/train.h"

namespace patina::daemon {

inline constexpr size_t kMaxConfigBytes = size_t{1} << 20;

enum class WatchMode { kAuto, kInotify, kPolling };
const char* WatchModeName(WatchMode mode);  // "auto", "inotify", "polling"

struct WatchConfig {
  std::string path;  // absolute
  WatchMode mode = WatchMode::kAuto;
  int settle_ms = 1000;    // without any change, before an asset is taken
  int poll_ms = 5000;      // between looks, where polling
  int rescan_s = 900;      // between full looks all the same
  bool as_svbrdf = false;  // texture sets become reflectance, not materials
};

// Of jobs that the watcher makes; jobs that come by the API say for themselves.
struct JobDefaults {
  Quality quality = Quality::kStandard;
  Recipe recipe = Recipe::kPatina;
  Profile profile = Profile::kBcf1k;
  uint64_t seed = 1;
  int priority = 0;
};

struct ApiConfig {
  std::string socket;       // Unix socket, mode 0600; never empty
  std::string listen_host;  // a loopback address; empty: no TCP
  int listen_port = 0;      // 0 with a host: any free one
  std::string token_file;   // of mode 0600; set where there is TCP
  bool makes_token =
      false;  // nobody named token_file, which is the state folder's: made if missing
  int max_event_clients = 64;
  size_t max_body_bytes = size_t{4} << 20;
  int request_timeout_ms = 10000;
};

struct LimitsConfig {
  int threads = 0;            // of a job that names none; 0: the core budget
  int64_t memory_mb = 0;      // 0: no limit
  int64_t max_memory_mb = 0;  // what a retry after running out of memory may get; 0: no limit
  int64_t cpu_s = 0;
  int64_t wall_s = 0;
  int grace_s = 10;  // between asking a job to end and ending it
};

struct RetryConfig {
  int max_attempts = 5;  // then the job is buried
  int64_t base_ms = 5000;
  int64_t max_ms = 600000;
  double jitter = 0.5;  // a wait is drawn from [1 - jitter, 1] of the full one
};

struct RetentionConfig {
  int revisions = 3;  // newest ones kept for each asset, besides `current`
  int finished_days = 30;
  int64_t finished_jobs = 10000;
  int64_t events = 10000;
};

enum class SandboxMode { kOff, kAuto, kRequire };

struct Config {
  std::string file;        // where it was read from; empty: no file
  std::string state_dir;   // absolute: queue, jobs, lock, socket
  std::string out;         // absolute: containers
  std::string failed_dir;  // absolute: for <asset>.failed.json; empty: beside the asset
  std::vector<WatchConfig> watch;
  JobDefaults job;
  // Folders that jobs of the API may read from and write to besides the watched ones and `out`.
  std::vector<std::string> input_roots, output_roots;
  ApiConfig api;
  std::string worker;  // the `patina` program; default: beside this program, else from PATH
  int cores = 0;       // core budget, on a farm that of one job; never 0 after loading
  int nice = 5;        // of jobs
  SandboxMode sandbox = SandboxMode::kAuto;
  ExecutorConfig executor;
  LimitsConfig limits;
  RetryConfig retry;
  RetentionConfig retention;
  int stop_grace_s = 30;  // running jobs may finish before they are handed back
  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kJson;
};

// What flags and environment say; absent: nothing.
struct ConfigOverrides {
  std::optional<std::string> state_dir, out, failed_dir, socket, listen, token_file, worker,
      log_level, cores, log_format;
  std::vector<std::string> watch;  // instead of the file's list
};

// One thing that is wrong with a configuration.
struct ConfigProblem {
  std::string where;    // "patinad.json: /retry/base_ms", "PATINA_CORES", "--watch"
  std::string message;  // what is wrong and what to do
};

struct LoadedConfig {
  Config config;                        // usable only without problems
  std::vector<ConfigProblem> problems;  // the complete list
  std::vector<ConfigProblem> warnings;  // what is odd, but works
};

// `file`: path, or "" for none. `environment`: "NAME=value", as environ(7). Looks at the file
// system (do the folders exist, is the worker there), changes nothing.
LoadedConfig LoadConfig(const std::string& file, const std::vector<std::string>& environment,
                        const ConfigOverrides& flags);

inline bool OnFarm(const Config& config) { return config.executor.kind != ExecutorKind::kLocal; }

// Holds what jobs read and write besides their input and output.
inline const std::string& WorkFolderOf(const Config& config) {
  return config.executor.shared_dir.empty() ? config.state_dir : config.executor.shared_dir;
}

// Where the API puts what clients send; jobs may read it.
inline std::string UploadFolderOf(const Config& config) {
  return WorkFolderOf(config) + "/uploads";
}

// The configuration in effect, as a configuration file.
std::string ConfigToJson(const Config& config);

// What may be changed by a reload: all but state_dir, out, watch, api, worker, nice, sandbox and
// executor. Returns the names of the others that differ.
std::vector<std::string> RestartOnlyChanges(const Config& before, const Config& after);

}  // namespace patina::daemon
