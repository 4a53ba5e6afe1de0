#include "daemon/execute/local_executor.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/file.h>
#include <sys/inotify.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>

#include "daemon/base/unique_fd.h"
#include "daemon/execute/child_process.h"
#include "daemon/execute/event_tail.h"
#include "daemon/execute/sandbox.h"
#include "daemon/execute/worker_command.h"

namespace patina::daemon {
namespace {

constexpr uint64_t kMaxResultBytes = uint64_t{4} << 20;
constexpr int kStragglerPollMs = 20;
constexpr int kEventsPollMs = 250;  // where inotify is not to be had

// What programs of a Debian system read besides their input.
const std::vector<std::string>& SystemPrograms() {
  static const std::vector<std::string> paths{"/usr", "/lib", "/lib64", "/bin"};
  return paths;
}
const std::vector<std::string>& SystemFiles() {
  static const std::vector<std::string> paths{"/etc",         "/proc",       "/sys/devices/system",
                                              "/dev/urandom", "/dev/random", "/dev/zero"};
  return paths;
}

struct Attempt {
  AttemptSpec spec;
  pid_t pid = -1;
  UniqueFd pidfd;
  bool ours = false;           // a child of this process, to be reaped
  bool leader_dead = false;    // others of its group may still live
  bool reported_dead = false;  // found dead by Adopt
  int exit_code = -1, signal = 0;
  int watch = -1;
  EventTail tail;

  explicit Attempt(const AttemptSpec& s) : spec(s), tail(s.folder + "/events.ndjson") {}
  std::string alive_file() const { return spec.folder + "/alive"; }
};

enum class Lock { kFree, kHeld, kMissing, kUnknown };

class LocalExecutor : public Executor {
 public:
  LocalExecutor(const LocalExecutorOptions& options, FileCalls& files, Logger& log)
      : options_(options), files_(files), log_(log) {}

  Status Open() {
    epoll_ = UniqueFd(::epoll_create1(EPOLL_CLOEXEC));
    if (!epoll_) return FailErrno(errno, "cannot make", "an epoll descriptor");
    inotify_ = UniqueFd(::inotify_init1(IN_CLOEXEC | IN_NONBLOCK));
    if (inotify_) Listen(inotify_.get());
    if (options_.sandbox == LocalExecutorOptions::Sandbox::kOff) return {};
    use_sandbox_ = true;
    PATINA_TRY(CheckSandbox(options_.sandbox));
    if (Sandbox::LandlockVersion() > 0) return {};
    log_.Warning("half_a_sandbox",
                 {{"reason",
                   "this kernel has no Landlock: jobs are kept from sockets and the like, "
                   "but not from files"}});
    return {};
  }

