// The files of a container that lies in an archive.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/archive.h"
#include "formats/manifest.h"
#include "pipeline/validate/container_files.h"
#include "pipeline/validate/findings.h"

namespace patina::validate {

class ArchiveFiles : public ContainerFiles {
 public:
  ArchiveFiles(std::vector<ArchiveMember> members, ReadAt read_at)
      : members_(std::move(members)), read_at_(std::move(read_at)) {}
  Result<std::vector<ContainerEntry>> List() const override;
  Result<std::vector<uint8_t>> Read(const std::string& name, uint64_t max_bytes) const override;
  Result<std::vector<uint8_t>> ReadShared(const std::string& name,
                                          uint64_t max_bytes) const override;

 private:
  std::vector<ArchiveMember> members_;
  ReadAt read_at_;
};

// Checks an archive and the container in it. Findings name its members as <label>/<member>. Returns
// the container's manifest if it can be used.
std::optional<Manifest> CheckArchive(const std::string& path, const std::string& label,
                                     FindingList* findings);

}  // namespace patina::validate
