#include <cstdio>
#include <exception>

#include "daemon/daemon.h"
#include "pipeline/jobs/job_result.h"

int main(int argc, char** argv) {
  try {
    return patina::daemon::DaemonMain(argc, argv, patina::daemon::RealFileCalls());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "patinad: error: unexpected failure: %s\n", error.what());
  } catch (...) {
    std::fprintf(stderr, "patinad: error: unexpected failure\n");
  }
  return patina::kExitFailed;
}
