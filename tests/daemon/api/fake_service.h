// A service without a daemon: jobs live in a map and never run.
#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/service/service.h"

namespace patina::daemon {

class FakeService : public Service {
 public:
  FakeService();

  // An event for every listener; kept ones have an id.
  void Publish(const std::string& type, int64_t job, const std::string& data, bool keep = true);
  // Events up to this id are no longer kept.
  void Forget(int64_t id);
  void Close();
  void Add(int64_t id);  // a queued job
  void Change(int64_t id, JobState state);
  int subscribers() const;

  Result<Submitted> Submit(const SubmitRequest& request) override;
  Result<JobView> Get(int64_t id) override;
  Result<JobViewPage> List(const JobFilter& filter) override;
  Result<JobState> Cancel(int64_t id) override;
  Status Retry(int64_t id) override;
  Status SetHeld(int64_t id, bool held) override;
  Status SetPriority(int64_t id, int priority) override;
  Status SetQueuePaused(bool paused) override;
  Result<LogChunk> ReadLog(int64_t id, int64_t offset, size_t max_bytes) override;
  Result<std::vector<CurvePoint>> Curve(int64_t id) override;
  Result<std::unique_ptr<Subscription>> Subscribe(std::optional<int64_t> after,
                                                  int64_t job) override;
  Result<OfferOutcome> OfferAsset(const AssetOffer& offer) override;
  Status WithdrawAsset(const std::string& name) override;
  Result<std::vector<AssetView>> Assets(const std::string& after_name, int limit) override;
  Result<AssetView> GetAsset(const std::string& name) override;
  void AttachSource(AssetSource* source) override;
  Result<ServiceStatus> GetStatus() override;
  Result<ServiceMetrics> GetMetrics() override;
  Status Ready() override;

  std::map<int64_t, JobView> jobs;
  std::vector<SubmitRequest> submitted;
  std::map<std::string, AssetView> assets;
  std::vector<WatchedRoot> roots = {{"/drop", "inotify", "ext4", 3, 4}};
  std::optional<Error> failure;  // of every call that can fail
  std::string log = "line 1\nline 2\n";

 private:
  class Listener;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Event> events_;
  int64_t forgotten_ = 0, last_id_ = 0;
  int subscribers_ = 0;
  bool closed_ = false;
};

}  // namespace patina::daemon
