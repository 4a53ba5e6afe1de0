#include "formats/index_pack.h"

#include <gtest/gtest.h>
#include <zstd.h>

#include <cstring>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "formats/base/sha256.h"
#include "formats/base/zstd_frame.h"
#include "tests/formats/sample_brdf.h"

namespace patina {
namespace {

using test::MessageOf;
using test::PackOptions;
using test::Random;
using test::RandomPack;

bool StartsWith(const std::string& text, const char* start) { return text.rfind(start, 0) == 0; }

IndexPack SmallPack() {
  Random random(11);
  return RandomPack(random, {.nside = 2, .primitive_size = 3, .index_bits = 5, .entries = 20});
}

IndexPack SharedPack() {
  IndexPack pack = SmallPack();
  pack.codebook.clear();
  pack.codebook_file = "metals.hpc";
  pack.codebook_sha256 = std::string(63, '0') + "f";
  return pack;
}

// Makes size and checksum right again, so that what lies behind them is reached.
std::vector<uint8_t> Resealed(std::vector<uint8_t> bytes) {
  StoreLittle64(&bytes[16], bytes.size());
  StoreLittle32(&bytes[24], 0);
  StoreLittle32(&bytes[24], Crc32(bytes));
  return bytes;
}

void ExpectSame(const IndexPack& a, const IndexPack& b) {
  EXPECT_EQ(a.nside, b.nside);
  EXPECT_EQ(a.primitive_size, b.primitive_size);
  EXPECT_EQ(a.index_bits, b.index_bits);
  EXPECT_EQ(a.interpolation, b.interpolation);
  EXPECT_EQ(a.isotropic, b.isotropic);
  EXPECT_EQ(a.canonical_order, b.canonical_order);
  EXPECT_EQ(a.angle_inputs, b.angle_inputs);
  EXPECT_EQ(a.half_vector_inputs, b.half_vector_inputs);
  for (int h = 0; h < 2; ++h) EXPECT_EQ(a.stored[h], b.stored[h]);
  EXPECT_EQ(a.indices, b.indices);
  EXPECT_EQ(a.codebook, b.codebook);
  EXPECT_EQ(a.codebook_file, b.codebook_file);
  EXPECT_EQ(a.codebook_sha256, b.codebook_sha256);
}

TEST(IndexPack, RoundTripsEveryFeature) {
  Random random(1);
  for (const int nside : {1, 2, 3, 4, 7, 16}) {
    for (int bits = 1; bits <= 16; bits += nside == 3 ? 1 : 5) {
      for (const double stored : {0.0, 0.3, 1.0}) {
        const int entries = std::min(1 << bits, 300);
        IndexPack pack = RandomPack(random, {.nside = nside,
                                             .primitive_size = 1 + random.Below(8),
                                             .index_bits = bits,
                                             .entries = entries,
                                             .stored = stored});
        pack.interpolation = static_cast<Interpolation>(random.Below(3));
        pack.isotropic = random.Below(2) != 0;
        pack.canonical_order = random.Below(2) != 0;
        pack.angle_inputs = random.Below(2) != 0;
        pack.half_vector_inputs = pack.angle_inputs && random.Below(2) != 0;
        for (const int level : {0, 3, 19}) {
          const auto bytes = EncodeIndexPack(pack, level);
          ASSERT_OK(bytes);
          EXPECT_EQ(IsZstdFrame(*bytes), level != 0);
          const auto read = ParseIndexPack(*bytes);
          ASSERT_OK(read);
          ExpectSame(*read, pack);
        }
      }
    }
  }
  const auto shared = ParseIndexPack(*EncodeIndexPack(SharedPack()));
  ASSERT_OK(shared);
  ExpectSame(*shared, SharedPack());
}

TEST(IndexPack, WritesTheBytesOfVersionOne) {
  IndexPack pack;
  pack.nside = 1;
  pack.primitive_size = 2;
  pack.index_bits = 3;
  pack.interpolation = Interpolation::kUniform;
  pack.isotropic = true;
  pack.canonical_order = false;
  pack.angle_inputs = true;
  pack.stored[0].assign(13, 1);
  pack.stored[1] = {1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1};
  for (int i = 0; i < 20; ++i) pack.indices.push_back(static_cast<uint16_t>(i % 3));
  pack.codebook = {0x3C00, 0xBC00, 1, 2, 3, 4};
  const auto bytes = EncodeIndexPack(pack);
  ASSERT_OK(bytes);
  // Header, three primitives of two halves, one run of 13, a bitmap of 13 bits, 60 bits.
  ASSERT_EQ(bytes->size(), 64u + 12 + 1 + 2 + 8);
  const uint8_t* b = bytes->data();
  EXPECT_EQ(std::memcmp(b, "PATINAHX", 8), 0);
  EXPECT_EQ(LoadLittle32(b + 8), 1u);
  EXPECT_EQ(LoadLittle32(b + 12), 5u);
  EXPECT_EQ(LoadLittle64(b + 16), bytes->size());
  EXPECT_EQ(LoadLittle32(b + 28), 1u | 2u << 16);
  EXPECT_EQ(LoadLittle32(b + 32), 3u);
  const uint8_t small[4] = {3, 2, 1, 0};  // bits, interpolation, runs, bitmap
  EXPECT_EQ(std::memcmp(b + 36, small, 4), 0);
  EXPECT_EQ(LoadLittle32(b + 40), 13u);
  EXPECT_EQ(LoadLittle32(b + 44), 7u);
  EXPECT_EQ(LoadLittle32(b + 48), 1u);
  EXPECT_EQ(LoadLittle32(b + 52), 2u);
  // The indices 0 1 2 0 1 2 0 1 in 3 bits each are the octal digits of 010210210 = 0x211088.
  const uint8_t body[] = {0x00, 0x3C, 0x00, 0xBC, 1,    0,    2,    0,    3,
                          0,    4,    0,    13,   0x55, 0x15, 0x88, 0x10, 0x21};
  EXPECT_EQ(std::memcmp(b + 64, body, sizeof body), 0);
  std::vector<uint8_t> sealed = *bytes;
  StoreLittle32(&sealed[24], 0);
  EXPECT_EQ(LoadLittle32(b + 24), Crc32(sealed));
}

TEST(IndexPack, MapsTakeTheSmallerCoding) {
  Random random(2);
  // All stored: a run; every other: a bitmap; the half plane of an isotropic material: runs.
  IndexPack pack = RandomPack(random, {.nside = 32, .stored = 1.0});
  EXPECT_LT(EncodeIndexPack(pack)->size(),
            64 + pack.codebook.size() * 2 + 8 + (pack.indices.size() * 6 + 7) / 8);
  pack = RandomPack(random, {.nside = 32, .stored = 0.5});
  const size_t bitmap = static_cast<size_t>((healpix::CornerCount(32) + 7) / 8);
  EXPECT_EQ(EncodeIndexPack(pack)->size(),
            64 + pack.codebook.size() * 2 + 2 * bitmap + (pack.indices.size() * 6 + 7) / 8);
}

TEST(IndexPack, NoticesEveryTruncation) {
  for (const IndexPack& pack : {SmallPack(), SharedPack()}) {
    for (const int level : {0, 5}) {
      const std::vector<uint8_t> bytes = *EncodeIndexPack(pack, level);
      for (size_t size = 0; size < bytes.size(); ++size) {
        const auto result = ParseIndexPack(test::Prefix(bytes, size));
        ASSERT_FALSE(result) << size;
        ASSERT_EQ(result.error().code, ErrorCode::kCorruptData);
        // The first three bytes of a zstd frame are no frame yet.
        if (level == 0 || size > 3) {
          ASSERT_TRUE(StartsWith(result.error().message, "truncated"))
              << size << ": " << result.error().message;
        }
      }
    }
  }
}

TEST(IndexPack, NoticesTrailingBytes) {
  for (const int level : {0, 5}) {
    std::vector<uint8_t> bytes = *EncodeIndexPack(SmallPack(), level);
    bytes.push_back(0);
    EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(bytes)), "trailing bytes"));
  }
  // In a frame that is whole, and with a size that covers them.
  std::vector<uint8_t> bytes = *EncodeIndexPack(SmallPack());
  bytes.push_back(0);
  EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(*CompressZstd(bytes, 1))), "trailing bytes"));
  EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(Resealed(bytes))), "bad header"));
}

