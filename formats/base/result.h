// Result<T> and Status: how anything that the world can break reports it.
//
// Our own bugs abort through PATINA_CHECK (check.h); bytes from outside never reach a check.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace patina {

// What the caller should do about an error. Closed set; the names reach JSON (see ErrorCodeName).
enum class ErrorCode {
  kInvalidArgument,    // the request is wrong: correct it and ask again
  kNotFound,           // the named thing is not there
  kConflict,           // the thing exists, or two claims exclude each other
  kCorruptData,        // the bytes are not what their format says
  kUnsupported,        // well formed, but not something this version handles
  kOutOfRange,         // a value or size beyond a stated limit
  kResourceExhausted,  // memory, disk or descriptors ran out
  kIo,                 // the operating system refused a read or write
  kCancelled,          // somebody asked to stop
  kTimeout,            // a stated time ran out
  kInternal            // our fault
};

// "invalid_argument", "not_found", ... as written to JSON; never reused for another meaning.
const char* ErrorCodeName(ErrorCode code);

struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;  // what, where (file, JSON pointer or byte offset), the offending value, the remedy
};

// A value or an Error. Dereference only after testing.
template <class T>
class [[nodiscard]] Result : public tl::expected<T, Error> {
 public:
  using tl::expected<T, Error>::expected;
};

using Status = Result<void>;

inline tl::unexpected<Error> Fail(ErrorCode code, std::string message) {
  return tl::unexpected<Error>(Error{code, std::move(message)});
}

// The same error with "context: " put in front of its message.
inline tl::unexpected<Error> Fail(Error error, const std::string& context) {
  error.message = context + ": " + error.message;
  return tl::unexpected<Error>(std::move(error));
}
inline tl::unexpected<Error> Fail(Error error) { return tl::unexpected<Error>(std::move(error)); }

}  // namespace patina

#define PATINA_CONCAT_INNER(a, b) a##b
#define PATINA_CONCAT(a, b) PATINA_CONCAT_INNER(a, b)

// Returns the error of a Status or Result expression to the caller.
#define PATINA_TRY(expr)                                                     \
  do {                                                                       \
    auto patina_try_status = (expr);                                         \
    if (!patina_try_status) return ::patina::Fail(std::move(patina_try_status).error()); \
  } while (false)

// `PATINA_ASSIGN(auto x, F());` declares x from the value of a Result or returns its error.
#define PATINA_ASSIGN(lhs, expr) PATINA_ASSIGN_INNER(PATINA_CONCAT(patina_result_, __LINE__), lhs, expr)
#define PATINA_ASSIGN_INNER(tmp, lhs, expr)                  \
  auto tmp = (expr);                                         \
  if (!tmp) return ::patina::Fail(std::move(tmp).error());   \
  lhs = std::move(*tmp)
