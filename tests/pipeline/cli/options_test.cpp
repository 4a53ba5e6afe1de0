#include "pipeline/cli/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace patina {
namespace {

using testing::HasSubstr;

ParsedCommandLine Parse(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "patina");
  return ParseCommandLine(static_cast<int>(arguments.size()), arguments.data());
}

TEST(ParseCommandLine, LeavesOutWhatIsNotGiven) {
  const ParsedCommandLine parsed = Parse({"bake", "folder"});
  ASSERT_TRUE(parsed.command) << parsed.text;
  EXPECT_EQ(parsed.command->command, Command::kBake);
  EXPECT_EQ(parsed.command->bake.inputs, std::vector<std::string>{"folder"});
  const JobOverrides& job = parsed.command->bake.job;
  EXPECT_FALSE(job.out || job.profile || job.quality || job.recipe || job.address ||
               job.normal_convention || job.seed || job.threads || job.target_psnr_db ||
               job.time_budget_s || job.samples || job.min_psnr_db);
  EXPECT_FALSE(job.repair_nonfinite || job.no_toksvig);
  EXPECT_EQ(parsed.command->simd, "");
  EXPECT_EQ(parsed.command->verbosity, Verbosity::kNormal);
}

TEST(ParseCommandLine, ReadsEveryOptionOfBake) {
  const ParsedCommandLine parsed = Parse({"bake",
                                          "a",
                                          "b",
                                          "--out",
                                          "o",
                                          "--profile",
                                          "bcf-2k++",
                                          "--quality",
                                          "reference",
                                          "--target-psnr",
                                          "35.5",
                                          "--time-budget",
                                          "60",
                                          "--min-psnr",
                                          "30",
                                          "--recipe",
                                          "paper",
                                          "--seed",
                                          "9",
                                          "--threads",
                                          "2",
                                          "--maps",
                                          "m.json",
                                          "--json",
                                          "--simd",
                                          "avx2",
                                          "--address",
                                          "clamp",
                                          "--samples",
                                          "1e6",
                                          "--verbose",
                                          "--no-toksvig",
                                          "--repair-nonfinite",
                                          "--normal-convention",
                                          "directx",
                                          "--working-space",
                                          "acescg",
                                          "--color-space",
                                          "ACES - ACEScg",
                                          "--ocio",
                                          "c.ocio"});
  ASSERT_TRUE(parsed.command) << parsed.text;
  const JobOverrides& job = parsed.command->bake.job;
  EXPECT_EQ(parsed.command->bake.inputs.size(), 2u);
  EXPECT_EQ(job.out, "o");
  EXPECT_EQ(job.profile, "bcf-2k++");
  EXPECT_EQ(job.quality, "reference");
  EXPECT_EQ(job.target_psnr_db, 35.5);
  EXPECT_EQ(job.time_budget_s, 60);
  EXPECT_EQ(job.min_psnr_db, 30);
  EXPECT_EQ(job.recipe, "paper");
  EXPECT_EQ(job.working_space, "acescg");
  EXPECT_EQ(job.color_space, "ACES - ACEScg");
  EXPECT_EQ(job.ocio, "c.ocio");
  EXPECT_EQ(job.seed, 9u);
  EXPECT_EQ(job.threads, 2);
  EXPECT_EQ(job.address, "clamp");
  EXPECT_EQ(job.samples, 1e6);
  EXPECT_EQ(job.normal_convention, "directx");
  EXPECT_TRUE(job.repair_nonfinite);
  EXPECT_TRUE(job.no_toksvig);
  EXPECT_EQ(parsed.command->bake.map_list, "m.json");
  EXPECT_TRUE(parsed.command->json);
  EXPECT_EQ(parsed.command->simd, "avx2");
  EXPECT_EQ(parsed.command->verbosity, Verbosity::kVerbose);
}

