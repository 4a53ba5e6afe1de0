#include "formats/index_pack.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "formats/base/check.h"
#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/base/zstd_frame.h"
#include "formats/half.h"
#include "formats/weights.h"

namespace patina {
namespace {

constexpr char kPackMagic[] = "PATINAHX";
constexpr char kCodebookMagic[] = "PATINAHC";
constexpr size_t kHeaderBytes = 64;
constexpr size_t kShaBytes = 32;

// Both kinds of file begin alike.
enum HeaderOffset : int {
  kVersionAt = 8,
  kFlagsAt = 12,  // of a codebook: 0
  kFileBytesAt = 16,
  kCrcAt = 24,
  kNsideAt = 28,          // u16; of a codebook: 0
  kPrimitiveSizeAt = 30,  // u16
  kEntriesAt = 32,        // u32
  // Of a pack; of a codebook 0 from here on.
  kIndexBitsAt = 36,      // u8
  kInterpolationAt = 37,  // u8
  kMapCodingAt = 38,      // u8 for each hemisphere
  kStoredAt = 40,         // u32 for each hemisphere
  kMapBytesAt = 48,       // u32 for each hemisphere
  kNameBytesAt = 56,      // u16
  kReservedAt = 58
};

enum Flag : uint32_t {
  kIsotropic = 1,
  kCanonicalOrder = 2,
  kAngleInputs = 4,
  kHalfVectorInputs = 8,
  kKnownFlags = 15
};
enum MapCoding : uint8_t { kBitmap = 0, kRuns = 1 };

// Of the file with the checksum's own four bytes as zeros.
uint32_t FileCrc(std::span<const uint8_t> bytes) {
  const uint8_t zeros[4] = {};
  uint32_t crc = Crc32(bytes.first(kCrcAt));
  crc = Crc32(zeros, crc);
  return Crc32(bytes.subspan(kCrcAt + 4), crc);
}

tl::unexpected<Error> Corrupt(const std::string& what) {
  return Fail(ErrorCode::kCorruptData, what);
}

tl::unexpected<Error> Invalid(const std::string& what) {
  return Fail(ErrorCode::kInvalidArgument, what);
}

std::string NonFinite(std::span<const uint16_t> halves, int primitive_size) {
  for (size_t i = 0; i < halves.size(); ++i) {
    if (!HalfIsFinite(halves[i])) {
      const size_t k = static_cast<size_t>(primitive_size);
      return "non-finite primitive: value " + std::to_string(i % k) + " of entry " +
             std::to_string(i / k) + " is " + ((halves[i] & 0x3FF) != 0 ? "NaN" : "infinite");
    }
  }
  return "";
}

void AppendHalves(std::span<const uint16_t> halves, std::vector<uint8_t>* bytes) {
  for (const uint16_t half : halves) {
    bytes->push_back(static_cast<uint8_t>(half & 0xFF));
    bytes->push_back(static_cast<uint8_t>(half >> 8));
  }
}

std::vector<uint16_t> LoadHalves(const uint8_t* from, size_t count) {
  std::vector<uint16_t> halves(count);
  for (uint16_t& half : halves) {
    half = LoadLittle16(from);
    from += 2;
  }
  return halves;
}

// ---- Maps ----

// Alternating lengths as LEB128, of stored corners first; only the first may be 0.
std::vector<uint8_t> EncodeRuns(std::span<const uint8_t> stored) {
  std::vector<uint8_t> bytes;
  uint8_t kind = 1;
  for (size_t at = 0; at < stored.size() || at == 0;) {
    size_t end = at;
    while (end < stored.size() && stored[end] == kind) ++end;
    size_t length = end - at;
    do {
      const bool more = length >= 128;
      bytes.push_back(static_cast<uint8_t>((length & 127) | (more ? 128u : 0u)));
      length >>= 7;
    } while (length != 0);
    at = end;
    kind ^= 1;
  }
  return bytes;
}

std::vector<uint8_t> EncodeBitmap(std::span<const uint8_t> stored) {
  std::vector<uint8_t> bytes((stored.size() + 7) / 8, 0);
  for (size_t i = 0; i < stored.size(); ++i)
    bytes[i / 8] = static_cast<uint8_t>(bytes[i / 8] | stored[i] << (i % 8));
  return bytes;
}

Result<std::vector<uint8_t>> DecodeMap(std::span<const uint8_t> bytes, uint8_t coding,
                                       size_t corners, int hemisphere) {
  const std::string where = "bad map of hemisphere " + std::to_string(hemisphere) + ": ";
  std::vector<uint8_t> stored(corners, 0);
  if (coding == kBitmap) {
    if (bytes.size() != (corners + 7) / 8) {
      return Corrupt(where + std::to_string(bytes.size()) + " bytes for " +
                     std::to_string(corners) + " corners");
    }
    for (size_t i = 0; i < corners; ++i) stored[i] = bytes[i / 8] >> (i % 8) & 1;
    if (corners % 8 != 0 && bytes.back() >> (corners % 8) != 0)
      return Corrupt(where + "bits beyond the last corner");
    return stored;
  }
  size_t at = 0;
  size_t corner = 0;
  uint8_t kind = 1;
  while (at < bytes.size()) {
    const size_t first = at;
    uint64_t length = 0;
    for (int shift = 0;; shift += 7, ++at) {
      if (at >= bytes.size() || shift > 28)
        return Corrupt(where + "the run at byte " + std::to_string(first) + " does not end");
      length |= static_cast<uint64_t>(bytes[at] & 127) << shift;
      if (bytes[at] < 128) break;
    }
    const bool longer_than_needed = at > first && bytes[at] == 0;
    ++at;
    if (longer_than_needed || (length == 0 && first != 0) || length > corners - corner) {
      return Corrupt(where + "a run of " + std::to_string(length) + " at byte " +
                     std::to_string(first) + " with " + std::to_string(corners - corner) +
                     " corners left");
    }
    std::fill_n(stored.begin() + static_cast<std::ptrdiff_t>(corner), length, kind);
    corner += static_cast<size_t>(length);
    kind ^= 1;
  }
  if (corner != corners) {
    return Corrupt(where + "the runs cover " + std::to_string(corner) + " of " +
                   std::to_string(corners) + " corners");
  }
  return stored;
}

size_t CountStored(std::span<const uint8_t> stored) {
  return static_cast<size_t>(std::count(stored.begin(), stored.end(), uint8_t{1}));
}

// ---- Rules ----

Status CheckSizes(int nside, int primitive_size, int index_bits) {
  const auto in = [](int value, int max) { return value >= 1 && value <= max; };
  if (!in(nside, healpix::kMaxNside))
    return Invalid("nside " + std::to_string(nside) + " is not within 1 to 1024");
  if (!in(primitive_size, kMaxPrimitiveSize)) {
    return Invalid("primitive_size " + std::to_string(primitive_size) + " is not within 1 to 64");
  }
  if (!in(index_bits, kMaxIndexBits))
    return Invalid("index_bits " + std::to_string(index_bits) + " is not within 1 to 16");
  return {};
}

Status CheckInputs(const IndexPack& pack) {
  if (pack.half_vector_inputs && !pack.angle_inputs)
    return Invalid("half_vector_inputs without angle_inputs");
  return {};
}

Status CheckHalves(std::span<const uint16_t> halves, int primitive_size, size_t max_entries) {
  const size_t k = static_cast<size_t>(primitive_size);
  if (halves.empty() || halves.size() % k != 0 || halves.size() / k > max_entries) {
    return Invalid("codebook: " + std::to_string(halves.size()) + " values are not 1 to " +
                   std::to_string(max_entries) + " entries of " + std::to_string(k));
  }
  const std::string bad = NonFinite(halves, primitive_size);
  if (!bad.empty()) return Invalid(bad);
  return {};
}

bool IsSha256(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

Status CheckReference(const IndexPack& pack) {
  PATINA_TRY(CheckPlainName(pack.codebook_file, "codebook_file"));
  if (!IsSha256(pack.codebook_sha256)) {
    return Invalid("codebook_sha256: " + QuoteForMessage(pack.codebook_sha256) +
                   " is not 64 lower-case hex digits");
  }
  return {};
}

Status CheckMaps(const IndexPack& pack) {
  const auto corners = static_cast<size_t>(healpix::CornerCount(pack.nside));
  size_t count = 0;
  for (int h = 0; h < 2; ++h) {
    const auto& stored = pack.stored[h];
    if (stored.size() != corners ||
        std::any_of(stored.begin(), stored.end(), [](uint8_t s) { return s > 1; })) {
      return Invalid("stored[" + std::to_string(h) + "]: not " + std::to_string(corners) +
                     " values of 0 or 1");
    }
    count += CountStored(stored);
  }
  if (pack.indices.size() != count) {
    return Invalid("indices: " + std::to_string(pack.indices.size()) + " for " +
                   std::to_string(count) + " stored corners");
  }
  return {};
}

Status CheckPack(const IndexPack& pack) {
  PATINA_TRY(CheckSizes(pack.nside, pack.primitive_size, pack.index_bits));
  if (static_cast<int>(pack.interpolation) > 2) return Invalid("interpolation is not known");
  PATINA_TRY(CheckInputs(pack));
  PATINA_TRY(CheckMaps(pack));
  size_t entries = size_t{1} << pack.index_bits;
  if (pack.codebook_file.empty() && pack.codebook_sha256.empty()) {
    PATINA_TRY(CheckHalves(pack.codebook, pack.primitive_size, entries));
    entries = pack.codebook.size() / static_cast<size_t>(pack.primitive_size);
  } else {
    if (!pack.codebook.empty()) return Invalid("codebook: both inline and in a file");
    PATINA_TRY(CheckReference(pack));
  }
  for (size_t i = 0; i < pack.indices.size(); ++i) {
    if (pack.indices[i] >= entries) {
      return Invalid("indices[" + std::to_string(i) + "]: " + std::to_string(pack.indices[i]) +
                     " with " + std::to_string(entries) + " entries");
    }
  }
  return {};
}

// ---- Files ----

// The file of a header, whose common fields are filled in here, and a body; in a zstd frame if the
// level is not 0.
Result<std::vector<uint8_t>> Sealed(const char* magic, uint32_t version,
                                    std::array<uint8_t, kHeaderBytes> header,
                                    std::span<const uint8_t> body, int zstd_level) {
  std::memcpy(header.data(), magic, 8);
  StoreLittle32(&header[kVersionAt], version);
  StoreLittle64(&header[kFileBytesAt], kHeaderBytes + body.size());
  StoreLittle32(&header[kCrcAt], Crc32(body, Crc32(header)));
  std::vector<uint8_t> bytes(header.begin(), header.end());
  bytes.insert(bytes.end(), body.begin(), body.end());
  if (zstd_level == 0) return bytes;
  return CompressZstd(bytes, zstd_level);
}

// What both kinds of file begin with: magic, version, size, checksum.
Status CheckHeader(std::span<const uint8_t> bytes, const char* magic, uint32_t version_known,
                   const char* what) {
  if (bytes.empty()) return Corrupt("truncated: the file is empty");
  if (std::memcmp(bytes.data(), magic, std::min<size_t>(bytes.size(), 8)) != 0) {
    return Corrupt(std::string("bad magic: the file does not start with \"") + magic + "\"");
  }
  if (bytes.size() < kHeaderBytes)
    return Corrupt("truncated: " + std::to_string(bytes.size()) + " of 64 header bytes");
  const uint32_t version = LoadLittle32(&bytes[kVersionAt]);
  if (version == 0) return Corrupt("bad header: version 0 at byte 8");
  if (version > version_known) {
    return Fail(ErrorCode::kUnsupported, std::string(what) + " version " + std::to_string(version) +
                                             " is newer than this program, which reads up to " +
                                             std::to_string(version_known) +
                                             "; use a newer patina");
  }
  const uint64_t file_bytes = LoadLittle64(&bytes[kFileBytesAt]);
  if (file_bytes < kHeaderBytes || file_bytes > kMaxIndexPackBytes)
    return Corrupt("bad header: file size " + std::to_string(file_bytes) + " at byte 16");
  if (bytes.size() < file_bytes) {
    return Corrupt("truncated: " + std::to_string(bytes.size()) + " of " +
                   std::to_string(file_bytes) + " bytes");
  }
  if (bytes.size() > file_bytes) {
    return Corrupt("trailing bytes: the " + std::string(what) + " ends at byte " +
                   std::to_string(file_bytes) + ", the file at " + std::to_string(bytes.size()));
  }
  const uint32_t crc = FileCrc(bytes);
  const uint32_t stated = LoadLittle32(&bytes[kCrcAt]);
  if (crc != stated) {
    return Corrupt("bad checksum: the file says " + std::to_string(stated) +
                   " at byte 24, its bytes give " + std::to_string(crc) +
                   "; bake or copy it again");
  }
  return {};
}

Status HeaderError(Status status) {
  if (status) return {};
  return Corrupt("bad header: " + status.error().message);
}

// Reads the body of a pack whose header was checked; gives out sections and never runs past the
// end.
class Body {
 public:
  explicit Body(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  Result<std::span<const uint8_t>> Take(uint64_t count, const char* what) {
    if (count > bytes_.size() - at_) {
      return Corrupt(std::string("bad header: the ") + what + " of " + std::to_string(count) +
                     " bytes at byte " + std::to_string(at_) + " does not end within the file");
    }
    const auto section = bytes_.subspan(at_, static_cast<size_t>(count));
    at_ += static_cast<size_t>(count);
    return section;
  }
  size_t at() const { return at_; }
  bool AtEnd() const { return at_ == bytes_.size(); }

 private:
  std::span<const uint8_t> bytes_;
  size_t at_ = kHeaderBytes;
};

Status ParseCodebookOfPack(std::span<const uint8_t> header, Body* body, IndexPack* pack) {
  const uint32_t entries = LoadLittle32(&header[kEntriesAt]);
  const uint32_t name_bytes = LoadLittle16(&header[kNameBytesAt]);
  if ((entries == 0) == (name_bytes == 0)) {
    return Corrupt("bad header: " + std::to_string(entries) + " entries at byte 32 and a name of " +
                   std::to_string(name_bytes) + " bytes at byte 56: one of them must be 0");
  }
  if (entries > 0) {
    if (entries > uint32_t{1} << pack->index_bits) {
      return Corrupt("bad header: " + std::to_string(entries) + " entries at byte 32 for " +
                     std::to_string(pack->index_bits) + " index bits");
    }
    const size_t count = size_t{entries} * static_cast<size_t>(pack->primitive_size);
    PATINA_ASSIGN(const auto section, body->Take(2 * count, "codebook"));
    pack->codebook = LoadHalves(section.data(), count);
    const std::string bad = NonFinite(pack->codebook, pack->primitive_size);
    if (!bad.empty()) return Corrupt(bad);
    return {};
  }
  PATINA_ASSIGN(const auto digest, body->Take(kShaBytes, "codebook reference"));
  PATINA_ASSIGN(const auto name, body->Take(name_bytes, "codebook reference"));
  for (const uint8_t byte : digest) {
    pack->codebook_sha256 += "0123456789abcdef"[byte >> 4];
    pack->codebook_sha256 += "0123456789abcdef"[byte & 15];
  }
  pack->codebook_file.assign(name.begin(), name.end());
  if (auto status = CheckReference(*pack); !status)
    return Corrupt("bad codebook reference: " + status.error().message);
  return {};
}

Status ParseIndices(Body* body, uint64_t count, uint64_t entries, IndexPack* pack) {
  const auto bits = static_cast<uint64_t>(pack->index_bits);
  const size_t start = body->at();
  PATINA_ASSIGN(const auto section, body->Take((count * bits + 7) / 8, "indices"));
  pack->indices.resize(static_cast<size_t>(count));
  uint64_t window = 0;
  uint64_t held = 0;
  size_t at = 0;
  for (size_t i = 0; i < pack->indices.size(); ++i) {
    while (held < bits) {
      window |= static_cast<uint64_t>(section[at++]) << held;
      held += 8;
    }
    const uint64_t index = window & ((uint64_t{1} << bits) - 1);
    window >>= bits;
    held -= bits;
    if (index >= entries) {
      return Corrupt("bad index " + std::to_string(index) + " of stored corner " +
                     std::to_string(i) + " (section at byte " + std::to_string(start) +
                     "): the codebook has " + std::to_string(entries) + " entries");
    }
    pack->indices[i] = static_cast<uint16_t>(index);
  }
  if (window != 0) return Corrupt("bad index section: bits beyond the last index");
  return {};
}

Result<IndexPack> ParseBarePack(std::span<const uint8_t> bytes) {
  PATINA_TRY(CheckHeader(bytes, kPackMagic, kIndexPackVersion, "index pack"));
  const uint8_t* header = bytes.data();
  IndexPack pack;
  pack.nside = static_cast<int>(LoadLittle16(header + kNsideAt));
  pack.primitive_size = static_cast<int>(LoadLittle16(header + kPrimitiveSizeAt));
  pack.index_bits = header[kIndexBitsAt];
  PATINA_TRY(HeaderError(CheckSizes(pack.nside, pack.primitive_size, pack.index_bits)));
  const uint32_t flags = LoadLittle32(header + kFlagsAt);
  const bool reserved =
      std::any_of(header + kReservedAt, header + kHeaderBytes, [](uint8_t b) { return b != 0; });
  if ((flags & ~uint32_t{kKnownFlags}) != 0 || header[kInterpolationAt] > 2 ||
      header[kMapCodingAt] > 1 || header[kMapCodingAt + 1] > 1 || reserved) {
    return Corrupt("bad header: flags " + std::to_string(flags) + ", interpolation " +
                   std::to_string(header[kInterpolationAt]) + ", map codings " +
                   std::to_string(header[kMapCodingAt]) + " and " +
                   std::to_string(header[kMapCodingAt + 1]) +
                   ": a value or reserved byte that this version does not know");
  }
  pack.interpolation = static_cast<Interpolation>(header[kInterpolationAt]);
  pack.isotropic = (flags & kIsotropic) != 0;
  pack.canonical_order = (flags & kCanonicalOrder) != 0;
  pack.angle_inputs = (flags & kAngleInputs) != 0;
  pack.half_vector_inputs = (flags & kHalfVectorInputs) != 0;
  PATINA_TRY(HeaderError(CheckInputs(pack)));

  Body body(bytes);
  PATINA_TRY(ParseCodebookOfPack(bytes.first(kHeaderBytes), &body, &pack));
  const auto corners = static_cast<size_t>(healpix::CornerCount(pack.nside));
  uint64_t count = 0;
  for (int h = 0; h < 2; ++h) {
    PATINA_ASSIGN(const auto section, body.Take(LoadLittle32(header + kMapBytesAt + 4 * h), "map"));
    PATINA_ASSIGN(pack.stored[h], DecodeMap(section, header[kMapCodingAt + h], corners, h));
    const uint32_t stated = LoadLittle32(header + kStoredAt + 4 * h);
    const size_t found = CountStored(pack.stored[h]);
    if (found != stated) {
      return Corrupt("bad map of hemisphere " + std::to_string(h) + ": it marks " +
                     std::to_string(found) + " corners, the header says " + std::to_string(stated));
    }
    count += found;
  }
  const uint64_t entries = pack.codebook.empty()
                               ? uint64_t{1} << pack.index_bits
                               : pack.codebook.size() / static_cast<size_t>(pack.primitive_size);
  PATINA_TRY(ParseIndices(&body, count, entries, &pack));
  if (!body.AtEnd()) {
    return Corrupt("bad header: file size " + std::to_string(bytes.size()) +
                   " at byte 16, but the indices end at " + std::to_string(body.at()));
  }
  return pack;
}

Result<Codebook> ParseBareCodebook(std::span<const uint8_t> bytes) {
  PATINA_TRY(CheckHeader(bytes, kCodebookMagic, kCodebookVersion, "codebook"));
  const uint8_t* header = bytes.data();
  Codebook codebook;
  codebook.primitive_size = static_cast<int>(LoadLittle16(header + kPrimitiveSizeAt));
  PATINA_TRY(HeaderError(CheckSizes(1, codebook.primitive_size, 1)));
  const uint32_t entries = LoadLittle32(header + kEntriesAt);
  const size_t count = size_t{entries} * static_cast<size_t>(codebook.primitive_size);
  const bool reserved =
      std::any_of(header + kIndexBitsAt, header + kHeaderBytes, [](uint8_t b) { return b != 0; });
  if (LoadLittle32(header + kFlagsAt) != 0 || LoadLittle16(header + kNsideAt) != 0 || reserved)
    return Corrupt("bad header: a reserved byte is not 0");
  if (entries < 1 || entries > 65536 || kHeaderBytes + 2 * count != bytes.size()) {
    return Corrupt("bad header: " + std::to_string(entries) + " entries at byte 32 in a file of " +
                   std::to_string(bytes.size()) + " bytes");
  }
  codebook.halves = LoadHalves(header + kHeaderBytes, count);
  const std::string bad = NonFinite(codebook.halves, codebook.primitive_size);
  if (!bad.empty()) return Corrupt(bad);
  return codebook;
}

}  // namespace

Result<std::vector<uint8_t>> EncodeIndexPack(const IndexPack& pack, int zstd_level) {
  PATINA_TRY(CheckPack(pack));
  const bool shared = !pack.codebook_file.empty();
  std::vector<uint8_t> maps[2];
  uint8_t codings[2] = {};
  for (int h = 0; h < 2; ++h) {
    std::vector<uint8_t> runs = EncodeRuns(pack.stored[h]);
    std::vector<uint8_t> bitmap = EncodeBitmap(pack.stored[h]);
    codings[h] = runs.size() < bitmap.size() ? kRuns : kBitmap;
    maps[h] = codings[h] == kRuns ? std::move(runs) : std::move(bitmap);
  }
  std::array<uint8_t, kHeaderBytes> header{};
  StoreLittle32(&header[kFlagsAt], (pack.isotropic ? uint32_t{kIsotropic} : 0) |
                                       (pack.canonical_order ? uint32_t{kCanonicalOrder} : 0) |
                                       (pack.angle_inputs ? uint32_t{kAngleInputs} : 0) |
                                       (pack.half_vector_inputs ? uint32_t{kHalfVectorInputs} : 0));
  StoreLittle16(&header[kNsideAt], static_cast<uint16_t>(pack.nside));
  StoreLittle16(&header[kPrimitiveSizeAt], static_cast<uint16_t>(pack.primitive_size));
  header[kIndexBitsAt] = static_cast<uint8_t>(pack.index_bits);
  header[kInterpolationAt] = static_cast<uint8_t>(pack.interpolation);

  std::vector<uint8_t> body;
  if (shared) {
    StoreLittle16(&header[kNameBytesAt], static_cast<uint16_t>(pack.codebook_file.size()));
    for (size_t i = 0; i < kShaBytes; ++i) {
      const auto digit = [&](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
      body.push_back(static_cast<uint8_t>(digit(pack.codebook_sha256[2 * i]) << 4 |
                                          digit(pack.codebook_sha256[2 * i + 1])));
    }
    body.insert(body.end(), pack.codebook_file.begin(), pack.codebook_file.end());
  } else {
    const size_t entries = pack.codebook.size() / static_cast<size_t>(pack.primitive_size);
    StoreLittle32(&header[kEntriesAt], static_cast<uint32_t>(entries));
    AppendHalves(pack.codebook, &body);
  }
  for (size_t h = 0; h < 2; ++h) {
    header[kMapCodingAt + h] = codings[h];
    StoreLittle32(&header[kStoredAt + 4 * h], static_cast<uint32_t>(CountStored(pack.stored[h])));
    StoreLittle32(&header[kMapBytesAt + 4 * h], static_cast<uint32_t>(maps[h].size()));
    body.insert(body.end(), maps[h].begin(), maps[h].end());
  }
  const auto bits = static_cast<size_t>(pack.index_bits);
  const size_t start = body.size();
  body.resize(start + (pack.indices.size() * bits + 7) / 8, 0);
  size_t bit = 8 * start;
  for (const uint16_t index : pack.indices) {
    for (size_t b = 0; b < bits; ++b, ++bit)
      body[bit / 8] = static_cast<uint8_t>(body[bit / 8] | (index >> b & 1) << (bit % 8));
  }
  if (kHeaderBytes + body.size() > kMaxIndexPackBytes) return Invalid("an index pack above 64 MiB");
  return Sealed(kPackMagic, kIndexPackVersion, header, body, zstd_level);
}

Result<IndexPack> ParseIndexPack(std::span<const uint8_t> bytes) {
  if (!IsZstdFrame(bytes)) return ParseBarePack(bytes);
  PATINA_ASSIGN(const std::vector<uint8_t> content, DecompressZstd(bytes, kMaxIndexPackBytes));
  return ParseBarePack(content);
}

Status WriteIndexPack(const std::string& path, const IndexPack& pack, int zstd_level) {
  auto bytes = EncodeIndexPack(pack, zstd_level);
  if (!bytes) return Fail(std::move(bytes).error(), path);
  return WriteFileDurably(path, std::span<const uint8_t>(*bytes));
}

Result<IndexPack> ReadIndexPack(const std::string& path) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, kMaxIndexPackBytes));
  auto pack = ParseIndexPack(bytes);
  if (!pack) return Fail(std::move(pack).error(), path);
  return pack;
}

Result<std::vector<uint8_t>> EncodeCodebook(const Codebook& codebook, int zstd_level) {
  PATINA_TRY(CheckSizes(1, codebook.primitive_size, 1));
  PATINA_TRY(CheckHalves(codebook.halves, codebook.primitive_size, 65536));
  std::array<uint8_t, kHeaderBytes> header{};
  const size_t entries = codebook.halves.size() / static_cast<size_t>(codebook.primitive_size);
  StoreLittle16(&header[kPrimitiveSizeAt], static_cast<uint16_t>(codebook.primitive_size));
  StoreLittle32(&header[kEntriesAt], static_cast<uint32_t>(entries));
  std::vector<uint8_t> body;
  AppendHalves(codebook.halves, &body);
  return Sealed(kCodebookMagic, kCodebookVersion, header, body, zstd_level);
}

Result<Codebook> ParseCodebook(std::span<const uint8_t> bytes) {
  if (!IsZstdFrame(bytes)) return ParseBareCodebook(bytes);
  PATINA_ASSIGN(const std::vector<uint8_t> content, DecompressZstd(bytes, kMaxIndexPackBytes));
  return ParseBareCodebook(content);
}

Status WriteCodebook(const std::string& path, const Codebook& codebook, int zstd_level) {
  auto bytes = EncodeCodebook(codebook, zstd_level);
  if (!bytes) return Fail(std::move(bytes).error(), path);
  return WriteFileDurably(path, std::span<const uint8_t>(*bytes));
}

Result<Codebook> ReadCodebook(const std::string& path) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, kMaxIndexPackBytes));
  auto codebook = ParseCodebook(bytes);
  if (!codebook) return Fail(std::move(codebook).error(), path);
  return codebook;
}

