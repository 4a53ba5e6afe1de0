#include "daemon/execute/worker_command.h"

namespace patina::daemon {
namespace {

// One word of a shell, whatever is in it.
std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::vector<std::string> WorkerCommand(const std::string& worker, const AttemptSpec& spec) {
  std::vector<std::string> words{worker,
                                 "run",
                                 spec.folder + "/job.json",
                                 "--events",
                                 spec.folder + "/events.ndjson",
                                 "--result",
                                 spec.folder + "/result.json",
                                 "--fence",
                                 spec.fence,
                                 "--attempt",
                                 std::to_string(spec.attempt)};
  if (spec.skip_unchanged) words.push_back("--skip-unchanged");
  if (!spec.force_past.empty()) {
    words.push_back("--not-revision");
    words.push_back(spec.force_past);
  }
  return words;
}

std::string WorkerScript(const std::string& worker, const std::vector<std::string>& environment,
                         const AttemptSpec& spec) {
  std::string text = "#!/bin/sh\n# Job " + std::to_string(spec.job) + " of patinad, attempt " +
                     std::to_string(spec.attempt) + "; for the farm, not to be run by hand.\n";
  text += "cd " + Quoted(spec.folder) + " || exit 75\n";
  text += "mkdir " + std::string(kStartedName) + " || exit 76\n";
  text += "read -r current < " + Quoted(spec.fence) + "\n";
  text += "[ \"$current\" = " + std::to_string(spec.attempt) + " ] || exit 77\n";
  text += "ulimit -c 0\n";
  if (spec.memory_mb > 0) text += "ulimit -d " + std::to_string(spec.memory_mb * 1024) + "\n";
  if (spec.cpu_s > 0) {
    text += "ulimit -S -t " + std::to_string(spec.cpu_s) + "\n";
    text += "ulimit -H -t " + std::to_string(spec.cpu_s + 5) + "\n";
  }
  text += "exec /usr/bin/env -i";
  for (const std::string& entry : environment) text += " " + Quoted(entry);
  for (const std::string& word : WorkerCommand(worker, spec)) text += " " + Quoted(word);
  return text + "\n";
}

}  // namespace patina::daemon
