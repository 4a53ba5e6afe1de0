#include "daemon/config/config.h"

#include <sched.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "daemon/config/config_paths.h"
#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/schema_check.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::json;

const char* SandboxModeName(SandboxMode mode) {
  switch (mode) {
    case SandboxMode::kOff:
      return "off";
    case SandboxMode::kAuto:
      return "auto";
    case SandboxMode::kRequire:
      return "require";
  }
  return "auto";
}

int UsableCores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  return ::sched_getaffinity(0, sizeof set, &set) == 0 ? std::max(1, CPU_COUNT(&set)) : 1;
}

// Where a value came from, for messages about it.
class Loader {
 public:
  explicit Loader(std::vector<std::string> environment) {
    for (const std::string& entry : environment) {
      const size_t equals = entry.find('=');
      if (equals != std::string::npos)
        environment_[entry.substr(0, equals)] = entry.substr(equals + 1);
    }
  }

  LoadedConfig Load(const std::string& file, const ConfigOverrides& flags) {
    if (!file.empty()) ReadConfigFile(file);
    ApplyEnvironment();
    ApplyFlags(flags);
    FillDefaults();
    Check();
    return std::move(loaded_);
  }

 private:
  void Complain(const std::string& where, const std::string& message) {
    loaded_.problems.push_back({where, message});
  }
  void Warn(const std::string& where, const std::string& message) {
    loaded_.warnings.push_back({where, message});
  }
  // Of a setting: where it was last set.
  std::string WhereIs(const std::string& setting) const {
    const auto found = origin_.find(setting);
    return found == origin_.end() ? setting : found->second;
  }

  // ---- The file

  void ReadConfigFile(const std::string& file) {
    Config& c = loaded_.config;
    c.file = AbsolutePath(file, "");
    auto text = ReadTextFile(file, kMaxConfigBytes);
    if (!text) return Complain(file, text.error().message);
    constexpr int kDeepest = 16;
    const auto parsed = ParseStrictJson(*text, kDeepest);
    if (!parsed) return Complain(file, parsed.error().message);
    const Json& json = *parsed;
    auto findings = FindSchemaProblems("config", json);
    if (!findings) return Complain(file, findings.error().message);
    for (const SchemaFinding& finding : *findings)
      Complain(file + ": " + (finding.pointer.empty() ? "/" : finding.pointer), finding.message);
    if (json.is_object()) ReadFields(json, file);
  }

  // Takes what has the right type; the rest the schema has complained about.
  template <class T>
  static void Take(const Json& object, const char* key, T* value) {
    const auto found = object.find(key);
    if (found == object.end()) return;
    if constexpr (std::is_same_v<T, std::string>) {
      if (found->is_string()) *value = found->get<std::string>();
    } else if constexpr (std::is_floating_point_v<T>) {
      if (found->is_number()) *value = found->get<T>();
    } else {
      // Integral by value is enough for the schema: 1.0 is 1.
      if (found->is_number()) *value = static_cast<T>(found->get<double>());
    }
  }

  static const Json& Object(const Json& json, const char* key) {
    static const Json empty = Json::object();
    const auto found = json.find(key);
    return found != json.end() && found->is_object() ? *found : empty;
  }

  void TakePath(const Json& object, const char* key, const std::string& pointer,
                const std::string& file, std::string* value) {
    const auto found = object.find(key);
    if (found == object.end() || !found->is_string() ||
        found->get_ref<const std::string&>().empty())
      return;
    *value = AbsolutePath(found->get<std::string>(), FolderOf(file));
    origin_[pointer] = file + ": " + pointer;
  }

  void TakePaths(const Json& json, const char* key, const std::string& file,
                 std::vector<std::string>* values) {
    const auto found = json.find(key);
    if (found == json.end() || !found->is_array()) return;
    for (const Json& item : *found) {
      if (item.is_string())
        values->push_back(AbsolutePath(item.get<std::string>(), FolderOf(file)));
    }
    origin_[std::string("/") + key] = file + ": /" + key;
  }

  template <class Enum, class Parse>
  static void TakeNamed(const Json& object, const char* key, Parse parse, Enum* value) {
    std::string name;
    Take(object, key, &name);
    if (name.empty()) return;
    if (auto parsed = parse(name)) *value = *parsed;
  }

