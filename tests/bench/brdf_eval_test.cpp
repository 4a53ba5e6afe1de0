#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "formats/base/file_io.h"
#include "formats/brdf/angles.h"
#include "formats/brdf/write_brdf.h"
#include "tests/bench/brdf_eval_measures.h"
#include "tests/bench/brdf_eval_run.h"
#include "tests/bench/brdf_eval_systems.h"
#include "tests/bench/brdf_eval_table.h"
#include "tests/pipeline/brdf/brdf_samples.h"

namespace patina::bench {
namespace {

using brdf::Direction;

std::shared_ptr<const brdf::Table> TableOf(brdf::FunctionTable::Function f) {
  return std::make_shared<brdf::FunctionTable>(std::move(f));
}

std::shared_ptr<const brdf::Table> Grey(float value) {
  return TableOf([value](const Direction&, const Direction&, float* rgb) {
    rgb[0] = rgb[1] = rgb[2] = value;
    return true;
  });
}

brdf::EvaluatePairs Constant(float value) { return FunctionOf(Grey(value)); }

class Measures : public testing::Test {
 protected:
  Measures() : environments_{brdf::StudioEnvironment(16, 8)} {}
  Values Measure(std::shared_ptr<const brdf::Table> table, const brdf::EvaluatePairs& model) {
    const Truth truth(std::move(table), environments_, 24, pool_);
    const auto values = truth.Measure(model, pool_);
    EXPECT_EQ(values.size(), 1u);
    return values[0];
  }
  ThreadPool pool_{2};
  std::vector<brdf::Environment> environments_;
};

TEST_F(Measures, OfTheTruthItselfAreZero) {
  const auto table = TableOf([](const Direction& wi, const Direction& wo, float* rgb) {
    return brdf::Plastic(0.2f, wi, wo, rgb);
  });
  const Values v = Measure(table, FunctionOf(table));
  for (int c = kMae; c < kReciprocity; ++c) {
    if (c != kSsim) {
      EXPECT_EQ(v[c], 0) << c;
    }
  }
  EXPECT_NEAR(v[kSsim], 1, 1e-6);
  EXPECT_LT(v[kReciprocity], 1e-5);  // rounding of the half vector
  EXPECT_EQ(v[kAlbedoError], 0);
  for (int a = 0; a < 5; ++a) EXPECT_EQ(v[kAlbedo0 + a], v[kTrueAlbedo0 + a]);
  EXPECT_EQ(v[kFinite], 1);
  EXPECT_GT(v[kMinimum], 0);
  EXPECT_EQ(v[kGrazingRatio], 1);
}

TEST_F(Measures, OfAConstantOffsetAreKnown) {
  const Values v = Measure(Grey(0.1f), Constant(0.12f));
  const double step = std::log1p(0.12) - std::log1p(0.1);
  EXPECT_NEAR(v[kLog1pMseTable], step * step, 1e-6 * step);
  EXPECT_NEAR(v[kLog1pMseDirections], step * step, 1e-6 * step);
  EXPECT_NEAR(v[kLog1pMaeDirections], step, 1e-6);
  EXPECT_NEAR(v[kPeak], 0.2, 1e-5);
  EXPECT_EQ(v[kReciprocity], 0);
  EXPECT_NEAR(v[kGrazingRatio], 1.2, 1e-5);
  EXPECT_NEAR(v[kMinimum], 0.12, 1e-7);
  // Lambert's albedo is pi f; the quadrature over half vectors is within a percent, but at 89
  // degrees, where half of it lies below the horizon, within three.
  EXPECT_NEAR(v[kTrueAlbedo0], 0.1 * 3.14159, 0.003);
  EXPECT_NEAR(v[kAlbedo60], 0.12 * 3.14159, 0.004);
  EXPECT_NEAR(v[kAlbedoError], 0.02 * 3.14159, 0.002);
  EXPECT_EQ(v[kAlbedoAboveOne], 0);
  EXPECT_GT(v[kMae], 0);
  EXPECT_LE(v[kMae], v[kRmse]);
  // 71 % of the frame are the sphere.
  EXPECT_NEAR(v[kMaeFrame] / v[kMae], 0.73, 0.05);
  EXPECT_NEAR(v[kRmseFrame] / v[kRmse], std::sqrt(0.73), 0.04);
  EXPECT_LT(v[kSsim], 1);
}

TEST_F(Measures, CountAlbedosAboveOneAndFindWhatIsNotFinite) {
  const Values bright = Measure(Grey(0.1f), Constant(0.4f));
  EXPECT_EQ(bright[kAlbedoAboveOne], 15);
  EXPECT_EQ(bright[kTrueAlbedoAboveOne], 0);
  const Values broken =
      Measure(Grey(0.1f), [](int, size_t count, const Direction* wi, const Direction*, float* rgb) {
        for (size_t i = 0; i < 3 * count; ++i)
          rgb[i] = wi[i / 3].z < 0.01f ? std::numeric_limits<float>::infinity() : 0.1f;
      });
  EXPECT_EQ(broken[kFinite], 0);
}

// A highlight where the truth has none is a ghost; one that is two degrees off is not.
TEST_F(Measures, TellAGhostFromAShiftedPeak) {
  const auto lobe = [](float centre) {
    return TableOf([centre](const Direction& wi, const Direction& wo, float* rgb) {
      const auto angles = brdf::ToHalfDifference(wi, wo);
      const float d = (angles.theta_h - centre) / 0.05f;
      rgb[0] = rgb[1] = rgb[2] = 5 * std::exp(-d * d);
      return true;
    });
  };
  const Values shifted = Measure(lobe(0.3f), FunctionOf(lobe(0.31f)));
  const Values ghost = Measure(lobe(0.3f), FunctionOf(lobe(0.6f)));
  EXPECT_LT(shifted[kGhostMax], 0.2);
  EXPECT_GT(ghost[kGhostMax], 3);
  EXPECT_GT(ghost[kGhostMean], 10 * shifted[kGhostMean]);
}

TEST_F(Measures, LeaveOutWhatTheTableDoesNotHold) {
  const auto half = TableOf([](const Direction& wi, const Direction&, float* rgb) {
    rgb[0] = rgb[1] = rgb[2] = wi.z > 0.5f ? 0.2f : 0;
    return wi.z > 0.5f;
  });
  const Values v =
      Measure(half, [](int, size_t count, const Direction* wi, const Direction*, float* rgb) {
        for (size_t i = 0; i < 3 * count; ++i) rgb[i] = wi[i / 3].z > 0.5f ? 0.2f : 7.0f;
      });
  EXPECT_EQ(v[kLog1pMseTable], 0);
  EXPECT_EQ(v[kPeak], 0);
}

TEST(TrainingPairs, AreThoseOfThePool) {
  const brdf::Source source =
      brdf::SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
        return brdf::Plastic(0.2f, wi, wo, rgb) && wi.x > 0.2f;
      });
  brdf::PoolOptions options;
  options.count = 3000;
  options.seed = 5;
  ThreadPool pool(2);
  const auto pairs = DrawTrainingPairs(source, options, pool);
  const auto samples = brdf::DrawPool(source, {}, options, pool);
  ASSERT_EQ(pairs.size(), samples.size());
  for (size_t n = 0; n < pairs.size(); ++n) {
    for (int c = 0; c < 3; ++c) ASSERT_EQ(pairs[n].value[c], samples[n].value[c]) << n;
    ASSERT_EQ(pairs[n].cosine, samples[n].cosine);
    ASSERT_EQ(pairs[n].importance, samples[n].importance);
  }
}

