#include "daemon/execute/child_process.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "formats/base/file_io.h"

namespace patina::daemon {
namespace {

// What the child says through its pipe when it cannot become the program.
struct Trouble {
  int error;
  char step[60];
};

[[noreturn]] void GiveUp(int pipe, int error, const char* step) {
  Trouble trouble{error, {}};
  std::strncpy(trouble.step, step, sizeof trouble.step - 1);
  // If nobody reads it, nobody waits for it.
  const ssize_t ignored = ::write(pipe, &trouble, sizeof trouble);
  ::_exit(ignored == 0 ? 126 : 127);
}

void Limit(int pipe, decltype(RLIMIT_CORE) what, rlim_t soft, rlim_t hard, const char* step) {
  const rlimit limit{soft, hard};
  if (::setrlimit(what, &limit) != 0) GiveUp(pipe, errno, step);
}

// So that the kernel, when memory runs out, ends a job and not the daemon.
void OfferToOomKiller() {
  const int fd = ::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (fd < 0) return;
  const ssize_t ignored = ::write(fd, "500", 3);
  static_cast<void>(ignored);
  ::close(fd);
}

size_t FormatId(pid_t pid, char* text) {
  char digits[24];
  size_t n = 0;
  for (auto rest = static_cast<uint64_t>(pid); rest != 0; rest /= 10)
    digits[n++] = static_cast<char>('0' + rest % 10);
  for (size_t i = 0; i < n; ++i) text[i] = digits[n - 1 - i];
  text[n++] = '\n';
  return n;
}

// Between fork and exec of a process with threads: system calls only.
[[noreturn]] void BecomeProgram(const ChildSpec& spec, char* const* argv, char* const* envp,
                                int null_fd, int pipe) {
  if (::setsid() < 0) GiveUp(pipe, errno, "make a session");
  char text[32];
  const size_t size = FormatId(::getpid(), text);
  if (::pwrite(spec.lock_fd, text, size, 0) != static_cast<ssize_t>(size))
    GiveUp(pipe, errno, "write its id");
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::signal(SIGPIPE, SIG_DFL);
  if (::dup2(null_fd, 0) < 0 || ::dup2(spec.log_fd, 1) < 0 || ::dup2(spec.log_fd, 2) < 0)
    GiveUp(pipe, errno, "open its log");
  ::syscall(SYS_close_range, 3u, ~0u, 4u /* CLOSE_RANGE_CLOEXEC */);
  if (::fcntl(spec.lock_fd, F_SETFD, 0) != 0) GiveUp(pipe, errno, "keep its lock");
  if (::chdir(spec.folder.c_str()) != 0) GiveUp(pipe, errno, "enter its folder");
  OfferToOomKiller();
  ::setpriority(PRIO_PROCESS, 0, spec.nice);
  Limit(pipe, RLIMIT_CORE, 0, 0, "limit its core file");
  if (spec.memory_mb > 0) {
    const auto bytes = static_cast<rlim_t>(spec.memory_mb) << 20;
    Limit(pipe, RLIMIT_DATA, bytes, bytes, "limit its memory");
  }
  if (spec.cpu_s > 0) {
    // At the first limit a signal that can be told from others, a little later the end.
    const auto seconds = static_cast<rlim_t>(spec.cpu_s);
    Limit(pipe, RLIMIT_CPU, seconds, seconds + 5, "limit its CPU time");
  }
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) GiveUp(pipe, errno, "give up privileges");
  if (spec.sandbox != nullptr) {
    const int error = spec.sandbox->Apply();
    if (error != 0) GiveUp(pipe, error, "enter its sandbox");
  }
  ::execve(argv[0], argv, envp);
  GiveUp(pipe, errno, "run the program");
}

std::vector<char*> Pointers(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (const std::string& text : texts) pointers.push_back(const_cast<char*>(text.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

Result<ChildProcess> StartChild(const ChildSpec& spec) {
  const std::string& program = spec.arguments[0];
  const UniqueFd null_fd(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  if (!null_fd) return FailErrno(errno, "cannot open", "/dev/null");
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return FailErrno(errno, "cannot make a pipe for", program);
  const UniqueFd reader(ends[0]);
  UniqueFd writer(ends[1]);
  const std::vector<char*> argv = Pointers(spec.arguments);
  const std::vector<char*> envp = Pointers(spec.environment);

  const pid_t pid = ::fork();
  if (pid == 0) BecomeProgram(spec, argv.data(), envp.data(), null_fd.get(), writer.get());
  if (pid < 0) return FailErrno(errno == EAGAIN ? ENOMEM : errno, "cannot start", program);
  writer.Reset();
  Trouble trouble{};
  ssize_t n;
  do {
    n = ::read(reader.get(), &trouble, sizeof trouble);
  } while (n < 0 && errno == EINTR);
  if (n == static_cast<ssize_t>(sizeof trouble)) {
    ::waitpid(pid, nullptr, 0);
    trouble.step[sizeof trouble.step - 1] = '\0';
    return FailErrno(trouble.error, "a job's process cannot " + std::string(trouble.step), program);
  }
  auto pidfd = OpenPidFd(pid);
  if (!pidfd) {
    ::kill(-pid, SIGKILL);
    ::waitpid(pid, nullptr, 0);
    return Fail(std::move(pidfd).error());
  }
  return ChildProcess{pid, std::move(*pidfd)};
}

Result<UniqueFd> OpenPidFd(pid_t pid) {
  UniqueFd fd(static_cast<int>(::syscall(SYS_pidfd_open, pid, 0)));
  if (fd) return fd;
  const std::string name = "process " + std::to_string(pid);
  if (errno == ESRCH) return Fail(ErrorCode::kNotFound, "there is no " + name);
  return FailErrno(errno, "cannot watch", name);
}

bool HasFileOpen(pid_t pid, const std::string& path) {
  struct stat wanted;
  if (::stat(path.c_str(), &wanted) != 0) return false;
  const std::string folder = "/proc/" + std::to_string(pid) + "/fd";
  DIR* directory = ::opendir(folder.c_str());
  if (directory == nullptr) return false;
  bool found = false;
  while (const dirent* entry = ::readdir(directory)) {
    struct stat info;
    if (::fstatat(::dirfd(directory), entry->d_name, &info, 0) == 0 &&
        info.st_ino == wanted.st_ino && info.st_dev == wanted.st_dev) {
      found = true;
      break;
    }
  }
  ::closedir(directory);
  return found;
}

}  // namespace patina::daemon
