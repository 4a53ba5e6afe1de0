// The files of one container, wherever they are.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina::validate {

inline constexpr uint64_t kMaxValidatedBytes = uint64_t{8} << 30;  // of one file

struct ContainerEntry {
  std::string name;
  bool is_regular = true;
};

class ContainerFiles {
 public:
  virtual ~ContainerFiles() = default;
  // All entries, sorted by name.
  virtual Result<std::vector<ContainerEntry>> List() const = 0;
  // The bytes of a regular file of the container. Errors: kNotFound, kIo, kInvalidArgument (not a
  // regular file), kOutOfRange; messages hold no absolute path.
  virtual Result<std::vector<uint8_t>> Read(const std::string& name, uint64_t max_bytes) const = 0;
  // A codebook that containers share: from the container, else from the folder that holds the
  // assets.
  virtual Result<std::vector<uint8_t>> ReadShared(const std::string& name,
                                                  uint64_t max_bytes) const = 0;
};

// A revision's directory.
class DirectoryFiles : public ContainerFiles {
 public:
  explicit DirectoryFiles(std::string directory) : directory_(std::move(directory)) {}
  Result<std::vector<ContainerEntry>> List() const override;
  Result<std::vector<uint8_t>> Read(const std::string& name, uint64_t max_bytes) const override;
  Result<std::vector<uint8_t>> ReadShared(const std::string& name,
                                          uint64_t max_bytes) const override;

 private:
  std::string directory_;
};

// ReadFile, with `shown` in place of the path in messages.
Result<std::vector<uint8_t>> ReadFileAs(const std::string& path, const std::string& shown,
                                        uint64_t max_bytes);

}  // namespace patina::validate
