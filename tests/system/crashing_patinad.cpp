// patinad that kills itself, as kill -9 would, before the N-th change of a file: one of its own
// (FileCalls) or one of SQLite's. N is in $CRASH_AT; without it, it never does.
#include <signal.h>

#include <atomic>
#include <cstdlib>

#include "daemon/daemon.h"
#include "tests/daemon/base/failing_file_calls.h"
#include "tests/daemon/queue/failing_vfs.h"

namespace patina::daemon::test {
namespace {

std::atomic<int> left{-1};

void Count() {
  if (left >= 0 && left-- == 0) ::raise(SIGKILL);
}

class CrashingFileCalls : public FailingFileCalls {
 public:
  CrashingFileCalls() : FailingFileCalls(-1) {}

 protected:
  void OnCall() override { Count(); }
};

}  // namespace
}  // namespace patina::daemon::test

int main(int argc, char** argv) {
  using namespace patina::daemon::test;  // NOLINT(google-build-using-namespace)
  if (const char* at = std::getenv("CRASH_AT")) left = std::atoi(at);
  UseWatchedVfs(&Count);
  CrashingFileCalls files;
  return patina::daemon::DaemonMain(argc, argv, files);
}
