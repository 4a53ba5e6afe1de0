// Structured log: one line an entry, as JSON or as key=value text, to a descriptor.
//
//   log.Info("job_started", {{"job", id}, {"attempt", attempt}, {"asset", asset}});
#pragma once

#include <cstdint>
#include <initializer_list>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

namespace patina::daemon {

enum class LogLevel { kDebug = 0, kInfo = 1, kWarning = 2, kError = 3 };
enum class LogFormat { kText, kJson };

const char* LogLevelName(LogLevel level);  // "debug", "info", "warning", "error"
std::optional<LogLevel> ParseLogLevel(std::string_view name);
std::optional<LogFormat> ParseLogFormat(std::string_view name);  // "text", "json"

// One member of an entry: a number, a truth value, or text of any bytes.
class LogField {
 public:
  LogField(const char* key, std::string_view text) : key_(key), kind_(Kind::kText), text_(text) {}
  LogField(const char* key, const char* text) : LogField(key, std::string_view(text)) {}
  LogField(const char* key, const std::string& text) : LogField(key, std::string_view(text)) {}
  LogField(const char* key, double value) : key_(key), kind_(Kind::kReal), real_(value) {}
  template <class T, class = std::enable_if_t<std::is_integral_v<T>>>
  LogField(const char* key, T value)
      : key_(key),
        kind_(std::is_same_v<T, bool> ? Kind::kFlag : Kind::kInteger),
        integer_(static_cast<int64_t>(value)) {}

 private:
  friend class Logger;
  enum class Kind { kText, kInteger, kReal, kFlag };
  const char* key_;
  Kind kind_;
  std::string_view text_;
  int64_t integer_ = 0;
  double real_ = 0;
};

// Thread-safe; each entry is one write(2). A write that fails is dropped: a full disk or a reader
// that went away must not stop the daemon.
class Logger {
 public:
  // fd stays the caller's; -1 swallows everything.
  Logger(int fd, LogLevel least, LogFormat format) : fd_(fd), least_(least), format_(format) {}
  Logger(const Logger&) = delete;
  Logger& operator=(const Logger&) = delete;

  void Configure(LogLevel least, LogFormat format);

  // event: a name in snake_case that never changes its meaning. In JSON: {"time": ..., "level":
  // ..., "event": ..., fields}; the time is UTC, RFC 3339 with milliseconds.
  void Write(LogLevel level, const char* event, std::initializer_list<LogField> fields);

  void Debug(const char* event, std::initializer_list<LogField> fields = {}) {
    Write(LogLevel::kDebug, event, fields);
  }
  void Info(const char* event, std::initializer_list<LogField> fields = {}) {
    Write(LogLevel::kInfo, event, fields);
  }
  void Warning(const char* event, std::initializer_list<LogField> fields = {}) {
    Write(LogLevel::kWarning, event, fields);
  }
  void Error(const char* event, std::initializer_list<LogField> fields = {}) {
    Write(LogLevel::kError, event, fields);
  }

 private:
  std::mutex mutex_;
  int fd_;
  LogLevel least_;
  LogFormat format_;
};

// Swallows everything; for tests.
Logger& NoLog();

}  // namespace patina::daemon