TEST(IndexPack, NoticesABadMagicAndAFutureVersion) {
  std::vector<uint8_t> bytes = *EncodeIndexPack(SmallPack());
  bytes[3] ^= 1;
  EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(bytes)), "bad magic"));
  EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(*EncodeCodebook({3, SmallPack().codebook}))),
                         "bad magic"));
  bytes = *EncodeIndexPack(SmallPack());
  StoreLittle32(&bytes[8], 2);
  EXPECT_EQ(ParseIndexPack(bytes).error().code, ErrorCode::kUnsupported);
  EXPECT_NE(MessageOf(ParseIndexPack(bytes)).find("newer"), std::string::npos);
  StoreLittle32(&bytes[8], 0);
  EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(bytes)), "bad header"));
}

TEST(IndexPack, NoticesEveryFlippedBit) {
  for (const int level : {0, 5}) {
    const std::vector<uint8_t> bytes = *EncodeIndexPack(SmallPack(), level);
    for (size_t bit = 0; bit < bytes.size() * 8; ++bit) {
      std::vector<uint8_t> damaged = bytes;
      damaged[bit / 8] = static_cast<uint8_t>(damaged[bit / 8] ^ 1 << (bit % 8));
      const auto read = ParseIndexPack(damaged);
      // A few bits of a zstd frame mean nothing: then the content is the same.
      if (read) {
        ASSERT_NE(level, 0) << "bit " << bit;
        ASSERT_EQ(*EncodeIndexPack(*read), *EncodeIndexPack(SmallPack())) << "bit " << bit;
      }
    }
  }
}