  void ReadFields(const Json& json, const std::string& file) {
    Config& c = loaded_.config;
    TakePath(json, "state_dir", "/state_dir", file, &c.state_dir);
    TakePath(json, "out", "/out", file, &c.out);
    TakePath(json, "failed_dir", "/failed_dir", file, &c.failed_dir);
    TakePath(json, "worker", "/worker", file, &c.worker);
    TakePaths(json, "input_roots", file, &c.input_roots);
    TakePaths(json, "output_roots", file, &c.output_roots);
    if (const auto list = json.find("watch"); list != json.end() && list->is_array()) {
      for (size_t i = 0; i < list->size(); ++i) {
        const Json& item = (*list)[i];
        if (!item.is_object()) continue;
        WatchConfig watch;
        TakePath(item, "path", "/watch/" + std::to_string(i) + "/path", file, &watch.path);
        TakeNamed(item, "mode", ParseWatchMode, &watch.mode);
        Take(item, "settle_ms", &watch.settle_ms);
        Take(item, "poll_ms", &watch.poll_ms);
        Take(item, "rescan_s", &watch.rescan_s);
        watch.as_svbrdf = item.value("as", Json()) == "svbrdf";
        if (!watch.path.empty()) c.watch.push_back(watch);
      }
    }
    const Json& job = Object(json, "job");
    TakeNamed(job, "quality", ParseQuality, &c.job.quality);
    TakeNamed(job, "recipe", ParseRecipe, &c.job.recipe);
    TakeNamed(job, "profile", ParseProfile, &c.job.profile);
    Take(job, "seed", &c.job.seed);
    Take(job, "priority", &c.job.priority);
    const Json& api = Object(json, "api");
    TakePath(api, "socket", "/api/socket", file, &c.api.socket);
    TakePath(api, "token_file", "/api/token_file", file, &c.api.token_file);
    Take(api, "max_event_clients", &c.api.max_event_clients);
    Take(api, "max_body_bytes", &c.api.max_body_bytes);
    Take(api, "request_timeout_ms", &c.api.request_timeout_ms);
    if (std::string listen; Take(api, "listen", &listen), !listen.empty())
      SetListen(listen, file + ": /api/listen");
    Take(json, "cores", &c.cores);
    ReadExecutor(json, FolderOf(file), &c.executor);
    Take(json, "nice", &c.nice);
    TakeNamed(json, "sandbox", ParseSandboxMode, &c.sandbox);
    const Json& limits = Object(json, "limits");
    Take(limits, "threads", &c.limits.threads);
    Take(limits, "memory_mb", &c.limits.memory_mb);
    Take(limits, "max_memory_mb", &c.limits.max_memory_mb);
    Take(limits, "cpu_s", &c.limits.cpu_s);
    Take(limits, "wall_s", &c.limits.wall_s);
    Take(limits, "grace_s", &c.limits.grace_s);
    const Json& retry = Object(json, "retry");
    Take(retry, "max_attempts", &c.retry.max_attempts);
    Take(retry, "base_ms", &c.retry.base_ms);
    Take(retry, "max_ms", &c.retry.max_ms);
    Take(retry, "jitter", &c.retry.jitter);
    const Json& retention = Object(json, "retention");
    Take(retention, "revisions", &c.retention.revisions);
    Take(retention, "finished_days", &c.retention.finished_days);
    Take(retention, "finished_jobs", &c.retention.finished_jobs);
    Take(retention, "events", &c.retention.events);
    Take(json, "stop_grace_s", &c.stop_grace_s);
    const Json& log = Object(json, "log");
    TakeNamed(log, "level", ParseLogLevel, &c.log_level);
    TakeNamed(log, "format", ParseLogFormat, &c.log_format);
    for (const char* setting : {"/retry/base_ms", "/limits/max_memory_mb", "/cores"})
      origin_[setting] = file + ": " + setting;
  }

