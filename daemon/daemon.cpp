#include "daemon/daemon.h"

#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>

#include "daemon/api/api_server.h"
#include "daemon/base/clock.h"
#include "daemon/base/log.h"
#include "daemon/base/service_manager.h"
#include "daemon/base/state_lock.h"
#include "daemon/config/config.h"
#include "daemon/drop_folders.h"
#include "daemon/make_executor.h"
#include "daemon/options.h"
#include "daemon/queue/job_store.h"
#include "daemon/service/daemon_service.h"
#include "pipeline/jobs/job_result.h"

extern char** environ;

namespace patina::daemon {
namespace {

std::vector<std::string> Environment() {
  std::vector<std::string> entries;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry)
    entries.emplace_back(*entry);
  return entries;
}

void PrintProblems(const LoadedConfig& loaded) {
  for (const ConfigProblem& warning : loaded.warnings)
    std::fprintf(stderr, "patinad: warning: %s: %s\n", warning.where.c_str(),
                 warning.message.c_str());
  for (const ConfigProblem& problem : loaded.problems)
    std::fprintf(stderr, "patinad: error: %s: %s\n", problem.where.c_str(),
                 problem.message.c_str());
}

int CheckConfig(const LoadedConfig& loaded) {
  PrintProblems(loaded);
  if (!loaded.problems.empty()) {
    std::fprintf(stderr, "patinad: %zu %s\n", loaded.problems.size(),
                 loaded.problems.size() == 1 ? "problem" : "problems");
    return kExitBadInput;
  }
  auto answer = AskExecutor(loaded.config, SystemClock());
  if (answer) {
    std::fputs(answer->c_str(), stdout);
  } else {
    // A farm that is down must not keep the daemon from starting: it waits for it.
    const bool is_down = answer.error().code == ErrorCode::kIo;
    std::fprintf(stderr, "patinad: %s: %s\n", is_down ? "warning" : "error",
                 answer.error().message.c_str());
    if (!is_down) return kExitBadInput;
  }
  std::printf("patinad: the configuration is good\n");
  return kExitDone;
}

class Daemon {
 public:
  Daemon(Options options, Config config, FileCalls& files)
      : options_(std::move(options)),
        config_(std::move(config)),
        files_(files),
        log_(STDERR_FILENO, config_.log_level, config_.log_format) {}

  int Run() {
    const Status begun = Begin();
    if (!begun) {
      log_.Error("start_failed", {{"reason", begun.error().message}});
      return kExitFailed;
    }
    log_.Info("ready", {{"version", PATINA_VERSION},
                        {"pid", ::getpid()},
                        {"state_dir", config_.state_dir},
                        {"out", config_.out},
                        {"socket", config_.api.socket},
                        {"executor", ExecutorKindName(config_.executor.kind)},
                        {"cores", config_.cores}});
    if (api_->tcp_port() != 0) {
      const bool v6 = config_.api.listen_host.find(':') != std::string::npos;
      log_.Info("dashboard",
                {{"url", "http://" +
                             (v6 ? "[" + config_.api.listen_host + "]" : config_.api.listen_host) +
                             ":" + std::to_string(api_->tcp_port()) + "/"},
                 {"token_file", config_.api.token_file}});
    }
    NotifyServiceManager("READY=1");
    Follow();
    log_.Info("stopped");
    return kExitDone;
  }

 private:
  Status Begin() {
    sigset_t set;
    sigemptyset(&set);
    for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&set, signal);
    // Before there are threads, so that all of them leave these to the descriptor.
    ::sigprocmask(SIG_BLOCK, &set, nullptr);
    ::signal(SIGPIPE, SIG_IGN);
    signals_ = UniqueFd(::signalfd(-1, &set, SFD_CLOEXEC));
    if (!signals_) return FailErrno(errno, "cannot make", "a signal descriptor");

    PATINA_TRY(MakePrivate(config_.state_dir));
    PATINA_ASSIGN(StateLock lock, StateLock::Acquire(config_.state_dir));
    lock_.emplace(std::move(lock));
    const std::string work_dir = WorkFolderOf(config_);
    if (work_dir != config_.state_dir) {
      // Two daemons with one queue each must not share folders of jobs.
      PATINA_TRY(MakePrivate(work_dir));
      PATINA_ASSIGN(StateLock work_lock, StateLock::Acquire(work_dir));
      work_lock_.emplace(std::move(work_lock));
    }
    PATINA_TRY(MakePrivate(work_dir + "/jobs"));
    PATINA_TRY(MakeDirectories(config_.out, files_));
    if (!config_.failed_dir.empty()) PATINA_TRY(MakeDirectories(config_.failed_dir, files_));
    PATINA_ASSIGN(store_, JobStore::Open(config_.state_dir + "/queue.db"));
    PATINA_ASSIGN(executor_, MakeExecutor(config_, Environment(), files_, SystemClock(), log_));
    const uint64_t seed = (uint64_t{std::random_device()()} << 32) | std::random_device()();
    PATINA_ASSIGN(service_, DaemonService::Create(
                                {*store_, *executor_, files_, SystemClock(), log_}, config_, seed));
    service_->StartThread();
    if (!config_.watch.empty()) {
      PATINA_ASSIGN(folders_, DropFolders::Start(config_, *service_, log_));
    }
    UploadOptions uploads;
    uploads.folder = UploadFolderOf(config_);
    uploads.files = &files_;
    PATINA_ASSIGN(api_, ApiServer::Start(config_.api, config_.out, service_.get(),
                                         folders_ ? folders_->source() : nullptr, &log_, uploads));
    return {};
  }