// Every byte of the file set to several values, with a right checksum: no crash, and what is
// accepted is legal.
TEST(IndexPack, SurvivesEveryResealedByte) {
  for (const IndexPack& pack : {SmallPack(), SharedPack()}) {
    const std::vector<uint8_t> bytes = *EncodeIndexPack(pack);
    int refused = 0;
    for (size_t at = 0; at < bytes.size(); ++at) {
      for (const int value : {0, 1, 2, 17, 0x7C, 0x7F, 0x80, 0xFF}) {
        std::vector<uint8_t> changed = bytes;
        changed[at] = static_cast<uint8_t>(value);
        if (at < 16 || at >= 24) changed = Resealed(changed);
        const auto read = ParseIndexPack(changed);
        if (read) {
          ASSERT_TRUE(EncodeIndexPack(*read)) << at << " = " << value;
        } else {
          ++refused;
        }
      }
    }
    EXPECT_GT(refused, 300);
  }
}

TEST(IndexPack, RefusesImpossibleHeaders) {
  struct Case {
    size_t at;
    uint32_t value;
    const char* start;
  };
  for (const Case& broken : std::initializer_list<Case>{{12, 8, "bad header"},
                                                        {12, 0xFFFFFFFF, "bad header"},
                                                        {28, 3u << 16, "bad header"},
                                                        {28, 1025 | 3u << 16, "bad header"},
                                                        {28, 2 | 0u << 16, "bad header"},
                                                        {28, 2 | 65u << 16, "bad header"},
                                                        {28, 1024 | 3u << 16, "bad map"},
                                                        {28, 1024 | 64u << 16, "bad header"},
                                                        {32, 0, "bad header"},
                                                        {32, 33, "bad header"},
                                                        {32, 0xFFFFFFFF, "bad header"},
                                                        {36, 0, "bad header"},
                                                        {36, 17, "bad header"},
                                                        {36, 5 | 3 << 8, "bad header"},
                                                        {36, 5 | 2 << 16, "bad header"},
                                                        {40, 0, "bad map"},
                                                        {40, 0xFFFFFFFF, "bad map"},
                                                        {48, 0, "bad map"},
                                                        {48, 0xFFFFFFFF, "bad header"},
                                                        {52, 0x80000000, "bad header"},
                                                        {56, 1, "bad header"},
                                                        {58, 1, "bad header"},
                                                        {60, 1, "bad header"}}) {
    std::vector<uint8_t> bytes = *EncodeIndexPack(SmallPack());
    StoreLittle32(&bytes[broken.at], broken.value);
    const auto result = ParseIndexPack(Resealed(bytes));
    ASSERT_FALSE(result) << broken.at << " = " << broken.value;
    EXPECT_EQ(result.error().code, ErrorCode::kCorruptData);
    EXPECT_TRUE(StartsWith(result.error().message, broken.start))
        << broken.at << " = " << broken.value << ": " << result.error().message;
  }
  for (const uint64_t size : {uint64_t{0}, uint64_t{63}, kMaxIndexPackBytes + 1, ~uint64_t{0}}) {
    std::vector<uint8_t> bytes = *EncodeIndexPack(SmallPack());
    StoreLittle64(&bytes[16], size);
    EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(bytes)), "bad header")) << size;
  }
}

