#include "tests/daemon/watch/drop_folder_rig.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace patina::daemon {

namespace fs = std::filesystem;

RiggedEvents::RiggedEvents() : kernel_(std::move(OpenInotify().value())) {}

Result<int> RiggedEvents::AddFolder(const std::string& path) {
  if (watches >= limit) return Fail(ErrorCode::kResourceExhausted, "no more watches");
  auto watch = kernel_->AddFolder(path);
  if (watch) ++watches;
  return watch;
}

void RiggedEvents::RemoveFolder(int watch) {
  --watches;
  kernel_->RemoveFolder(watch);
}

int RiggedEvents::fd() const { return kernel_->fd(); }

bool RiggedEvents::Read(std::vector<FolderEvent>* read) {
  bool lost = kernel_->Read(read);
  if (deaf || lose_all) read->clear();
  if (deaf) lost = false;
  if (lose_all) lost = true;
  lose_all = false;
  return lost;
}

DropFolderRig::DropFolderRig(const std::function<void(WatchOptions*)>& change,
                             WatchCore::KindAt kind) {
  root = fs::canonical(folder.path()).string() + "/drop";
  fs::create_directory(root);
  WatchOptions options;
  options.root = root;
  options.settle_ms = kSettleMs;
  if (change) change(&options);
  if (!kind) kind = [](const std::string&) { return FileSystemKind{"ext4", false}; };
  core = std::make_unique<WatchCore>(options, &events, kind);
  const Status opened = core->Open(now_ns);
  EXPECT_TRUE(opened) << opened.error().message;
}

void DropFolderRig::Advance(int64_t ms) {
  const int64_t end_ns = now_ns + ms * 1000000;
  for (;;) {
    std::vector<FolderEvent> read;
    const bool lost = events.Read(&read);
    if (lost || !read.empty()) core->OnEvents(read, lost, now_ns);
    const WatchCore::Outcome outcome = core->OnTime(now_ns);
    gone.insert(gone.end(), outcome.gone.begin(), outcome.gone.end());
    for (const ReadyAsset& asset : outcome.ready) {
      ready.push_back(asset);
      core->HandedOver(
          asset,
          refuse ? Status(Fail(ErrorCode::kResourceExhausted, "the disk is full")) : Status(),
          now_ns);
    }
    const int64_t next_ns = core->NextDeadline();
    if (!read.empty() || next_ns <= now_ns) continue;
    if (next_ns > end_ns) break;
    now_ns = next_ns;
  }
  now_ns = end_ns;
}

void DropFolderRig::Write(const std::string& relative, const std::string& content) const {
  fs::create_directories(fs::path(Path(relative)).parent_path());
  std::ofstream(Path(relative), std::ios::binary) << content;
}

void DropFolderRig::MakeFolder(const std::string& relative) const {
  fs::create_directories(Path(relative));
}

void DropFolderRig::Remove(const std::string& relative) const { fs::remove_all(Path(relative)); }

void DropFolderRig::Rename(const std::string& from, const std::string& to) const {
  fs::rename(Path(from), Path(to));
}

std::vector<std::string> DropFolderRig::TakeReady() {
  std::vector<std::string> names;
  for (const ReadyAsset& asset : ready) names.push_back(asset.name);
  ready.clear();
  return names;
}

std::vector<std::string> DropFolderRig::TakeGone() {
  std::vector<std::string> names;
  for (const ReadyAsset& asset : gone) names.push_back(asset.name);
  gone.clear();
  return names;
}

WatchedAsset DropFolderRig::Asset(const std::string& name) const {
  for (const WatchedAsset& asset : core->assets(now_ns)) {
    if (asset.name == name) return asset;
  }
  WatchedAsset none;
  none.reason = "not listed";
  return none;
}

}  // namespace patina::daemon