  static std::optional<WatchMode> ParseWatchMode(const std::string& name) {
    for (const WatchMode mode : {WatchMode::kAuto, WatchMode::kInotify, WatchMode::kPolling}) {
      if (name == WatchModeName(mode)) return mode;
    }
    return std::nullopt;
  }
  static std::optional<SandboxMode> ParseSandboxMode(const std::string& name) {
    for (const SandboxMode mode : {SandboxMode::kOff, SandboxMode::kAuto, SandboxMode::kRequire}) {
      if (name == SandboxModeName(mode)) return mode;
    }
    return std::nullopt;
  }

  // ---- Environment and flags

  void SetPath(const std::string& setting, const std::string& where, const std::string& value,
               std::string* target) {
    if (value.empty()) return Complain(where, "is empty; name a path");
    *target = AbsolutePath(value, "");
    origin_[setting] = where;
  }

  void SetListen(const std::string& value, const std::string& where) {
    ApiConfig& api = loaded_.config.api;
    const size_t colon = value.rfind(':');
    std::string host = colon == std::string::npos ? value : value.substr(0, colon);
    const std::string port = colon == std::string::npos ? "" : value.substr(colon + 1);
    if (host.size() > 2 && host.front() == '[' && host.back() == ']')
      host = host.substr(1, host.size() - 2);
    int number = -1;
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), number);
    if (error != std::errc() || end != port.data() + port.size() || number < 0 || number > 65535) {
      return Complain(
          where, QuoteForMessage(value) + " is not an address and a port, like 127.0.0.1:7420");
    }
    origin_["/api/listen"] = where;
    if (!IsLoopback(host)) {
      return Complain(where, QuoteForMessage(host) +
                                 " is not a loopback address; listen on 127.0.0.1 or [::1], and "
                                 "put a proxy in front for others");
    }
    api.listen_host = host;
    api.listen_port = number;
  }

  void SetWatch(const std::vector<std::string>& paths, const std::string& where) {
    // Keeps what the file says of a folder that is named again.
    std::vector<WatchConfig> watch;
    for (size_t i = 0; i < paths.size(); ++i) {
      WatchConfig entry;
      const std::string setting = "/watch/" + std::to_string(i) + "/path";
      SetPath(setting, where, paths[i], &entry.path);
      for (const WatchConfig& old : loaded_.config.watch) {
        if (old.path == entry.path) entry = old;
      }
      if (!entry.path.empty()) watch.push_back(entry);
    }
    loaded_.config.watch = std::move(watch);
  }

  void SetCores(const std::string& text, const std::string& where) {
    int cores = -1;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), cores);
    if (error != std::errc() || end != text.data() + text.size() || cores < 0 || cores > 1024) {
      return Complain(where,
                      "must be a whole number between 0 and 1024; is " + QuoteForMessage(text));
    }
    loaded_.config.cores = cores;
    origin_["/cores"] = where;
  }

  void SetLogging(const std::string* level, const std::string* format, const std::string& level_at,
                  const std::string& format_at) {
    if (level != nullptr) {
      if (const auto parsed = ParseLogLevel(*level)) {
        loaded_.config.log_level = *parsed;
      } else {
        Complain(level_at, "must be debug, info, warning or error; is " + QuoteForMessage(*level));
      }
    }
    if (format != nullptr) {
      if (const auto parsed = ParseLogFormat(*format)) {
        loaded_.config.log_format = *parsed;
      } else {
        Complain(format_at, "must be json or text; is " + QuoteForMessage(*format));
      }
    }
  }

  const std::string* Variable(const std::string& name) const {
    const auto found = environment_.find(name);
    return found == environment_.end() ? nullptr : &found->second;
  }

  void ApplyEnvironment() {
    Config& c = loaded_.config;
    const std::pair<const char*, std::pair<const char*, std::string*>> paths[] = {
        {"PATINA_STATE_DIR", {"/state_dir", &c.state_dir}},
        {"PATINA_OUT", {"/out", &c.out}},
        {"PATINA_FAILED_DIR", {"/failed_dir", &c.failed_dir}},
        {"PATINA_SOCKET", {"/api/socket", &c.api.socket}},
        {"PATINA_TOKEN_FILE", {"/api/token_file", &c.api.token_file}},
        {"PATINA_WORKER", {"/worker", &c.worker}}};
    std::vector<std::string> known{"PATINA_WATCH",     "PATINA_LISTEN",     "PATINA_CORES",
                                   "PATINA_LOG_LEVEL", "PATINA_LOG_FORMAT", "PATINA_CONFIG",
                                   "PATINA_SIMD"};
    for (const auto& [name, setting] : paths) {
      known.emplace_back(name);
      if (const std::string* value = Variable(name))
        SetPath(setting.first, name, *value, setting.second);
    }
    if (const std::string* value = Variable("PATINA_WATCH")) {
      std::vector<std::string> folders;
      for (size_t at = 0; at <= value->size();) {
        const size_t end = std::min(value->find(':', at), value->size());
        if (end > at) folders.push_back(value->substr(at, end - at));
        at = end + 1;
      }
      SetWatch(folders, "PATINA_WATCH");
    }
    if (const std::string* value = Variable("PATINA_LISTEN")) SetListen(*value, "PATINA_LISTEN");
    if (const std::string* value = Variable("PATINA_CORES")) SetCores(*value, "PATINA_CORES");
    SetLogging(Variable("PATINA_LOG_LEVEL"), Variable("PATINA_LOG_FORMAT"), "PATINA_LOG_LEVEL",
               "PATINA_LOG_FORMAT");
    for (const auto& [name, value] : environment_) {
      if (name.rfind("PATINA_", 0) == 0 &&
          std::find(known.begin(), known.end(), name) == known.end()) {
        Warn(name, "is not a variable that patinad knows; it is passed over");
      }
    }
  }

  void ApplyFlags(const ConfigOverrides& flags) {
    Config& c = loaded_.config;
    if (flags.state_dir) SetPath("/state_dir", "--state", *flags.state_dir, &c.state_dir);
    if (flags.out) SetPath("/out", "--out", *flags.out, &c.out);
    if (flags.failed_dir) SetPath("/failed_dir", "--failed", *flags.failed_dir, &c.failed_dir);
    if (flags.socket) SetPath("/api/socket", "--socket", *flags.socket, &c.api.socket);
    if (flags.token_file)
      SetPath("/api/token_file", "--token-file", *flags.token_file, &c.api.token_file);
    if (flags.worker) SetPath("/worker", "--worker", *flags.worker, &c.worker);
    if (flags.listen) SetListen(*flags.listen, "--listen");
    if (flags.cores) SetCores(*flags.cores, "--cores");
    if (!flags.watch.empty()) SetWatch(flags.watch, "--watch");
    SetLogging(flags.log_level ? &*flags.log_level : nullptr,
               flags.log_format ? &*flags.log_format : nullptr, "--log-level", "--log-format");
  }

  // ---- What nobody has said

  void FillDefaults() {
    Config& c = loaded_.config;
    if (c.state_dir.empty()) {
      const std::string* systemd = Variable("STATE_DIRECTORY");
      const std::string* xdg = Variable("XDG_STATE_HOME");
      const std::string* home = Variable("HOME");
      if (systemd != nullptr && !systemd->empty()) {
        c.state_dir = systemd->substr(0, systemd->find(':'));
      } else if (xdg != nullptr && !xdg->empty() && xdg->front() == '/') {
        c.state_dir = AbsolutePath(*xdg + "/patina", "");
      } else if (home != nullptr && !home->empty() && home->front() == '/') {
        c.state_dir = AbsolutePath(*home + "/.local/state/patina", "");
      } else {
        Complain("/state_dir", "is missing, and so is $HOME; give --state DIR");
      }
    }
    if (c.api.socket.empty() && !c.state_dir.empty()) c.api.socket = c.state_dir + "/patinad.sock";
    if (!c.api.listen_host.empty() && c.api.token_file.empty() && !c.state_dir.empty()) {
      c.api.token_file = c.state_dir + "/token";
      c.api.makes_token = true;
    }
    if (c.worker.empty()) c.worker = FindWorker(Variable("PATH"));
    const int usable = UsableCores();
    if (c.cores > usable && !OnFarm(c)) {
      Warn(WhereIs("/cores"), std::to_string(c.cores) + " cores are more than the " +
                                  std::to_string(usable) + " that patinad may use");
    }
    if (c.cores == 0) c.cores = usable;
  }

  // ---- What fits together

  void Check() {
    Config& c = loaded_.config;
    if (c.out.empty())
      Complain("/out", "is missing: where shall the containers go? Give --out DIR");
    struct stat info;
    for (size_t i = 0; i < c.watch.size(); ++i) {
      const std::string& path = c.watch[i].path;
      const std::string where = WhereIs("/watch/" + std::to_string(i) + "/path");
      if (::stat(path.c_str(), &info) != 0 || !S_ISDIR(info.st_mode)) {
        Complain(where, path + " is not a folder; make it first");
        continue;
      }
      for (size_t j = 0; j < c.watch.size(); ++j) {
        if (j != i && IsWithin(path, c.watch[j].path) && (path != c.watch[j].path || j < i))
          Complain(where, path + " lies in " + c.watch[j].path + ", which is watched as well");
      }
      if (!c.out.empty() && IsWithin(path, c.out)) {
        Complain(where, path + " lies in the output folder " + c.out +
                            ": containers would be baked again; keep them apart");
      }
      if (!c.state_dir.empty() && IsWithin(c.state_dir, path)) {
        Complain(WhereIs("/state_dir"),
                 c.state_dir + " lies in the watched folder " + path + "; keep them apart");
      }
    }
    for (const std::string& root : c.input_roots) {
      if (::stat(root.c_str(), &info) != 0)
        Warn(WhereIs("/input_roots"), root + " does not exist yet");
    }
    if (c.worker.empty() || ::access(c.worker.c_str(), X_OK) != 0) {
      Complain(WhereIs("/worker"),
               c.worker.empty()
                   ? "there is no `patina` beside patinad or in $PATH; give --worker FILE"
                   : c.worker + " is not a program that can be run; name the `patina` program");
    }
    if (c.api.socket.size() >= sizeof(sockaddr_un::sun_path)) {
      Complain(WhereIs("/api/socket"), c.api.socket + " is longer than a socket's path may be (" +
                                           std::to_string(sizeof(sockaddr_un::sun_path) - 1) +
                                           " bytes); give --socket");
    }
    CheckToken();
    for (const std::string& problem : ExecutorProblems(c.executor)) {
      // Each begins with its pointer.
      const size_t end = problem.find(' ');
      Complain(c.file + ": " + problem.substr(0, end), problem.substr(end + 1));
    }
    if (OnFarm(c) && c.sandbox == SandboxMode::kRequire)
      Complain(WhereIs("/sandbox"),
               "a farm's nodes have no sandbox of patinad; set it to \"auto\"");
    if (c.retry.base_ms > c.retry.max_ms) {
      Complain(WhereIs("/retry/base_ms"),
               "must not be larger than /retry/max_ms: " + std::to_string(c.retry.base_ms) + " > " +
                   std::to_string(c.retry.max_ms));
    }
    if (c.limits.max_memory_mb > 0 && c.limits.max_memory_mb < c.limits.memory_mb) {
      Complain(WhereIs("/limits/max_memory_mb"), "must not be smaller than /limits/memory_mb: " +
                                                     std::to_string(c.limits.max_memory_mb) +
                                                     " < " + std::to_string(c.limits.memory_mb));
    }
  }

  void CheckToken() {
    const ApiConfig& api = loaded_.config.api;
    if (api.listen_host.empty() || api.token_file.empty()) return;
    const std::string where = WhereIs("/api/token_file");
    struct stat info;
    if (::stat(api.token_file.c_str(), &info) != 0) {
      if (api.makes_token && errno == ENOENT) return;
      return Complain(where, FailErrno(errno, "cannot open", api.token_file).value().message);
    }
    if ((info.st_mode & 077) != 0) {
      return Complain(where,
                      api.token_file + " can be read by others; chmod 600 " + api.token_file);
    }
    auto text = ReadTextFile(api.token_file, 4096);
    if (!text) return Complain(where, text.error().message);
    if (std::count_if(text->begin(), text->end(), [](unsigned char ch) { return ch > ' '; }) < 16)
      Complain(where, api.token_file + " holds fewer than 16 characters; write a longer token");
  }

  LoadedConfig loaded_;
  std::map<std::string, std::string> environment_;
  std::map<std::string, std::string> origin_;
};

}  // namespace

