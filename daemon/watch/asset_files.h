// What the files of a drop folder are to the watcher.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace patina::daemon {

enum class FileRole {
  kImage,  // a map, perhaps, or a scene
  kBrdf,   // measurements, perhaps: some of the extensions are used by other programs, too
  kOther,  // its changes show that somebody is at work in the folder
  kNone    // says nothing: ours (*.failed.json), or what file managers leave behind
};

// By the name alone.
FileRole RoleOfFile(std::string_view name);

// Whether a file of this name may refer to files in folders below its own: a scene, a list of
// images.
bool NamesFilesBelow(const std::string& name);

// Whether a folder is passed over for its name: it is hidden.
bool IsHiddenName(std::string_view name);

// An entry of a folder.
struct Entry {
  enum class Kind { kFile, kFolder, kOther };
  std::string name;
  Kind kind = Kind::kOther;
  bool is_link = false;  // the rest is of what it points at
  uint64_t device = 0, inode = 0;
  uint64_t size = 0;
  int64_t mtime_ns = 0, ctime_ns = 0;
};

// The entries of a folder, sorted by name, "." and ".." left out. Links are resolved; one that
// points at nothing is kOther. Entries that vanish meanwhile are left out. Errors: kNotFound, kIo.
Result<std::vector<Entry>> ListEntries(const std::string& folder);

// One entry. Errors: kNotFound, kIo.
Result<Entry> LookAt(const std::string& folder, const std::string& name);

// Adds what identifies the state of a file to a text that is hashed for comparison.
void AppendIdentity(const Entry& entry, std::string* text);

enum class WriterState { kNone, kOpen, kUnknown };

// Whether some program has a file open for writing, or mapped so. kUnknown where the file system
// or its rights do not let us ask.
WriterState WriterOf(const std::string& path);

}  // namespace patina::daemon