// A pack of Nside 1 whose body follows the header in the given bytes; runs in both maps.
std::vector<uint8_t> PackWithMaps(const std::vector<uint8_t>& map0,
                                  const std::vector<uint8_t>& map1, uint32_t stored0,
                                  uint32_t stored1, const std::vector<uint8_t>& indices,
                                  uint8_t coding = 1) {
  IndexPack pack;
  pack.nside = 1;
  pack.primitive_size = 1;
  pack.index_bits = 2;
  for (auto& stored : pack.stored) stored.assign(13, 0);
  pack.codebook = {0, 1, 2};
  std::vector<uint8_t> bytes = *EncodeIndexPack(pack);
  bytes.resize(64 + 6);
  bytes.insert(bytes.end(), map0.begin(), map0.end());
  bytes.insert(bytes.end(), map1.begin(), map1.end());
  bytes.insert(bytes.end(), indices.begin(), indices.end());
  bytes[38] = bytes[39] = coding;
  StoreLittle32(&bytes[40], stored0);
  StoreLittle32(&bytes[44], stored1);
  StoreLittle32(&bytes[48], static_cast<uint32_t>(map0.size()));
  StoreLittle32(&bytes[52], static_cast<uint32_t>(map1.size()));
  return Resealed(bytes);
}

TEST(IndexPack, RefusesIllegalMapsAndIndices) {
  const std::vector<uint8_t> none = {0, 13};
  ASSERT_OK(ParseIndexPack(PackWithMaps(none, none, 0, 0, {})));
  ASSERT_OK(ParseIndexPack(PackWithMaps({2, 11}, none, 2, 0, {0x09})));
  const auto message = [&](const std::vector<uint8_t>& map, uint32_t stored,
                           const std::vector<uint8_t>& indices, uint8_t coding = 1) {
    const std::vector<uint8_t> other = coding == 1 ? none : std::vector<uint8_t>{0, 0};
    return MessageOf(ParseIndexPack(PackWithMaps(map, other, stored, 0, indices, coding)));
  };
  const std::vector<std::vector<uint8_t>> maps = {
      {0, 12},                            // too short
      {0, 14},                            // too long
      {0, 13, 0},                         // an empty run after the first
      {0, 6, 0, 7},                       //
      {0x80, 0x00, 13},                   // a length in more bytes than it needs
      {0, 0x80},                          // a length that does not end
      {0, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F},  // 2^32 - 1
      {0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1},
      {}};
  for (const auto& map : maps) {
    EXPECT_TRUE(StartsWith(message(map, 0, {}), "bad map of hemisphere 0")) << message(map, 0, {});
  }
  EXPECT_TRUE(StartsWith(message({2, 11}, 3, {0}), "bad map"));
  EXPECT_TRUE(StartsWith(message({0, 0x20}, 0, {}, 0), "bad map"));  // a bit beyond the end
  EXPECT_TRUE(StartsWith(message({0}, 0, {}, 0), "bad map"));
  EXPECT_TRUE(StartsWith(message({2, 11}, 2, {0x0F}), "bad index 3"));  // three entries
  EXPECT_TRUE(StartsWith(message({2, 11}, 2, {0x19}), "bad index section"));
  EXPECT_TRUE(StartsWith(message({2, 11}, 2, {}), "bad header"));
  EXPECT_TRUE(StartsWith(message({2, 11}, 2, {0, 0}), "bad header"));
}