  Result<std::string> Start(const AttemptSpec& spec) override {
    Attempt attempt(spec);
    UniqueFd lock(
        ::open(attempt.alive_file().c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (!lock) return FailErrno(errno, "cannot create", attempt.alive_file());
    if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0)
      return FailErrno(errno, "cannot lock", attempt.alive_file());
    int log_fd = -1;
    if (const int error = files_.Open(spec.log, O_WRONLY | O_APPEND | O_CREAT, 0600, &log_fd))
      return FailErrno(error, "cannot open", spec.log);
    const UniqueFd log(log_fd);

    ChildSpec child;
    child.arguments = WorkerCommand(options_.worker, spec);
    child.environment = options_.environment;
    child.folder = spec.folder;
    child.log_fd = log.get();
    child.lock_fd = lock.get();
    child.nice = options_.nice;
    child.memory_mb = spec.memory_mb;
    child.cpu_s = spec.cpu_s;
    std::optional<Sandbox> sandbox;
    if (use_sandbox_) {
      PATINA_ASSIGN(Sandbox made, MakeSandbox(spec));
      sandbox.emplace(std::move(made));
      child.sandbox = &*sandbox;
    }
    PATINA_ASSIGN(ChildProcess process, StartChild(child));
    attempt.pid = process.pid;
    attempt.pidfd = std::move(process.pidfd);
    attempt.ours = true;
    const std::string handle = "pid:" + std::to_string(attempt.pid);
    Add(std::move(attempt));
    return handle;
  }

  Result<bool> Adopt(const AttemptSpec& spec, const std::string&) override {
    Attempt attempt(spec);
    switch (LookAtLock(attempt.alive_file())) {
      case Lock::kUnknown:
        return false;
      case Lock::kFree:
      case Lock::kMissing:
        attempt.reported_dead = true;
        attempts_.push_back(std::move(attempt));
        return true;
      case Lock::kHeld:
        break;
    }
    attempt.pid = ReadPid(attempt.alive_file());
    if (attempt.pid <= 0) return false;
    auto pidfd = OpenPidFd(attempt.pid);
    // The leader may be dead and another of its group alive; then there is nothing to wait for but
    // the lock.
    if (pidfd && HasFileOpen(attempt.pid, attempt.alive_file())) {
      attempt.pidfd = std::move(*pidfd);
    } else {
      attempt.leader_dead = true;
    }
    Add(std::move(attempt));
    return true;
  }

  void Stop(int64_t job, int64_t number, StopMode mode) override {
    for (Attempt& attempt : attempts_) {
      if (attempt.spec.job != job || attempt.spec.attempt != number || attempt.pid <= 0) continue;
      // As long as the group has members, reaped ones not counted, its id is not given to others.
      ::kill(-attempt.pid, mode == StopMode::kKill ? SIGKILL : SIGTERM);
    }
  }

  std::vector<AttemptReport> Poll() override {
    DrainInotify();
    std::vector<AttemptReport> reports;
    for (size_t i = 0; i < attempts_.size();) {
      AttemptReport report;
      report.job = attempts_[i].spec.job;
      report.attempt = attempts_[i].spec.attempt;
      const bool ended = Look(&attempts_[i], &report);
      if (ended || !report.events.empty()) reports.push_back(std::move(report));
      if (ended) {
        if (attempts_[i].watch >= 0) ::inotify_rm_watch(inotify_.get(), attempts_[i].watch);
        attempts_.erase(attempts_.begin() + static_cast<std::ptrdiff_t>(i));
      } else {
        ++i;
      }
    }
    return reports;
  }

  bool IsAlive(int64_t job, int64_t attempt) const override {
    return std::any_of(attempts_.begin(), attempts_.end(), [&](const Attempt& a) {
      return a.spec.job == job && a.spec.attempt == attempt && !a.reported_dead;
    });
  }

  int poll_fd() const override { return epoll_.get(); }

  int poll_timeout_ms() const override {
    int timeout = -1;
    for (const Attempt& attempt : attempts_) {
      if (attempt.reported_dead) return 0;
      if (attempt.leader_dead) return kStragglerPollMs;
      if (attempt.watch < 0) timeout = kEventsPollMs;
    }
    return timeout;
  }

 private:
  Result<Sandbox> MakeSandbox(const AttemptSpec& spec) {
    SandboxPaths paths;
    paths.read = SystemFiles();
    paths.read.insert(paths.read.end(), spec.inputs.begin(), spec.inputs.end());
    paths.read.insert(paths.read.end(), options_.read.begin(), options_.read.end());
    paths.read.push_back(spec.fence);
    paths.execute = SystemPrograms();
    paths.execute.push_back(options_.worker);
    // What the worker becomes; a worker of another kind has none.
    const std::string folder = options_.worker.substr(0, options_.worker.rfind('/') + 1);
    paths.execute.push_back(folder + "../libexec/patina");
    paths.list = {spec.out};
    paths.write = {spec.out + "/" + spec.asset, spec.folder, "/dev/null"};
    return Sandbox::Create(paths);
  }

  void Add(Attempt attempt) {
    if (attempt.pidfd) Listen(attempt.pidfd.get());
    if (inotify_)
      attempt.watch =
          ::inotify_add_watch(inotify_.get(), attempt.spec.folder.c_str(), IN_MODIFY | IN_CREATE);
    attempts_.push_back(std::move(attempt));
  }

  void Listen(int fd) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = fd;
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event);
  }