Row MakeRow(const std::string& material, const std::string& system, uint64_t seed,
            const std::string& env, double mae, double ssim) {
  Row row;
  row.material = material;
  row.system = system;
  row.seed = seed;
  row.env = env;
  row.side = 256;
  row.map_columns = 96;
  row.values.fill(std::numeric_limits<double>::quiet_NaN());
  row.values[kMae] = mae;
  row.values[kSsim] = ssim;
  return row;
}

TEST(EvalCsv, RowsComeBack) {
  const Row rows[] = {MakeRow("steel", "default", 3, "beach", 0.00123456789, 0.5),
                      MakeRow("brass", "ggx", 18446744073709551615ull, "grace", -1e-30, 1)};
  std::string text = CsvHeader() + "\n";
  for (const Row& row : rows) text += CsvLine(row) + "\n";
  size_t good = 0;
  const auto parsed = ParseCsv(text, "rows.csv", &good);
  ASSERT_TRUE(parsed);
  EXPECT_EQ(good, text.size());
  ASSERT_EQ(parsed->size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(CsvLine((*parsed)[i]), CsvLine(rows[i]));
    EXPECT_EQ((*parsed)[i].seed, rows[i].seed);
    EXPECT_TRUE(std::isnan((*parsed)[i].values[kRmse]));
  }
}

