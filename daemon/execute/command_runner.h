// Short programs of others, such as squeue and sbatch, run side by side: each with a time limit,
// and nobody waits for them.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "daemon/base/clock.h"
#include "daemon/base/unique_fd.h"
#include "formats/base/result.h"

namespace patina::daemon {

struct CommandOutcome {
  uint64_t id = 0;
  int exit_code = -1;  // -1: it was killed, ran out of time, or could not be started
  bool timed_out = false;
  bool not_started = false;  // it did nothing
  std::string out;
  std::string error;  // what it wrote to standard error, or why it could not be started
};

// What went wrong with a command, in words: "squeue: no answer in time", "sbatch: exit code 1:
// sbatch: error: ...".
std::string FailureOf(const std::string& program, const CommandOutcome& outcome);

// Used by one thread.
class CommandRunner {
 public:
  // The clock must outlive it.
  static Result<CommandRunner> Create(Clock& clock);
  CommandRunner(CommandRunner&&) = default;
  CommandRunner& operator=(CommandRunner&&) = delete;
  // Kills what still runs.
  ~CommandRunner();

  // Starts words[0], looked for in $PATH, with this process's environment and without input, in a
  // session of its own. The id is 1, 2, 3 ...; that it cannot be started is an outcome, too.
  uint64_t Start(const std::vector<std::string>& words, int64_t timeout_ms);
  // What has ended. One that ran out of time is killed, with its process group, and reported at
  // once: a program that hangs in the kernel is not waited for.
  std::vector<CommandOutcome> Poll();
  // Becomes readable when Poll has something to say but for time-outs.
  int poll_fd() const { return epoll_.get(); }
  // Until the next time-out; -1: none.
  int64_t timeout_ms() const;

 private:
  struct Command {
    pid_t pid = -1;
    UniqueFd pidfd, out, error;
    int64_t end_ms = 0;  // steady
    CommandOutcome outcome;
  };

  CommandRunner(Clock& clock, UniqueFd epoll) : clock_(clock), epoll_(std::move(epoll)) {}
  Status Spawn(const std::vector<std::string>& words, Command* command);
  void Listen(const UniqueFd& fd);
  void Reap();

  Clock& clock_;
  UniqueFd epoll_;
  uint64_t last_id_ = 0;
  std::map<uint64_t, Command> running_;
  std::vector<CommandOutcome> not_started_;
  std::vector<pid_t> dying_;  // killed, not yet dead
};

}  // namespace patina::daemon
