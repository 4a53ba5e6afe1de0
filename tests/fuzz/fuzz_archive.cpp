// Archives: any bytes, also with a right checksum of the index. What can be read front to back has
// an index that says the same, each member alone is what it was in the stream, and the writer makes
// an archive of it again.
#include <algorithm>
#include <optional>

#include "formats/archive.h"
#include "formats/base/little_endian.h"
#include "formats/base/sha256.h"
#include "formats/weights.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

namespace {

using Bytes = std::vector<uint8_t>;

constexpr size_t kFooterBytes = 24;
constexpr size_t kSkippableBytes = 8;  // of a skippable frame's head
// A header may state gigabytes: enough is read of them to see that this does no harm.
constexpr size_t kMaxContent = 1 << 20;

ReadBytes Source(const Bytes& bytes) {
  return [&bytes, at = size_t{0}](std::span<uint8_t> out) mutable -> Result<size_t> {
    // Pieces that end anywhere.
    const size_t count = std::min({out.size(), size_t{37}, bytes.size() - at});
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), count, out.begin());
    at += count;
    return count;
  };
}

WriteBytes Sink(Bytes* bytes) {
  return [bytes](std::span<const uint8_t> more) -> Status {
    if (bytes->size() + more.size() > kMaxContent) return Fail(ErrorCode::kOutOfRange, "enough");
    bytes->insert(bytes->end(), more.begin(), more.end());
    return {};
  };
}

ReadAt Access(const Bytes& bytes) {
  return [&bytes](uint64_t offset, std::span<uint8_t> out) -> Status {
    FUZZ_CHECK(offset <= bytes.size() && out.size() <= bytes.size() - offset);
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), out.size(), out.begin());
    return {};
  };
}

struct Member {
  ArchiveMember header;
  Bytes content;
};

std::optional<std::vector<Member>> ReadStream(const Bytes& bytes) {
  ArchiveStream stream(Source(bytes));
  const auto good = [](const auto& result) {
    if (!result) FUZZ_CHECK(!result.error().message.empty());
    return result.has_value();
  };
  if (!good(stream.Begin())) return std::nullopt;
  std::vector<Member> members;
  for (uint32_t i = 0; i < stream.count(); ++i) {
    auto header = stream.Next();
    if (!good(header)) return std::nullopt;
    Member member{std::move(*header), {}};
    if (!good(stream.Content(Sink(&member.content)))) return std::nullopt;
    members.push_back(std::move(member));
  }
  if (!good(stream.End())) return std::nullopt;
  return members;
}

Bytes Written(const std::vector<Member>& members) {
  Bytes bytes;
  auto writer = ArchiveWriter::Begin(static_cast<uint32_t>(members.size()), 1, Sink(&bytes));
  FUZZ_CHECK(writer.has_value());
  for (const Member& member : members)
    FUZZ_CHECK(writer->Add(member.header, Source(member.content)).has_value());
  FUZZ_CHECK(writer->Finish().has_value());
  return bytes;
}

void Try(const Bytes& bytes) {
  const auto members = ReadStream(bytes);
  const auto index = ReadArchiveIndex(bytes.size(), Access(bytes));
  if (!index) FUZZ_CHECK(!index.error().message.empty());
  if (index) {
    for (const ArchiveMember& member : *index) {
      const auto content = ReadArchiveMember(member, kMaxContent, Access(bytes));
      FUZZ_CHECK(content ? Sha256Hex(*content) == member.sha256 : !content.error().message.empty());
    }
  }
  if (!members) return;
  FUZZ_CHECK(index.has_value() && index->size() == members->size());
  for (size_t i = 0; i < members->size(); ++i) {
    const Member& member = (*members)[i];
    FUZZ_CHECK((*index)[i].name == member.header.name &&
               (*index)[i].sha256 == member.header.sha256);
    const auto alone = ReadArchiveMember((*index)[i], kMaxContent, Access(bytes));
    FUZZ_CHECK(alone.has_value() && *alone == member.content);
  }
  const auto again = ReadStream(Written(*members));
  FUZZ_CHECK(again.has_value() && again->size() == members->size());
}

// Puts the checksum of the index right, which would stop every mutation of it. False: there is
// none.
bool MendIndex(Bytes* bytes) {
  if (bytes->size() < kFooterBytes) return false;
  const size_t end = bytes->size() - kFooterBytes;
  const uint64_t begin = LoadLittle64(bytes->data() + end);
  if (begin > end || end - begin < kSkippableBytes) return false;
  const std::span<const uint8_t> entries(bytes->data() + begin + kSkippableBytes,
                                         end - begin - kSkippableBytes);
  StoreLittle32(bytes->data() + end + 12, Crc32(entries));
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bytes bytes(data, data + size);
  Try(bytes);
  if (MendIndex(&bytes)) Try(bytes);
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  const auto member = [](const char* name, Bytes content) {
    ArchiveMember header;
    header.name = name;
    header.content_bytes = content.size();
    header.sha256 = Sha256Hex(content);
    return Member{header, std::move(content)};
  };
  const std::vector<std::vector<uint8_t>> seeds = {
      Written({member("manifest.json", {'{', '}'})}),
      Written({member("manifest.json", Bytes(300, 'm')), member("features_0.dds", Bytes(2000, 7)),
               member("decoder.weights", {})})};
  for (const Bytes& seed : seeds) {
    Bytes mended = seed;
    FUZZ_CHECK(MendIndex(&mended) && mended == seed && ReadStream(seed).has_value());
  }
  return seeds;
}