TEST(ParseCommandLine, ReadsTheOtherCommands) {
  const ParsedCommandLine run = Parse({"run", "j.json", "--events", "e", "--result", "r"});
  ASSERT_TRUE(run.command);
  EXPECT_EQ(run.command->command, Command::kRun);
  EXPECT_EQ(run.command->run.job_file, "j.json");
  EXPECT_EQ(run.command->run.events, "e");
  EXPECT_EQ(run.command->run.result, "r");
  EXPECT_FALSE(run.command->run.guards.skip_unchanged);
  const ParsedCommandLine guarded = Parse({"run", "j.json", "--skip-unchanged", "--not-revision",
                                           "r0001", "--fence", "f", "--attempt", "3"});
  ASSERT_TRUE(guarded.command);
  EXPECT_TRUE(guarded.command->run.guards.skip_unchanged);
  EXPECT_EQ(guarded.command->run.guards.not_revision, "r0001");
  EXPECT_EQ(guarded.command->run.guards.fence_file, "f");
  EXPECT_EQ(guarded.command->run.guards.attempt, 3);
  EXPECT_FALSE(Parse({"run", "j.json", "--attempt", "3"}).command);
  EXPECT_FALSE(Parse({"run", "j.json", "--fence", "f", "--attempt", "0"}).command);
  const ParsedCommandLine unpack =
      Parse({"unpack", "c", "--out", "d", "--mip", "3", "--format", "exr"});
  ASSERT_TRUE(unpack.command);
  EXPECT_EQ(unpack.command->unpack.mip, 3);
  EXPECT_EQ(unpack.command->unpack.format, "exr");
  const ParsedCommandLine compare = Parse({"compare", "c", "s", "--json"});
  ASSERT_TRUE(compare.command);
  EXPECT_EQ(compare.command->compare.source, "s");
  const ParsedCommandLine sample = Parse({"sample", "--out", "d", "--size", "256", "--seed", "4"});
  ASSERT_TRUE(sample.command);
  EXPECT_EQ(sample.command->sample.size, 256);
  EXPECT_EQ(sample.command->sample.seed, 4u);
  EXPECT_EQ(sample.command->sample.kind, "all");
  const ParsedCommandLine brdfs = Parse({"sample", "--out", "d", "--kind", "brdf"});
  ASSERT_TRUE(brdfs.command);
  EXPECT_EQ(brdfs.command->sample.kind, "brdf");
  const ParsedCommandLine eval = Parse({"eval", "c", "--pairs", "p.csv", "--out", "v.csv"});
  ASSERT_TRUE(eval.command);
  EXPECT_EQ(eval.command->command, Command::kEval);
  EXPECT_EQ(eval.command->eval.container, "c");
  EXPECT_EQ(eval.command->eval.pairs, "p.csv");
  EXPECT_EQ(eval.command->eval.out, "v.csv");
}

TEST(ParseCommandLine, AnswersAMistakeWithTheOptionAndWhereToLook) {
  const ParsedCommandLine parsed = Parse({"bake", "x", "--profile", "huge"});
  EXPECT_FALSE(parsed.command);
  EXPECT_EQ(parsed.exit_code, 2);
  EXPECT_THAT(parsed.text, HasSubstr("--profile"));
  EXPECT_THAT(parsed.text, HasSubstr("bcf-1k"));
  EXPECT_THAT(parsed.text, HasSubstr("patina bake --help"));
}

TEST(ParseCommandLine, RefusesNumbersThatAreNone) {
  for (const char* number : {"", "x", "-1", "1.5", "99999999999999999999", "nan"}) {
    EXPECT_EQ(Parse({"bake", "x", "--seed", number}).exit_code, 2) << number;
  }
  for (const char* number : {"", "x", "-1", "101", "nan", "inf"}) {
    EXPECT_EQ(Parse({"bake", "x", "--min-psnr", number}).exit_code, 2) << number;
  }
}

TEST(ProgressLine, LeavesOutWhatIsNotKnown) {
  ProgressEvent event;
  event.stage = "ingest";
  EXPECT_EQ(ProgressLine("floor", event), "floor: ingest");
  event.stage = "train";
  event.fraction = 0.634;
  event.samples_per_s = 29.44e6;
  event.psnr_db = 31.21;
  event.eta_s = 11.2;
  EXPECT_EQ(ProgressLine("floor", event),
            "floor: train 63 %, 29.4 M samples/s, 31.2 dB, 11 s left");
}