  Status MakePrivate(const std::string& folder) {
    const mode_t mask = ::umask(077);
    Status made = MakeDirectories(folder, files_);
    ::umask(mask);
    return made;
  }

  void Follow() {
    bool stopping = false;
    for (;;) {
      pollfd ready[2] = {{signals_.get(), POLLIN, 0}, {service_->stopped_fd(), POLLIN, 0}};
      if (::poll(ready, 2, -1) < 0) continue;
      if ((ready[1].revents & POLLIN) != 0) break;
      signalfd_siginfo info{};
      if (::read(signals_.get(), &info, sizeof info) != static_cast<ssize_t>(sizeof info)) continue;
      if (info.ssi_signo == SIGHUP) {
        if (!stopping) Reload();
      } else if (stopping) {
        log_.Info("stopping_now");
        service_->HandBackNow();
      } else {
        stopping = true;
        log_.Info("stopping", {{"grace_s", config_.stop_grace_s}});
        NotifyServiceManager("STOPPING=1");
        // Drop folders and API go on, for those who ask; the service takes nothing from them.
        service_->BeginStop();
      }
    }
    service_->Join();
  }

  void Reload() {
    NotifyServiceManager("RELOADING=1\nMONOTONIC_USEC=" +
                         std::to_string(SystemClock().SteadyMs() * 1000));
    LoadedConfig loaded = LoadConfig(options_.config_file, Environment(), options_.overrides);
    for (const ConfigProblem& problem : loaded.problems)
      log_.Error("config_problem", {{"where", problem.where}, {"problem", problem.message}});
    if (loaded.problems.empty()) {
      for (const std::string& name : RestartOnlyChanges(config_, loaded.config))
        log_.Warning("config_needs_restart", {{"setting", name}});
      // What needs a restart stays as it is until then.
      Config fresh = loaded.config;
      fresh.state_dir = config_.state_dir;
      fresh.out = config_.out;
      fresh.watch = config_.watch;
      fresh.api = config_.api;
      fresh.worker = config_.worker;
      fresh.nice = config_.nice;
      fresh.sandbox = config_.sandbox;
      fresh.executor = config_.executor;
      config_ = fresh;
      log_.Configure(config_.log_level, config_.log_format);
      service_->Reconfigure(config_);
      log_.Info("reloaded", {{"file", config_.file}});
    } else {
      log_.Warning("not_reloaded", {{"reason", "the configuration in effect stays"}});
    }
    NotifyServiceManager("READY=1");
  }

  Options options_;
  Config config_;
  FileCalls& files_;
  Logger log_;
  UniqueFd signals_;
  std::optional<StateLock> lock_, work_lock_;
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<Executor> executor_;
  std::unique_ptr<DaemonService> service_;
  std::unique_ptr<DropFolders> folders_;
  std::unique_ptr<ApiServer> api_;
};

}  // namespace

int DaemonMain(int argc, char** argv, FileCalls& files) {
  // Threads come and go with connections; each with an arena of its own would keep its memory.
  ::mallopt(M_ARENA_MAX, 2);
  ParsedOptions parsed = ParseOptions(argc, argv);
  if (!parsed.run) {
    if (parsed.exit_code == 0) {
      std::fputs(parsed.text.c_str(), stdout);
    } else {
      std::fprintf(stderr, "patinad: error: %s\n", parsed.text.c_str());
    }
    return parsed.exit_code;
  }
  Options& options = parsed.options;
  const char* from_environment = std::getenv("PATINA_CONFIG");
  if (options.config_file.empty() && from_environment != nullptr)
    options.config_file = from_environment;
  LoadedConfig loaded = LoadConfig(options.config_file, Environment(), options.overrides);
  if (options.check_config) return CheckConfig(loaded);
  PrintProblems(loaded);
  if (!loaded.problems.empty()) return kExitBadInput;
  if (options.print_config) {
    std::fputs(ConfigToJson(loaded.config).c_str(), stdout);
    return kExitDone;
  }
  return Daemon(std::move(options), std::move(loaded.config), files).Run();
}

}  // namespace patina::daemon
