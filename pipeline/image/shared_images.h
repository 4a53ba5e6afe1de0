// Images that several bakes of one process read: each file's pixels once, while there is room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "formats/base/result.h"
#include "pipeline/image/image.h"

namespace patina {

// Safe to call from several threads; two that ask for the same file at once may both read it.
class SharedImages {
 public:
  static constexpr uint64_t kDefaultBytes = uint64_t{1} << 30;

  explicit SharedImages(uint64_t most_bytes = kDefaultBytes) : most_bytes_(most_bytes) {}

  // The image in `path`, whose content has the name `key` (its SHA-256): a copy of one that was
  // read before, or read now and kept in place of the ones that were read longest ago. Errors:
  // those of ReadImage.
  Result<Image> Read(const std::string& key, const std::string& path);

  // How often a file was really read.
  size_t files_read() const;

 private:
  mutable std::mutex mutex_;
  uint64_t most_bytes_;
  uint64_t bytes_ = 0;
  size_t files_read_ = 0;
  std::map<std::string, Image> images_;
  std::deque<std::string> by_age_;
};

}  // namespace patina
