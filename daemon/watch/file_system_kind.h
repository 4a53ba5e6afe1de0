// What kind of file system a folder is on.
#pragma once

#include <string>

#include "formats/base/result.h"

namespace patina::daemon {

struct FileSystemKind {
  std::string name;      // "ext4", "nfs", ...; "0x..." if it is not in the table
  bool network = false;  // others may change it without this kernel hearing of it
};

// By the number that statfs gives. FUSE counts as network: nearly all of it is.
FileSystemKind FileSystemKindOf(long magic);

// Errors: kNotFound, kIo.
Result<FileSystemKind> FileSystemKindAt(const std::string& path);

}  // namespace patina::daemon