Result<Codebook> CodebookOf(const IndexPack& pack, const std::string& directory) {
  if (pack.codebook_file.empty()) return Codebook{pack.primitive_size, pack.codebook};
  PATINA_TRY(CheckReference(pack));
  std::string path = directory + "/" + pack.codebook_file;
  auto found = ReadFile(path, kMaxIndexPackBytes);
  if (!found && found.error().code == ErrorCode::kNotFound) {
    path = directory + "/../../" + pack.codebook_file;
    found = ReadFile(path, kMaxIndexPackBytes);
  }
  if (!found) return Fail(std::move(found).error(), "the codebook that the index pack shares");
  return SharedCodebookOf(pack, *found, path);
}

Result<Codebook> SharedCodebookOf(const IndexPack& pack, std::span<const uint8_t> bytes,
                                  const std::string& name) {
  const std::string sha256 = Sha256Hex(bytes);
  if (sha256 != pack.codebook_sha256) {
    return Corrupt(name + " has the SHA-256 " + sha256 + ", the index pack was written for " +
                   pack.codebook_sha256 + "; bake or copy both again");
  }
  auto codebook = ParseCodebook(bytes);
  if (!codebook) return Fail(std::move(codebook).error(), name);
  if (codebook->primitive_size != pack.primitive_size) {
    return Corrupt(name + " has primitives of " + std::to_string(codebook->primitive_size) +
                   " values, the index pack of " + std::to_string(pack.primitive_size));
  }
  return codebook;
}

