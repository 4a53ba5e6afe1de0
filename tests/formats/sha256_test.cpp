#include "formats/base/sha256.h"

#include <gtest/gtest.h>

#include "formats/base/file_io.h"
#include "tests/formats/test_support.h"

namespace patina {
namespace {

// FIPS 180-2, appendix B.
constexpr const char* kOfNothing =
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr const char* kOfAbc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr const char* kOfMillionA =
    "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";

TEST(Sha256, MatchesThePublishedVectors) {
  EXPECT_EQ(Sha256Hex(""), kOfNothing);
  EXPECT_EQ(Sha256Hex("abc"), kOfAbc);
  EXPECT_EQ(Sha256Hex(std::string(1000000, 'a')), kOfMillionA);
}

TEST(Sha256, DoesNotDependOnThePieces) {
  Sha256 hash;
  for (int i = 0; i < 1000; ++i) hash.Update(std::string(1000, 'a'));
  EXPECT_EQ(hash.FinishHex(), kOfMillionA);
}

TEST(Sha256, HashesFiles) {
  const test::TemporaryDirectory directory;
  ASSERT_OK(WriteFileDurably(directory / "a", std::string_view(std::string(1000000, 'a'))));
  const auto digest = Sha256OfFile(directory / "a");
  ASSERT_OK(digest);
  EXPECT_EQ(digest->sha256, kOfMillionA);
  EXPECT_EQ(digest->bytes, 1000000u);
  EXPECT_EQ(Sha256OfFile(directory / "absent").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(Sha256OfFile(directory.path()).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace patina
