// PATINA_CHECK aborts on a broken invariant of our own, in every build type. Never use it on outside data.
#pragma once

namespace patina {
[[noreturn]] void CheckFailed(const char* file, int line, const char* expression);
}

#define PATINA_CHECK(condition)                                               \
  do {                                                                        \
    if (!(condition)) [[unlikely]] ::patina::CheckFailed(__FILE__, __LINE__, #condition); \
  } while (false)