Status CheckIndices(const IndexPack& pack, const Codebook& codebook) {
  const size_t entries = codebook.halves.size() / static_cast<size_t>(codebook.primitive_size);
  for (size_t i = 0; i < pack.indices.size(); ++i) {
    if (pack.indices[i] >= entries) {
      return Corrupt("bad index " + std::to_string(pack.indices[i]) + " of stored corner " +
                     std::to_string(i) + ": the codebook has " + std::to_string(entries) +
                     " entries");
    }
  }
  return {};
}

void FillDerivedCorners(int nside, int primitive_size, std::span<const uint8_t> stored,
                        float* features) {
  const auto corners = static_cast<size_t>(healpix::CornerCount(nside));
  const auto k = static_cast<size_t>(primitive_size);
  PATINA_CHECK(stored.size() == corners);
  int coarsest = nside;
  while (coarsest % 2 == 0) coarsest /= 2;
  for (int level = coarsest; level <= nside; level *= 2) {
    // The index in the finest lattice.
    const auto finest = [&](healpix::Corner corner) {
      for (int n = level; n < nside; n *= 2) corner = healpix::ToChild(n, corner);
      return static_cast<size_t>(healpix::CornerIndex(nside, corner));
    };
    const int rings = level == nside ? 2 * nside + 2 : 2 * level + 1;
    for (int ring = 0; ring < rings; ++ring) {
      for (int j = 0; j < healpix::CornersInRing(level, ring); ++j) {
        const size_t at = finest({ring, j});
        if (stored[at] != 0) continue;
        float* value = features + at * k;
        if (level == coarsest) {
          std::fill_n(value, k, 0.0f);
          continue;
        }
        const healpix::Parents parents = healpix::ParentsOf(level, {ring, j});
        if (parents.count == 0) continue;  // filled on a coarser level
        const float* from[4];
        for (int p = 0; p < parents.count; ++p) from[p] = features + finest(parents.corner[p]) * k;
        const float share = parents.count == 2 ? 0.5f : 0.25f;
        for (size_t i = 0; i < k; ++i) {
          float sum = 0;
          for (int p = 0; p < parents.count; ++p) sum += from[p][i];
          value[i] = share * sum;
        }
      }
    }
  }
}