TEST(EvalCsv, AnyCutOffLeavesWholeRows) {
  const std::string head = CsvHeader() + "\n",
                    text = head + CsvLine(MakeRow("steel", "default", 1, "beach", 0.5, 0.25)) +
                           "\n" + CsvLine(MakeRow("brass", "default", 1, "beach", 0.5, 0.25)) +
                           "\n";
  for (size_t length = 0; length <= text.size(); ++length) {
    size_t good = 0;
    const auto parsed = ParseCsv(std::string_view(text).substr(0, length), "rows.csv", &good);
    ASSERT_TRUE(parsed) << length;
    EXPECT_LE(good, length);
    EXPECT_TRUE(good == 0 || text[good - 1] == '\n');
    EXPECT_EQ(parsed->size(), length == text.size()                  ? 2u
                              : length > good && good <= head.size() ? 0u
                              : good > head.size()                   ? 1u
                                                                     : 0u);
  }
}

TEST(EvalCsv, RefusesOtherFiles) {
  size_t good = 0;
  const std::string line = CsvLine(MakeRow("steel", "default", 1, "beach", 0.5, 0.25));
  for (const std::string& text :
       {std::string("a,b,c\n"), CsvHeader() + ",more\n", CsvHeader() + "\nsteel,default\n",
        CsvHeader() + "\n" + line + ",1\n",
        CsvHeader() + "\nx" + line.substr(0, line.size() - 1) + ",zero\n"}) {
    const auto parsed = ParseCsv(text, "rows.csv", &good);
    ASSERT_FALSE(parsed) << text;
    EXPECT_EQ(parsed.error().code, ErrorCode::kCorruptData);
    EXPECT_NE(parsed.error().message.find("rows.csv: line "), std::string::npos);
  }
}

TEST(EvalSummary, TakesMeansOverSeedsThenDeviationsOverMaterials) {
  const std::vector<Row> rows = {MakeRow("steel", "default", 1, "beach", 0.1, 0.9),
                                 MakeRow("steel", "default", 2, "beach", 0.3, 0.7),
                                 MakeRow("brass", "default", 1, "beach", 0.4, 0.95),
                                 MakeRow("steel", "default", 1, "grace", 0.5, 0.5),
                                 MakeRow("steel", "ggx", 1, "beach", 1, 0.1)};
  const std::vector<std::string> systems = {"ggx", "default", "table"};
  const auto statistics = Summarize(rows, systems);
  ASSERT_EQ(statistics.size(), 5u);
  EXPECT_EQ(statistics[0].system, "ggx");
  EXPECT_EQ(statistics[1].env, "mean");
  const Statistics& beach = statistics[2];
  EXPECT_EQ(beach.env, "beach");
  EXPECT_EQ(beach.materials, 2);
  EXPECT_EQ(beach.runs, 3);
  EXPECT_NEAR(beach.mean[kMae], (0.2 + 0.4) / 2, 1e-12);
  EXPECT_NEAR(beach.deviation[kMae], std::sqrt(2 * 0.1 * 0.1), 1e-12);
  EXPECT_NEAR(beach.seed_deviation[kMae], std::sqrt(2 * 0.1 * 0.1), 1e-12);
  EXPECT_NEAR(beach.worst[kMae], 0.4, 1e-12);
  EXPECT_EQ(beach.worst_material[kMae], "brass");
  EXPECT_NEAR(beach.worst[kSsim], 0.8, 1e-12);
  EXPECT_EQ(beach.worst_material[kSsim], "steel");
  EXPECT_TRUE(std::isnan(beach.mean[kPeak]));
  const Statistics& all = statistics[4];
  EXPECT_EQ(all.env, "mean");
  EXPECT_NEAR(all.mean[kMae], (((0.1 + 0.5) / 2 + 0.3) / 2 + 0.4) / 2, 1e-12);
  const std::string csv = SummaryCsv(statistics);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 5 * 5);
  EXPECT_NE(SummaryMarkdown(statistics).find("| default | beach |"), std::string::npos);
}

