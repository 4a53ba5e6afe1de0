#include "pipeline/client/client_commands.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "pipeline/client/client_text.h"
#include "pipeline/client/http_client.h"
#include "pipeline/jobs/job_result.h"

namespace patina {
namespace {

using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;

// How long a daemon may be away, as it is when it is started anew, before we give up on it.
constexpr std::chrono::seconds kReconnectFor{30};
constexpr std::chrono::milliseconds kReconnectPause{500};
constexpr std::chrono::milliseconds kFollowPause{500};

int ExitCodeOf(const Error& error) {
  switch (error.code) {
    case ErrorCode::kInvalidArgument:
    case ErrorCode::kConflict:
      return kExitBadInput;
    case ErrorCode::kCancelled:
      return kExitInterrupted;
    default:
      return kExitFailed;
  }
}

int FailWith(const Error& error) {
  std::fprintf(stderr, "patina: error: %s\n", error.message.c_str());
  return ExitCodeOf(error);
}

// Later in the list is worse.
int Worse(int a, int b) {
  constexpr int kOrder[] = {kExitDone, kExitQualityGate, kExitBadInput, kExitFailed,
                            kExitInterrupted};
  const auto rank = [&](int code) { return std::find(std::begin(kOrder), std::end(kOrder), code); };
  return rank(a) >= rank(b) ? a : b;
}

// A client, and how its answers are printed.
class Session {
 public:
  Session(const ClientOptions& options, const CancelToken& cancel)
      : cancel_(cancel),
        client_(options.socket.empty() ? DefaultSocketPath() : options.socket, cancel) {}

  // The body of an answer; an answer of 400 and above is an error.
  Result<HttpAnswer> Ask(const std::string& method, const std::string& target,
                         const std::string& body = "", const HttpHeaders& headers = {}) {
    PATINA_ASSIGN(HttpAnswer answer, client_.Request(method, target, body, headers));
    if (answer.status >= 400) {
      Error error = ErrorOfAnswer(answer);
      // That the daemon does not know what was asked for is the asker's, not the daemon's.
      if (error.code == ErrorCode::kNotFound) error.code = ErrorCode::kInvalidArgument;
      return Fail(std::move(error));
    }
    return answer;
  }

  Result<Json> AskJson(const std::string& method, const std::string& target,
                       const std::string& body = "", const HttpHeaders& headers = {}) {
    PATINA_ASSIGN(const HttpAnswer answer, Ask(method, target, body, headers));
    Json json = Json::parse(answer.body, nullptr, false);
    if (!json.is_object())
      return Fail(ErrorCode::kCorruptData, "the daemon's answer is not JSON: is it a patinad?");
    return json;
  }

  Result<Json> Job(int64_t id) { return AskJson("GET", "/v1/jobs/" + std::to_string(id)); }