TEST(ParseCommandLine, ReadsTheCommandsOfADaemonsClient) {
  const ParsedCommandLine submit = Parse({"submit", "a", "b.json", "--wait", "--priority", "-7",
                                          "--socket", "s", "--json", "--force", "--key", "k"});
  ASSERT_TRUE(submit.command) << submit.text;
  EXPECT_EQ(submit.command->command, Command::kSubmit);
  const ClientOptions& o = submit.command->client;
  EXPECT_EQ(o.inputs, (std::vector<std::string>{"a", "b.json"}));
  EXPECT_TRUE(o.wait && o.json && o.force);
  EXPECT_EQ(o.priority, -7);
  EXPECT_EQ(o.socket, "s");
  EXPECT_EQ(o.idempotency_key, "k");
  const ParsedCommandLine cancel = Parse({"cancel", "1", "22"});
  ASSERT_TRUE(cancel.command) << cancel.text;
  EXPECT_EQ(cancel.command->client.ids, (std::vector<int64_t>{1, 22}));
  const ParsedCommandLine watch = Parse({"watch"});
  ASSERT_TRUE(watch.command) << watch.text;
  EXPECT_TRUE(watch.command->client.ids.empty());
  for (const char* command : {"jobs", "status"}) EXPECT_TRUE(Parse({command, "--json"}).command);
  EXPECT_TRUE(Parse({"logs", "3", "--follow", "--tail", "100"}).command);
}

TEST(ParseCommandLine, RefusesWhatNoDaemonTakes) {
  for (const std::vector<const char*>& arguments : {std::vector<const char*>{"submit"},
                                                    {"submit", "a", "--priority", "101"},
                                                    {"cancel"},
                                                    {"cancel", "0"},
                                                    {"cancel", "x"},
                                                    {"watch", "1", "2"},
                                                    {"logs"},
                                                    {"jobs", "--limit", "0"},
                                                    {"retry", "-1"}}) {
    const ParsedCommandLine parsed = Parse(arguments);
    EXPECT_FALSE(parsed.command);
    EXPECT_EQ(parsed.exit_code, 2) << parsed.text;
  }
}

TEST(DurationText, ChangesItsUnit) {
  EXPECT_EQ(DurationText(-1), "0.0 s");
  EXPECT_EQ(DurationText(0.04), "0.0 s");
  EXPECT_EQ(DurationText(9.94), "9.9 s");
  EXPECT_EQ(DurationText(9.96), "10 s");
  EXPECT_EQ(DurationText(59.4), "59 s");
  EXPECT_EQ(DurationText(59.6), "1 min 00 s");
  EXPECT_EQ(DurationText(125), "2 min 05 s");
  EXPECT_EQ(DurationText(3725), "1 h 02 min");
}

TEST(BytesText, ChangesItsUnit) {
  EXPECT_EQ(BytesText(999), "999 bytes");
  EXPECT_EQ(BytesText(1500), "1.5 kB");
  EXPECT_EQ(BytesText(1.77e6), "1.77 MB");
  EXPECT_EQ(BytesText(2e9), "2.00 GB");
}

TEST(ParseCommandLine, ReadsEveryOptionOfView) {
  const ParsedCommandLine parsed =
      Parse({"view", "baked/wall", "--source", "wall", "--port", "8080", "--no-browser"});
  ASSERT_TRUE(parsed.command) << parsed.text;
  EXPECT_EQ(parsed.command->command, Command::kView);
  EXPECT_EQ(parsed.command->view.container, "baked/wall");
  EXPECT_EQ(parsed.command->view.source, "wall");
  EXPECT_EQ(parsed.command->view.port, 8080);
  EXPECT_TRUE(parsed.command->view.no_browser);
  EXPECT_EQ(Parse({"view", "a"}).command->view.port, 0);
  for (const char* port : {"-1", "65536", "http", "80x"})
    EXPECT_EQ(Parse({"view", "a", "--port", port}).exit_code, 2) << port;
  EXPECT_EQ(Parse({"view"}).exit_code, 2);
}

}  // namespace
}  // namespace patina