  void DrainInotify() {
    alignas(inotify_event) char buffer[4096];
    while (inotify_ && ::read(inotify_.get(), buffer, sizeof buffer) > 0) {
    }
  }

  // Fills the report; true: all of it is dead.
  bool Look(Attempt* attempt, AttemptReport* report) {
    if (!attempt->leader_dead && !attempt->reported_dead) CheckLeader(attempt);
    bool ended = attempt->reported_dead;
    if (attempt->leader_dead) {
      const Lock lock = LookAtLock(attempt->alive_file());
      ended = lock == Lock::kFree || lock == Lock::kMissing;
      if (lock == Lock::kHeld && attempt->pid > 0) ::kill(-attempt->pid, SIGKILL);
    }
    // Lines are read after it is known to be dead: then they are all there.
    for (;;) {
      std::vector<std::string> lines = attempt->tail.Read(files_);
      if (lines.empty()) break;
      std::move(lines.begin(), lines.end(), std::back_inserter(report->events));
    }
    if (!ended) return false;
    report->ended = true;
    report->exit_code = attempt->exit_code;
    report->signal = attempt->signal;
    auto result = ReadTextFile(attempt->spec.folder + "/result.json", kMaxResultBytes);
    if (result) report->result_json = std::move(*result);
    return true;
  }

  void CheckLeader(Attempt* attempt) {
    if (!attempt->ours) {
      pollfd ready{attempt->pidfd.get(), POLLIN, 0};
      if (::poll(&ready, 1, 0) <= 0) return;
    } else {
      siginfo_t info{};
      // The zombie keeps the group's id while the rest of the group is killed; then it is reaped.
      if (::waitid(P_PID, static_cast<id_t>(attempt->pid), &info, WEXITED | WNOHANG | WNOWAIT) !=
              0 ||
          info.si_pid == 0) {
        return;
      }
      if (info.si_code == CLD_EXITED) {
        attempt->exit_code = info.si_status;
      } else {
        attempt->signal = info.si_status;
      }
      ::kill(-attempt->pid, SIGKILL);
      ::waitpid(attempt->pid, nullptr, 0);
    }
    attempt->leader_dead = true;
    attempt->pidfd.Reset();
  }

  static Lock LookAtLock(const std::string& path) {
    const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
    if (!fd) return errno == ENOENT ? Lock::kMissing : Lock::kUnknown;
    if (::flock(fd.get(), LOCK_EX | LOCK_NB) == 0) return Lock::kFree;
    return errno == EWOULDBLOCK ? Lock::kHeld : Lock::kUnknown;
  }

  static pid_t ReadPid(const std::string& path) {
    auto text = ReadTextFile(path, 64);
    pid_t pid = -1;
    if (text && !text->empty() && text->back() == '\n')
      std::from_chars(text->data(), text->data() + text->size() - 1, pid);
    return pid;
  }

  LocalExecutorOptions options_;
  FileCalls& files_;
  Logger& log_;
  bool use_sandbox_ = false;
  UniqueFd epoll_, inotify_;
  std::vector<Attempt> attempts_;
};

}  // namespace

Status CheckSandbox(LocalExecutorOptions::Sandbox sandbox) {
  if (sandbox != LocalExecutorOptions::Sandbox::kRequired || Sandbox::LandlockVersion() > 0)
    return {};
  return Fail(ErrorCode::kUnsupported,
              "this kernel has no Landlock, and the configuration requires a sandbox; boot with "
              "lsm=...,landlock, or set \"sandbox\" to \"auto\"");
}

Result<std::unique_ptr<Executor>> MakeLocalExecutor(const LocalExecutorOptions& options,
                                                    FileCalls& files, Logger& log) {
  auto executor = std::make_unique<LocalExecutor>(options, files, log);
  PATINA_TRY(executor->Open());
  return executor;
}

}  // namespace patina::daemon
