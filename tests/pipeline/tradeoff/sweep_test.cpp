#include "pipeline/tradeoff/sweep.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "formats/schema_check.h"
#include "pipeline/tradeoff/sweep_files.h"

namespace patina {
namespace {

using testing::HasSubstr;

SweepRow Row(const std::string& variant, double quality_db, double encode_s, uint64_t bytes,
             double decode_ns, const std::string& asset = "wall") {
  SweepRow row;
  row.asset = asset;
  row.variant = variant;
  row.settings = {{"profile", variant}};
  row.quality_db = quality_db;
  row.encode_s = row.encode_cpu_s = encode_s;
  row.bytes = bytes;
  row.decode_ns = decode_ns;
  return row;
}

TEST(Variants, AreTheProductOfTheAxesOfTheirKind) {
  SweepAxes axes;
  axes.profiles = {Profile::kBcf05k, Profile::kBcf2k};
  axes.qualities = {Quality::kPreview, Quality::kStandard, Quality::kReference};
  axes.nsides = {8, 16};
  const auto materials = ProductOf(axes, JobKind::kMaterial);
  ASSERT_EQ(materials.size(), 6u);
  EXPECT_EQ(materials[1].name, "profile-bcf-0.5k_quality-standard");
  Job job;
  job.choose_profile = true;
  job.target_psnr_db = job.min_psnr_db = job.time_budget_s = job.target_bpp = 40;
  job.size_budget_bytes = 40;
  materials[5].ApplyTo(&job);
  EXPECT_EQ(job.target_psnr_db + job.min_psnr_db + job.time_budget_s + job.target_bpp, 0);
  EXPECT_EQ(job.size_budget_bytes, 0u);
  EXPECT_EQ(job.profile, Profile::kBcf2k);
  EXPECT_EQ(job.quality, Quality::kReference);
  EXPECT_FALSE(job.choose_profile);
  const auto brdfs = ProductOf(axes, JobKind::kBrdf);
  ASSERT_EQ(brdfs.size(), 6u);
  EXPECT_EQ(brdfs[5].name, "quality-reference_nside-16");
  EXPECT_EQ(brdfs[5].model.nside, 16);
  EXPECT_EQ(ProductOf({}, JobKind::kBrdf).at(0).name, "default");
}

TEST(Variants, HaveNamesOfTheirOwn) {
  std::set<std::string> names;
  const auto variants = DefaultBrdfVariants();
  for (const Variant& variant : variants) names.insert(variant.name);
  EXPECT_EQ(names.size(), variants.size());
}

TEST(Fronts, HoldWhatNothingBeats) {
  std::vector<SweepRow> rows = {Row("cheap", 20, 1, 100, 9), Row("good", 30, 5, 400, 9),
                                Row("worse for more", 25, 6, 500, 9),
                                Row("same quality, slower", 30, 7, 300, 9)};
  rows.push_back(Row("failed", 99, 0, 0, 0));
  rows.back().problem = "no";
  MarkFronts(rows);
  const auto encode = [&](size_t i) { return rows[i].front_encode; };
  EXPECT_TRUE(encode(0) && encode(1));
  EXPECT_FALSE(encode(2) || encode(3) || encode(4));
  EXPECT_TRUE(rows[0].front_bytes && rows[3].front_bytes);
  EXPECT_FALSE(rows[1].front_bytes);
  // Equals in both do not push each other off.
  EXPECT_TRUE(rows[1].front_decode && rows[3].front_decode);
  EXPECT_FALSE(rows[0].front_decode);
}

TEST(Means, AreOfVariantsThatAllInputsHave) {
  std::vector<SweepRow> rows = {Row("a", 20, 1, 100, 8), Row("a", 30, 3, 300, 12, "floor"),
                                Row("b", 40, 1, 100, 8), Row("b", 40, 1, 100, 8, "floor")};
  rows[3].problem = "broken";
  const auto means = MeansOf(rows);
  ASSERT_EQ(means.size(), 1u);
  EXPECT_EQ(means[0].variant, "a");
  EXPECT_EQ(means[0].inputs, 2);
  EXPECT_DOUBLE_EQ(means[0].quality_db, 25);
  EXPECT_DOUBLE_EQ(means[0].encode_s, 2);
  EXPECT_EQ(means[0].bytes, 200u);
  EXPECT_DOUBLE_EQ(means[0].decode_ns, 10);
  EXPECT_TRUE(means[0].front_bytes);
}

TEST(SweepFiles, AreWhatTheySay) {
  std::vector<SweepRow> rows = {Row("a", 20, 1, 100, 8), Row("b", 30, 2, 200, 9),
                                Row("b", 30, 2, 200, 9, "=cmd,\"x\"<script>")};
  rows[1].problem = "a line\nand another";
  const auto means = MeansOf(rows);
  const std::string csv = SweepCsv(rows, means);
  EXPECT_THAT(csv, HasSubstr("\r\nwall,material,a,20.0000,1.000,1.000,100,8.00,0,0,0,\r\n"));
  EXPECT_THAT(csv, HasSubstr("\"'=cmd,\"\"x\"\"<script>\",material,b,"));
  EXPECT_THAT(csv, HasSubstr("wall,material,b,,,,,,,,,\"a line\nand another\"\r\n"));
  const auto json = nlohmann::json::parse(SweepJson(rows, means), nullptr, false);
  const Status valid = CheckAgainstSchema("tradeoff", json);
  EXPECT_TRUE(valid) << (valid ? "" : valid.error().message);
  const std::string page = SweepPage(rows, means);
  EXPECT_EQ(page.find("<script>"), std::string::npos);
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;"));
  EXPECT_THAT(page, HasSubstr("failed: a line"));
}

}  // namespace
}  // namespace patina
