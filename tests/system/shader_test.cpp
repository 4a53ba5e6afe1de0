// `patina shader` as a user meets it: files, messages and exit codes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/formats/sample_container.h"
#include "tests/system/child_process.h"

namespace patina {
namespace {

using test::TemporaryDirectory;
using testing::AllOf;
using testing::HasSubstr;
using testing_support::Outcome;
using testing_support::Patina;

TEST(PatinaShader, WritesWhatItPrints) {
  const TemporaryDirectory folder;
  auto staging = test::StageSample(folder.path(), "wall", 1);
  ASSERT_OK(staging);
  ASSERT_OK(staging->Publish());
  const Outcome done =
      Patina({"shader", folder / "wall", "--out", folder / "deep/shaders", "--lang", "hlsl"});
  EXPECT_EQ(done.exit_code, 0) << done.err;
  for (const char* name : {"material.hlsl", "material_weights.bin", "bindings.json"}) {
    EXPECT_THAT(done.out, HasSubstr("deep/shaders/" + std::string(name) + "\n"));
    EXPECT_TRUE(std::filesystem::exists(folder / ("deep/shaders/" + std::string(name))));
  }
}

TEST(PatinaShader, SaysWhatIsWrong) {
  const TemporaryDirectory folder;
  auto staging = test::StageSample(folder.path(), "wall", 1);
  ASSERT_OK(staging);
  const auto published = staging->Publish();
  ASSERT_OK(published);
  Outcome done = Patina({"shader", folder / "wall", "--out", folder / "out", "--lang", "msl"});
  EXPECT_EQ(done.exit_code, 2);
  EXPECT_THAT(done.err, AllOf(HasSubstr("msl"), HasSubstr("patina shader --help")));
  done = Patina({"shader", folder / "wall", "--out", folder / "out", "--first-binding", "1000"});
  EXPECT_EQ(done.exit_code, 2);
  done = Patina({"shader", folder / "floor", "--out", folder / "out"});
  EXPECT_EQ(done.exit_code, 3);
  EXPECT_THAT(done.err, HasSubstr("no such container"));
  std::filesystem::remove(published->directory + "/features_1.dds");
  done = Patina({"shader", folder / "wall", "--out", folder / "out"});
  EXPECT_EQ(done.exit_code, 3);
  EXPECT_THAT(done.err, HasSubstr("features_1.dds"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

}  // namespace
}  // namespace patina