  // Reads events until on_event returns false, coming again when the connection breaks. An event of
  // type "reset" comes first, and whenever something may have been missed: then the listener looks
  // at what is so.
  Status Listen(const std::string& query,
                const std::function<Result<bool>(const ServerEvent&)>& on_event) {
    std::string last_id;
    bool heard = false;
    Clock::time_point lost{};
    for (;;) {
      Status failed;
      const auto take = [&](const ServerEvent& event) {
        if (!event.id.empty()) last_id = event.id;
        heard = true;
        // Who names the last event misses nothing; who cannot has to look once it is heard again.
        if (event.type == kStreamOpened && !last_id.empty()) return true;
        auto more = on_event(event.type == kStreamOpened ? ServerEvent{"", "reset", "{}"} : event);
        if (!more) failed = Fail(more.error());
        if (more) lost = {};
        return more && *more;
      };
      HttpHeaders headers;
      if (!last_id.empty()) headers.emplace_back("Last-Event-ID", last_id);
      const auto end = client_.Stream("/v1/events" + query, headers, take);
      if (cancel_.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
      if (failed && end && *end == StreamEnd::kStopped) return {};
      Status broken = failed ? (end ? Status() : Status(Fail(end.error()))) : failed;
      // What was looked at on account of the last event is not known.
      if (!failed) last_id.clear();
      // A daemon that was there may come back.
      if (!broken && (!heard || !IsBreak(broken.error()))) return broken;
      const Clock::time_point now = Clock::now();
      if (lost == Clock::time_point{}) lost = now;
      if (!broken && now - lost > kReconnectFor) return broken;
      std::this_thread::sleep_for(kReconnectPause);
    }
  }

  bool cancelled() const { return cancel_.cancelled(); }

 private:
  // Nobody listens, or the connection ended within an answer: what is seen of a daemon that ends.
  static bool IsBreak(const Error& error) {
    return error.code == ErrorCode::kNotFound || error.code == ErrorCode::kCorruptData;
  }

  const CancelToken& cancel_;
  HttpClient client_;
};

// The folders that a daemon watches, from its status.
std::vector<SubmitDropFolder> DropFoldersOf(const Json& status) {
  static const Json::json_pointer kRoots("/watch/roots");
  std::vector<SubmitDropFolder> folders;
  if (!status.contains(kRoots)) return folders;
  for (const Json& root : status.at(kRoots)) {
    if (root.is_object() && root.contains("path") && root["path"].is_string())
      folders.push_back({root["path"].get<std::string>(), root.value("as", Json()) == "svbrdf"});
  }
  return folders;
}

// One line that is redrawn on a terminal; lines now and then elsewhere.
class LiveLine {
 public:
  explicit LiveLine(bool quiet) : quiet_(quiet) {
    const char* term = std::getenv("TERM");
    live_ = isatty(STDERR_FILENO) == 1 && term != nullptr && std::string(term) != "dumb";
  }
  ~LiveLine() { Clear(); }
  void Show(const std::string& line) {
    const Clock::time_point now = Clock::now();
    if (quiet_ || now - last_ < std::chrono::milliseconds(live_ ? 100 : 2000)) return;
    last_ = now;
    std::fprintf(stderr, live_ ? "\r\x1b[K%s" : "%s\n", line.substr(0, live_ ? 100 : 400).c_str());
    std::fflush(stderr);
    drawn_ = live_;
  }
  void Print(const std::string& line) {
    Clear();
    if (!quiet_) std::fprintf(stderr, "%s\n", line.c_str());
  }
  void Clear() {
    if (drawn_) std::fprintf(stderr, "\r\x1b[K");
    drawn_ = false;
  }

