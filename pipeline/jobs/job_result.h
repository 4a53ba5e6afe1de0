// How a job ended: the content of result.json and of `--json`. Described by
// schemas/result.schema.json.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina {

// Exit codes of the program; never reused for another meaning.
enum ExitCode : int {
  kExitDone = 0,
  kExitFailed = 1,
  kExitUsage = 2,
  kExitBadInput = 3,
  kExitQualityGate = 4,
  kExitInterrupted = 130
};

// The PSNRs of schemas/result.schema.json, in dB.
struct PsnrSummary {
  double overall_db = 0;
  double mip0_db = 0;
  double mean_mips_db = 0;
  std::vector<std::pair<std::string, double>>
      maps;  // role -> dB over all mips, in the manifest's order
};

// Colatitudes of the incoming light at which the albedo of a BRDF is measured, degrees.
inline constexpr std::array<double, 5> kAlbedoDegrees = {0, 30, 60, 80, 89};

// How good a baked BRDF is; see schemas/result.schema.json and MeasureBrdf.
struct BrdfSummary {
  std::optional<double> image_mae, image_rmse, image_ssim;  // absent for a list of measurements
  double log1p_mae = 0;
  double reciprocity = 0;
  std::array<std::array<double, 3>, kAlbedoDegrees.size()> albedo{};
};

// How good a baked spatially varying BRDF is; see schemas/result.schema.json and MeasureSvbrdf.
struct SvbrdfSummary {
  double image_mae = 0, image_rmse = 0, image_ssim = 0;
  double psnr_db = 0;
  double log1p_mae = 0;
  double ratio = 0;  // bytes of the images as halves to those of what an engine loads
};

struct JobResult {
  int exit_code = kExitDone;
  std::optional<Error> error;  // set exactly when exit_code is not kExitDone
  std::string error_stage;     // where; may be empty
  std::string asset;
  std::string container;    // folder of the published container, or of the rejected one; else empty
  std::string revision;     // empty if not published
  std::string fingerprint;  // empty if the input could not be read
  std::string profile;      // of materials
  std::string quality, recipe;
  uint64_t seed = 0;
  double seconds = 0;
  double cpu_seconds = 0;
  double samples = 0;
  std::string stopped_by;
  std::string choice;  // why this profile, if the job asked for a quality or a size
  uint64_t bytes = 0;  // of what an engine loads
  std::optional<PsnrSummary> psnr;
  std::optional<double> ssim, flip, normal_angle_deg;
  std::optional<BrdfSummary> brdf;
  std::optional<SvbrdfSummary> svbrdf;
  std::vector<std::string> warnings;
};

// The result as JSON: one line without a line break if indent < 0, else indented by so many blanks.
std::string JobResultToJson(const JobResult& result, int indent);

// The exit code for an error that came while input was read (`reading_input`) or later.
int ExitCodeFor(const Error& error, bool reading_input);

}  // namespace patina
