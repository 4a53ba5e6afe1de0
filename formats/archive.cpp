#include "formats/archive.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "formats/base/check.h"
#include "formats/base/little_endian.h"
#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/weights.h"

namespace patina {
namespace {

// All that is not a member's content stands in skippable frames of zstd, so that the whole file is
// a legal stream for it.
constexpr uint32_t kSkippableMagic = 0x184D2A5E;
constexpr size_t kSkippableBytes = 8;
constexpr char kMagic[] = "PATINAAR";
constexpr char kIndexMagic[] = "PATINAIX";
constexpr size_t kHeadBytes = 24;    // magic, version, count, zeros
constexpr size_t kMemberBytes = 48;  // content bytes, SHA-256, name bytes, zeros; then the name
constexpr size_t kEntryBytes = 64;   // offset, frame bytes, and a member's header
constexpr size_t kFooterBytes = 24;  // index offset, count, CRC-32, magic
constexpr size_t kShaBytes = 32;
constexpr uint64_t kMaxIndexBytes =
    kMaxArchiveMembers * (kEntryBytes + kMaxNameBytes) + kFooterBytes;

tl::unexpected<Error> Corrupt(const std::string& what) {
  return Fail(ErrorCode::kCorruptData, what);
}

void Append32(uint32_t value, std::vector<uint8_t>* bytes) {
  bytes->resize(bytes->size() + 4);
  StoreLittle32(&(*bytes)[bytes->size() - 4], value);
}

void Append64(uint64_t value, std::vector<uint8_t>* bytes) {
  bytes->resize(bytes->size() + 8);
  StoreLittle64(&(*bytes)[bytes->size() - 8], value);
}

std::vector<uint8_t> Skippable(std::span<const uint8_t> content) {
  std::vector<uint8_t> bytes;
  Append32(kSkippableMagic, &bytes);
  Append32(static_cast<uint32_t>(content.size()), &bytes);
  bytes.insert(bytes.end(), content.begin(), content.end());
  return bytes;
}

int HexValue(char digit) { return digit <= '9' ? digit - '0' : digit - 'a' + 10; }

// Without the skippable frame around it.
std::vector<uint8_t> MemberBytes(const ArchiveMember& member) {
  std::vector<uint8_t> bytes;
  Append64(member.content_bytes, &bytes);
  for (size_t i = 0; i < kShaBytes; ++i) {
    bytes.push_back(static_cast<uint8_t>(HexValue(member.sha256[2 * i]) << 4 |
                                         HexValue(member.sha256[2 * i + 1])));
  }
  Append32(static_cast<uint32_t>(member.name.size()), &bytes);
  Append32(0, &bytes);
  bytes.insert(bytes.end(), member.name.begin(), member.name.end());
  return bytes;
}

std::vector<uint8_t> IndexBytes(const std::vector<ArchiveMember>& members, uint64_t offset) {
  std::vector<uint8_t> bytes;
  for (const ArchiveMember& member : members) {
    Append64(member.offset, &bytes);
    Append64(member.frame_bytes, &bytes);
    const std::vector<uint8_t> header = MemberBytes(member);
    bytes.insert(bytes.end(), header.begin(), header.end());
  }
  const uint32_t crc = Crc32(bytes);
  Append64(offset, &bytes);
  Append32(static_cast<uint32_t>(members.size()), &bytes);
  Append32(crc, &bytes);
  bytes.insert(bytes.end(), kIndexMagic, kIndexMagic + 8);
  return bytes;
}

// The fields of a member's header at the start of `bytes`; `used` is its size.
Result<ArchiveMember> ParseMember(std::span<const uint8_t> bytes, const char* what, size_t* used) {
  if (bytes.size() < kMemberBytes)
    return Corrupt(std::string(what) + ": a member of " + std::to_string(bytes.size()) + " bytes");
  ArchiveMember member;
  member.content_bytes = LoadLittle64(bytes.data());
  member.sha256 = ToHex(bytes.subspan(8, kShaBytes));
  const uint32_t name_bytes = LoadLittle32(&bytes[40]);
  if (LoadLittle32(&bytes[44]) != 0 || name_bytes > kMaxNameBytes ||
      name_bytes > bytes.size() - kMemberBytes) {
    return Corrupt(std::string(what) + ": a name of " + std::to_string(name_bytes) + " bytes");
  }
  if (member.content_bytes > kMaxArchiveMemberBytes) {
    return Corrupt(std::string(what) + ": a member of " + std::to_string(member.content_bytes) +
                   " bytes, more than " + std::to_string(kMaxArchiveMemberBytes));
  }
  const auto* name = reinterpret_cast<const char*>(bytes.data() + kMemberBytes);
  member.name.assign(name, name_bytes);
  if (const Status legal = CheckPlainName(member.name, "bad name:"); !legal)
    return Corrupt(legal.error().message);
  *used = kMemberBytes + name_bytes;
  return member;
}

Status CheckHead(std::span<const uint8_t> head, uint32_t* count) {
  const uint8_t* bytes = head.data() + kSkippableBytes;
  if (LoadLittle32(head.data()) != kSkippableMagic || std::memcmp(bytes, kMagic, 8) != 0)
    return Corrupt("bad magic: the file is no archive of `patina pack`");
  const uint32_t version = LoadLittle32(bytes + 8);
  if (version > kArchiveVersion) {
    return Fail(ErrorCode::kUnsupported, "archive version " + std::to_string(version) +
                                             " is newer than this program, which reads up to " +
                                             std::to_string(kArchiveVersion) +
                                             "; use a newer patina");
  }
  *count = LoadLittle32(bytes + 12);
  if (version == 0 || LoadLittle32(head.data() + 4) != kHeadBytes || *count == 0 ||
      *count > kMaxArchiveMembers || LoadLittle64(bytes + 16) != 0) {
    return Corrupt("bad header: version " + std::to_string(version) + " and " +
                   std::to_string(*count) + " members at byte 16, or what must be 0 is not");
  }
  return {};
}

Status CheckNew(const ArchiveMember& member, const std::vector<ArchiveMember>& members) {
  for (const ArchiveMember& other : members) {
    if (other.name == member.name)
      return Corrupt("bad name: " + QuoteForMessage(member.name) + " stands twice");
  }
  return {};
}

Status CheckDigest(const ArchiveMember& member, const std::string& sha256) {
  if (sha256 == member.sha256) return {};
  return Corrupt("bad member " + QuoteForMessage(member.name) + ": its SHA-256 is " + sha256 +
                 ", the archive says " + member.sha256);
}

// "bad zstd frame: ..." as "bad member "x": ...".
Error OfMember(Error error, const ArchiveMember& member) {
  if (error.code == ErrorCode::kCorruptData && error.message.rfind("truncated", 0) != 0)
    error.message = "bad member " + QuoteForMessage(member.name) + ": " + error.message;
  return error;
}

}  // namespace

ArchiveWriter::ArchiveWriter(uint32_t count, int level, WriteBytes write)
    : count_(count), level_(level), write_(std::move(write)) {}

Status ArchiveWriter::Write(std::span<const uint8_t> bytes) {
  position_ += bytes.size();
  return write_(bytes);
}

Result<ArchiveWriter> ArchiveWriter::Begin(uint32_t count, int level, WriteBytes write) {
  if (count == 0 || count > kMaxArchiveMembers) {
    return Fail(ErrorCode::kInvalidArgument, std::to_string(count) +
                                                 " members; an archive has 1 to " +
                                                 std::to_string(kMaxArchiveMembers));
  }
  ArchiveWriter writer(count, level, std::move(write));
  std::vector<uint8_t> head(kMagic, kMagic + 8);
  Append32(kArchiveVersion, &head);
  Append32(count, &head);
  Append64(0, &head);
  PATINA_TRY(writer.Write(Skippable(head)));
  return writer;
}

Status ArchiveWriter::Add(ArchiveMember member, const ReadBytes& read) {
  PATINA_CHECK(members_.size() < count_ && member.sha256.size() == 2 * kShaBytes);
  PATINA_TRY(CheckPlainName(member.name, "the member"));
  if (const Status is_new = CheckNew(member, members_);
      !is_new || member.content_bytes > kMaxArchiveMemberBytes) {
    return Fail(ErrorCode::kInvalidArgument,
                QuoteForMessage(member.name) + " is too large or stands twice");
  }
  member.offset = position_;
  PATINA_TRY(Write(Skippable(MemberBytes(member))));
  Sha256 hash;
  const auto hashing = [&](std::span<uint8_t> out) -> Result<size_t> {
    PATINA_ASSIGN(const size_t count, read(out));
    hash.Update(out.first(count));
    return count;
  };
  auto frame = CompressFrame(member.content_bytes, level_, hashing,
                             [this](std::span<const uint8_t> bytes) { return Write(bytes); });
  if (!frame) return Fail(std::move(frame).error(), member.name);
  member.frame_bytes = *frame;
  if (const std::string sha256 = hash.FinishHex(); sha256 != member.sha256) {
    return Fail(ErrorCode::kConflict, member.name + " has the SHA-256 " + sha256 + ", not " +
                                          member.sha256 + "; bake or copy it again");
  }
  members_.push_back(std::move(member));
  return {};
}

Status ArchiveWriter::Finish() {
  PATINA_CHECK(members_.size() == count_);
  return Write(Skippable(IndexBytes(members_, position_)));
}

Status ArchiveStream::Begin() {
  std::array<uint8_t, kSkippableBytes + kHeadBytes> head{};
  PATINA_TRY(reader_.ReadExactly(head, "the header"));
  return CheckHead(head, &count_);
}

Result<ArchiveMember> ArchiveStream::Next() {
  const uint64_t offset = reader_.position();
  std::array<uint8_t, kSkippableBytes> frame{};
  PATINA_TRY(reader_.ReadExactly(frame, "the header of a member"));
  const uint32_t bytes = LoadLittle32(&frame[4]);
  if (LoadLittle32(frame.data()) != kSkippableMagic || bytes < kMemberBytes ||
      bytes > kMemberBytes + kMaxNameBytes) {
    return Corrupt("bad header: no member begins at byte " + std::to_string(offset));
  }
  std::vector<uint8_t> header(bytes);
  PATINA_TRY(reader_.ReadExactly(header, "the header of a member"));
  size_t used = 0;
  PATINA_ASSIGN(ArchiveMember member, ParseMember(header, "bad header", &used));
  if (used != header.size())
    return Corrupt("bad header: bytes behind a name at byte " + std::to_string(offset));
  PATINA_TRY(CheckNew(member, members_));
  member.offset = offset;
  members_.push_back(member);
  return member;
}

Status ArchiveStream::Content(const WriteBytes& write) {
  ArchiveMember& member = members_.back();
  const uint64_t begin = reader_.position();
  Sha256 hash;
  const Status read = DecompressFrame(member.content_bytes, &reader_,
                                      [&](std::span<const uint8_t> bytes) -> Status {
                                        hash.Update(bytes);
                                        return write(bytes);
                                      });
  if (!read) return Fail(OfMember(read.error(), member));
  member.frame_bytes = reader_.position() - begin;
  return CheckDigest(member, hash.FinishHex());
}

Status ArchiveStream::End() {
  const uint64_t at = reader_.position();
  const std::vector<uint8_t> wanted = Skippable(IndexBytes(members_, at));
  std::vector<uint8_t> index(wanted.size());
  PATINA_TRY(reader_.ReadExactly(index, "the index"));
  if (index != wanted)
    return Corrupt("bad index: it is not that of the members, at byte " + std::to_string(at));
  PATINA_ASSIGN(const std::span<const uint8_t> rest, reader_.Peek());
  if (!rest.empty()) {
    return Corrupt("trailing bytes: the archive ends at byte " +
                   std::to_string(reader_.position()));
  }
  return {};
}

Result<std::vector<ArchiveMember>> ReadArchiveIndex(uint64_t archive_bytes, const ReadAt& read_at) {
  std::array<uint8_t, kSkippableBytes + kHeadBytes> head{};
  if (archive_bytes < head.size() + kSkippableBytes + kFooterBytes)
    return Corrupt("truncated: " + std::to_string(archive_bytes) + " bytes are no archive");
  PATINA_TRY(read_at(0, head));
  uint32_t count = 0;
  PATINA_TRY(CheckHead(head, &count));
  std::array<uint8_t, kFooterBytes> footer{};
  PATINA_TRY(read_at(archive_bytes - footer.size(), footer));
  if (std::memcmp(&footer[16], kIndexMagic, 8) != 0)
    return Corrupt("truncated: the file does not end with an index, or bytes follow it");
  const uint64_t offset = LoadLittle64(footer.data());
  if (offset < head.size() || offset > archive_bytes - kSkippableBytes - kFooterBytes ||
      archive_bytes - offset > kSkippableBytes + kMaxIndexBytes ||
      LoadLittle32(&footer[8]) != count) {
    return Corrupt("bad index: it begins at byte " + std::to_string(offset) + " with " +
                   std::to_string(LoadLittle32(&footer[8])) + " members");
  }
  std::vector<uint8_t> index(archive_bytes - offset);
  PATINA_TRY(read_at(offset, index));
  const auto entries = std::span<const uint8_t>(index).subspan(
      kSkippableBytes, index.size() - kSkippableBytes - kFooterBytes);
  if (LoadLittle32(index.data()) != kSkippableMagic ||
      LoadLittle32(&index[4]) != index.size() - kSkippableBytes ||
      Crc32(entries) != LoadLittle32(&footer[12])) {
    return Corrupt("bad index: its checksum does not match, at byte " + std::to_string(offset));
  }
  std::vector<ArchiveMember> members;
  uint64_t end = head.size();
  auto left = entries;
  for (uint32_t i = 0; i < count; ++i) {
    if (left.size() < 16) return Corrupt("bad index: it ends within its members");
    size_t used = 0;
    PATINA_ASSIGN(ArchiveMember member, ParseMember(left.subspan(16), "bad index", &used));
    member.offset = LoadLittle64(left.data());
    member.frame_bytes = LoadLittle64(left.data() + 8);
    PATINA_TRY(CheckNew(member, members));
    const uint64_t header_bytes = kSkippableBytes + used;
    if (member.offset != end || member.frame_bytes > offset - end ||
        header_bytes > offset - end - member.frame_bytes) {
      return Corrupt("bad index: " + QuoteForMessage(member.name) + " lies at byte " +
                     std::to_string(member.offset) + ", not at " + std::to_string(end));
    }
    end += header_bytes + member.frame_bytes;
    left = left.subspan(16 + used);
    members.push_back(std::move(member));
  }
  if (end != offset || !left.empty())
    return Corrupt("bad index: its members end at byte " + std::to_string(end));
  return members;
}

Result<std::vector<uint8_t>> ReadArchiveMember(const ArchiveMember& member, uint64_t max_bytes,
                                               const ReadAt& read_at) {
  if (member.content_bytes > max_bytes) {
    return Fail(ErrorCode::kOutOfRange, QuoteForMessage(member.name) + " has " +
                                            std::to_string(member.content_bytes) +
                                            " bytes, more than " + std::to_string(max_bytes));
  }
  const std::vector<uint8_t> wanted = Skippable(MemberBytes(member));
  std::vector<uint8_t> header(wanted.size());
  PATINA_TRY(read_at(member.offset, header));
  if (header != wanted) {
    return Corrupt("bad member " + QuoteForMessage(member.name) + ": its header at byte " +
                   std::to_string(member.offset) + " is not what the index says");
  }
  uint64_t at = member.offset + header.size();
  const uint64_t end = at + member.frame_bytes;
  BufferedReader reader([&](std::span<uint8_t> out) -> Result<size_t> {
    const auto count = static_cast<size_t>(std::min<uint64_t>(out.size(), end - at));
    if (count > 0) PATINA_TRY(read_at(at, out.first(count)));
    at += count;
    return count;
  });
  std::vector<uint8_t> content;
  const Status read =
      DecompressFrame(member.content_bytes, &reader, [&](std::span<const uint8_t> bytes) -> Status {
        content.insert(content.end(), bytes.begin(), bytes.end());
        return {};
      });
  if (!read) return Fail(OfMember(read.error(), member));
  if (reader.position() != member.frame_bytes)
    return Corrupt("bad member " + QuoteForMessage(member.name) + ": bytes behind its zstd frame");
  PATINA_TRY(CheckDigest(member, Sha256Hex(content)));
  return content;
}

}  // namespace patina
