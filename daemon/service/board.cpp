#include "daemon/service/board.h"

namespace patina::daemon {

Histogram EmptyHistogram(std::vector<double> bounds) {
  Histogram histogram;
  histogram.counts.resize(bounds.size() + 1);
  histogram.bounds = std::move(bounds);
  return histogram;
}

void Observe(double value, Histogram* histogram) {
  const auto bucket = std::lower_bound(histogram->bounds.begin(), histogram->bounds.end(), value) -
                      histogram->bounds.begin();
  ++histogram->counts[static_cast<size_t>(bucket)];
  ++histogram->count;
  histogram->sum += value;
}

Board::Board() {
  metrics_.queue_seconds = EmptyHistogram({0.1, 1, 10, 60, 600, 3600});
  metrics_.job_seconds = EmptyHistogram({1, 5, 15, 60, 300, 1800});
}

ServiceMetrics Board::metrics() const {
  const std::lock_guard lock(mutex_);
  return metrics_;
}

void Board::SetProgress(int64_t job, const JobProgress& progress) {
  const std::lock_guard lock(mutex_);
  progress_[job] = progress;
}

void Board::ForgetProgress(int64_t job) {
  const std::lock_guard lock(mutex_);
  progress_.erase(job);
}

std::optional<JobProgress> Board::progress(int64_t job) const {
  const std::lock_guard lock(mutex_);
  const auto found = progress_.find(job);
  return found == progress_.end() ? std::nullopt : std::optional(found->second);
}

void Board::SetCores(int used, int budget) {
  const std::lock_guard lock(mutex_);
  metrics_.cores_used = used;
  metrics_.cores = budget;
}

std::pair<int, int> Board::cores() const {
  const std::lock_guard lock(mutex_);
  return {metrics_.cores_used, metrics_.cores};
}

void Board::SetProblem(const std::string& name, const std::string& text) {
  const std::lock_guard lock(mutex_);
  if (text.empty()) {
    problems_.erase(name);
  } else {
    problems_[name] = text;
  }
}

std::vector<std::string> Board::problems() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> texts;
  for (const auto& [name, text] : problems_) texts.push_back(text);
  return texts;
}

}  // namespace patina::daemon
