#include "daemon/api/submit_body.h"

#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "formats/base/strict_json.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::json;

constexpr int kDeepest = 24;
constexpr size_t kMaxProblems = 50;
constexpr int64_t kMaxLimit = int64_t{1} << 40;

// Parses an object.
bool Parse(std::string_view text, Json* json, std::vector<FieldProblem>* problems) {
  auto parsed = ParseStrictJson(text, kDeepest);
  if (!parsed) {
    problems->push_back({"", parsed.error().message});
  } else if (!parsed->is_object()) {
    problems->push_back({"", "must be a JSON object"});
  } else {
    *json = std::move(*parsed);
  }
  return problems->empty();
}

class Reader {
 public:
  Reader(const Json& object, std::string pointer, std::vector<FieldProblem>* problems)
      : object_(object), pointer_(std::move(pointer)), problems_(problems) {}

  const Json* Find(const char* key) {
    known_.insert(key);
    const auto found = object_.find(key);
    return found == object_.end() ? nullptr : &*found;
  }

  void Complain(const std::string& key, const std::string& detail) {
    if (problems_->size() < kMaxProblems)
      problems_->push_back({pointer_ + "/" + EscapePointer(key), detail});
  }

  std::optional<int64_t> Integer(const char* key, int64_t least, int64_t most) {
    const Json* value = Find(key);
    if (value == nullptr) return std::nullopt;
    const bool fits = value->is_number_integer() &&
                      (!value->is_number_unsigned() ||
                       value->get<uint64_t>() <= std::numeric_limits<int64_t>::max()) &&
                      value->get<int64_t>() >= least && value->get<int64_t>() <= most;
    if (fits) return value->get<int64_t>();
    Complain(key, "must be a whole number from " + std::to_string(least) + " to " +
                      std::to_string(most));
    return std::nullopt;
  }

  std::string Text(const char* key) {
    const Json* value = Find(key);
    if (value != nullptr && value->is_string()) return value->get<std::string>();
    Complain(key, value == nullptr ? "is missing" : "must be a text");
    return "";
  }

  bool Flag(const char* key) {
    const Json* value = Find(key);
    if (value == nullptr) return false;
    if (!value->is_boolean()) Complain(key, "must be true or false");
    return value->is_boolean() && value->get<bool>();
  }

  void RefuseUnknown() {
    for (const auto& [key, value] : object_.items()) {
      if (known_.count(key) != 0) continue;
      std::string list;
      for (const std::string& known : known_) list += (list.empty() ? "" : ", ") + known;
      Complain(key, "is not known; known are " + list);
    }
  }

 private:
  const Json& object_;
  std::string pointer_;
  std::vector<FieldProblem>* problems_;
  std::set<std::string> known_;
};

void ReadLimits(const Json& limits, ParsedSubmit* parsed) {
  if (!limits.is_object()) {
    parsed->problems.push_back({"/limits", "must be an object"});
    return;
  }
  Reader reader(limits, "/limits", &parsed->problems);
  parsed->request.memory_mb = reader.Integer("memory_mb", 0, kMaxLimit);
  parsed->request.cpu_s = reader.Integer("cpu_s", 0, kMaxLimit);
  parsed->request.wall_s = reader.Integer("wall_s", 0, kMaxLimit);
  reader.RefuseUnknown();
}

void RefuseRelative(const std::string& path, const std::string& pointer, ParsedSubmit* parsed) {
  if (!path.empty() && path[0] != '/') {
    parsed->problems.push_back(
        {pointer, "must be an absolute path: the daemon has another working folder than you"});
  }
}

void ReadJob(Json job, const std::string& default_out, ParsedSubmit* parsed) {
  if (!job.is_object()) {
    parsed->problems.push_back({"/job", "must be an object, as in a job file"});
    return;
  }
  if (!job.contains("version")) job["version"] = kJobVersion;
  if (!job.contains("out")) job["out"] = default_out;
  auto read = ParseJob(job.dump(), "", "job");
  if (!read) {
    parsed->problems = FieldProblemsOf(read.error().message, "/job");
    if (parsed->problems.empty()) parsed->problems.push_back({"/job", read.error().message});
    return;
  }
  RefuseRelative(read->file, "/job/file", parsed);
  RefuseRelative(read->folder, "/job/folder", parsed);
  RefuseRelative(read->out, "/job/out", parsed);
  RefuseRelative(read->ocio, "/job/ocio", parsed);
  if (read->folder.empty()) {
    for (size_t i = 0; i < read->maps.size(); ++i)
      RefuseRelative(read->maps[i].file, "/job/maps/" + std::to_string(i) + "/file", parsed);
  }
  parsed->request.job = std::move(*read);
}

}  // namespace

