// The command line of `patina` as plain values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/container_archive.h"
#include "pipeline/cli/terminal_progress.h"
#include "pipeline/client/client_commands.h"
#include "pipeline/jobs/run_guards.h"

namespace patina {

// Every option of `bake` that can replace what a job file says. Absent: the job file's value, or
// the default.
struct JobOverrides {
  std::optional<std::string> out;
  std::optional<std::string> profile;
  std::optional<std::string> quality;
  std::optional<std::string> recipe;
  std::optional<std::string> address;
  std::optional<std::string> normal_convention;
  std::optional<uint64_t> seed;
  std::optional<int> threads;
  std::optional<double> target_psnr_db;
  std::optional<double> target_bpp;
  std::optional<uint64_t> size_budget_bytes;
  std::optional<double> time_budget_s;
  std::optional<double> samples;
  std::optional<double> min_psnr_db;
  std::optional<std::string> working_space;
  std::optional<std::string> color_space;
  std::optional<std::string> ocio;
  std::optional<std::string> texture_format;
  bool no_report = false;
  bool repair_nonfinite = false;
  bool no_toksvig = false;
  bool learn_all = false;
  std::vector<std::string> effects_off;
  std::optional<double> constant_tolerance;
  std::optional<std::vector<int>> lod_range;  // two
};

struct BakeOptions {
  std::vector<std::string> inputs;     // folders, BRDF files, job files
  std::string map_list;                // --maps FILE.json, or empty
  int share = 1;                       // BRDFs on one codebook
  std::vector<std::string> materials;  // of scenes: only these; empty: all
  std::string as;                      // what texture sets become; empty: "material"
  JobOverrides job;
};

// Lists that are empty: not asked for.
struct TradeoffOptions {
  std::vector<std::string> inputs;
  std::string out;
  std::vector<std::string> profiles, qualities, recipes, interpolations;
  std::vector<int> nsides, index_bits, hidden, hidden_layers, shares;
};

struct RunOptions {
  std::string job_file;
  RunGuards guards;
  std::string events;  // empty: none
  std::string result;  // empty: result.json beside the events, or beside the job
};

struct UnpackArguments {
  std::string container;
  std::string out;
  std::optional<int> mip;
  std::string format;  // "png" or "exr"; empty: by what is written
  std::string space;   // of colour maps; empty: sRGB or linear Rec.709
  std::string ocio;    // empty: $OCIO, else the built-in one
};

struct InfoOptions {
  std::string container;
};

struct CompareOptions {
  std::string container;
  std::string source;             // a folder of maps, or a job file
  std::string map_list;           // --maps FILE.json, or empty
  std::string color_space, ocio;  // as of `bake`; empty: the job's
  bool repair_nonfinite = false;
};

struct EvalOptions {
  std::string container;
  std::string pairs;
  std::string out;  // empty: standard output
};

struct SampleOptions {
  std::string out;
  std::string kind = "all";  // "all", "material", "brdf", "layered", "svlayers", ...
  std::optional<int> size;   // 1024; of a BTF 64
  int images = 256;
  uint64_t seed = 1;
};

struct ShaderCommandOptions {
  std::string container;
  std::string out;
  std::string language = "glsl";  // "glsl", "essl", "hlsl"
  int first_binding = 0;
};

struct ViewArguments {
  std::string container;
  std::string source;  // a folder of maps or a job file; empty: none
  int port = 0;        // 0: any
  bool no_browser = false;
};

struct ValidateArguments {
  std::vector<std::string> paths;
  std::string format = "text";          // "text", "json", "junit", "sarif"
  std::string out;                      // empty: standard output
  std::string fail_on;                  // empty: the configuration's, or "error"
  std::vector<std::string> severities;  // "PAT-1104=note"
  std::string config, baseline, write_baseline;
  std::string against, inputs;
  bool current_only = false;
  bool list_codes = false;
};

// Of `pack` and `unpack-archive`.
struct PackArguments {
  std::string container;
  std::string archive;  // "-": standard input
  std::string out;      // "-": standard output, of `pack`
  int level = kDefaultArchiveLevel;
  uint64_t max_bytes = kDefaultUnpackedBytes;
};

enum class Command {
  kBake,
  kRun,
  kUnpack,
  kInfo,
  kCompare,
  kEval,
  kSample,
  kShader,
  kTradeoff,
  kValidate,
  kView,
  kPack,
  kUnpackArchive,
  // Of a daemon's client.
  kSubmit,
  kJobs,
  kWatch,
  kCancel,
  kRetry,
  kLogs,
  kStatus
};

struct CommandLine {
  Command command = Command::kBake;
  BakeOptions bake;
  RunOptions run;
  UnpackArguments unpack;
  InfoOptions info;
  CompareOptions compare;
  EvalOptions eval;
  SampleOptions sample;
  ShaderCommandOptions shader;
  TradeoffOptions tradeoff;
  ValidateArguments validate;
  ViewArguments view;
  PackArguments pack;
  ClientOptions client;
  bool json = false;
  Verbosity verbosity = Verbosity::kNormal;
  std::string simd;  // empty: what the environment says, or the best
  int threads = 0;   // of commands other than bake and run
};

// What came of parsing: a command to run, or text to print and a code to exit with.
struct ParsedCommandLine {
  std::optional<CommandLine> command;
  int exit_code = 0;
  std::string text;  // help or version if exit_code is 0, else the error
};

// Parses the arguments. No arguments, `help` and --help give the help text; --version the version.
ParsedCommandLine ParseCommandLine(int argc, const char* const* argv);

}  // namespace patina
