#include "daemon/watch/file_system_kind.h"

#include <sys/vfs.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>

#include "formats/base/file_io.h"

namespace patina::daemon {
namespace {

struct Known {
  uint32_t magic;
  const char* name;
  bool network;
};

// linux/magic.h, statfs(2), and the sources of those that are in neither.
constexpr Known kKnown[] = {
    {0x0000EF53, "ext4", false},     {0x58465342, "xfs", false},      {0x9123683E, "btrfs", false},
    {0x01021994, "tmpfs", false},    {0x794C7630, "overlay", false},  {0x2FC12FC1, "zfs", false},
    {0xF2F52010, "f2fs", false},     {0xCA451A4E, "bcachefs", false}, {0x00004D44, "fat", false},
    {0x2011BAB0, "exfat", false},    {0x7366746E, "ntfs3", false},    {0x858458F6, "ramfs", false},
    {0x52654973, "reiserfs", false}, {0x3153464A, "jfs", false},      {0x00006969, "nfs", true},
    {0x0000517B, "smb", true},       {0xFE534D42, "smb", true},       {0xFF534D42, "cifs", true},
    {0x65735546, "fuse", true},      {0x01021997, "9p", true},        {0x5346414F, "afs", true},
    {0x6B414653, "afs", true},       {0x73757245, "coda", true},      {0x00C36400, "ceph", true},
    {0x0000564C, "ncp", true},       {0x01161970, "gfs2", true},      {0x7461636F, "ocfs2", true},
    {0x0BD00BD0, "lustre", true},    {0x47504653, "gpfs", true},      {0x786F4256, "vboxsf", true},
    {0xBACBACBC, "vmhgfs", true},    {0x19830326, "beegfs", true},    {0xAAD7AAEA, "panfs", true},
    {0x20030528, "orangefs", true},
};

}  // namespace

FileSystemKind FileSystemKindOf(long magic) {
  const auto wanted = static_cast<uint32_t>(magic);
  for (const Known& known : kKnown) {
    if (known.magic == wanted) return {known.name, known.network};
  }
  char text[16];
  std::snprintf(text, sizeof text, "0x%08x", wanted);
  return {text, false};
}

Result<FileSystemKind> FileSystemKindAt(const std::string& path) {
  struct statfs info {};
  if (statfs(path.c_str(), &info) != 0) return FailErrno(errno, "cannot look at", path);
  return FileSystemKindOf(static_cast<long>(info.f_type));
}

}  // namespace patina::daemon
