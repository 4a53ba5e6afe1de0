#include "daemon/execute/farm_attempt.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "daemon/execute/worker_command.h"

namespace patina::daemon {
namespace {

constexpr uint64_t kMaxResultBytes = uint64_t{4} << 20;
constexpr uint64_t kMaxListBytes = uint64_t{1} << 20;
// What a shell, or env, says of a program that it cannot run; and WorkerScript of its folder.
constexpr int kNoFolder = 75, kCannotExecute = 126, kNotFound = 127;
constexpr int kInterrupted = 130;  // what `patina run` says after a signal that asks it to end

std::vector<std::string> ReadLines(const std::string& path) {
  std::vector<std::string> lines;
  const auto text = ReadTextFile(path, kMaxListBytes);
  if (!text) return lines;
  std::istringstream stream(*text);
  for (std::string line; std::getline(stream, line);) {
    if (IsFarmId(line)) lines.push_back(line);
  }
  return lines;
}

Status WriteLines(const std::string& path, const std::vector<std::string>& lines,
                  FileCalls& files) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return WriteFileDurably(path, text, files);
}

std::string FailedNodesFile(const AttemptSpec& spec) {
  return spec.folder.substr(0, spec.folder.rfind('/')) + "/failed_nodes";
}

}  // namespace

std::string FarmNameOf(const AttemptSpec& spec) {
  return "patina-" + std::to_string(spec.job) + "-a" + std::to_string(spec.attempt);
}

std::vector<std::string> ReadFarmIds(const AttemptSpec& spec) {
  return ReadLines(spec.folder + "/farm_id");
}

Status WriteFarmIds(const AttemptSpec& spec, const std::vector<std::string>& ids,
                    FileCalls& files) {
  return WriteLines(spec.folder + "/farm_id", ids, files);
}

std::vector<std::string> ReadFailedNodes(const AttemptSpec& spec) {
  return ReadLines(FailedNodesFile(spec));
}

Status AddFailedNode(const AttemptSpec& spec, const std::string& node, FileCalls& files) {
  std::vector<std::string> nodes = ReadFailedNodes(spec);
  if (!IsFarmId(node) || std::find(nodes.begin(), nodes.end(), node) != nodes.end()) return {};
  nodes.push_back(node);
  return WriteLines(FailedNodesFile(spec), nodes, files);
}

bool FileIsThere(const std::string& path, FileCalls& files) {
  struct stat info;
  return files.Stat(path, false, &info) == 0;
}

std::string ReadResultFile(const AttemptSpec& spec) {
  auto text = ReadTextFile(spec.folder + "/result.json", kMaxResultBytes);
  return text ? std::move(*text) : "";
}

bool SaysDone(const std::string& result_json) {
  if (result_json.empty()) return false;
  const auto json = nlohmann::json::parse(result_json, nullptr, false);
  const auto code = json.find("exit_code");
  return json.is_object() && code != json.end() && code->is_number_integer() && *code == 0;
}

std::string FarmEventLine(const std::string& message) {
  const nlohmann::ordered_json json{
      {"type", "stage_started"}, {"stage", "farm"}, {"message", message}};
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

EndCause CauseOf(const FarmJob& job, bool started) {
  switch (job.state) {
    case FarmState::kTimeLimit:
      return EndCause::kTimeLimit;
    case FarmState::kOutOfMemory:
      return EndCause::kOutOfMemory;
    case FarmState::kNodeFailed:
      return EndCause::kNodeFailed;
    case FarmState::kPreempted:
      return EndCause::kPreempted;
    case FarmState::kCancelled:
      return EndCause::kCancelled;
    case FarmState::kFailed: {
      // A node without the shared disk, or without the program.
      const bool cannot = job.exit_code == kNoFolder || job.exit_code == kCannotExecute ||
                          job.exit_code == kNotFound;
      if (!started || cannot) return EndCause::kNodeFailed;
      return job.exit_code == kInterrupted ? EndCause::kAskedToEnd : EndCause::kNone;
    }
    case FarmState::kUnknown:
    case FarmState::kWaiting:
    case FarmState::kRunning:
    case FarmState::kCompleted:
      break;
  }
  return EndCause::kNone;
}

}  // namespace patina::daemon
