#include "daemon/drop_folders.h"

#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <shared_mutex>
#include <vector>

#include "daemon/base/clock.h"
#include "daemon/watch/watcher.h"
#include "pipeline/jobs/as_reflectance.h"
#include "pipeline/jobs/drop_jobs.h"

namespace patina::daemon {
namespace {

std::string ParentOf(const std::string& path) {
  return std::filesystem::path(path).parent_path().string();
}

class WatchedFolders : public DropFolders, public AssetSource {
 public:
  WatchedFolders(Service& service, Logger& log) : service_(service), log_(log) {}

  ~WatchedFolders() override {
    // Status calls end here; then the watchers, whose handlers may still call the service.
    service_.AttachSource(nullptr);
    const std::lock_guard lock(mutex_);
    watchers_.clear();
  }

  Status Open(const Config& config) {
    for (const WatchConfig& watch : config.watch) {
      WatchOptions options;
      // Without links, as the paths of assets are.
      std::error_code ignored;
      const std::string root = std::filesystem::weakly_canonical(watch.path, ignored).string();
      options.root = ignored ? watch.path : root;
      options.exclude = {config.out, config.state_dir, WorkFolderOf(config)};
      options.exclude.insert(options.exclude.end(), config.output_roots.begin(),
                             config.output_roots.end());
      if (!config.failed_dir.empty()) options.exclude.push_back(config.failed_dir);
      options.mode = watch.mode;
      options.settle_ms = watch.settle_ms;
      options.poll_ms = watch.poll_ms;
      options.rescan_s = watch.rescan_s;
      WatchHandlers handlers;
      handlers.on_ready = [this, root = options.root, watch](const ReadyAsset& asset) {
        return Offer(root, watch.as_svbrdf, asset);
      };
      handlers.on_gone = [this](const ReadyAsset& asset) { WithdrawAll(asset); };
      handlers.on_scanned = [this, root = options.root] { WithdrawMissing(root); };
      PATINA_ASSIGN(std::unique_ptr<Watcher> watcher, Watcher::Start(options, std::move(handlers)));
      const std::lock_guard lock(mutex_);
      watchers_.push_back({std::move(watcher), watch.as_svbrdf});
    }
    service_.AttachSource(this);
    return {};
  }

  AssetSource* source() override { return this; }

  WatchHealth Health() const override {
    const std::shared_lock lock(mutex_);
    WatchHealth health;
    for (const auto& [watcher, as_svbrdf] : watchers_) {
      const WatchStatus status = watcher->status();
      WatchedRoot root;
      root.path = status.root;
      root.mode = status.mode;
      root.mode_reason = status.mode_reason;
      root.folders = status.folders;
      root.assets = status.assets;
      root.as_svbrdf = as_svbrdf;
      health.roots.push_back(std::move(root));
      health.events += static_cast<int64_t>(status.events);
      health.overflows += static_cast<int64_t>(status.overflows);
      health.rescans += static_cast<int64_t>(status.rescans);
      for (const WatchProblem& problem : status.problems) {
        health.healthy = false;
        health.reason += (health.reason.empty() ? "" : "; ") + problem.reason;
        health.cure += (health.cure.empty() ? "" : "; ") + problem.cure;
      }
    }
    return health;
  }

  std::vector<PendingAsset> Pending() const override {
    const std::shared_lock lock(mutex_);
    std::vector<PendingAsset> pending;
    for (const auto& [watcher, as_svbrdf] : watchers_) {
      for (const WatchedAsset& asset : watcher->assets()) {
        if (asset.state != AssetState::kReady)
          pending.push_back({asset.name, asset.path, asset.reason, 0});
      }
    }
    std::sort(pending.begin(), pending.end(),
              [](const PendingAsset& a, const PendingAsset& b) { return a.name < b.name; });
    return pending;
  }

  void RequestRescan() override {
    const std::shared_lock lock(mutex_);
    for (const auto& watched : watchers_) watched.watcher->RequestRescan();
  }

 private:
  struct Watched {
    std::unique_ptr<Watcher> watcher;
    bool as_svbrdf = false;
  };

  static std::vector<AssetOffer> OffersOf(const std::string& root, bool as_svbrdf,
                                          const ReadyAsset& asset) {
    std::vector<AssetOffer> offers;
    for (Job& job : DropJobs(root, asset.path, asset.name, asset.is_file)) {
      AssetOffer offer;
      offer.job = std::move(job);
      if (as_svbrdf) BakeAsReflectance(&offer.job);
      offer.signature = asset.token;
      offer.failed_folder = asset.path == root ? root : ParentOf(asset.path);
      offers.push_back(std::move(offer));
    }
    return offers;
  }

  Status Offer(const std::string& root, bool as_svbrdf, const ReadyAsset& asset) {
    std::set<std::string> names;
    for (const AssetOffer& offer : OffersOf(root, as_svbrdf, asset)) {
      const std::string& name = offer.job.asset;
      names.insert(name);
      auto outcome = service_.OfferAsset(offer);
      if (!outcome) {
        if (outcome.error().code == ErrorCode::kCancelled) return Fail(outcome.error());
        log_.Warning("asset_refused",
                     {{"asset", name}, {"path", asset.path}, {"reason", outcome.error().message}});
        return Fail(outcome.error());
      }
      log_.Info("asset_ready", {{"asset", name},
                                {"path", asset.path},
                                {"files", asset.files},
                                {"unchanged", *outcome == OfferOutcome::kUnchanged}});
    }
    // A folder may hold other materials than it did.
    const std::lock_guard lock(offered_mutex_);
    std::set<std::string>& before = offered_[asset.path];
    for (const std::string& name : before) {
      if (names.count(name) == 0) Withdraw(name);
    }
    before = std::move(names);
    return {};
  }

  void WithdrawAll(const ReadyAsset& asset) {
    const std::lock_guard lock(offered_mutex_);
    const auto found = offered_.find(asset.path);
    if (found == offered_.end()) return Withdraw(asset.name);
    for (const std::string& name : found->second) Withdraw(name);
    offered_.erase(found);
  }

  void Withdraw(const std::string& name) {
    const Status withdrawn = service_.WithdrawAsset(name);
    if (!withdrawn)
      log_.Warning("asset_not_withdrawn", {{"asset", name}, {"reason", withdrawn.error().message}});
  }

  // What was removed while no daemon ran.
  void WithdrawMissing(const std::string& root) {
    constexpr int kPage = 1000;
    std::string after;
    for (;;) {
      auto assets = service_.Assets(after, kPage);
      if (!assets || assets->empty()) return;
      for (const AssetView& asset : *assets) {
        struct stat info;
        if (asset.state != "gone" && asset.source.size() > root.size() &&
            asset.source.compare(0, root.size() + 1, root + "/") == 0 &&
            ::lstat(asset.source.c_str(), &info) != 0 && errno == ENOENT) {
          Withdraw(asset.name);
        }
      }
      if (assets->size() < kPage) return;
      after = assets->back().name;
    }
  }

  Service& service_;
  Logger& log_;
  // Shared by those who ask: a list of assets that waits for a disk must not keep back a look at
  // the health.
  mutable std::shared_mutex mutex_;
  std::vector<Watched> watchers_;
  std::mutex offered_mutex_;
  std::map<std::string, std::set<std::string>> offered_;  // path -> names of assets
};

}  // namespace

Result<std::unique_ptr<DropFolders>> DropFolders::Start(const Config& config, Service& service,
                                                        Logger& log) {
  auto folders = std::make_unique<WatchedFolders>(service, log);
  PATINA_TRY(folders->Open(config));
  return folders;
}

}  // namespace patina::daemon