TEST(IndexPack, RefusesNonFinitePrimitives) {
  for (const int bad : {0x7C00, 0xFC00, 0x7E00, 0x7C01}) {
    std::vector<uint8_t> bytes = *EncodeIndexPack(SmallPack());
    bytes[64 + 8] = static_cast<uint8_t>(bad & 0xFF);
    bytes[64 + 9] = static_cast<uint8_t>(bad >> 8);
    EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(Resealed(bytes))),
                           "non-finite primitive: value 1 of entry 1"));
  }
}

TEST(IndexPack, RefusesHostileReferences) {
  for (const char* name : {"../etc/pw", "a/b.hpc/cc", ".hidden.hp", "back\\slash"}) {
    std::vector<uint8_t> bytes = *EncodeIndexPack(SharedPack());
    std::memcpy(&bytes[64 + 32], name, 10);
    EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(Resealed(bytes))), "bad codebook reference"))
        << name;
  }
}

TEST(IndexPack, BoundsWhatZstdFramesUnpackTo) {
  // 65 MiB of zeros in a few kilobytes.
  const std::vector<uint8_t> zeros(kMaxIndexPackBytes + (1 << 20), 0);
  std::vector<uint8_t> bomb = *CompressZstd(zeros, 1);
  EXPECT_LT(bomb.size(), 20000u);
  EXPECT_EQ(ParseIndexPack(bomb).error().code, ErrorCode::kOutOfRange);
  EXPECT_EQ(ParseCodebook(bomb).error().code, ErrorCode::kOutOfRange);
  // A frame that does not say how much it holds.
  const std::vector<uint8_t> bytes = *EncodeIndexPack(SmallPack());
  ZSTD_CCtx* context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, 0);
  std::vector<uint8_t> unknown(ZSTD_compressBound(bytes.size()));
  unknown.resize(
      ZSTD_compress2(context, unknown.data(), unknown.size(), bytes.data(), bytes.size()));
  ZSTD_freeCCtx(context);
  EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(unknown)), "bad zstd frame"));
  // A frame in a frame is no pack.
  const auto twice = CompressZstd(*CompressZstd(bytes, 1), 1);
  EXPECT_TRUE(StartsWith(MessageOf(ParseIndexPack(*twice)), "bad magic"));
  EXPECT_EQ(CompressZstd(bytes, 0).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(CompressZstd(bytes, 20).error().code, ErrorCode::kInvalidArgument);
}

