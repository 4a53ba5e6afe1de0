// What older versions wrote is read: their containers give the values that their own decoders gave,
// and their queue goes on. README.md in this folder says which versions, and how to add one.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <memory>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/queue/job_store.h"
#include "formats/decoder/patina_brdf_decoder.h"
#include "formats/decoder/patina_decoder.h"
#include "tests/formats/test_support.h"

namespace patina {
namespace {

using daemon::JobState;
using daemon::JobStore;
using Rows = std::vector<std::vector<double>>;

const std::string kFolder = std::string(PATINA_SOURCE_DIR) + "/tests/golden/";

// The rows of a file of numbers between blanks; lines that begin with # are comments.
Rows ReadRows(const std::string& path) {
  std::ifstream file(path);
  Rows rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    rows.emplace_back(std::istream_iterator<double>(words), std::istream_iterator<double>());
  }
  return rows;
}

// Decoders promise the same bits to those who compile without fused multiplications; what is
// printed has nine digits, and a function of the standard library may differ in the last bit.
void ExpectClose(const std::vector<float>& found, const std::vector<double>& row, size_t begin) {
  ASSERT_EQ(row.size(), begin + found.size());
  for (size_t i = 0; i < found.size(); ++i) {
    EXPECT_NEAR(found[i], row[begin + i], 1e-6 + 1e-6 * std::abs(row[begin + i])) << "value " << i;
  }
}

class GoldenMaterial : public testing::TestWithParam<const char*> {};
class GoldenBrdf : public testing::TestWithParam<const char*> {};

TEST_P(GoldenMaterial, DecodesToWhatItsOwnVersionDecoded) {
  Decoder decoder;
  std::string problem;
  const std::string folder = kFolder + GetParam();
  ASSERT_EQ(Decoder::Load(folder + "/container", &decoder, &problem), Decoder::LoadStatus::kOk)
      << problem;
  const Rows rows = ReadRows(folder + "/expected.txt");
  ASSERT_EQ(rows.size(), 15u);
  for (const auto& row : rows) {
    ASSERT_GE(row.size(), 3u);
    std::vector<float> values(decoder.channels().size());
    decoder.Physical(row[0], row[1], row[2], values.data());
    ExpectClose(values, row, 3);
  }
}

TEST_P(GoldenBrdf, DecodesToWhatItsOwnVersionDecoded) {
  BrdfDecoder decoder;
  std::string problem;
  const std::string folder = kFolder + GetParam();
  ASSERT_EQ(BrdfDecoder::Load(folder + "/container", &decoder, &problem),
            BrdfDecoder::LoadStatus::kOk)
      << problem;
  const Rows rows = ReadRows(folder + "/expected.txt");
  ASSERT_EQ(rows.size(), 9u);
  for (const auto& row : rows) {
    ASSERT_EQ(row.size(), 7u);
    float w[2][3];
    for (int i = 0; i < 2; ++i) {
      const double theta = row[2 * i] * std::numbers::pi / 180,
                   phi = row[2 * i + 1] * std::numbers::pi / 180;
      w[i][0] = static_cast<float>(std::sin(theta) * std::cos(phi));
      w[i][1] = static_cast<float>(std::sin(theta) * std::sin(phi));
      w[i][2] = static_cast<float>(std::cos(theta));
    }
    std::vector<float> f(3);
    decoder.Evaluate(w[0], w[1], f.data());
    ExpectClose(f, row, 4);
  }
}

INSTANTIATE_TEST_SUITE_P(Versions, GoldenMaterial,
                         testing::Values("material-1", "material-2", "material-hdr"));
INSTANTIATE_TEST_SUITE_P(Versions, GoldenBrdf, testing::Values("brdf-1", "brdf-shared/metal"));

// The dump of a queue that its own patinad had written, as a database again.
void Restore(const std::string& dump, const std::string& path) {
  std::ifstream file(dump);
  const std::string sql{std::istreambuf_iterator<char>(file), {}};
  ASSERT_FALSE(sql.empty()) << dump;
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(database);
  sqlite3_close(database);
}

TEST(GoldenQueue, OfTheFirstVersionGoesOn) {
  const test::TemporaryDirectory folder;
  Restore(kFolder + "queue-1.sql", folder / "queue.db");
  auto opened = JobStore::Open(folder / "queue.db");
  ASSERT_OK(opened);
  JobStore& store = **opened;

  const auto page = store.List({});
  ASSERT_OK(page);
  std::vector<std::string> found;
  for (const auto& job : page->jobs)
    found.push_back(job.asset + " " + daemon::JobStateName(job.state));
  EXPECT_EQ(found, (std::vector<std::string>{"later queued", "broken failed", "wall succeeded"}));

  const auto wall = store.Get(page->jobs[2].id);
  ASSERT_OK(wall);
  EXPECT_EQ(wall->revision, "r0001");
  EXPECT_NE(wall->result_json.find("\"r0001\""), std::string::npos);
  const auto broken = store.Get(page->jobs[1].id);
  ASSERT_OK(broken);
  EXPECT_FALSE(broken->error_message.empty());

  // What waited is run, what failed may be tried again, and what comes in is behind both.
  const int64_t now = page->jobs[0].updated_ms + 1000;
  const auto runnable = store.Runnable(5);
  ASSERT_OK(runnable);
  ASSERT_EQ(runnable->size(), 1u);
  const auto started = store.Start(runnable->front().id, "", now + 1000, now);
  ASSERT_OK(started);
  daemon::AttemptEnd end;
  end.state = JobState::kSucceeded;
  end.revision = "r0001";
  ASSERT_OK(store.Finish({started->id, started->attempt}, end, now));
  ASSERT_OK(store.Retry(broken->id, now));
  daemon::NewJob job;
  job.asset = "new";
  job.kind = "material";
  job.out = "/out";
  job.job_json = "{}";
  const auto submitted = store.Submit(job, now);
  ASSERT_OK(submitted);
  EXPECT_GT(submitted->id, page->jobs[0].id);
}

}  // namespace
}  // namespace patina
