#include "daemon/execute/command_runner.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/epoll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "daemon/execute/child_process.h"
#include "formats/base/file_io.h"

extern char** environ;

namespace patina::daemon {
namespace {

constexpr size_t kMaxOutBytes = size_t{64} << 20;
constexpr size_t kMaxErrorBytes = size_t{16} << 10;

Status MakePipe(UniqueFd* reader, UniqueFd* writer) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return FailErrno(errno, "cannot make", "a pipe");
  *reader = UniqueFd(ends[0]);
  *writer = UniqueFd(ends[1]);
  ::fcntl(ends[0], F_SETFL, O_NONBLOCK);
  return {};
}

// Takes what is there; what is beyond the limit is dropped. At its end the pipe is closed.
void Drain(UniqueFd* pipe, size_t most, std::string* text) {
  std::array<char, 65536> buffer;
  while (*pipe) {
    const ssize_t n = ::read(pipe->get(), buffer.data(), buffer.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EAGAIN) return;
    if (n <= 0) return pipe->Reset();
    text->append(buffer.data(),
                 std::min(static_cast<size_t>(n), most - std::min(most, text->size())));
  }
}

}  // namespace

std::string FailureOf(const std::string& program, const CommandOutcome& outcome) {
  std::string text = program + ": ";
  if (outcome.timed_out) return text + "no answer in time";
  if (outcome.exit_code >= 0) text += "exit code " + std::to_string(outcome.exit_code) + ": ";
  std::string said = outcome.error.empty() ? outcome.out : outcome.error;
  while (!said.empty() && static_cast<unsigned char>(said.back()) <= ' ') said.pop_back();
  constexpr size_t kMost = 500;
  if (said.size() > kMost) said.resize(kMost);
  std::replace(said.begin(), said.end(), '\n', ' ');
  return text + (said.empty() ? "it says nothing" : said);
}

Result<CommandRunner> CommandRunner::Create(Clock& clock) {
  UniqueFd epoll(::epoll_create1(EPOLL_CLOEXEC));
  if (!epoll) return FailErrno(errno, "cannot make", "an epoll descriptor");
  return CommandRunner(clock, std::move(epoll));
}

CommandRunner::~CommandRunner() {
  for (const auto& [id, command] : running_) {
    ::kill(-command.pid, SIGKILL);
    dying_.push_back(command.pid);
  }
  Reap();
}

uint64_t CommandRunner::Start(const std::vector<std::string>& words, int64_t timeout_ms) {
  Command command;
  command.outcome.id = ++last_id_;
  command.end_ms = clock_.SteadyMs() + timeout_ms;
  if (const Status spawned = Spawn(words, &command); !spawned) {
    command.outcome.not_started = true;
    command.outcome.error = spawned.error().message;
    not_started_.push_back(std::move(command.outcome));
    return last_id_;
  }
  Listen(command.pidfd);
  // So that one with much to say does not wait for its reader.
  Listen(command.out);
  Listen(command.error);
  running_.emplace(last_id_, std::move(command));
  return last_id_;
}

Status CommandRunner::Spawn(const std::vector<std::string>& words, Command* command) {
  UniqueFd out, error;
  PATINA_TRY(MakePipe(&command->out, &out));
  PATINA_TRY(MakePipe(&command->error, &error));
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, out.get(), 1);
  ::posix_spawn_file_actions_adddup2(&actions, error.get(), 2);
  ::posix_spawn_file_actions_addclosefrom_np(&actions, 3);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  sigset_t none, by_default;
  sigemptyset(&none);
  sigemptyset(&by_default);
  sigaddset(&by_default, SIGPIPE);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setsigdefault(&attributes, &by_default);
  ::posix_spawnattr_setflags(&attributes,
                             POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  const int failed =
      ::posix_spawnp(&command->pid, argv[0], &actions, &attributes, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::posix_spawnattr_destroy(&attributes);
  if (failed != 0) return FailErrno(failed, "cannot run", words[0]);
  auto pidfd = OpenPidFd(command->pid);
  if (!pidfd) {
    ::kill(-command->pid, SIGKILL);
    ::waitpid(command->pid, nullptr, 0);
    return Fail(std::move(pidfd).error());
  }
  command->pidfd = std::move(*pidfd);
  return {};
}

void CommandRunner::Listen(const UniqueFd& fd) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = fd.get();
  ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd.get(), &event);
}

std::vector<CommandOutcome> CommandRunner::Poll() {
  Reap();
  std::vector<CommandOutcome> ended = std::move(not_started_);
  not_started_.clear();
  const int64_t now = clock_.SteadyMs();
  for (auto it = running_.begin(); it != running_.end();) {
    Command& command = it->second;
    CommandOutcome& outcome = command.outcome;
    int status = 0;
    const bool dead = ::waitpid(command.pid, &status, WNOHANG) == command.pid;
    // What it wrote before it died is in the pipes now.
    Drain(&command.out, kMaxOutBytes, &outcome.out);
    Drain(&command.error, kMaxErrorBytes, &outcome.error);
    if (!dead && now < command.end_ms) {
      ++it;
      continue;
    }
    if (dead && WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
    if (!dead) {
      outcome.timed_out = true;
      ::kill(-command.pid, SIGKILL);
      dying_.push_back(command.pid);
    }
    ended.push_back(std::move(outcome));
    it = running_.erase(it);
  }
  return ended;
}

void CommandRunner::Reap() {
  std::erase_if(dying_, [](pid_t pid) { return ::waitpid(pid, nullptr, WNOHANG) == pid; });
}

int64_t CommandRunner::timeout_ms() const {
  if (!not_started_.empty()) return 0;
  int64_t wait = -1;
  for (const auto& [id, command] : running_) {
    const int64_t left = std::max<int64_t>(0, command.end_ms - clock_.SteadyMs());
    wait = wait < 0 ? left : std::min(wait, left);
  }
  return wait;
}

}  // namespace patina::daemon
