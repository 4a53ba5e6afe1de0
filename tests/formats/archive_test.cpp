#include "formats/archive.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <map>

#include "formats/base/little_endian.h"
#include "formats/base/sha256.h"
#include "formats/container_archive.h"
#include "formats/weights.h"
#include "tests/formats/sample_brdf.h"
#include "tests/formats/sample_container.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<uint8_t>;
using Files = std::vector<std::pair<std::string, Bytes>>;

// Gives at most `most` bytes at a time.
ReadBytes Source(const Bytes& bytes, size_t most = 1 << 20) {
  return [&bytes, most, at = size_t{0}](std::span<uint8_t> out) mutable -> Result<size_t> {
    const size_t count = std::min({out.size(), most, bytes.size() - at});
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), count, out.begin());
    at += count;
    return count;
  };
}

WriteBytes Sink(Bytes* bytes) {
  return [bytes](std::span<const uint8_t> more) -> Status {
    bytes->insert(bytes->end(), more.begin(), more.end());
    return {};
  };
}

ReadAt Access(const Bytes& bytes, uint64_t* total = nullptr) {
  return [&bytes, total](uint64_t offset, std::span<uint8_t> out) -> Status {
    if (offset > bytes.size() || out.size() > bytes.size() - offset)
      return Fail(ErrorCode::kInternal, "a read beyond the file");
    if (total != nullptr) *total += out.size();
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), out.size(), out.begin());
    return {};
  };
}

ArchiveMember MemberOf(const std::string& name, const Bytes& content) {
  ArchiveMember member;
  member.name = name;
  member.content_bytes = content.size();
  member.sha256 = Sha256Hex(content);
  return member;
}

Bytes Packed(const Files& files, int level = 5, size_t most = 1 << 20) {
  Bytes bytes;
  auto writer = ArchiveWriter::Begin(static_cast<uint32_t>(files.size()), level, Sink(&bytes));
  EXPECT_TRUE(writer.has_value());
  for (const auto& [name, content] : files) {
    const Status added = writer->Add(MemberOf(name, content), Source(content, most));
    EXPECT_TRUE(added.has_value()) << test::MessageOf(added);
  }
  EXPECT_TRUE(writer->Finish().has_value());
  return bytes;
}

// Front to back.
Result<Files> Streamed(const Bytes& bytes, size_t most = 1 << 20) {
  ArchiveStream stream(Source(bytes, most));
  PATINA_TRY(stream.Begin());
  Files files;
  for (uint32_t i = 0; i < stream.count(); ++i) {
    PATINA_ASSIGN(const ArchiveMember member, stream.Next());
    files.emplace_back(member.name, Bytes());
    PATINA_TRY(stream.Content(Sink(&files.back().second)));
  }
  PATINA_TRY(stream.End());
  return files;
}

// By the index.
Result<Files> Indexed(const Bytes& bytes) {
  PATINA_ASSIGN(const auto members, ReadArchiveIndex(bytes.size(), Access(bytes)));
  Files files;
  for (const ArchiveMember& member : members) {
    PATINA_ASSIGN(Bytes content, ReadArchiveMember(member, 1 << 24, Access(bytes)));
    files.emplace_back(member.name, std::move(content));
  }
  return files;
}

Files SmallFiles() {
  Bytes text(300, 'a');
  for (size_t i = 0; i < text.size(); i += 7) text[i] = static_cast<uint8_t>(i);
  return {{"aaaa", text}, {"bbbb", {}}, {"cccc", {1, 2, 3}}};
}

Files LargeFiles() {
  test::Random random(1);
  Files files = {{"noise.bin", Bytes(700001)}, {"zeros.bin", Bytes(1500000, 0)}};
  for (uint8_t& byte : files[0].second) byte = static_cast<uint8_t>(random.Next());
  return files;
}

TEST(Archive, ComesBackBothWays) {
  for (const Files& files : {SmallFiles(), LargeFiles()}) {
    const Bytes bytes = Packed(files);
    const auto streamed = Streamed(bytes, 1000);
    ASSERT_OK(streamed);
    EXPECT_EQ(*streamed, files);
    const auto indexed = Indexed(bytes);
    ASSERT_OK(indexed);
    EXPECT_EQ(*indexed, files);
  }
}

