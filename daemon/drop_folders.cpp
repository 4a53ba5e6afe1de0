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
#include "pipeline/image/map_groups.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/scene_job.h"

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
      options.root = watch.path;
      options.exclude = {config.out, config.state_dir, WorkFolderOf(config)};
      options.exclude.insert(options.exclude.end(), config.output_roots.begin(),
                             config.output_roots.end());
      if (!config.failed_dir.empty()) options.exclude.push_back(config.failed_dir);
      options.mode = watch.mode;
      options.settle_ms = watch.settle_ms;
      options.poll_ms = watch.poll_ms;
      options.rescan_s = watch.rescan_s;
      WatchHandlers handlers;
      handlers.on_ready = [this, root = watch.path](const ReadyAsset& asset) {
        return Offer(root, asset);
      };
      handlers.on_gone = [this](const ReadyAsset& asset) { WithdrawAll(asset); };
      handlers.on_scanned = [this, root = watch.path] { WithdrawMissing(root); };
      PATINA_ASSIGN(std::unique_ptr<Watcher> watcher, Watcher::Start(options, std::move(handlers)));
      const std::lock_guard lock(mutex_);
      watchers_.push_back(std::move(watcher));
    }
    service_.AttachSource(this);
    return {};
  }

  AssetSource* source() override { return this; }

  WatchHealth Health() const override {
    const std::shared_lock lock(mutex_);
    WatchHealth health;
    for (const auto& watcher : watchers_) {
      const WatchStatus status = watcher->status();
      WatchedRoot root;
      root.path = status.root;
      root.mode = status.mode;
      root.mode_reason = status.mode_reason;
      root.folders = status.folders;
      root.assets = status.assets;
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
    for (const auto& watcher : watchers_) {
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
    for (const auto& watcher : watchers_) watcher->RequestRescan();
  }

 private:
  // One offer for a file or a folder with one material; one for each material of a folder that
  // holds several, named after folder and set.
  static std::vector<AssetOffer> OffersOf(const std::string& root, const ReadyAsset& asset) {
    AssetOffer offer;
    offer.job.asset = asset.name;
    offer.signature = asset.token;
    offer.failed_folder = asset.path == root ? root : ParentOf(asset.path);
    if (asset.is_file) {
      offer.job = JobOfBrdfFile(asset.name, asset.path);
      return {offer};
    }
    std::vector<AssetOffer> offers;
    const std::vector<std::string> lists = FindImageSets(asset.path);
    for (const std::string& list : lists) {
      const std::string name = BrdfAssetName(list);
      AssetOffer of_list = offer;
      of_list.job = JobOfBrdfFile(
          lists.size() == 1 ? asset.name : AssetNameFromPath(asset.name + "_" + name), list);
      offers.push_back(std::move(of_list));
    }
    // Its images are no maps.
    if (!offers.empty()) return offers;
    std::set<std::string> claimed;
    OfferScenes(root, asset.path, offer, &claimed, &offers);
    OfferStacks(root, asset, offer, &claimed, &offers);
    offer.job.folder = asset.path;
    if (!offers.empty() || !claimed.empty()) {
      auto unclaimed = FindSetNames(asset.path, claimed);
      if (!unclaimed) return offers;  // images that are no sets are the scene's
      OfferSets(asset, *unclaimed, offer, &offers);
      return offers;
    }
    const auto sets = FindSetNames(asset.path);
    // What is wrong with a folder the job says, for all to read.
    if (!sets || sets->size() < 2) return {offer};
    OfferSets(asset, *sets, offer, &offers);
    return offers;
  }

  // The materials of the scenes of a folder; and the files that scenes of it, or of folders above
  // it, refer to. Named after folder, scene and material. Of a scene that cannot be read an offer
  // whose run will say why.
  static void OfferScenes(const std::string& root, const std::string& folder,
                          const AssetOffer& pattern, std::set<std::string>* claimed,
                          std::vector<AssetOffer>* offers) {
    for (std::string above = folder;; above = ParentOf(above)) {
      for (const std::string& path : FindSceneFiles(above)) {
        const auto scene = ReadScene(path);
        if (scene) {
          for (std::string& file : FilesOfScene(*scene)) claimed->insert(std::move(file));
        }
        if (above != folder) continue;
        AssetOffer offer = pattern;
        offer.job.scene = path;
        if (!scene) {
          offer.job.asset = AssetNameFromPath(pattern.job.asset + "_scene");
          offer.job.scene_material = "#0";
          offers->push_back(std::move(offer));
          continue;
        }
        for (const SceneMaterial& material : scene->materials) {
          offer.job.asset = AssetNameFromPath(pattern.job.asset + "_" + material.asset);
          offer.job.scene_material = SceneMaterialKey(*scene, material);
          offers->push_back(offer);
        }
      }
      if (above == root || above.size() <= root.size()) return;
    }
  }

  // The layered materials with maps of a folder, named as other files are: after the way to them.
  static void OfferStacks(const std::string& root, const ReadyAsset& asset,
                          const AssetOffer& pattern, std::set<std::string>* claimed,
                          std::vector<AssetOffer>* offers) {
    for (const std::string& stack : FindMappedStacks(asset.path)) {
      for (std::string& map : MapsOfStack(stack)) claimed->insert(std::move(map));
      AssetOffer offer = pattern;
      offer.job = JobOfBrdfFile(asset.path == root
                                    ? BrdfAssetName(stack)
                                    : AssetNameFromPath(asset.name + "_" + BrdfAssetName(stack)),
                                stack);
      offers->push_back(std::move(offer));
    }
  }

  // Each set of a folder, named after folder and set.
  static void OfferSets(const ReadyAsset& asset, const std::vector<std::string>& sets,
                        AssetOffer offer, std::vector<AssetOffer>* all) {
    const std::string folder = std::filesystem::path(asset.path).filename().string();
    std::vector<AssetOffer>& offers = *all;
    for (const std::string& set : sets) {
      const bool prefixed = set.rfind(folder + "_", 0) == 0;
      const std::string suffix = prefixed ? set.substr(folder.size()) : "_" + set;
      offer.job.set = set;
      offer.job.asset = AssetNameFromPath(asset.name + suffix);
      offers.push_back(offer);
    }
  }

  Status Offer(const std::string& root, const ReadyAsset& asset) {
    std::set<std::string> names;
    for (const AssetOffer& offer : OffersOf(root, asset)) {
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
  std::vector<std::unique_ptr<Watcher>> watchers_;
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