class Evaluation : public testing::Test {
 protected:
  void SetUp() override {
    char pattern[] = "/tmp/patina_brdf_eval_XXXXXX";
    ASSERT_NE(mkdtemp(pattern), nullptr);
    folder_ = pattern;
    options_.tables = folder_ + "/tables";
    options_.out = folder_ + "/out";
    options_.systems = {"table", "nbrdf"};
    options_.nbrdf = folder_ + "/networks.txt";
    options_.side = 16;
    options_.map_columns = 8;
    ASSERT_TRUE(MakeDirectories(options_.tables));
    WriteTable("plastic", 0.3f);
    std::string networks;
    for (const char* name : {"plastic", "rough"}) {
      networks += name;
      for (int i = 0; i < kNbrdfParameters; ++i) networks += " 0.01";
      networks += "\n";
    }
    ASSERT_TRUE(WriteFileDurably(options_.nbrdf, networks));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void WriteTable(const std::string& name, float alpha) {
    const auto bytes = brdf::EncodeUtia([alpha](const Direction& wi, const Direction& wo,
                                                float* rgb) { brdf::Plastic(alpha, wi, wo, rgb); });
    ASSERT_TRUE(
        WriteFileDurably(options_.tables + "/" + name + ".bin", std::span<const uint8_t>(bytes)));
  }
  std::string Rows() { return *ReadTextFile(options_.out + "/rows.csv", 1 << 20); }
  std::string Table() { return *ReadTextFile(options_.out + "/table.md", 1 << 20); }

  std::string folder_;
  EvalOptions options_;
};

TEST_F(Evaluation, GoesOnWhereItWasInterrupted) {
  ASSERT_TRUE(RunEvaluation(options_));
  const std::string first = Rows();
  EXPECT_EQ(std::count(first.begin(), first.end(), '\n'), 3);
  // Times are of the first run: the rows were not measured again.
  ASSERT_TRUE(RunEvaluation(options_));
  EXPECT_EQ(Rows(), first);
  // A run that was stopped in the middle of its last line.
  ASSERT_TRUE(WriteFileDurably(options_.out + "/rows.csv",
                               std::string_view(first).substr(0, first.size() - 20)));
  ASSERT_TRUE(RunEvaluation(options_));
  const std::string again = Rows();
  EXPECT_EQ(std::count(again.begin(), again.end(), '\n'), 3);
  const size_t kept = first.rfind('\n', first.size() - 2) + 1;
  EXPECT_EQ(again.substr(0, kept), first.substr(0, kept));
  // Another side is another measurement.
  options_.side = 20;
  WriteTable("rough", 0.6f);
  ASSERT_TRUE(RunEvaluation(options_));
  const std::string more = Rows();
  EXPECT_EQ(std::count(more.begin(), more.end(), '\n'), 7);
  EXPECT_EQ(more.substr(0, again.size()), again);
  EXPECT_NE(Table().find("| table | 2, 2 |"), std::string::npos);
}

TEST_F(Evaluation, MeasuresAgainstAnotherTruth) {
  WriteTable("clean", 0.3f);
  WriteTable("other", 0.6f);
  options_.only = {"plastic"};
  options_.systems = {"table"};
  options_.truth = options_.tables + "/clean.bin";
  ASSERT_TRUE(RunEvaluation(options_));
  EXPECT_NE(Rows().find("plastic,table,1,studio,16,8,0,0,0,0,"), std::string::npos);
  options_.out += "_other";
  options_.truth = options_.tables + "/other.bin";
  ASSERT_TRUE(RunEvaluation(options_));
  EXPECT_EQ(Rows().find("plastic,table,1,studio,16,8,0,0,0,0,"), std::string::npos);
}

TEST_F(Evaluation, SaysWhatIsWrong) {
  const auto message = [&] {
    const Status status = RunEvaluation(options_);
    return status ? std::string() : status.error().message;
  };
  options_.systems = {"no-such"};
  EXPECT_NE(message().find("no-such"), std::string::npos);
  options_.systems = {"nbrdf"};
  options_.nbrdf.clear();
  EXPECT_NE(message().find("--nbrdf"), std::string::npos);
  options_.systems = {"table"};
  options_.only = {"missing"};
  EXPECT_NE(message().find("no BRDF files"), std::string::npos);
  options_.only.clear();
  options_.envs = {folder_ + "/missing.hdr"};
  EXPECT_NE(message().find("missing.hdr"), std::string::npos);
  options_.envs.clear();
  ASSERT_TRUE(MakeDirectories(options_.out));
  ASSERT_TRUE(WriteFileDurably(options_.out + "/rows.csv", std::string_view("other\n")));
  EXPECT_NE(message().find("rows.csv: line 1"), std::string::npos);
}

}  // namespace
}  // namespace patina::bench
