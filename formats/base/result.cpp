#include "formats/base/result.h"

#include <cstdio>
#include <cstdlib>

#include "formats/base/check.h"

namespace patina {

const char* ErrorCodeName(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument: return "invalid_argument";
    case ErrorCode::kNotFound: return "not_found";
    case ErrorCode::kConflict: return "conflict";
    case ErrorCode::kCorruptData: return "corrupt_data";
    case ErrorCode::kUnsupported: return "unsupported";
    case ErrorCode::kOutOfRange: return "out_of_range";
    case ErrorCode::kResourceExhausted: return "resource_exhausted";
    case ErrorCode::kIo: return "io";
    case ErrorCode::kCancelled: return "cancelled";
    case ErrorCode::kTimeout: return "timeout";
    case ErrorCode::kInternal: return "internal";
  }
  return "internal";
}

void CheckFailed(const char* file, int line, const char* expression) {
  std::fprintf(stderr, "patina: internal error at %s:%d: %s\n", file, line, expression);
  std::abort();
}

}  // namespace patina