TEST(IndexPack, WriterRefusesBrokenRules) {
  const auto refuses = [](const char* start, auto&& break_it) {
    IndexPack pack = SmallPack();
    break_it(&pack);
    const auto result = EncodeIndexPack(pack);
    EXPECT_FALSE(result) << start;
    if (result) return;
    EXPECT_EQ(result.error().code, ErrorCode::kInvalidArgument);
    EXPECT_TRUE(StartsWith(result.error().message, start)) << result.error().message;
  };
  refuses("nside", [](IndexPack* p) { p->nside = 0; });
  refuses("nside", [](IndexPack* p) { p->nside = 1025; });
  refuses("primitive_size", [](IndexPack* p) { p->primitive_size = 0; });
  refuses("primitive_size", [](IndexPack* p) { p->primitive_size = 65; });
  refuses("index_bits", [](IndexPack* p) { p->index_bits = 17; });
  refuses("interpolation", [](IndexPack* p) { p->interpolation = static_cast<Interpolation>(3); });
  refuses("stored[1]", [](IndexPack* p) { p->stored[1].pop_back(); });
  refuses("stored[0]", [](IndexPack* p) { p->stored[0][0] = 2; });
  refuses("indices", [](IndexPack* p) { p->indices.push_back(0); });
  refuses("indices[0]", [](IndexPack* p) { p->indices[0] = 20; });
  refuses("codebook", [](IndexPack* p) { p->codebook.pop_back(); });
  refuses("codebook", [](IndexPack* p) { p->codebook.clear(); });
  refuses("codebook", [](IndexPack* p) { p->codebook.resize(33 * 3); });
  refuses("non-finite", [](IndexPack* p) { p->codebook[4] = 0x7C00; });
  refuses("codebook: both", [](IndexPack* p) { p->codebook_file = "x.hpc"; });
  refuses("codebook_sha256", [](IndexPack* p) {
    p->codebook.clear();
    p->codebook_file = "x.hpc";
  });
  refuses("codebook_file", [](IndexPack* p) {
    p->codebook.clear();
    p->codebook_file = "../x.hpc";
    p->codebook_sha256 = std::string(64, 'a');
  });
}

