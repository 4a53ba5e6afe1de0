// Whole containers as archives (archive.h), and back.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "formats/archive.h"
#include "formats/base/result.h"
#include "formats/container.h"

namespace patina {

// Of all members of an archive together, where nothing else is asked for.
inline constexpr uint64_t kDefaultUnpackedBytes = uint64_t{16} << 30;

struct PackedContainer {
  std::vector<ArchiveMember> members;
  std::vector<std::string> left_out;  // names of what the manifest does not list
};

// Writes manifest.json, the payloads, run.json if there is one, and the codebook that a BRDF shares
// with others: what unpacks is complete. The same container, level and version of libzstd give the
// same bytes. Sizes and hashes are checked on the way. on_member hears of each member when it is
// written. Errors: those of write and ArchiveWriter; they name the file.
Result<PackedContainer> PackContainer(const Container& container, int level,
                                      const WriteBytes& write,
                                      const std::function<void(const ArchiveMember&)>& on_member);

// Makes the container `directory`, which must not be there (or be an empty folder), by one rename
// after every member has been checked against the manifest within. Reads front to back. Nothing is
// left behind on an error. Errors: those of ArchiveStream; kCorruptData for members that are not
// those of the manifest; kOutOfRange for more than max_bytes in all; kConflict, kIo.
Result<std::vector<ArchiveMember>> UnpackArchive(
    const ReadBytes& read, const std::string& directory, uint64_t max_bytes,
    const std::function<void(const ArchiveMember&)>& on_member);

// The bytes of a file, one piece after another. Errors: as ReadFile.
Result<ReadBytes> ReadPieces(const std::string& path);

// Any part of a file. `bytes`: its size.
Result<ReadAt> OpenForReadAt(const std::string& path, uint64_t* bytes);

}  // namespace patina