TEST(Archive, HasTheBytesOfTheFormat) {
  const Bytes bytes = Packed({{"a", {7}}}, 3);
  const uint8_t head[] = {0x5E, 0x2A, 0x4D, 0x18, 24, 0, 0, 0, 'P',  'A',  'T',  'I',
                          'N',  'A',  'A',  'R',  1,  0, 0, 0, 1,    0,    0,    0,
                          0,    0,    0,    0,    0,  0, 0, 0, 0x5E, 0x2A, 0x4D, 0x18,
                          49,   0,    0,    0,    1,  0, 0, 0, 0,    0,    0,    0};
  ASSERT_GT(bytes.size(), sizeof head);
  EXPECT_EQ(std::memcmp(bytes.data(), head, sizeof head), 0);
  EXPECT_EQ(std::memcmp(&bytes[bytes.size() - 8], "PATINAIX", 8), 0);
  const uint64_t index = LoadLittle64(&bytes[bytes.size() - 24]);
  EXPECT_EQ(LoadLittle32(&bytes[index]), 0x184D2A5Eu);
  EXPECT_EQ(LoadLittle64(&bytes[index + 8]), 32u);  // where the first member begins
}

TEST(Archive, DependsOnContentAndLevelOnly) {
  const Files files = LargeFiles();
  const Bytes once = Packed(files, 5);
  EXPECT_EQ(once, Packed(files, 5, 777));
  EXPECT_NE(once, Packed(files, 12));
}

TEST(Archive, ReadsOneMemberWithoutTheOthers) {
  const Bytes bytes = Packed(LargeFiles());
  uint64_t read = 0;
  const auto members = ReadArchiveIndex(bytes.size(), Access(bytes, &read));
  ASSERT_OK(members);
  ASSERT_OK(ReadArchiveMember((*members)[1], 1 << 24, Access(bytes, &read)));
  EXPECT_LT(read, 2000u);  // the noise before it has 700001
  EXPECT_EQ(ReadArchiveMember((*members)[1], 1000, Access(bytes)).error().code,
            ErrorCode::kOutOfRange);
}

TEST(Archive, EveryTruncationAndLongerFileIsRefused) {
  const Bytes bytes = Packed(SmallFiles());
  for (size_t size = 0; size < bytes.size(); ++size) {
    const Bytes prefix = test::Prefix(bytes, size);
    const auto streamed = Streamed(prefix);
    ASSERT_FALSE(streamed.has_value()) << size;
    EXPECT_EQ(streamed.error().message.rfind("truncated", 0), 0u) << streamed.error().message;
    ASSERT_FALSE(Indexed(prefix).has_value()) << size;
  }
  Bytes longer = bytes;
  longer.push_back(0);
  EXPECT_EQ(Streamed(longer).error().message.rfind("trailing bytes", 0), 0u);
  EXPECT_FALSE(Indexed(longer).has_value());
}

TEST(Archive, NoFlippedByteGivesAnotherContent) {
  const Files files = SmallFiles();
  const Bytes bytes = Packed(files);
  int refused = 0;
  for (size_t at = 0; at < bytes.size(); ++at) {
    for (const uint8_t flip : std::initializer_list<uint8_t>{0x01, 0x10, 0xFF}) {
      Bytes broken = bytes;
      broken[at] ^= flip;
      // zstd has a bit in its frames that means nothing; every other one is missed.
      const auto streamed = Streamed(broken);
      const auto indexed = Indexed(broken);
      if (streamed) {
        EXPECT_EQ(*streamed, files) << at;
      }
      if (indexed) {
        EXPECT_EQ(*indexed, files) << at;
      }
      refused += !streamed && !indexed ? 1 : 0;
    }
  }
  EXPECT_GE(refused, static_cast<int>(3 * bytes.size()) - 8);
}

// The archive with a member's header changed in both of its places, and the index sealed again.
Bytes Forged(const Bytes& bytes, size_t member, const std::function<void(uint8_t*)>& change) {
  Bytes forged = bytes;
  const auto members = ReadArchiveIndex(bytes.size(), Access(bytes));
  const uint64_t index = LoadLittle64(&bytes[bytes.size() - 24]);
  change(&forged[(*members)[member].offset + 8]);
  size_t entry = index + 8;
  for (size_t i = 0; i < member; ++i) entry += 16 + 48 + (*members)[i].name.size();
  change(&forged[entry + 16]);
  const auto entries =
      std::span<const uint8_t>(forged).subspan(index + 8, forged.size() - 24 - index - 8);
  StoreLittle32(&forged[forged.size() - 12], Crc32(entries));
  return forged;
}