 private:
  bool quiet_, live_ = false, drawn_ = false;
  Clock::time_point last_{};
};

// Waits until all jobs have ended; `done` gets each of them as it ends.
Status WaitForJobs(Session* session, const ClientOptions& options, std::set<int64_t> ids,
                   std::map<int64_t, Json>* done) {
  LiveLine line(options.quiet || options.json);
  const std::string query = ids.size() == 1 ? "?job=" + std::to_string(*ids.begin()) : "";
  const auto look = [&](int64_t id) -> Status {
    auto job = session->Job(id);
    if (!job) return Fail(job.error());
    if (!IsFinalState(job->value("state", ""))) return {};
    line.Print(JobLine(*job));
    ids.erase(id);
    (*done)[id] = std::move(*job);
    return {};
  };
  return session->Listen(query, [&](const ServerEvent& event) -> Result<bool> {
    if (event.type == "reset") {
      for (const int64_t id : std::set<int64_t>(ids)) PATINA_TRY(look(id));
      return !ids.empty();
    }
    const Json data = Json::parse(event.data, nullptr, false);
    const int64_t id = data.is_object() ? data.value("job", int64_t{0}) : 0;
    if (ids.count(id) == 0) return true;
    if (event.type == "progress") {
      line.Show(EventLine(data));
    } else {
      PATINA_TRY(look(id));
    }
    return !ids.empty();
  });
}

// Waits for jobs and says what became of them.
int FinishJobs(Session* session, const ClientOptions& options, const std::set<int64_t>& ids,
               int worst, Json* list) {
  std::map<int64_t, Json> done;
  const Status waited = WaitForJobs(session, options, ids, &done);
  for (auto& [id, job] : done) {
    worst = Worse(worst, ExitCodeOfJob(job));
    if (list != nullptr) {
      for (Json& entry : *list) {
        if (entry.value("id", int64_t{0}) == id) entry = job;
      }
    }
  }
  if (waited) return worst;
  if (waited.error().code == ErrorCode::kCancelled) {
    std::fprintf(stderr,
                 "patina: no longer waiting; the jobs go on (`patina cancel ID` ends one)\n");
    return kExitInterrupted;
  }
  return Worse(worst, FailWith(waited.error()));
}

void PrintJson(const Json& json) {
  std::printf("%s\n", json.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
}

bool IsSocket(const std::string& path) {
  struct stat info {};
  return stat(path.c_str(), &info) == 0 && S_ISSOCK(info.st_mode);
}

int ForEachId(const ClientOptions& options, const CancelToken& cancel, const char* action) {
  Session session(options, cancel);
  int worst = kExitDone;
  Json list = Json::array();
  for (const int64_t id : options.ids) {
    auto answer = session.AskJson("POST", "/v1/jobs/" + std::to_string(id) + "/" + action);
    if (!answer) {
      worst = Worse(worst, FailWith(answer.error()));
      list.push_back({{"id", id}, {"error", answer.error().message}});
      if (ExitCodeOf(answer.error()) != kExitBadInput) break;
      continue;
    }
    const std::string state = answer->value("state", "");
    if (!options.json && !options.quiet) {
      std::printf("%lld: %s\n", static_cast<long long>(id),
                  state == "running" && std::string(action) == "cancel" ? "being cancelled"
                                                                        : state.c_str());
    }
    list.push_back({{"id", id}, {"state", state}});
  }
  if (options.json) PrintJson({{"jobs", list}});
  return worst;
}

}  // namespace

std::string DefaultSocketPath() {
  constexpr const char* kName = "/patinad.sock";
  if (const char* given = std::getenv("PATINA_SOCKET"); given != nullptr && *given != '\0')
    return given;
  std::string own;
  const char* xdg = std::getenv("XDG_STATE_HOME");
  const char* home = std::getenv("HOME");
  if (xdg != nullptr && *xdg == '/') {
    own = std::string(xdg) + "/patina" + kName;
  } else if (home != nullptr && *home == '/') {
    own = std::string(home) + "/.local/state/patina" + kName;
  }
  const std::string of_system = std::string("/var/lib/patina") + kName;
  return own.empty() || (!IsSocket(own) && IsSocket(of_system)) ? of_system : own;
}

int SubmitCommand(const ClientOptions& options, SubmitPlanner planner, const CancelToken& cancel) {
  Session session(options, cancel);
  const auto status = session.AskJson("GET", "/v1/status");
  SubmitSettings settings;
  settings.out = options.out;
  settings.priority = options.priority;
  settings.force = options.force;
  settings.working_space = options.working_space;
  settings.color_space = options.color_space;
  settings.ocio = options.ocio;
  settings.as = options.as;
  if (status) settings.drop_folders = DropFoldersOf(*status);
  std::vector<PlannedSubmit> plan;
  for (const std::string& input : options.inputs) {
    std::vector<PlannedSubmit> more = planner(input, settings);
    std::move(more.begin(), more.end(), std::back_inserter(plan));
  }
  if (!options.idempotency_key.empty() && plan.size() != 1) {
    std::fprintf(stderr,
                 "patina: error: --key names one job, and these inputs make %zu; leave it out\n",
                 plan.size());
    return kExitUsage;
  }
  int worst = kExitDone;
  Json list = Json::array();
  std::set<int64_t> ids;
  for (const PlannedSubmit& planned : plan) {
    Result<Json> answer = planned.error ? Result<Json>(Fail(*planned.error)) : status;
    if (answer) {
      HttpHeaders headers;
      if (!options.idempotency_key.empty())
        headers.emplace_back("Idempotency-Key", options.idempotency_key);
      answer = session.AskJson("POST", "/v1/jobs", planned.body, headers);
    }
    if (!answer) {
      Error error = answer.error();
      const int code = planned.error ? ExitCodeFor(error, true) : ExitCodeOf(error);
      list.push_back({{"asset", planned.asset}, {"error", error.message}});
      const bool unreachable = !planned.error && code != kExitBadInput;
      if (!unreachable) error.message = planned.asset + ": " + error.message;
      FailWith(error);
      worst = Worse(worst, code);
      if (unreachable) break;
      continue;
    }
    const int64_t id = answer->value("id", int64_t{0});
    ids.insert(id);
    list.push_back(
        {{"id", id}, {"asset", planned.asset}, {"created", answer->value("created", true)}});
    if (!options.json && !options.quiet)
      std::printf("%lld %s\n", static_cast<long long>(id), planned.asset.c_str());
  }
  std::fflush(stdout);
  if (options.wait && !ids.empty()) worst = FinishJobs(&session, options, ids, worst, &list);
  if (options.json) PrintJson({{"jobs", list}});
  return worst;
}

int JobsCommand(const ClientOptions& options, const CancelToken& cancel) {
  Session session(options, cancel);
  std::string target = "/v1/jobs?limit=" + std::to_string(options.limit);
  const auto add = [&target](const char* name, const std::string& value) {
    if (value.empty()) return;
    target += std::string("&") + name + "=";
    for (const char c : value) {
      const bool plain = (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
                         (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.' || c == ',';
      char escaped[4];
      std::snprintf(escaped, sizeof escaped, "%%%02X", static_cast<unsigned char>(c));
      target += plain ? std::string(1, c) : std::string(escaped);
    }
  };
  add("state", options.state);
  add("asset", options.asset);
  auto answer = session.AskJson("GET", target);
  if (!answer) return FailWith(answer.error());
  if (options.json) {
    PrintJson(*answer);
  } else {
    std::fputs(JobsText(*answer).c_str(), stdout);
  }
  return kExitDone;
}

int WatchCommand(const ClientOptions& options, const CancelToken& cancel) {
  Session session(options, cancel);
  if (!options.ids.empty() && !options.json) {
    const auto job = session.Job(options.ids[0]);
    if (!job) return FailWith(job.error());
    if (!IsFinalState(job->value("state", "")) && !options.quiet)
      std::fprintf(stderr, "%s\n", JobLine(*job).c_str());
    return FinishJobs(&session, options, {options.ids[0]}, kExitDone, nullptr);
  }
  const int64_t id = options.ids.empty() ? 0 : options.ids[0];
  int code = kExitDone;
  LiveLine line(options.quiet);
  const auto on_event = [&](const ServerEvent& event) -> Result<bool> {
    const Json data = Json::parse(event.data, nullptr, false);
    if (event.type == "reset") {
      if (id == 0) return true;
    } else if (options.json) {
      PrintJson(data);
    } else if (event.type == "progress") {
      line.Show(EventLine(data));
    } else {
      line.Clear();
      std::printf("%s\n", EventLine(data).c_str());
    }
    if (std::fflush(stdout) != 0) return false;  // the reader has gone
    if (id == 0 || event.type == "progress") return true;
    PATINA_ASSIGN(const Json job, session.Job(id));
    if (!IsFinalState(job.value("state", ""))) return true;
    code = ExitCodeOfJob(job);
    PrintJson(job);
    return false;
  };
  const Status ended = session.Listen(id > 0 ? "?job=" + std::to_string(id) : "", on_event);
  if (ended) return code;
  // Somebody has seen enough.
  if (ended.error().code == ErrorCode::kCancelled) return kExitInterrupted;
  return FailWith(ended.error());
}

int CancelCommand(const ClientOptions& options, const CancelToken& cancel) {
  return ForEachId(options, cancel, "cancel");
}

int RetryCommand(const ClientOptions& options, const CancelToken& cancel) {
  return ForEachId(options, cancel, "retry");
}

int LogsCommand(const ClientOptions& options, const CancelToken& cancel) {
  Session session(options, cancel);
  const std::string path = "/v1/jobs/" + std::to_string(options.ids[0]) + "/log?limit=1048576";
  std::string offset = options.tail_bytes > 0 ? std::to_string(-options.tail_bytes) : "0";
  std::string whole;
  for (;;) {
    auto answer = session.Ask("GET", path + "&offset=" + offset);
    if (!answer) return FailWith(answer.error());
    offset = answer->Header("Patina-Next-Offset");
    const bool complete = answer->Header("Patina-Log-Complete") == "true";
    if (options.json && !options.follow) {
      whole += answer->body;
    } else if (options.json && !answer->body.empty()) {
      PrintJson({{"id", options.ids[0]}, {"text", answer->body}});
    } else {
      std::fwrite(answer->body.data(), 1, answer->body.size(), stdout);
    }
    if (std::fflush(stdout) != 0) return kExitFailed;
    if (offset.empty()) return FailWith({ErrorCode::kCorruptData, "the daemon sent no offset"});
    if (complete || (answer->body.empty() && !options.follow)) break;
    if (!answer->body.empty()) continue;
    if (session.cancelled()) return kExitInterrupted;
    std::this_thread::sleep_for(kFollowPause);
  }
  if (options.json && !options.follow) PrintJson({{"id", options.ids[0]}, {"text", whole}});
  return kExitDone;
}

int StatusCommand(const ClientOptions& options, const CancelToken& cancel) {
  Session session(options, cancel);
  auto answer = session.AskJson("GET", "/v1/status");
  if (!answer) return FailWith(answer.error());
  if (options.json) {
    PrintJson(*answer);
  } else {
    std::fputs(StatusText(*answer).c_str(), stdout);
  }
  return kExitDone;
}

}  // namespace patina
