// What the scheduler lets others see: counters, progress, and what is wrong.
#pragma once

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/service/service.h"

namespace patina::daemon {

// A histogram without counts yet.
Histogram EmptyHistogram(std::vector<double> bounds);
void Observe(double value, Histogram* histogram);

// Thread-safe.
class Board {
 public:
  Board();

  // change(ServiceMetrics&), with the lock held.
  template <class Change>
  void Count(Change change) {
    const std::lock_guard lock(mutex_);
    change(metrics_);
  }
  ServiceMetrics metrics() const;

  void SetProgress(int64_t job, const JobProgress& progress);
  void ForgetProgress(int64_t job);
  std::optional<JobProgress> progress(int64_t job) const;

  void SetCores(int used, int budget);
  std::pair<int, int> cores() const;  // used, budget

  // A problem that lasts, by a name; an empty text ends it.
  void SetProblem(const std::string& name, const std::string& text);
  std::vector<std::string> problems() const;

 private:
  mutable std::mutex mutex_;
  ServiceMetrics metrics_;
  std::map<int64_t, JobProgress> progress_;
  std::map<std::string, std::string> problems_;
};

}  // namespace patina::daemon
