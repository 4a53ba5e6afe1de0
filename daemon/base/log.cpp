#include "daemon/base/log.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "daemon/base/clock.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::ordered_json;

bool IsBare(std::string_view text) {
  if (text.empty()) return false;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("_-./:+,@%").find(c) != std::string_view::npos;
    if (!plain) return false;
  }
  return true;
}

std::string Dump(const Json& value) {
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

const char* LogLevelName(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return "debug";
    case LogLevel::kInfo:
      return "info";
    case LogLevel::kWarning:
      return "warning";
    case LogLevel::kError:
      return "error";
  }
  return "error";
}

std::optional<LogLevel> ParseLogLevel(std::string_view name) {
  for (const LogLevel level :
       {LogLevel::kDebug, LogLevel::kInfo, LogLevel::kWarning, LogLevel::kError}) {
    if (name == LogLevelName(level)) return level;
  }
  return std::nullopt;
}

std::optional<LogFormat> ParseLogFormat(std::string_view name) {
  if (name == "text") return LogFormat::kText;
  if (name == "json") return LogFormat::kJson;
  return std::nullopt;
}

void Logger::Configure(LogLevel least, LogFormat format) {
  const std::lock_guard lock(mutex_);
  least_ = least;
  format_ = format;
}

void Logger::Write(LogLevel level, const char* event, std::initializer_list<LogField> fields) {
  const std::lock_guard lock(mutex_);
  if (fd_ < 0 || level < least_) return;
  Json entry{
      {"time", Rfc3339(SystemClock().WallMs())}, {"level", LogLevelName(level)}, {"event", event}};
  for (const LogField& field : fields) {
    switch (field.kind_) {
      case LogField::Kind::kText:
        entry[field.key_] = std::string(field.text_);
        break;
      case LogField::Kind::kInteger:
        entry[field.key_] = field.integer_;
        break;
      case LogField::Kind::kReal:
        entry[field.key_] = field.real_;
        break;
      case LogField::Kind::kFlag:
        entry[field.key_] = field.integer_ != 0;
        break;
    }
  }
  std::string line;
  if (format_ == LogFormat::kJson) {
    line = Dump(entry);
  } else {
    for (const auto& [key, value] : entry.items()) {
      const bool bare = value.is_string() && IsBare(value.get_ref<const std::string&>());
      const std::string shown = bare ? value.get<std::string>() : Dump(value);
      line += line.empty()                       ? shown
              : key == "level" || key == "event" ? " " + shown
                                                 : " " + key + "=" + shown;
    }
  }
  line += '\n';
  ssize_t n;
  do {
    n = ::write(fd_, line.data(), line.size());
  } while (n < 0 && errno == EINTR);
}

Logger& NoLog() {
  static Logger log(-1, LogLevel::kError, LogFormat::kText);
  return log;
}

}  // namespace patina::daemon