const char* WatchModeName(WatchMode mode) {
  switch (mode) {
    case WatchMode::kAuto:
      return "auto";
    case WatchMode::kInotify:
      return "inotify";
    case WatchMode::kPolling:
      return "polling";
  }
  return "auto";
}

LoadedConfig LoadConfig(const std::string& file, const std::vector<std::string>& environment,
                        const ConfigOverrides& flags) {
  return Loader(environment).Load(file, flags);
}

std::string ConfigToJson(const Config& c) {
  nlohmann::ordered_json json;
  json["version"] = 1;
  json["state_dir"] = c.state_dir;
  json["out"] = c.out;
  json["watch"] = nlohmann::ordered_json::array();
  for (const WatchConfig& watch : c.watch) {
    json["watch"].push_back({{"path", watch.path},
                             {"mode", WatchModeName(watch.mode)},
                             {"settle_ms", watch.settle_ms},
                             {"poll_ms", watch.poll_ms},
                             {"rescan_s", watch.rescan_s},
                             {"as", watch.as_svbrdf ? "svbrdf" : "material"}});
  }
  if (!c.failed_dir.empty()) json["failed_dir"] = c.failed_dir;
  json["input_roots"] = c.input_roots;
  json["output_roots"] = c.output_roots;
  json["job"] = {{"quality", QualityName(c.job.quality)},
                 {"recipe", RecipeName(c.job.recipe)},
                 {"profile", ProfileName(c.job.profile)},
                 {"seed", c.job.seed},
                 {"priority", c.job.priority}};
  json["api"] = {{"socket", c.api.socket}};
  if (!c.api.listen_host.empty()) {
    const bool v6 = c.api.listen_host.find(':') != std::string::npos;
    json["api"]["listen"] = (v6 ? "[" + c.api.listen_host + "]" : c.api.listen_host) + ":" +
                            std::to_string(c.api.listen_port);
  }
  if (!c.api.token_file.empty()) json["api"]["token_file"] = c.api.token_file;
  json["api"]["max_event_clients"] = c.api.max_event_clients;
  json["api"]["max_body_bytes"] = c.api.max_body_bytes;
  json["api"]["request_timeout_ms"] = c.api.request_timeout_ms;
  json["worker"] = c.worker;
  json["cores"] = c.cores;
  json["nice"] = c.nice;
  json["sandbox"] = SandboxModeName(c.sandbox);
  json["executor"] = ExecutorToJson(c.executor);
  json["limits"] = {{"threads", c.limits.threads},
                    {"memory_mb", c.limits.memory_mb},
                    {"max_memory_mb", c.limits.max_memory_mb},
                    {"cpu_s", c.limits.cpu_s},
                    {"wall_s", c.limits.wall_s},
                    {"grace_s", c.limits.grace_s}};
  json["retry"] = {{"max_attempts", c.retry.max_attempts},
                   {"base_ms", c.retry.base_ms},
                   {"max_ms", c.retry.max_ms},
                   {"jitter", c.retry.jitter}};
  json["retention"] = {{"revisions", c.retention.revisions},
                       {"finished_days", c.retention.finished_days},
                       {"finished_jobs", c.retention.finished_jobs},
                       {"events", c.retention.events}};
  json["stop_grace_s"] = c.stop_grace_s;
  json["log"] = {{"level", LogLevelName(c.log_level)},
                 {"format", c.log_format == LogFormat::kJson ? "json" : "text"}};
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::vector<std::string> RestartOnlyChanges(const Config& before, const Config& after) {
  const auto part = [](const Config& config, const char* key) {
    const Json json = Json::parse(ConfigToJson(config), nullptr, false);
    const auto found = json.find(key);
    return found == json.end() ? Json() : *found;
  };
  std::vector<std::string> names;
  for (const char* key :
       {"state_dir", "out", "watch", "api", "worker", "nice", "sandbox", "executor"}) {
    if (part(before, key) != part(after, key)) names.emplace_back(key);
  }
  return names;
}

}  // namespace patina::daemon