Result<std::vector<float>> ExpandCorners(const IndexPack& pack, const Codebook& codebook) {
  PATINA_TRY(CheckSizes(pack.nside, pack.primitive_size, pack.index_bits));
  PATINA_TRY(CheckMaps(pack));
  if (codebook.primitive_size != pack.primitive_size)
    return Invalid("primitive_size: " + std::to_string(codebook.primitive_size) +
                   " in the codebook, " + std::to_string(pack.primitive_size) + " in the pack");
  PATINA_TRY(CheckHalves(codebook.halves, codebook.primitive_size, 65536));
  const auto corners = static_cast<size_t>(healpix::CornerCount(pack.nside));
  const auto k = static_cast<size_t>(pack.primitive_size);
  if (2 * corners * k > kMaxExpandedFloats) {
    return Fail(ErrorCode::kOutOfRange, "features of " + std::to_string(2 * corners * k) +
                                            " values, more than " +
                                            std::to_string(kMaxExpandedFloats));
  }
  PATINA_TRY(CheckIndices(pack, codebook));
  std::vector<float> values(codebook.halves.size());
  for (size_t i = 0; i < values.size(); ++i) values[i] = HalfToFloat(codebook.halves[i]);
  std::vector<float> features(2 * corners * k);
  size_t next = 0;
  for (size_t h = 0; h < 2; ++h) {
    float* hemisphere = features.data() + h * corners * k;
    for (size_t c = 0; c < corners; ++c) {
      if (pack.stored[h][c] == 0) continue;
      const size_t index = pack.indices[next++];
      std::copy_n(values.data() + index * k, k, hemisphere + c * k);
    }
    FillDerivedCorners(pack.nside, pack.primitive_size, pack.stored[h], hemisphere);
  }
  return features;
}

}  // namespace patina
