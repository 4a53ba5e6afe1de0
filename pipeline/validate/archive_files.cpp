#include "pipeline/validate/archive_files.h"

#include <algorithm>
#include <set>

#include "formats/base/names.h"
#include "formats/container_archive.h"
#include "pipeline/validate/check_container.h"

namespace patina::validate {
namespace {

int NumberOf(const Error& error) {
  if (error.code == ErrorCode::kUnsupported) return 7003;
  constexpr std::pair<const char*, int> kPrefixes[] = {
      {"bad magic", 7001}, {"bad header", 7002}, {"truncated", 7004}, {"trailing bytes", 7005},
      {"bad index", 7006}, {"bad name", 7007},   {"bad member", 7008}};
  for (const auto& [prefix, number] : kPrefixes) {
    if (error.message.rfind(prefix, 0) == 0) return number;
  }
  return 9002;
}

}  // namespace

Result<std::vector<ContainerEntry>> ArchiveFiles::List() const {
  std::vector<ContainerEntry> entries;
  for (const ArchiveMember& member : members_) entries.push_back({member.name, true});
  std::sort(entries.begin(), entries.end(),
            [](const ContainerEntry& a, const ContainerEntry& b) { return a.name < b.name; });
  return entries;
}

Result<std::vector<uint8_t>> ArchiveFiles::Read(const std::string& name, uint64_t max_bytes) const {
  for (const ArchiveMember& member : members_) {
    if (member.name == name) return ReadArchiveMember(member, max_bytes, read_at_);
  }
  return Fail(ErrorCode::kNotFound, QuoteForMessage(name) + " is not in the archive");
}

Result<std::vector<uint8_t>> ArchiveFiles::ReadShared(const std::string& name,
                                                      uint64_t max_bytes) const {
  return Read(name, max_bytes);
}

std::optional<Manifest> CheckArchive(const std::string& path, const std::string& label,
                                     FindingList* findings) {
  uint64_t bytes = 0;
  const auto read_at = OpenForReadAt(path, &bytes);
  if (!read_at) {
    findings->Add(9002, label, {}, "the archive cannot be opened");
    return std::nullopt;
  }
  const auto members = ReadArchiveIndex(bytes, *read_at);
  if (!members) {
    findings->AddError(NumberOf(members.error()), label, members.error());
    return std::nullopt;
  }
  // Damaged members are told once, by themselves.
  std::vector<ArchiveMember> whole;
  for (const ArchiveMember& member : *members) {
    const auto content = ReadArchiveMember(member, kMaxValidatedBytes, *read_at);
    if (content) {
      whole.push_back(member);
    } else {
      findings->AddError(NumberOf(content.error()), label, content.error());
    }
  }
  if (whole.size() != members->size()) return std::nullopt;
  return CheckContainer(ArchiveFiles(std::move(whole), *read_at), label, findings);
}

}  // namespace patina::validate
