#include "daemon/execute/slurm_commands.h"

#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>
#include <utility>

#include "formats/base/names.h"

namespace patina::daemon {
namespace {

// A job is asked to end so long before its time limit; less than a minute is not to be had.
constexpr int64_t kSignalLeadS = 60;

// The order of kFormat.
enum Field { kId, kState, kExitCode, kNodes, kReason, kName, kFolder, kFields };
constexpr const char* kFormat =
    "--Format=JobID:|,State:|,exit_code:|,NodeList:|,Reason:|,Name:|,WorkDir:|";

constexpr std::pair<std::string_view, FarmState> kStates[] = {
    {"PENDING", FarmState::kWaiting},      {"CONFIGURING", FarmState::kWaiting},
    {"RUNNING", FarmState::kRunning},      {"COMPLETED", FarmState::kCompleted},
    {"FAILED", FarmState::kFailed},        {"CANCELLED", FarmState::kCancelled},
    {"TIMEOUT", FarmState::kTimeLimit},    {"DEADLINE", FarmState::kTimeLimit},
    {"PREEMPTED", FarmState::kPreempted},  {"OUT_OF_MEMORY", FarmState::kOutOfMemory},
    {"NODE_FAIL", FarmState::kNodeFailed}, {"BOOT_FAIL", FarmState::kNodeFailed},
};

FarmState StateOf(std::string_view name) {
  for (const auto& [known, state] : kStates) {
    if (name == known) return state;
  }
  return FarmState::kUnknown;  // COMPLETING, SUSPENDED, REQUEUED ...: alive, or not known to be
                               // dead
}

// File names of sbatch have patterns.
std::string WithoutPatterns(const std::string& path) {
  std::string text;
  for (const char c : path) text += c == '%' ? "%%" : std::string(1, c);
  return text;
}

Words Resources(const SlurmOptions& options, int cpus, int64_t memory_mb, int64_t wall_s) {
  Words words{"--nodes=1", "--ntasks=1", "--cpus-per-task=" + std::to_string(cpus)};
  if (memory_mb > 0) words.push_back("--mem=" + std::to_string(memory_mb) + "M");
  // Minutes.
  if (wall_s > 0) words.push_back("--time=" + std::to_string((wall_s + kSignalLeadS + 59) / 60));
  if (!options.partition.empty()) words.push_back("--partition=" + options.partition);
  if (!options.account.empty()) words.push_back("--account=" + options.account);
  if (!options.qos.empty()) words.push_back("--qos=" + options.qos);
  words.insert(words.end(), options.arguments.begin(), options.arguments.end());
  return words;
}

class SlurmCommands : public FarmCommands {
 public:
  explicit SlurmCommands(SlurmOptions options) : options_(std::move(options)) {}

  std::string name() const override { return "Slurm"; }
  bool finds_names() const override { return true; }

  Words Submit(const FarmSubmission& job) const override {
    Words words{"sbatch",
                "--parsable",
                "--no-requeue",
                "--job-name=" + job.name,
                "--export=NONE",
                "--open-mode=append",
                "--output=" + WithoutPatterns(job.log),
                "--chdir=" + job.folder,
                "--signal=B:TERM@" + std::to_string(kSignalLeadS)};
    const Words resources = Resources(options_, job.cpus, job.memory_mb, job.wall_s);
    words.insert(words.end(), resources.begin(), resources.end());
    std::string excluded;
    for (const std::string& node : job.excluded) excluded += (excluded.empty() ? "" : ",") + node;
    if (!excluded.empty()) words.push_back("--exclude=" + excluded);
    words.push_back(job.script);
    return words;
  }

  std::optional<std::string> ParseSubmitted(const std::string& out) const override {
    // "123", or "123;cluster".
    std::string id = out.substr(0, out.find_first_of(";\n"));
    if (id.empty() || id.find_first_not_of("0123456789") != std::string::npos) return std::nullopt;
    return id;
  }

  std::vector<StatusCall> Status(const std::vector<std::string>&,
                                 const std::vector<std::string>&) const override {
    return {{{"squeue", "--me", "--states=all", "--noheader", kFormat}, ""}};
  }

