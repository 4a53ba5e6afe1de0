#include "daemon/service/roots.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "tests/formats/test_support.h"

namespace patina::daemon {
namespace {

namespace fs = std::filesystem;

TEST(Roots, DecideAfterResolvingLinks) {
  const patina::test::TemporaryDirectory folder;
  fs::create_directories(folder / "root/inner");
  fs::create_directories(folder / "root2");
  fs::create_directory_symlink("..", folder / "root/up");
  fs::create_directory_symlink(folder / "root", folder / "alias");
  const std::vector<std::string> roots{folder / "root"};
  for (const char* inside : {"root", "root/", "root/inner", "root/new/file", "alias/inner",
                             "root/up/root/inner", "root2/../root/inner"}) {
    EXPECT_TRUE(LiesWithin(folder / inside, roots)) << inside;
  }
  for (const char* outside : {"", "root2", "root/..", "root/up", "root/up/root2", "rootx"}) {
    EXPECT_FALSE(LiesWithin(folder / outside, roots)) << outside;
  }
  EXPECT_FALSE(LiesWithin(folder / "root", {}));
}

TEST(Roots, AJobsPathsAreReplacedByWhatTheyResolveTo) {
  const patina::test::TemporaryDirectory folder;
  fs::create_directories(folder / "in/wall");
  fs::create_directory_symlink(folder / "in", folder / "alias");
  const Roots roots{{folder / "in"}, {folder / "out"}};
  Job job;
  job.folder = folder / "alias/wall";
  job.out = folder / "out";
  job.maps.resize(1);
  job.maps[0].file = "albedo.png";
  ASSERT_OK(ConfineJob(roots, &job));
  const std::string real = fs::canonical(folder / "in/wall").string();
  EXPECT_EQ(job.folder, real);
  EXPECT_EQ(job.maps[0].file, real + "/albedo.png");
  job.maps[0].file = "../../secret.png";
  EXPECT_EQ(patina::test::MessageOf(ConfineJob(roots, &job)).rfind("/maps/0/file: ", 0), 0u);
}

TEST(Roots, AColourConfigurationLiesWithinTheRootsAndIsReadWithItsTables) {
  const patina::test::TemporaryDirectory folder;
  fs::create_directories(folder / "in/wall");
  fs::create_directories(folder / "in/studio");
  std::ofstream(folder / "in/studio/config.ocio") << "c";
  std::ofstream(folder / "secret.ocio") << "s";
  const Roots roots{{folder / "in"}, {folder / "out"}};
  Job job;
  job.folder = folder / "in/wall";
  job.out = folder / "out";
  job.ocio = folder / "in/wall/../studio/config.ocio";
  ASSERT_OK(ConfineJob(roots, &job));
  const std::string real = fs::canonical(folder / "in/studio").string();
  EXPECT_EQ(job.ocio, real + "/config.ocio");
  const std::vector<std::string> inputs = InputsOf(job, roots);
  EXPECT_NE(std::find(inputs.begin(), inputs.end(), real), inputs.end());
  for (const std::string& outside : {folder / "secret.ocio", std::string("config.ocio")}) {
    job.ocio = outside;
    EXPECT_EQ(patina::test::MessageOf(ConfineJob(roots, &job)).rfind("/ocio: ", 0), 0u) << outside;
  }
}

TEST(Roots, AScenesFolderIsItsInput) {
  const patina::test::TemporaryDirectory folder;
  fs::create_directories(folder / "in/car");
  std::ofstream(folder / "in/car/car.glb") << "g";
  std::ofstream(folder / "secret.glb") << "s";
  fs::create_symlink(folder / "secret.glb", folder / "in/car/link.glb");
  const Roots roots{{folder / "in"}, {folder / "out"}};
  Job job;
  job.out = folder / "out";
  job.scene = folder / "in/car/../car/car.glb";
  job.scene_material = "paint";
  ASSERT_OK(ConfineJob(roots, &job));
  const std::string real = fs::canonical(folder / "in/car").string();
  EXPECT_EQ(job.scene, real + "/car.glb");
  EXPECT_EQ(InputsOf(job, roots), std::vector<std::string>{real});
  for (const char* outside : {"secret.glb", "in/../secret.glb", "in/car/link.glb"}) {
    job.scene = folder / outside;
    EXPECT_EQ(patina::test::MessageOf(ConfineJob(roots, &job)).rfind("/scene: ", 0), 0u) << outside;
  }
}

TEST(Roots, TheImagesOfASetAreInputsToo) {
  Job job;
  job.file = "/in/cloth/cloth.btf.json";
  job.kind = JobKind::kSvbrdf;
  EXPECT_EQ(InputsOf(job, {{"/in"}, {}}), (std::vector<std::string>{job.file, "/in/cloth"}));
  job.file = "/in/lacquer/lacquer.layers.json";  // maps lie beside it
  EXPECT_EQ(InputsOf(job, {{"/in"}, {}}), (std::vector<std::string>{job.file, "/in/lacquer"}));
  job.kind = JobKind::kBrdf;
  EXPECT_EQ(InputsOf(job, {{"/in"}, {}}), std::vector<std::string>{job.file});
}

TEST(Roots, AReflectanceOfATextureSetReadsItsFolderOrItsList) {
  const patina::test::TemporaryDirectory folder;
  fs::create_directories(folder / "in/wall");
  const Roots roots = {{folder / "in"}, {folder / "out"}};
  Job job;
  job.kind = JobKind::kSvbrdf;
  job.folder = folder / "in/wall";
  job.out = folder / "out";
  ASSERT_OK(ConfineJob(roots, &job));
  EXPECT_EQ(InputsOf(job, roots), std::vector<std::string>{job.folder});
  job.folder = folder / "elsewhere";
  EXPECT_EQ(patina::test::MessageOf(ConfineJob(roots, &job)).rfind("/folder: ", 0), 0u);
  job.folder.clear();
  job.maps.emplace_back();
  job.maps[0].role = "albedo";
  job.maps[0].file = folder / "in/wall/c.png";
  ASSERT_OK(ConfineJob(roots, &job));
  EXPECT_EQ(InputsOf(job, roots), std::vector<std::string>{job.maps[0].file});
}

TEST(Roots, LinksWithinTheRootsAreInputsToo) {
  const patina::test::TemporaryDirectory folder;
  fs::create_directories(folder / "in/wall");
  fs::create_directories(folder / "in/shared");
  std::ofstream(folder / "in/shared/a.png") << "a";
  std::ofstream(folder / "secret.png") << "s";
  fs::create_symlink(folder / "in/shared/a.png", folder / "in/wall/a.png");
  fs::create_symlink(folder / "secret.png", folder / "in/wall/s.png");
  Job job;
  job.folder = folder / "in/wall";
  EXPECT_EQ(InputsOf(job, {{folder / "in"}, {}}),
            (std::vector<std::string>{folder / "in/wall",
                                      fs::canonical(folder / "in/shared/a.png").string()}));
}

}  // namespace
}  // namespace patina::daemon
