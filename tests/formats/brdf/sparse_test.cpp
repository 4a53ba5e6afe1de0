#include "formats/brdf/sparse.h"

#include <gtest/gtest.h>

#include "tests/formats/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

using test::MessageOf;
using test::Random;

std::vector<std::pair<Direction, Direction>> SomePairs(int count) {
  Random random(31);
  std::vector<std::pair<Direction, Direction>> pairs;
  for (int i = 0; i < count; ++i)
    pairs.emplace_back(RandomDirection(random, 85), RandomDirection(random, 85));
  return pairs;
}

void ExpectSamples(const Source& source,
                   const std::vector<std::pair<Direction, Direction>>& pairs) {
  EXPECT_EQ(source.format, "sparse");
  EXPECT_EQ(source.table, nullptr);
  EXPECT_EQ(source.cells, pairs.size());
  EXPECT_EQ(source.invalid_cells, 0u);
  EXPECT_TRUE(source.warnings.empty());
  ASSERT_EQ(source.samples.size(), pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    const Sample& sample = source.samples[i];
    float exact[3];
    SmoothBrdf(pairs[i].first, pairs[i].second, exact);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(sample.rgb[c], exact[c]);  // shortest digits are exact
    // Normalised again, which may move the last bit.
    EXPECT_NEAR(sample.wi.x, pairs[i].first.x, 2e-7);
    EXPECT_NEAR(sample.wi.y, pairs[i].first.y, 2e-7);
    EXPECT_NEAR(sample.wo.z, pairs[i].second.z, 2e-7);
    EXPECT_EQ(sample.weight, 1);
  }
}

TEST(SparseCsv, GivesBackWhatWasWritten) {
  const auto pairs = SomePairs(100);
  const auto source = ParseSparseCsv(EncodeSparseCsv(SmoothBrdf, pairs, true), "list");
  ASSERT_OK(source);
  EXPECT_TRUE(source->isotropic);
  ExpectSamples(*source, pairs);
  EXPECT_NEAR(source->max_theta_rad, 85 * kDegree, 0.03);
  EXPECT_FALSE(ParseSparseCsv(EncodeSparseCsv(SmoothBrdf, pairs, false), "list")->isotropic);
}

TEST(SparseJson, GivesBackWhatWasWritten) {
  const auto pairs = SomePairs(100);
  const auto source = ParseSparseJson(EncodeSparseJson(SmoothBrdf, pairs, true), "list");
  ASSERT_OK(source);
  EXPECT_TRUE(source->isotropic);
  ExpectSamples(*source, pairs);
  EXPECT_FALSE(ParseSparseJson(EncodeSparseJson(SmoothBrdf, pairs, false), "list")->isotropic);
}

TEST(SparseCsv, ReadsEveryFeature) {
  const auto source = ParseSparseCsv(
      "\xEF\xBB\xBF# measured on a Tuesday\r\n"
      "\r\n"
      " weight, G ,r, b,Theta_I,phi_i,theta_o,phi_o\r\n"
      "2.5, +0.2, 1e-1, .3, 30, 0, 60, 90\r\n"
      "#  anisotropic \r\n"
      "1,2,1,3,0,0,0,0",
      "all");
  ASSERT_OK(source);
  EXPECT_FALSE(source->isotropic);
  ASSERT_EQ(source->samples.size(), 2u);
  const Sample& sample = source->samples[0];
  EXPECT_NEAR(sample.wi.x, 0.5, 1e-6);
  EXPECT_NEAR(sample.wi.z, 0.8660254, 1e-6);
  EXPECT_NEAR(sample.wo.y, 0.8660254, 1e-6);
  EXPECT_EQ(sample.weight, 2.5f);
  EXPECT_EQ(sample.rgb[0], 0.1f);
  EXPECT_EQ(sample.rgb[1], 0.2f);
  EXPECT_EQ(sample.rgb[2], 0.3f);
  const auto plain = ParseSparseCsv("0,0,1,0,0,1,1,2,3,4\n0,0,1,0.6,0,0.8,1,2,3,1\n", "plain");
  ASSERT_OK(plain);
  EXPECT_EQ(plain->samples[0].weight, 4);
  EXPECT_EQ(plain->samples[1].wo.x, 0.6f);
}

