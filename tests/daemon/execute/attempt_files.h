// Attempts of the fake worker (fake_worker.cpp), as the service describes them on the disk.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "daemon/execute/executor.h"
#include "pipeline/jobs/run_guards.h"
#include "tests/formats/test_support.h"

namespace patina::daemon::test {

// What a worker that is built with a sanitizer must know of this process's environment.
inline std::vector<std::string> SanitizerEnvironment() {
  std::vector<std::string> entries;
  for (const char* name : {"ASAN_OPTIONS", "UBSAN_OPTIONS", "TSAN_OPTIONS"}) {
    if (const char* value = std::getenv(name)) entries.push_back(std::string(name) + "=" + value);
  }
  return entries;
}

// An attempt whose worker behaves like this: job 7, with its folder `job` below `folder` and its
// input and output beside that.
inline AttemptSpec PrepareAttempt(const patina::test::TemporaryDirectory& folder,
                                  const std::string& behaviour, int64_t attempt) {
  AttemptSpec spec;
  spec.job = 7;
  spec.attempt = attempt;
  spec.folder = folder / ("job/a" + std::to_string(attempt));
  spec.fence = folder / "job/fence";
  spec.log = folder / "job/log";
  spec.out = folder / "out";
  spec.asset = "wall";
  spec.inputs = {folder / "in"};
  for (const std::string& made : {spec.folder, spec.out + "/wall", folder / "in"})
    std::filesystem::create_directories(made);
  std::ofstream(folder / "in/input.png") << "content";
  std::ofstream(folder / "in/behaviour") << "0 " << behaviour << "\n";
  std::ofstream(spec.folder + "/job.json")
      << R"({"version": 1, "kind": "material", "asset": "wall", "folder": ")" << (folder / "in")
      << R"(", "out": ")" << spec.out << R"("})";
  EXPECT_TRUE(MoveFence(spec.fence, attempt));
  return spec;
}

}  // namespace patina::daemon::test