TEST(Archive, HostileHeadersAreRefused) {
  const Bytes bytes = Packed(SmallFiles());
  const auto name = [](const char* text) {
    return [text](uint8_t* header) { std::memcpy(header + 48, text, 4); };
  };
  const auto size = [](uint64_t content) {
    return [content](uint8_t* header) { StoreLittle64(header, content); };
  };
  const struct {
    const char* what;
    size_t member;
    std::function<void(uint8_t*)> change;
    const char* message;
  } cases[] = {{"parent", 0, name("../x"), "bad name"},
               {"absolute", 0, name("/etc"), "bad name"},
               {"folder", 0, name("a/bc"), "bad name"},
               {"hidden", 0, name(".abc"), "bad name"},
               {"backslash", 0, name("..\\x"), "bad name"},
               {"control", 0, name("a\n\nb"), "bad name"},
               {"not UTF-8", 0, name("\xFF\xFE\xFF\xFE"), "bad name"},
               {"twice", 1, name("aaaa"), "bad name"},
               {"too small", 0, size(299), "bad member"},
               {"too large", 0, size(301), "bad member"},
               {"nothing", 0, size(0), "bad member"},
               {"enormous", 0, size(uint64_t{1} << 60), "bad "},
               {"hash", 2, [](uint8_t* header) { header[8] ^= 1; }, "bad member"}};
  for (const auto& hostile : cases) {
    const Bytes forged = Forged(bytes, hostile.member, hostile.change);
    const auto streamed = Streamed(forged);
    ASSERT_FALSE(streamed.has_value()) << hostile.what;
    EXPECT_EQ(streamed.error().code, ErrorCode::kCorruptData) << hostile.what;
    EXPECT_EQ(streamed.error().message.rfind(hostile.message, 0), 0u)
        << hostile.what << ": " << streamed.error().message;
    ASSERT_FALSE(Indexed(forged).has_value()) << hostile.what;
  }
}

TEST(Archive, ABombPassesOnNoMoreThanItStates) {
  const Bytes zeros(8000000, 0);
  const Bytes bytes = Packed({{"zero", zeros}});
  ASSERT_LT(bytes.size(), 3000u);
  const Bytes forged = Forged(bytes, 0, [](uint8_t* header) { StoreLittle64(header, 1000); });
  ArchiveStream stream(Source(forged));
  ASSERT_OK(stream.Begin());
  ASSERT_OK(stream.Next());
  Bytes content;
  ASSERT_FALSE(stream.Content(Sink(&content)).has_value());
  EXPECT_LE(content.size(), 1000u);
}