TEST(Codebook, RoundTripsAndRefusesDamage) {
  Random random(5);
  Codebook codebook{7, {}};
  for (int i = 0; i < 7 * 30; ++i) codebook.halves.push_back(test::RandomHalf(random, 10));
  for (const int level : {0, 9}) {
    const std::vector<uint8_t> bytes = *EncodeCodebook(codebook, level);
    const auto read = ParseCodebook(bytes);
    ASSERT_OK(read);
    EXPECT_EQ(read->primitive_size, 7);
    EXPECT_EQ(read->halves, codebook.halves);
    for (size_t size = 0; size < bytes.size(); ++size) {
      const auto cut = ParseCodebook(test::Prefix(bytes, size));
      ASSERT_FALSE(cut);
      ASSERT_EQ(cut.error().code, ErrorCode::kCorruptData);
    }
    std::vector<uint8_t> longer = bytes;
    longer.push_back(0);
    EXPECT_TRUE(StartsWith(MessageOf(ParseCodebook(longer)), "trailing bytes"));
  }
  const std::vector<uint8_t> good = *EncodeCodebook(codebook);
  EXPECT_EQ(good.size(), 64u + 2 * 210);
  for (size_t at = 0; at < good.size(); ++at) {
    std::vector<uint8_t> damaged = good;
    damaged[at] ^= 0x40;
    ASSERT_FALSE(ParseCodebook(damaged)) << at;
  }
  for (const auto& [at, value] :
       std::initializer_list<std::pair<size_t, uint32_t>>{{8, 0},
                                                          {12, 1},
                                                          {28, 1 | 7u << 16},
                                                          {28, 0},
                                                          {28, 65u << 16},
                                                          {32, 0},
                                                          {32, 29},
                                                          {32, 0xFFFFFFFF},
                                                          {32, 65537},
                                                          {36, 1},
                                                          {60, 1}}) {
    std::vector<uint8_t> broken = good;
    StoreLittle32(&broken[at], value);
    EXPECT_TRUE(StartsWith(MessageOf(ParseCodebook(Resealed(broken))), "bad header"))
        << at << " = " << value << ": " << MessageOf(ParseCodebook(Resealed(broken)));
  }
  std::vector<uint8_t> future = good;
  StoreLittle32(&future[8], 2);
  EXPECT_EQ(ParseCodebook(future).error().code, ErrorCode::kUnsupported);
  std::vector<uint8_t> infinite = good;
  infinite[64] = 0;
  infinite[65] = 0x7C;
  EXPECT_TRUE(StartsWith(MessageOf(ParseCodebook(Resealed(infinite))), "non-finite primitive"));
  EXPECT_EQ(EncodeCodebook({7, {1, 2}}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(EncodeCodebook({7, {}}).error().code, ErrorCode::kInvalidArgument);
}

TEST(IndexPack, FindsItsCodebookBesideItselfAndBesideTheAssets) {
  const test::TemporaryDirectory out;
  const std::string revision = out / "asset/r0001";
  ASSERT_OK(MakeDirectories(revision));
  const Codebook codebook{3, SmallPack().codebook};
  IndexPack pack = SharedPack();
  pack.codebook_sha256 = Sha256Hex(*EncodeCodebook(codebook));
  ASSERT_OK(WriteIndexPack(revision + "/grid.hpx", pack, 19));
  const auto read = ReadIndexPack(revision + "/grid.hpx");
  ASSERT_OK(read);
  EXPECT_EQ(CodebookOf(*read, revision).error().code, ErrorCode::kNotFound);
  ASSERT_OK(WriteCodebook(out / "metals.hpc", codebook));
  const auto found = CodebookOf(*read, revision);
  ASSERT_OK(found);
  EXPECT_EQ(found->halves, codebook.halves);
  // Nearer, but another one.
  ASSERT_OK(WriteCodebook(revision + "/metals.hpc", {3, {1, 2, 3}}));
  const auto other = CodebookOf(*read, revision);
  EXPECT_EQ(other.error().code, ErrorCode::kCorruptData);
  EXPECT_NE(other.error().message.find("SHA-256"), std::string::npos);
  const auto own = CodebookOf(SmallPack(), "nowhere");
  ASSERT_OK(own);
  EXPECT_EQ(own->halves, SmallPack().codebook);
  EXPECT_EQ(ReadIndexPack(revision + "/absent.hpx").error().code, ErrorCode::kNotFound);
}

TEST(ExpandCorners, LooksUpStoredCornersAndAveragesParents) {
  Random random(6);
  for (const int nside : {1, 3, 2, 6, 8}) {
    const IndexPack pack = RandomPack(random, {.nside = nside, .primitive_size = 4});
    const auto features = ExpandCorners(pack, {4, pack.codebook});
    ASSERT_OK(features);
    const int corners = healpix::CornerCount(nside);
    ASSERT_EQ(features->size(), static_cast<size_t>(2 * corners * 4));
    size_t next = 0;
    for (int h = 0; h < 2; ++h) {
      const float* values = features->data() + h * corners * 4;
      for (int c = 0; c < corners; ++c) {
        float expected[4] = {};
        if (pack.stored[h][c] != 0) {
          for (int i = 0; i < 4; ++i)
            expected[i] = HalfToFloat(pack.codebook[pack.indices[next] * 4 + i]);
          ++next;
        } else {
          // The level at which this corner first appears, walking up.
          healpix::Corner corner = healpix::CornerOf(nside, c);
          int level = nside;
          int scale = 1;
          while (level % 2 == 0 && healpix::ParentsOf(level, corner).count == 0) {
            corner = {corner.ring / 2,
                      (corner.j - healpix::RingShift(level / 2, corner.ring / 2)) / 2};
            level /= 2;
            scale *= 2;
          }
          if (level % 2 == 0) {
            const healpix::Parents parents = healpix::ParentsOf(level, corner);
            for (int p = 0; p < parents.count; ++p) {
              healpix::Corner from = parents.corner[p];
              for (int n = level; n < nside; n *= 2) from = healpix::ToChild(n, from);
              for (int i = 0; i < 4; ++i) {
                expected[i] += values[healpix::CornerIndex(nside, from) * 4 + i] /
                               static_cast<float>(parents.count);
              }
            }
          }
        }
        // Sums of at most four halves, each mean rounded a few times.
        for (int i = 0; i < 4; ++i)
          ASSERT_NEAR(values[c * 4 + i], expected[i], 1e-6f) << nside << " " << c;
      }
    }
  }
}

// A lattice with only its coarse corners stored interpolates like the coarse lattice.
TEST(ExpandCorners, PrunedLatticeIsTheCoarseOne) {
  Random random(7);
  IndexPack coarse = RandomPack(random, {.nside = 4, .primitive_size = 2, .stored = 1.0});
  IndexPack fine = coarse;
  fine.nside = 16;
  fine.indices.clear();
  size_t next = 0;
  for (int h = 0; h < 2; ++h) {
    fine.stored[h].assign(static_cast<size_t>(healpix::CornerCount(16)), 0);
    std::vector<std::pair<int, uint16_t>> kept;
    for (int c = 0; c < healpix::CornerCount(4); ++c, ++next) {
      const healpix::Corner corner = healpix::CornerOf(4, c);
      if (corner.ring > 8) continue;
      kept.emplace_back(healpix::CornerIndex(16, healpix::ToChild(8, healpix::ToChild(4, corner))),
                        coarse.indices[next]);
    }
    for (const auto& [at, index] : kept) {
      fine.stored[h][static_cast<size_t>(at)] = 1;
      fine.indices.push_back(index);
    }
  }
  const auto a = ExpandCorners(coarse, {2, coarse.codebook});
  const auto b = ExpandCorners(fine, {2, fine.codebook});
  ASSERT_OK(a);
  ASSERT_OK(b);
  for (int i = 0; i < 20000; ++i) {
    // Above the coarse lattice's equator pixels, where nothing is mirrored.
    const double z = 0.2 + 0.8 * random.Unit();
    const double phi = 2 * M_PI * random.Unit();
    const double sine = std::sqrt(1 - z * z);
    const double d[3] = {sine * std::cos(phi), sine * std::sin(phi), z};
    const auto on_coarse = healpix::LookUp(4, d);
    const auto on_fine = healpix::LookUp(16, d);
    double values[2] = {};
    for (int c = 0; c < 4; ++c) {
      values[0] += on_coarse.weight[c] * static_cast<double>((*a)[on_coarse.index[c] * 2]);
      values[1] += on_fine.weight[c] * static_cast<double>((*b)[on_fine.index[c] * 2]);
    }
    ASSERT_NEAR(values[0], values[1], 1e-6);
  }
}

TEST(ExpandCorners, RefusesWhatDoesNotFit) {
  IndexPack pack = SmallPack();
  EXPECT_EQ(ExpandCorners(pack, {4, {0, 0, 0, 0}}).error().code, ErrorCode::kInvalidArgument);
  const auto small = ExpandCorners(pack, {3, {0, 0, 0}});
  EXPECT_EQ(small.error().code, ErrorCode::kCorruptData);
  EXPECT_TRUE(StartsWith(small.error().message, "bad index"));
  pack.indices.pop_back();
  EXPECT_EQ(ExpandCorners(pack, {3, pack.codebook}).error().code, ErrorCode::kInvalidArgument);
  IndexPack large;
  large.nside = 1024;
  large.primitive_size = 64;
  for (auto& stored : large.stored)
    stored.assign(static_cast<size_t>(healpix::CornerCount(1024)), 0);
  EXPECT_EQ(ExpandCorners(large, {64, std::vector<uint16_t>(64)}).error().code,
            ErrorCode::kOutOfRange);
}

}  // namespace
}  // namespace patina