  Result<std::vector<FarmJob>> ParseStatus(const StatusCall&,
                                           const std::string& out) const override {
    std::vector<FarmJob> jobs;
    for (size_t at = 0; at < out.size();) {
      const size_t end = std::min(out.find('\n', at), out.size());
      const std::string_view line(out.data() + at, end - at);
      at = end + 1;
      std::array<std::string_view, kFields> fields;
      size_t from = 0, field = 0;
      for (; field < kFields; ++field) {
        // The last one is a path, in which there may be anything.
        const size_t bar = field + 1 < kFields ? line.find('|', from) : line.rfind('|');
        if (bar == std::string_view::npos || bar < from) break;
        fields[field] = line.substr(from, bar - from);
        from = bar + 1;
      }
      if (field < kFields) {
        return Fail(ErrorCode::kCorruptData,
                    "squeue: a line without its fields: " + QuoteForMessage(std::string(line)));
      }
      FarmJob job;
      job.id = fields[kId];
      job.name = fields[kName];
      job.folder = fields[kFolder];
      job.state = StateOf(fields[kState]);
      job.node = fields[kNodes];
      job.reason = fields[kReason];
      // What sbatch was refused stays in the list as a job that failed, though it never was one.
      if (job.state == FarmState::kFailed && job.reason == "BadConstraints") continue;
      int status = -1;
      const std::string_view code = fields[kExitCode];
      const auto parsed = std::from_chars(code.data(), code.data() + code.size(), status);
      if (IsOver(job.state) && parsed.ec == std::errc() && status >= 0) {
        if (WIFEXITED(status)) job.exit_code = WEXITSTATUS(status);
        if (WIFSIGNALED(status)) job.signal = WTERMSIG(status);
      }
      jobs.push_back(std::move(job));
    }
    return jobs;
  }

  std::vector<Words> Cancel(const std::vector<std::string>& ids) const override {
    constexpr size_t kAtOnce = 200;
    std::vector<Words> calls;
    for (size_t at = 0; at < ids.size(); at += kAtOnce) {
      Words words{"scancel"};
      for (size_t i = at; i < std::min(ids.size(), at + kAtOnce); ++i) words.push_back(ids[i]);
      calls.push_back(std::move(words));
    }
    return calls;
  }

 private:
  SlurmOptions options_;
};

}  // namespace

bool IsFarmId(const std::string& text) {
  constexpr size_t kMost = 128;
  return !text.empty() && text.size() <= kMost && text.front() != '-' &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                  std::string_view("._:[]@-").find(c) != std::string_view::npos;
         });
}

std::unique_ptr<FarmCommands> MakeSlurmCommands(const SlurmOptions& options) {
  return std::make_unique<SlurmCommands>(options);
}

Words SlurmDryRun(const SlurmOptions& options, int cpus, int64_t memory_mb, int64_t wall_s) {
  Words words{"sbatch", "--test-only", "--export=NONE"};
  const Words resources = Resources(options, cpus, memory_mb, wall_s);
  words.insert(words.end(), resources.begin(), resources.end());
  words.push_back("--wrap=true");
  return words;
}

std::optional<std::string> SlurmOwnOption(const std::string& argument) {
  static constexpr std::string_view kLong[] = {
      "--array",     "--chdir",  "--clusters",  "--cpus-per-task", "--error",      "--exclude",
      "--export",    "--help",   "--job-name",  "--mem",           "--no-requeue", "--nodes",
      "--ntasks",    "--output", "--open-mode", "--parsable",      "--requeue",    "--signal",
      "--test-only", "--time",   "--uid",       "--version",       "--wait",       "--wrap"};
  static constexpr std::string_view kShort = "aDMceJNnotWhVxH";
  const std::string name = argument.substr(0, argument.find('='));
  if (name.size() > 2 && name.rfind("--", 0) == 0) {
    // sbatch takes any beginning that is not ambiguous.
    for (const std::string_view own : kLong) {
      if (own.rfind(name, 0) == 0) return name;
    }
    return std::nullopt;
  }
  if (name.size() >= 2 && name[0] == '-' && kShort.find(name[1]) != std::string_view::npos)
    return name.substr(0, 2);
  // What is no option would be taken for the script.
  if (name.empty() || name[0] != '-') return argument;
  return std::nullopt;
}

}  // namespace patina::daemon