TEST(Archive, TellsFutureVersionsAndOtherFiles) {
  Bytes bytes = Packed(SmallFiles());
  bytes[16] = 2;
  EXPECT_EQ(Streamed(bytes).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(Indexed(bytes).error().code, ErrorCode::kUnsupported);
  bytes[8] = 'X';
  EXPECT_EQ(Streamed(bytes).error().message.rfind("bad magic", 0), 0u);
}

TEST(Archive, TheWriterRefusesWhatIsNotWhatItWasTold) {
  Bytes bytes;
  const Bytes content = {1, 2, 3};
  const auto add = [&](ArchiveMember member) {
    auto writer = ArchiveWriter::Begin(1, 3, Sink(&bytes));
    return writer->Add(std::move(member), Source(content)).error().code;
  };
  ArchiveMember member = MemberOf("a", content);
  member.content_bytes = 4;
  EXPECT_EQ(add(member), ErrorCode::kConflict);
  member.content_bytes = 2;
  EXPECT_EQ(add(member), ErrorCode::kConflict);
  member = MemberOf("a", {1, 2, 4});
  EXPECT_EQ(add(member), ErrorCode::kConflict);
  EXPECT_EQ(add(MemberOf("../a", content)), ErrorCode::kInvalidArgument);
}

// ---- containers

std::map<std::string, Bytes> FolderContent(const std::string& folder) {
  std::map<std::string, Bytes> content;
  for (const auto& entry : fs::directory_iterator(folder))
    content[entry.path().filename().string()] = *ReadFile(entry.path().string(), 1 << 24);
  return content;
}

const auto kNobody = [](const ArchiveMember&) {};

class ContainerArchive : public ::testing::Test {
 protected:
  void SetUp() override {
    test::BrdfSampleOptions shared;
    shared.shared_codebook = true;
    auto material = test::StageSample(out_ / "out", "wall", 1);
    auto brdf = test::StageBrdfSample(out_ / "out", "chrome", 1, shared);
    ASSERT_OK(material);
    ASSERT_OK(brdf);
    ASSERT_OK(material->Publish());
    ASSERT_OK(brdf->Publish());
  }
  Bytes Pack(const std::string& asset) {
    Bytes bytes;
    const auto container = OpenContainer(out_ / "out/" + asset);
    const auto packed = PackContainer(*container, 5, Sink(&bytes), kNobody);
    EXPECT_TRUE(packed.has_value()) << test::MessageOf(packed);
    return bytes;
  }
  Status Unpack(const Bytes& bytes, uint64_t max_bytes = 1 << 30) {
    auto members = UnpackArchive(Source(bytes), out_ / "unpacked", max_bytes, kNobody);
    return members ? Status() : Status(Fail(members.error()));
  }
  // Only what was there before.
  void ExpectNothingLeft() const {
    for (const auto& entry : fs::directory_iterator(out_.path()))
      EXPECT_EQ(entry.path().filename(), "out");
  }
  const test::TemporaryDirectory out_;
};

TEST_F(ContainerArchive, ComesBackAsItWas) {
  const Bytes bytes = Pack("wall");
  EXPECT_EQ(bytes, Pack("wall"));
  ASSERT_OK(Unpack(bytes));
  EXPECT_EQ(FolderContent(out_ / "unpacked"), FolderContent(out_ / "out/wall/r0001"));
  EXPECT_EQ(Unpack(bytes).error().code, ErrorCode::kConflict);
}

TEST_F(ContainerArchive, HoldsTheCodebookThatIsShared) {
  ASSERT_OK(Unpack(Pack("chrome")));
  fs::remove_all(out_ / "out");
  const auto container = OpenContainer(out_ / "unpacked");
  ASSERT_OK(container);
  EXPECT_TRUE(VerifyPayloads(*container).has_value());
  const auto pack = ReadIndexPack(container->PathOf("grid.hpx"));
  ASSERT_OK(pack);
  ASSERT_OK(CodebookOf(*pack, container->directory));
}

TEST_F(ContainerArchive, LeavesNothingBehindWhenItIsRefused) {
  const Bytes bytes = Pack("wall");
  for (size_t size = 0; size < bytes.size(); size += 997) {
    EXPECT_FALSE(Unpack(test::Prefix(bytes, size)).has_value()) << size;
    ExpectNothingLeft();
  }
  EXPECT_EQ(Unpack(bytes, 1000).error().code, ErrorCode::kOutOfRange);
  ExpectNothingLeft();
  Bytes longer = bytes;
  longer.push_back(0);
  EXPECT_FALSE(Unpack(longer).has_value());
  ExpectNothingLeft();
}

TEST_F(ContainerArchive, TakesOnlyWhatTheManifestLists) {
  const auto content = FolderContent(out_ / "out/wall/r0001");
  Files files(content.begin(), content.end());
  std::stable_partition(files.begin(), files.end(),
                        [](const auto& file) { return file.first == "manifest.json"; });
  ASSERT_OK(Unpack(Packed(files)));
  fs::remove_all(out_ / "unpacked");

  Files extra = files;
  extra.push_back({"evil.so", {1}});
  EXPECT_NE(Unpack(Packed(extra)).error().message.find("evil.so"), std::string::npos);
  Files missing = files;
  missing.erase(missing.begin() + 1);
  EXPECT_NE(Unpack(Packed(missing)).error().message.find(files[1].first), std::string::npos);
  Files changed = files;
  changed[1].second[0] ^= 1;
  EXPECT_NE(Unpack(Packed(changed)).error().message.find(files[1].first), std::string::npos);
  Files late = files;
  std::swap(late[0], late[1]);
  EXPECT_FALSE(Unpack(Packed(late)).has_value());
  EXPECT_FALSE(Unpack(Packed({files[1]})).has_value());
  ExpectNothingLeft();
}

TEST_F(ContainerArchive, IsNotMadeOfADamagedContainer) {
  const auto container = OpenContainer(out_ / "out/wall");
  Bytes weights = *ReadFile(container->PathOf("decoder.weights"), 1 << 20);
  weights[100] ^= 1;
  ASSERT_OK(WriteFileDurably(container->PathOf("decoder.weights"), weights));
  Bytes bytes;
  const auto packed = PackContainer(*container, 5, Sink(&bytes), kNobody);
  ASSERT_FALSE(packed.has_value());
  EXPECT_NE(packed.error().message.find("decoder.weights"), std::string::npos);
}

}  // namespace
}  // namespace patina