ParsedSubmit ParseSubmit(std::string_view body, const std::string& default_out) {
  ParsedSubmit parsed;
  Json json;
  if (!Parse(body, &json, &parsed.problems)) return parsed;
  std::vector<FieldProblem> problems;
  Reader reader(json, "", &problems);
  const Json* job = reader.Find("job");
  if (job == nullptr) {
    reader.Complain("job", "is missing");
  } else {
    ReadJob(*job, default_out, &parsed);
  }
  if (const Json* limits = reader.Find("limits")) ReadLimits(*limits, &parsed);
  parsed.request.priority =
      static_cast<int>(reader.Integer("priority", kMinPriority, kMaxPriority).value_or(0));
  parsed.request.force = reader.Flag("force");
  reader.RefuseUnknown();
  parsed.problems.insert(parsed.problems.begin(), problems.begin(), problems.end());
  return parsed;
}

std::vector<FieldProblem> CheckEmptyBody(std::string_view body) {
  std::vector<FieldProblem> problems;
  if (body.find_first_not_of(" \t\r\n") == std::string_view::npos) return problems;
  Json json;
  if (!Parse(body, &json, &problems)) return problems;
  for (const auto& [key, value] : json.items()) {
    if (problems.size() < kMaxProblems)
      problems.push_back({"/" + EscapePointer(key), "is not known; this request has no fields"});
  }
  return problems;
}

ParsedPriority ParsePriority(std::string_view body) {
  ParsedPriority parsed;
  Json json;
  if (!Parse(body, &json, &parsed.problems)) return parsed;
  Reader reader(json, "", &parsed.problems);
  if (reader.Find("priority") == nullptr) {
    reader.Complain("priority", "is missing");
  } else {
    parsed.priority =
        static_cast<int>(reader.Integer("priority", kMinPriority, kMaxPriority).value_or(0));
  }
  reader.RefuseUnknown();
  return parsed;
}

ParsedUpload ParseUpload(std::string_view body) {
  ParsedUpload parsed;
  Json json;
  if (!Parse(body, &json, &parsed.problems)) return parsed;
  Reader reader(json, "", &parsed.problems);
  parsed.name = reader.Text("name");
  const Json* files = reader.Find("files");
  if (files == nullptr || !files->is_array()) {
    reader.Complain("files", files == nullptr ? "is missing" : "must be a list");
  } else {
    for (size_t i = 0; i < files->size(); ++i) {
      const std::string at = "/files/" + std::to_string(i);
      if (!(*files)[i].is_object()) {
        reader.Complain("files", "has an entry that is no object: " + std::to_string(i));
        continue;
      }
      Reader entry((*files)[i], at, &parsed.problems);
      UploadFile file;
      file.name = entry.Text("name");
      if (entry.Find("bytes") == nullptr) entry.Complain("bytes", "is missing");
      file.bytes = static_cast<uint64_t>(entry.Integer("bytes", 0, kMaxLimit).value_or(0));
      entry.RefuseUnknown();
      parsed.files.push_back(std::move(file));
    }
  }
  reader.RefuseUnknown();
  return parsed;
}

ParsedUploadSubmit ParseUploadSubmit(std::string_view body) {
  ParsedUploadSubmit parsed;
  Json json;
  if (!Parse(body, &json, &parsed.problems)) return parsed;
  Reader reader(json, "", &parsed.problems);
  if (reader.Find("quality") != nullptr) {
    const auto quality = ParseQuality(reader.Text("quality"));
    if (quality) parsed.quality = *quality;
    if (!quality) reader.Complain("quality", "must be preview, standard or reference");
  }
  parsed.priority =
      static_cast<int>(reader.Integer("priority", kMinPriority, kMaxPriority).value_or(0));
  parsed.force = reader.Flag("force");
  reader.RefuseUnknown();
  return parsed;
}

ParsedTicket ParseTicket(std::string_view body) {
  ParsedTicket parsed;
  Json json;
  if (!Parse(body, &json, &parsed.problems)) return parsed;
  Reader reader(json, "", &parsed.problems);
  parsed.path = reader.Text("path");
  if (parsed.problems.empty() &&
      (parsed.path.substr(0, 11) != "/v1/assets/" || parsed.path.size() > 8192))
    reader.Complain("path", "must be that of an asset's file");
  reader.RefuseUnknown();
  return parsed;
}

}  // namespace patina::daemon
