// Containers in memory, for mutations by the thousand.
#pragma once

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "formats/base/file_io.h"
#include "formats/base/sha256.h"
#include "pipeline/validate/check_container.h"

namespace patina::test {

using Bytes = std::vector<uint8_t>;

class MemoryFiles : public validate::ContainerFiles {
 public:
  MemoryFiles() = default;
  // What lies in a directory.
  explicit MemoryFiles(const std::string& directory) {
    for (const auto& entry : std::filesystem::directory_iterator(directory))
      files[entry.path().filename().string()] = *ReadFile(entry.path().string(), 1 << 24);
  }

  Result<std::vector<validate::ContainerEntry>> List() const override {
    std::vector<validate::ContainerEntry> entries;
    for (const auto& [name, bytes] : files) entries.push_back({name, true});
    return entries;
  }
  Result<Bytes> Read(const std::string& name, uint64_t max_bytes) const override {
    const auto found = files.find(name);
    if (found == files.end()) return Fail(ErrorCode::kNotFound, "cannot open " + name);
    if (found->second.size() > max_bytes) return Fail(ErrorCode::kOutOfRange, name + " is large");
    return found->second;
  }
  Result<Bytes> ReadShared(const std::string& name, uint64_t max_bytes) const override {
    return Read(name, max_bytes);
  }

  std::map<std::string, Bytes> files;
};

inline std::vector<validate::Finding> FindingsOf(const MemoryFiles& files) {
  validate::FindingList list;
  validate::CheckContainer(files, "", &list);
  return list.Take();
}

// The numbers of findings above notes.
inline std::vector<int> NumbersOf(const std::vector<validate::Finding>& findings) {
  std::vector<int> numbers;
  for (const validate::Finding& finding : findings) {
    if (finding.severity > validate::Severity::kNote) numbers.push_back(finding.number);
  }
  return numbers;
}

}  // namespace patina::test
