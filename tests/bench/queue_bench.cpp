// What the daemon's queue does in a second: durable submissions, one commit each, and pages of a
// long list.
//
// usage: patina_queue_bench [FOLDER]     the folder decides which disk; default: the working folder
#include <sqlite3.h>
#include <stdlib.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/queue/job_store.h"

namespace {

using patina::daemon::JobFilter;
using patina::daemon::JobState;
using patina::daemon::JobStore;
using patina::daemon::NewJob;

constexpr int kRuns = 7;
constexpr int kSubmissions = 300;
constexpr int kJobs = 100000;

double Seconds(const std::chrono::steady_clock::time_point& start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void Print(const char* what, std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::printf("%-46s median %9.2f   least %9.2f   most %9.2f\n", what, values[values.size() / 2],
              values.front(), values.back());
}

NewJob Sample(int i) {
  NewJob job;
  job.asset = "asset" + std::to_string(i);
  job.kind = "material";
  job.out = "/srv/patina/baked";
  job.source = "/srv/patina/drop/" + job.asset;
  job.job_json = R"({"version": 1, "kind": "material", "asset": ")" + job.asset +
                 R"(", "folder": ")" + job.source + R"(", "out": "/srv/patina/baked"})";
  return job;
}

int Run(const std::string& path) {
  auto store = JobStore::Open(path);
  if (!store) {
    std::fprintf(stderr, "queue_bench: %s\n", store.error().message.c_str());
    return 1;
  }
  std::vector<double> rates;
  int submitted = 0;
  for (int run = 0; run < kRuns; ++run) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < kSubmissions; ++i) {
      if (!(*store)->Submit(Sample(submitted++), 1)) return 1;
    }
    rates.push_back(kSubmissions / Seconds(start));
  }
  Print("durable submissions a second", rates);
  store->reset();

  // Filling it the same way would take minutes and show nothing more.
  sqlite3* database = nullptr;
  sqlite3_open(path.c_str(), &database);
  const std::string fill =
      "INSERT INTO jobs (asset, kind, out, origin, state, priority, threads, memory_mb, cpu_s, "
      "wall_s, force, created_ms, updated_ms, request_sha256, job) WITH RECURSIVE n(i) AS (SELECT "
      "1 UNION ALL SELECT i + 1 FROM n WHERE i < " +
      std::to_string(kJobs - submitted) +
      ") SELECT 'filler' || i, kind, out, origin, 1, 0, 1, 0, 0, 0, 0, 1, 1, request_sha256, job "
      "FROM n, jobs WHERE jobs.id = 1";
  const int code = sqlite3_exec(database, fill.c_str(), nullptr, nullptr, nullptr);
  sqlite3_close(database);
  if (code != SQLITE_OK) return 1;
  store = JobStore::Open(path);
  if (!store) return 1;
  std::vector<double> newest, middle, counts, runnable, more;
  for (int run = 0; run < kRuns; ++run) {
    JobFilter filter;
    filter.states = {JobState::kQueued};
    auto start = std::chrono::steady_clock::now();
    if (!(*store)->List(filter)) return 1;
    newest.push_back(1000 * Seconds(start));
    filter.before = kJobs / 2;
    start = std::chrono::steady_clock::now();
    if (!(*store)->List(filter)) return 1;
    middle.push_back(1000 * Seconds(start));
    start = std::chrono::steady_clock::now();
    if (!(*store)->Counts()) return 1;
    counts.push_back(1000 * Seconds(start));
    start = std::chrono::steady_clock::now();
    if (!(*store)->Runnable(64)) return 1;
    runnable.push_back(1000 * Seconds(start));
    start = std::chrono::steady_clock::now();
    for (int i = 0; i < kSubmissions; ++i) {
      if (!(*store)->Submit(Sample(submitted++), 1)) return 1;
    }
    more.push_back(kSubmissions / Seconds(start));
  }
  Print("100,000 jobs: the newest 100, ms", newest);
  Print("100,000 jobs: 100 from the middle, ms", middle);
  Print("100,000 jobs: counts by state, ms", counts);
  Print("100,000 jobs: the next 64 to run, ms", runnable);
  Print("100,000 jobs: durable submissions a second", more);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::string folder = std::string(argc > 1 ? argv[1] : ".") + "/patina_queue_bench_XXXXXX";
  if (mkdtemp(folder.data()) == nullptr) {
    std::perror("queue_bench");
    return 1;
  }
  const int result = Run(folder + "/queue.db");
  std::filesystem::remove_all(folder);
  return result;
}
