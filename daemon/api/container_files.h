// Files of a container, for clients who name them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/api/api_json.h"
#include "daemon/base/unique_fd.h"
#include "formats/base/result.h"

namespace patina::daemon {

struct OpenedFile {
  UniqueFd fd;
  uint64_t bytes = 0;
  int64_t mtime_ns = 0;
};

// Opens a regular file below a folder. Nothing outside can be named: neither by "..", nor by an
// absolute path, nor through a link, which are not followed at all. Errors: kInvalidArgument (the
// name), kNotFound, kIo.
Result<OpenedFile> OpenBelow(const std::string& folder, const std::string& name);

// The files below a folder, sorted, at most 1000; links are left out. Errors: kNotFound, kIo.
Result<std::vector<ContainerFile>> FilesBelow(const std::string& folder);

// The revisions of an asset's folder <out>/<asset> that are whole, newest first, at most 1000.
// Errors: kNotFound, kIo.
struct AssetRevision {
  std::string name;  // "r0002"
  std::string container;
  int64_t published_ms = 0;  // when the manifest was written
};
Result<std::vector<AssetRevision>> RevisionsOf(const std::string& asset_folder);

const char* ContentTypeOf(const std::string& name);

}  // namespace patina::daemon
