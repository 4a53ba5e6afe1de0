#include "daemon/make_executor.h"

#include <poll.h>

#include <cstdlib>
#include <filesystem>
#include <optional>

#include "daemon/execute/command_runner.h"
#include "daemon/execute/farm_executor.h"
#include "daemon/execute/local_executor.h"
#include "daemon/execute/slurm_commands.h"
#include "daemon/execute/template_commands.h"
#include "daemon/service/scheduler.h"
#include "formats/base/names.h"

namespace patina::daemon {
namespace {

// What of the daemon's environment a job's process sees.
std::vector<std::string> WorkerEnvironment(const std::vector<std::string>& environment) {
  std::vector<std::string> kept;
  for (const std::string& entry : environment) {
    for (const char* name : {"PATH=", "LANG=", "LC_ALL=", "TZ=", "LD_LIBRARY_PATH=", "PATINA_SIMD=",
                             "ASAN_OPTIONS=", "UBSAN_OPTIONS=", "TSAN_OPTIONS="}) {
      if (entry.rfind(name, 0) == 0) kept.push_back(entry);
    }
  }
  return kept;
}

// The colour configuration of jobs that name none is the operator's: where it lies is not asked.
// Jobs run in folders of their own, so it is named from the root.
std::optional<std::string> ColorConfig() {
  const char* named = std::getenv("OCIO");
  if (named == nullptr || *named == '\0') return std::nullopt;
  std::error_code error;
  const std::filesystem::path path = std::filesystem::weakly_canonical(named, error);
  return error ? std::string(named) : path.string();
}

int64_t Milliseconds(double seconds) { return static_cast<int64_t>(seconds * 1000); }

SlurmOptions SlurmOptionsOf(const ExecutorConfig& executor) {
  SlurmOptions options;
  options.partition = executor.partition;
  options.account = executor.account;
  options.qos = executor.qos;
  options.arguments = executor.sbatch_arguments;
  return options;
}

LocalExecutorOptions::Sandbox SandboxOf(const Config& config) {
  using Sandbox = LocalExecutorOptions::Sandbox;
  return config.sandbox == SandboxMode::kOff       ? Sandbox::kOff
         : config.sandbox == SandboxMode::kRequire ? Sandbox::kRequired
                                                   : Sandbox::kIfPossible;
}

Result<std::unique_ptr<FarmCommands>> MakeCommands(const ExecutorConfig& executor) {
  if (executor.kind == ExecutorKind::kSlurm) {
    for (const std::string& argument : executor.sbatch_arguments) {
      if (const auto own = SlurmOwnOption(argument)) {
        return Fail(ErrorCode::kInvalidArgument,
                    "/executor/sbatch_arguments: patinad itself says " + QuoteForMessage(*own) +
                        ", or it would break what patinad says; take it out, and write values with "
                        "\"=\"");
      }
    }
    return MakeSlurmCommands(SlurmOptionsOf(executor));
  }
  const TemplateOptions options{executor.submit, executor.status, executor.find, executor.cancel};
  const struct {
    const char* key;
    const Words& words;
    std::vector<std::string> names;
  } templates[] = {{"submit", options.submit, SubmitPlaceholders()},
                   {"status", options.status, {"ids"}},
                   {"find", options.find, {"name"}},
                   {"cancel", options.cancel, {"id"}}};
  for (const auto& [key, words, names] : templates) {
    if (const auto unknown = UnknownPlaceholder(words, names)) {
      std::string known;
      for (const std::string& name : names) known += " {" + name + "}";
      return Fail(ErrorCode::kInvalidArgument, std::string("/executor/") + key + ": " +
                                                   QuoteForMessage(*unknown) +
                                                   " is no placeholder; there are" + known);
    }
  }
  return MakeTemplateCommands(options);
}

CommandOutcome RunToItsEnd(CommandRunner* runner, const Words& words, int64_t timeout_ms) {
  runner->Start(words, timeout_ms);
  std::vector<CommandOutcome> ended;
  while ((ended = runner->Poll()).empty()) {
    pollfd ready{runner->poll_fd(), POLLIN, 0};
    ::poll(&ready, 1, static_cast<int>(runner->timeout_ms()));
  }
  return std::move(ended[0]);
}

}  // namespace

Result<std::unique_ptr<Executor>> MakeExecutor(const Config& config,
                                               const std::vector<std::string>& environment,
                                               FileCalls& files, Clock& clock, Logger& log) {
  std::vector<std::string> of_worker = WorkerEnvironment(environment);
  const std::optional<std::string> color_config = ColorConfig();
  if (color_config) of_worker.push_back("OCIO=" + *color_config);
  if (OnFarm(config)) {
    FarmOptions options;
    options.worker = config.worker;
    options.environment = std::move(of_worker);
    options.poll_ms = Milliseconds(config.executor.poll_s);
    options.command_timeout_ms = Milliseconds(config.executor.command_timeout_s);
    options.result_wait_ms = Milliseconds(config.executor.result_wait_s);
    PATINA_ASSIGN(std::unique_ptr<FarmCommands> commands, MakeCommands(config.executor));
    return MakeFarmExecutor(options, std::move(commands), files, clock, log);
  }
  LocalExecutorOptions options;
  options.worker = config.worker;
  options.nice = config.nice;
  options.environment = std::move(of_worker);
  if (color_config)
    options.read.push_back(std::filesystem::path(*color_config).parent_path().string());
  options.sandbox = SandboxOf(config);
  return MakeLocalExecutor(options, files, log);
}

Result<std::string> AskExecutor(const Config& config, Clock& clock) {
  if (!OnFarm(config)) {
    PATINA_TRY(CheckSandbox(SandboxOf(config)));
    return std::string();
  }
  PATINA_ASSIGN(const std::unique_ptr<FarmCommands> commands, MakeCommands(config.executor));
  if (config.executor.kind != ExecutorKind::kSlurm) return std::string();
  PATINA_ASSIGN(CommandRunner runner, CommandRunner::Create(clock));
  const int64_t timeout_ms = Milliseconds(config.executor.command_timeout_s);
  const Words words = SlurmDryRun(SlurmOptionsOf(config.executor), ThreadsOf(0, config),
                                  config.limits.memory_mb, config.limits.wall_s);
  const CommandOutcome outcome = RunToItsEnd(&runner, words, timeout_ms);
  if (outcome.exit_code == 0) return outcome.error;
  const std::string trouble = FailureOf(words[0], outcome);
  if (outcome.not_started) {
    return Fail(ErrorCode::kInvalidArgument,
                "/executor: " + trouble + "; install Slurm's programs (Debian: slurm-client)");
  }
  const Words status = commands->Status({}, {})[0].words;
  const CommandOutcome answer = RunToItsEnd(&runner, status, timeout_ms);
  if (outcome.exit_code < 0 || answer.exit_code != 0)
    return Fail(ErrorCode::kIo, "/executor: Slurm cannot be asked at present: " + trouble);
  return Fail(ErrorCode::kInvalidArgument, "/executor: Slurm would not take a job: " + trouble);
}

}  // namespace patina::daemon
