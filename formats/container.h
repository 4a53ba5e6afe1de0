// Containers on disk: <out>/<asset>/<revision>/ with manifest.json and its payloads, and
// <out>/<asset>/current, a symbolic link to the newest good revision. A revision appears complete
// or not at all, also when the machine stops at any moment.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/file_io.h"
#include "formats/base/result.h"
#include "formats/manifest.h"

namespace patina {

inline constexpr const char* kManifestName = "manifest.json";
inline constexpr const char* kCurrentName = "current";

// Accepts a name for an asset: CheckPlainName (formats/base/names.h). Errors: kInvalidArgument.
Status CheckAssetName(std::string_view name);

struct PublishedContainer {
  std::string revision;   // "r0001", "r0002", ...
  std::string directory;  // <out>/<asset>/<revision>
  std::string warning;    // not empty if it is published but may not outlive a power cut
};

// What a container may hold without listing it, because it differs from run to run.
inline constexpr const char* kRunRecordName = "run.json";
inline constexpr const char* kReportPageName = "report.html";
inline constexpr const char* kUnlistedFiles[] = {kRunRecordName, kReportPageName};

// A container in the making: a hidden directory <out>/<asset>/.staging-<pid>-<n> that belongs to
// this object, and the lock on the asset. Unless Publish succeeded, destruction removes all traces.
// Not thread-safe. `files` must outlive it.
class StagingArea {
 public:
  // Creates <out>/<asset>, locks it against other bakes, and removes what dead ones left behind.
  // Errors: kInvalidArgument (asset name), kConflict (another bake of this asset is running, or a
  // file stands where a directory is needed), kIo, kResourceExhausted.
  static Result<StagingArea> Create(const std::string& out_directory, const std::string& asset,
                                    FileSystem& files = RealFileSystem());
  StagingArea(StagingArea&&) noexcept;
  StagingArea& operator=(StagingArea&&) noexcept;
  ~StagingArea();

  // For readers of what was written so far: with a manifest it can be opened like any container.
  const std::string& directory() const;

  // Writes and syncs a payload and records it for the manifest. Errors: kInvalidArgument (name),
  // kConflict (name taken), kIo, kResourceExhausted.
  Status AddPayload(const std::string& name, const std::string& role,
                    std::span<const uint8_t> bytes);
  // The same for a file that the manifest does not list (run.json, report.html).
  Status AddUnlisted(const std::string& name, std::span<const uint8_t> bytes);
  // What AddPayload recorded, in order of the calls.
  const std::vector<ManifestPayload>& payloads() const;

  // Writes manifest.json with the asset's name and payloads() filled in; may be called again to
  // replace it. Errors: those of ToJson, kIo, kResourceExhausted.
  Status WriteManifest(Manifest manifest);

  // Makes the directory the next revision and points `current` at it. Call once, after
  // WriteManifest. On an error nothing is published and `current` is what it was. Errors: kIo,
  // kResourceExhausted, kConflict (`current` is not a symbolic link).
  Result<PublishedContainer> Publish();

 private:
  struct State;
  explicit StagingArea(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// Removes all revisions of an asset but the newest `keep` and the one that `current` points at, and
// returns how many. Nothing is removed where `current` points at no revision. Errors: kConflict (a
// bake of the asset is running), kNotFound (no such asset), kIo.
Result<int> PruneRevisions(const std::string& out_directory, const std::string& asset, int keep);

// An opened container. The directory is resolved: it does not change when `current` does.
struct Container {
  std::string directory;
  Manifest manifest;

  std::string PathOf(const std::string& payload_name) const {
    return directory + "/" + payload_name;
  }
};

// `path` is a revision's directory, an asset's directory (its `current` is taken), or a
// manifest.json. Errors: kNotFound, kIo, and those of ParseManifest; they name the file.
Result<Container> OpenContainer(const std::string& path);

// Checks presence, size and SHA-256 of every payload, and of a codebook that a BRDF shares with
// others. Errors: kNotFound, kCorruptData, kIo; they
// name the file.
Status VerifyPayloads(const Container& container);

}  // namespace patina