TEST(SparseCsv, RepairsOrLeavesOutWithCounts) {
  const auto source = ParseSparseCsv(
      "0,0,1,0,0,1,1,1,1,1\n"
      "0,0,2,0,0,1,1,1,1,1\n"       // line 2: not normalised
      "0,0,1,0,3,4,1,1,1,1\n"       // line 3: not normalised
      "0,0,1.0005,0,0,1,1,1,1,1\n"  // within the tolerance
      "0,0,-1,0,0,1,1,1,1,1\n"      // line 5: below the horizon
      "0,0,1,1,0,0,1,1,1,1\n"       // line 6: at the horizon
      "0,0,1,0,0,0,1,1,1,1\n"       // line 7: no length
      "0,0,1,0,nan,1,1,1,1,1\n"     // line 8: no direction
      "0,0,1,0,1e999,1,1,1,1,1\n"   // line 9: no direction
      "0,0,1,0,0,1,1,-1e-3,1,1\n"   // line 10: negative
      "0,0,1,0,0,1,1,1,inf,1\n"     // line 11: not finite
      "0,0,1,0,0,1,1,1,1,0\n"       // line 12: weight
      "1e200,0,1e200,0,0,1,1,1,1,1\n",
      "mixed");
  ASSERT_OK(source);
  EXPECT_EQ(source->samples.size(), 5u);
  EXPECT_EQ(source->cells, 13u);
  EXPECT_EQ(source->invalid_cells, 8u);
  const std::vector<std::string> expected = {
      "2 samples with a direction at or below the horizon left out, the first at line 5",
      "3 samples with a direction without a length left out, the first at line 7",
      "1 sample with a negative value left out, the first at line 10",
      "1 sample with a value that is not finite or above 1e30 left out, the first at line 11",
      "1 sample with a weight that is not above 0 left out, the first at line 12",
      "3 samples with a direction that is not of length 1: normalised, the first at line 2"};
  EXPECT_EQ(source->warnings, expected);
  EXPECT_NEAR(source->samples[1].wi.z, 1, 1e-7);
  EXPECT_NEAR(source->samples[2].wo.y, 0.6, 1e-7);
  EXPECT_NEAR(source->samples[4].wi.x, 0.70710678, 1e-7);
}

TEST(SparseCsv, RefusesWhatItCannotUse) {
  const auto refused = [](const std::string& text, const std::string& part) {
    const auto result = ParseSparseCsv(text, "bad.csv");
    ASSERT_FALSE(result) << text;
    EXPECT_EQ(result.error().code, ErrorCode::kCorruptData);
    EXPECT_EQ(result.error().message.rfind("bad.csv: ", 0), 0u);
    EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
  };
  refused("", "no usable sample");
  refused("# nothing\n\n", "no usable sample");
  refused("wix,wiy,wiz,wox,woy,woz,r,g,b\n", "no usable sample");
  refused("0,0,-1,0,0,1,1,1,1\n", "at or below the horizon left out, the first at line 1");
  refused("0,0,1,0,0,1,1,1\n", "line 1: 8 columns without names");
  refused("0,0,1,0,0,1,1,1,1\n0,0,1,0,0,1,1,1\n", "line 2: 8 columns instead of 9");
  refused("0,0,1,0,0,1,1,1,1\n0,0,1,0,0,1,1,1,1,1\n", "line 2: 10 columns instead of 9");
  refused("0,0,1,0,0,1,1,1,1\n0,0,1,0,0,1,1,x,1\n", "line 2, column g: \"x\" is not a number");
  refused("0,0,1,0,0,1,1,1,1\n0,0,1,0,0,1,1,,1\n", "column g: \"\" is not a number");
  refused("0,0,1,0,0,1,1,1,1\n0,0,1,0,0,1,1,0x10,1\n", "column g: \"0x10\"");
  refused("wix,wiy,wiz,wox,woy,woz,r,g\n", "do not make a list");
  refused("theta_i,phi_i,theta_o,phi_o,wix,r,g,b\n", "do not make a list");
  refused("wix,wiy,wiz,wox,woy,woz,r,g,b,b\n", "is there twice");
  refused("wix,wiy,wiz,wox,woy,woz,r,g,b,colour\n", "unknown column \"colour\"");
  refused(std::string(100000, ','), "unknown column");
  refused(std::string("\0\0\0\0", 4), "unknown column");
  refused("{\"samples\": []}", "unknown column");
}

