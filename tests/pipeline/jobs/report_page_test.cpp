#include "pipeline/jobs/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "pipeline/jobs/block_sizes.h"
#include "pipeline/jobs/page_time.h"

namespace patina {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ManifestChannel Channel(const char* map, const char* component, int output,
                        const char* encoding = "linear") {
  ManifestChannel channel;
  channel.map = map;
  channel.component = component;
  channel.output = output;
  channel.encoding = encoding;
  return channel;
}

Manifest Wall(int width, int height, int levels) {
  Manifest manifest;
  manifest.asset = "wall";
  manifest.source.width = width;
  manifest.source.height = height;
  manifest.source.levels = levels;
  return manifest;
}

TEST(UsualTextures, CountsBlocksOfAllMips) {
  Manifest manifest = Wall(16, 8, 5);  // blocks: 8, 2, 1, 1, 1
  manifest.channels = {Channel("albedo", "r", 0, "srgb"),
                       Channel("albedo", "g", 1, "srgb"),
                       Channel("albedo", "b", -1, "srgb"),
                       Channel("normal", "x", 2, "normal_xy"),
                       Channel("normal", "y", 3, "normal_xy"),
                       Channel("ao", "", 4),
                       Channel("roughness", "", 5),
                       Channel("metalness", "", -1)};
  const std::vector<TextureBytes> usual = UsualTextures(manifest);
  ASSERT_EQ(usual.size(), 4u);
  EXPECT_EQ(usual[0].bytes, 13u * (8 + 16 + 8));
  EXPECT_EQ(usual[1].bytes, 13u * (8 + 16 + 8 + 8));
  EXPECT_EQ(usual[2].bytes, 13u * (16 + 16 + 16));
  EXPECT_EQ(usual[3].bytes, (128u + 32 + 8 + 2 + 1) * (3 + 2 + 2));
  manifest.lod_range = {1, 2};
  EXPECT_EQ(UsualTextures(manifest)[1].bytes, 3u * 40);
}

TEST(UsualTextures, PutsLargeColoursIntoBc6h) {
  Manifest manifest = Wall(4, 4, 1);
  for (const char* component : {"r", "g", "b"})
    manifest.channels.push_back(Channel("emissive", component, 0, "signed_log"));
  EXPECT_EQ(UsualTextures(manifest)[1].bytes, 16u);
  EXPECT_EQ(UsualTextures(manifest)[3].bytes, 16u * 6);
}

TEST(UsualTextures, AreNoneOfConstants) {
  Manifest manifest = Wall(4, 4, 1);
  manifest.channels = {Channel("ao", "", -1)};
  EXPECT_TRUE(UsualTextures(manifest).empty());
}

TEST(MeasureOf, KnowsMeasuresThatCameLater) {
  EXPECT_EQ(MeasureOf("psnr_mip0_db")->label, "all maps, mip 0");
  EXPECT_FALSE(MeasureOf("psnr_mip0_db")->thin);
  EXPECT_FALSE(MeasureOf("log1p_mae")->decibels);
  const auto later = MeasureOf("psnr_albedo_mip0_db");
  ASSERT_TRUE(later);
  EXPECT_EQ(later->label, "albedo mip0");
  EXPECT_TRUE(later->decibels);
  EXPECT_TRUE(later->thin);
  EXPECT_FALSE(MeasureOf("cpu_seconds"));
  EXPECT_FALSE(MeasureOf(""));
}

TEST(GainPerDoubling, LooksAtTheLastDoubling) {
  EXPECT_FALSE(GainPerDoubling({}));
  EXPECT_FALSE(GainPerDoubling({{1, 30}}));
  EXPECT_FALSE(GainPerDoubling({{0, 10}, {0, 20}}));
  EXPECT_FALSE(GainPerDoubling({{8, 30}, {10, 31}}));
  EXPECT_FALSE(GainPerDoubling({{1, kNan}, {2, 30}}));
  EXPECT_DOUBLE_EQ(*GainPerDoubling({{1, 20}, {2, 30}, {4, 30.5}}), 0.5);
  EXPECT_DOUBLE_EQ(*GainPerDoubling({{1, 20}, {2, 30}, {7, 31}, {8, 32}}), 1.0);
  EXPECT_DOUBLE_EQ(*GainPerDoubling({{2, 30}, {4, 29}}), -1.0);
}

// Everything that a page of a material is made of.
struct Material {
  Job job;
  Manifest manifest = Wall(4, 4, 3);
  RunRecord run;
  JobSource source;
  Measurement measurement;
  std::vector<std::string> warnings;

  std::string Page() {
    const PageFacts facts{job, manifest, run, "budget", warnings, {}};
    return MaterialReportPage(facts, source, measurement, nullptr, {});
  }
};

metrics::MapQuality Quality(const std::string& name, double db) {
  metrics::MapQuality quality;
  quality.name = name;
  quality.psnr.psnr_db = {db, db, db};
  quality.psnr.overall_db = quality.psnr.mip0_db = quality.psnr.mean_mips_db = db;
  return quality;
}

TEST(MaterialReportPage, SurvivesValuesThatAreNoNumbersAndHostileText) {
  Material material;
  material.manifest.payloads = {{"features_0.dds", "features", 1000, std::string(64, '0')}};
  material.manifest.channels = {Channel("ao", "", 0)};
  const std::string hostile = "</script><img src=x onerror=alert(1)>\x02\xFF\"' &";
  const std::string far_too_long(20000, 'n');
  material.manifest.effects = {{hostile, hostile, hostile, std::nullopt}};
  material.source.reference.notes = {{MapNote::Kind::kIgnored, hostile, far_too_long}};
  material.warnings = {hostile};
  material.run.stages = {{"train", kNan, kNan}};
  material.run.curve = {{0, 1, {{"psnr_mip0_db", kNan}}},
                        {1, kNan, {{"psnr_mip0_db", 30}}},
                        {2, 3, {{"psnr_mip0_db", std::numeric_limits<double>::infinity()}}},
                        {3, 4, {{"psnr_mip0_db", 31}, {"unheard_of", 1}}}};
  material.measurement.quality.maps = {Quality("ao", kNan), Quality("albedo", 100),
                                       Quality(hostile, 20)};
  material.measurement.quality.psnr = Quality("", kNan).psnr;
  const std::string page = material.Page();
  EXPECT_THAT(page, Not(HasSubstr("<img")));
  EXPECT_THAT(page, Not(HasSubstr("</script")));
  EXPECT_THAT(page, HasSubstr("&lt;img src=x onerror=alert(1)&gt;"));
  EXPECT_THAT(page, Not(HasSubstr("nan")));
  EXPECT_THAT(page, HasSubstr(far_too_long));
  EXPECT_THAT(page, HasSubstr("exact"));
  EXPECT_THAT(page, HasSubstr("the weakest map is &lt;/script"));
}

TEST(MaterialReportPage, SaysThatNothingHadToBeLearned) {
  Material material;
  material.measurement.quality.maps = {Quality("ao", 100)};
  material.measurement.quality.psnr = Quality("", 100).psnr;
  const std::string page = material.Page();
  EXPECT_THAT(page, HasSubstr("nothing had to be learned"));
  EXPECT_THAT(page, HasSubstr("there is no curve"));
}

}  // namespace
}  // namespace patina
