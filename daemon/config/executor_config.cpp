#include "daemon/config/executor_config.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "daemon/config/config_paths.h"
#include "formats/base/names.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::json;

constexpr ExecutorKind kKinds[] = {ExecutorKind::kLocal, ExecutorKind::kSlurm,
                                   ExecutorKind::kCommand};

void TakeText(const Json& json, const char* key, std::string* text) {
  const auto found = json.find(key);
  if (found != json.end() && found->is_string()) *text = found->get<std::string>();
}

void TakeSeconds(const Json& json, const char* key, double* seconds) {
  const auto found = json.find(key);
  if (found != json.end() && found->is_number()) *seconds = found->get<double>();
}

void TakeWords(const Json& json, const char* key, std::vector<std::string>* words) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_array()) return;
  for (const Json& word : *found) {
    if (word.is_string()) words->push_back(word.get<std::string>());
  }
}

}  // namespace

const char* ExecutorKindName(ExecutorKind kind) {
  switch (kind) {
    case ExecutorKind::kLocal:
      return "local";
    case ExecutorKind::kSlurm:
      return "slurm";
    case ExecutorKind::kCommand:
      return "command";
  }
  return "local";
}

void ReadExecutor(const Json& file, const std::string& base, ExecutorConfig* executor) {
  const auto found = file.find("executor");
  if (found == file.end() || !found->is_object()) return;
  const Json& json = *found;
  std::string kind;
  TakeText(json, "kind", &kind);
  for (const ExecutorKind known : kKinds) {
    if (kind == ExecutorKindName(known)) executor->kind = known;
  }
  if (const auto jobs = json.find("jobs"); jobs != json.end() && jobs->is_number())
    executor->jobs = static_cast<int>(jobs->get<double>());
  TakeText(json, "shared_dir", &executor->shared_dir);
  if (!executor->shared_dir.empty())
    executor->shared_dir = AbsolutePath(executor->shared_dir, base);
  TakeSeconds(json, "poll_s", &executor->poll_s);
  TakeSeconds(json, "command_timeout_s", &executor->command_timeout_s);
  TakeSeconds(json, "result_wait_s", &executor->result_wait_s);
  TakeText(json, "partition", &executor->partition);
  TakeText(json, "account", &executor->account);
  TakeText(json, "qos", &executor->qos);
  TakeWords(json, "sbatch_arguments", &executor->sbatch_arguments);
  TakeWords(json, "submit", &executor->submit);
  TakeWords(json, "status", &executor->status);
  TakeWords(json, "find", &executor->find);
  TakeWords(json, "cancel", &executor->cancel);
}

std::vector<std::string> ExecutorProblems(const ExecutorConfig& executor) {
  std::vector<std::string> problems;
  const auto only_of = [&](ExecutorKind kind, const char* key, bool given) {
    if (given && executor.kind != kind) {
      problems.push_back(std::string("/executor/") + key + " is for the kind \"" +
                         ExecutorKindName(kind) + "\"; the kind is \"" +
                         ExecutorKindName(executor.kind) + "\"");
    }
  };
  only_of(ExecutorKind::kSlurm, "partition", !executor.partition.empty());
  only_of(ExecutorKind::kSlurm, "account", !executor.account.empty());
  only_of(ExecutorKind::kSlurm, "qos", !executor.qos.empty());
  only_of(ExecutorKind::kSlurm, "sbatch_arguments", !executor.sbatch_arguments.empty());
  const std::pair<const char*, const std::vector<std::string>*> templates[] = {
      {"submit", &executor.submit}, {"status", &executor.status}, {"cancel", &executor.cancel}};
  for (const auto& [key, words] : templates) {
    only_of(ExecutorKind::kCommand, key, !words->empty());
    if (executor.kind == ExecutorKind::kCommand && words->empty()) {
      problems.push_back(std::string("/executor/") + key +
                         " is missing: a program and its arguments, as a list of words");
    }
  }
  only_of(ExecutorKind::kCommand, "find", !executor.find.empty());
  if (executor.kind == ExecutorKind::kLocal && !executor.shared_dir.empty())
    problems.emplace_back("/executor/shared_dir is for farms; the kind is \"local\"");
  // Slurm tells of folders line by line.
  if (std::any_of(executor.shared_dir.begin(), executor.shared_dir.end(),
                  [](unsigned char c) { return c < ' '; })) {
    problems.push_back("/executor/shared_dir holds a control character: " +
                       QuoteForMessage(executor.shared_dir));
  }
  return problems;
}

nlohmann::ordered_json ExecutorToJson(const ExecutorConfig& executor) {
  nlohmann::ordered_json json{{"kind", ExecutorKindName(executor.kind)}};
  if (executor.kind == ExecutorKind::kLocal) return json;
  json["jobs"] = executor.jobs;
  if (!executor.shared_dir.empty()) json["shared_dir"] = executor.shared_dir;
  json["poll_s"] = executor.poll_s;
  json["command_timeout_s"] = executor.command_timeout_s;
  json["result_wait_s"] = executor.result_wait_s;
  if (executor.kind == ExecutorKind::kSlurm) {
    const std::pair<const char*, const std::string*> texts[] = {
        {"partition", &executor.partition}, {"account", &executor.account}, {"qos", &executor.qos}};
    for (const auto& [key, text] : texts) {
      if (!text->empty()) json[key] = *text;
    }
    json["sbatch_arguments"] = executor.sbatch_arguments;
  } else {
    json["submit"] = executor.submit;
    json["status"] = executor.status;
    if (!executor.find.empty()) json["find"] = executor.find;
    json["cancel"] = executor.cancel;
  }
  return json;
}

}  // namespace patina::daemon