TEST(SparseJson, ReadsWeightsAndKeepsTheAccount) {
  const auto source = ParseSparseJson(
      R"({"samples": [{"wi": [0, 0, 1], "wo": [0, 0, 2], "rgb": [1, 2, 3], "weight": 4, "note": "x"},
                      {"wi": [0, 0, -1], "wo": [0, 0, 1], "rgb": [1, 2, 3]}], "by": "hand"})",
      "list");
  ASSERT_OK(source);
  ASSERT_EQ(source->samples.size(), 1u);
  EXPECT_EQ(source->samples[0].weight, 4);
  EXPECT_EQ(source->samples[0].rgb[2], 3);
  ASSERT_EQ(source->warnings.size(), 2u);
  EXPECT_EQ(source->warnings[0],
            "1 sample with a direction at or below the horizon left out, the first at /samples/1");
  EXPECT_EQ(
      source->warnings[1],
      "1 sample with a direction that is not of length 1: normalised, the first at /samples/0");
}

TEST(SparseJson, RefusesWhatItCannotUse) {
  const auto refused = [](const std::string& text, const std::string& part) {
    const auto result = ParseSparseJson(text, "bad.json");
    ASSERT_FALSE(result) << text;
    EXPECT_EQ(result.error().code, ErrorCode::kCorruptData);
    EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
  };
  refused("", "not valid JSON");
  refused("{} {}", "not valid JSON");
  refused("null", "instead of an object");
  refused("{}", "\"samples\" is missing");
  refused(R"({"samples": 3})", "/samples: number instead of an array");
  refused(R"({"samples": []})", "no usable sample");
  refused(R"({"samples": [3]})", "/samples/0");
  refused(R"({"samples": [{"wi": [0, 0, 1], "wo": [0, 0, 1]}]})", "\"rgb\" is missing");
  refused(R"({"samples": [{"wi": [0, 0], "wo": [0, 0, 1], "rgb": [1, 1, 1]}]})",
          "/samples/0: \"wi\"");
  refused(R"({"samples": [{"wi": [0, 0, 1, 1], "wo": [0, 0, 1], "rgb": [1, 1, 1]}]})",
          "/samples/0/wi");
  refused(R"({"samples": [{"wi": [0, 0, null], "wo": [0, 0, 1], "rgb": [1, 1, 1]}]})",
          "/samples/0/wi/2");
  refused(R"({"samples": [{"wi": [0, 0, 1], "wo": [0, 0, 1], "rgb": [1, 1, 1]}], "isotropic": 1})",
          "/isotropic");
  refused(R"({"samples": [{"wi": [0, 0, 1], "wo": [0, 0, 1], "rgb": [1, 1, -1]}]})",
          "negative value left out");
  refused(R"({"samples": [{"wi": [0, 0, 1], "wo": [0, 0, 1], "rgb": [1, 1, 1e999]}]})",
          "not valid JSON");
  refused(std::string(200000, '['), "not valid JSON");
}

TEST(SparseParse, SurvivesEveryTruncation) {
  const auto pairs = SomePairs(12);
  const std::string csv = EncodeSparseCsv(SmoothBrdf, pairs, false);
  const std::string json = EncodeSparseJson(SmoothBrdf, pairs, false);
  for (size_t size = 0; size < csv.size(); ++size) {
    // A list that ends between or within numbers may still be one; never more samples than lines.
    const std::vector<char> part(csv.begin(), csv.begin() + static_cast<std::ptrdiff_t>(size));
    const auto result = ParseSparseCsv({part.data(), part.size()}, "short");
    EXPECT_LE(result ? result->samples.size() : 0, 12u);
  }
  for (size_t size = 0; size + 1 < json.size(); ++size) {
    const std::vector<char> part(json.begin(), json.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_FALSE(ParseSparseJson({part.data(), part.size()}, "short")) << size;
  }
}

}  // namespace
}  // namespace patina::brdf
