#include "daemon/execute/template_commands.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <sstream>
#include <utility>

#include "formats/base/names.h"

namespace patina::daemon {
namespace {

constexpr size_t kIdsAtOnce = 500;

constexpr std::pair<const char*, FarmState> kStates[] = {
    {"waiting", FarmState::kWaiting},           {"running", FarmState::kRunning},
    {"completed", FarmState::kCompleted},       {"failed", FarmState::kFailed},
    {"cancelled", FarmState::kCancelled},       {"time_limit", FarmState::kTimeLimit},
    {"out_of_memory", FarmState::kOutOfMemory}, {"node_failed", FarmState::kNodeFailed},
    {"preempted", FarmState::kPreempted},
};

// Calls take(name) for each {name}, and text(part) for what lies between.
template <class Text, class Take>
void Walk(const std::string& word, Text text, Take take) {
  size_t at = 0;
  while (at < word.size()) {
    const size_t open = word.find('{', at);
    const size_t close = open == std::string::npos ? open : word.find('}', open);
    if (close == std::string::npos) break;
    text(word.substr(at, open - at));
    take(word.substr(open + 1, close - open - 1));
    at = close + 1;
  }
  text(word.substr(at));
}

// A word with a placeholder that has no value is left out.
Words Fill(const Words& words, const std::map<std::string, std::string>& values) {
  Words filled;
  for (const std::string& word : words) {
    std::string text;
    bool whole = true;
    Walk(
        word, [&](const std::string& part) { text += part; },
        [&](const std::string& name) {
          const auto found = values.find(name);
          if (found == values.end() || found->second.empty()) {
            whole = false;
          } else {
            text += found->second;
          }
        });
    if (whole) filled.push_back(std::move(text));
  }
  return filled;
}

std::string OrNothing(int64_t value) { return value > 0 ? std::to_string(value) : ""; }

class TemplateCommands : public FarmCommands {
 public:
  explicit TemplateCommands(TemplateOptions options) : options_(std::move(options)) {}

  std::string name() const override { return "the farm"; }
  bool finds_names() const override { return !options_.find.empty(); }

  Words Submit(const FarmSubmission& job) const override {
    std::string excluded;
    for (const std::string& node : job.excluded) excluded += (excluded.empty() ? "" : ",") + node;
    return Fill(options_.submit, {{"script", job.script},
                                  {"name", job.name},
                                  {"folder", job.folder},
                                  {"log", job.log},
                                  {"cpus", std::to_string(job.cpus)},
                                  {"memory_mb", OrNothing(job.memory_mb)},
                                  {"seconds", OrNothing(job.wall_s)},
                                  {"exclude", excluded}});
  }

  std::optional<std::string> ParseSubmitted(const std::string& out) const override {
    std::istringstream words(out);
    std::string id;
    for (std::string word; words >> word;) id = std::move(word);
    return IsFarmId(id) ? std::optional(std::move(id)) : std::nullopt;
  }

  std::vector<StatusCall> Status(const std::vector<std::string>& ids,
                                 const std::vector<std::string>& names) const override {
    std::vector<StatusCall> calls;
    for (size_t at = 0; at < ids.size(); at += kIdsAtOnce) {
      StatusCall call;
      for (const std::string& word : options_.status) {
        if (word != "{ids}") {
          call.words.push_back(word);
          continue;
        }
        for (size_t i = at; i < std::min(ids.size(), at + kIdsAtOnce); ++i)
          call.words.push_back(ids[i]);
      }
      calls.push_back(std::move(call));
    }
    if (finds_names()) {
      for (const std::string& name : names)
        calls.push_back({Fill(options_.find, {{"name", name}}), name});
    }
    return calls;
  }

  Result<std::vector<FarmJob>> ParseStatus(const StatusCall& call,
                                           const std::string& out) const override {
    std::vector<FarmJob> jobs;
    std::istringstream lines(out);
    for (std::string line; std::getline(lines, line);) {
      std::istringstream words(line);
      FarmJob job;
      std::string state, exit_code;
      if (!(words >> job.id)) continue;
      words >> state >> job.node >> exit_code;
      if (!IsFarmId(job.id) || state.empty()) {
        return Fail(
            ErrorCode::kCorruptData,
            options_.status[0] + ": a line that is not \"ID STATE\": " + QuoteForMessage(line));
      }
      for (const auto& [name, known] : kStates) {
        if (state == name) job.state = known;
      }
      if (job.state == FarmState::kUnknown) job.reason = state;
      std::from_chars(exit_code.data(), exit_code.data() + exit_code.size(), job.exit_code);
      job.name = call.name;
      jobs.push_back(std::move(job));
    }
    return jobs;
  }

  std::vector<Words> Cancel(const std::vector<std::string>& ids) const override {
    std::vector<Words> calls;
    for (const std::string& id : ids) calls.push_back(Fill(options_.cancel, {{"id", id}}));
    return calls;
  }

 private:
  TemplateOptions options_;
};

}  // namespace

std::unique_ptr<FarmCommands> MakeTemplateCommands(const TemplateOptions& options) {
  return std::make_unique<TemplateCommands>(options);
}

std::optional<std::string> UnknownPlaceholder(const Words& words,
                                              const std::vector<std::string>& names) {
  std::optional<std::string> unknown;
  for (const std::string& word : words) {
    Walk(
        word, [](const std::string&) {},
        [&](const std::string& name) {
          if (std::find(names.begin(), names.end(), name) == names.end())
            unknown = "{" + name + "}";
        });
  }
  return unknown;
}

const std::vector<std::string>& SubmitPlaceholders() {
  static const std::vector<std::string> names{"script", "name",      "folder",  "log",
                                              "cpus",   "memory_mb", "seconds", "exclude"};
  return names;
}

}  // namespace patina::daemon
