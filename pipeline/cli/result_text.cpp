#include "pipeline/cli/result_text.h"

#include <cstdio>

#include "pipeline/cli/terminal_progress.h"

namespace patina {
namespace {

std::string Number(double value, int digits) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string FirstLine(const std::string& text) { return text.substr(0, text.find('\n')); }

}  // namespace

std::string ResultText(const JobResult& result) {
  std::string text = result.asset + ": ";
  if (result.psnr) {
    text += Number(result.psnr->overall_db, 2) + " dB (mip 0 " + Number(result.psnr->mip0_db, 2) +
            ", mean of mips " + Number(result.psnr->mean_mips_db, 2) + ")";
    if (result.ssim) text += ", SSIM " + Number(*result.ssim, 3);
    if (result.flip) text += ", FLIP " + Number(*result.flip, 3);
    if (result.normal_angle_deg)
      text += ", normals " + Number(*result.normal_angle_deg, 2) + " degrees";
    text += "\n  ";
    for (const auto& [role, db] : result.psnr->maps) text += role + " " + Number(db, 2) + " dB, ";
    text += BytesText(static_cast<double>(result.bytes)) + ", ";
  }
  if (result.brdf) {
    const BrdfSummary& brdf = *result.brdf;
    if (brdf.image_mae) {
      text += "lit sphere MAE " + Number(*brdf.image_mae, 5) + ", RMSE " +
              Number(brdf.image_rmse.value_or(0), 5) + ", SSIM " +
              Number(brdf.image_ssim.value_or(0), 5) + ", ";
    }
    text += "log1p MAE " + Number(brdf.log1p_mae, 5) + ", reciprocity error " +
            Number(brdf.reciprocity, 5) + "\n  " + BytesText(static_cast<double>(result.bytes)) +
            ", ";
  }
  if (result.svbrdf) {
    const SvbrdfSummary& svbrdf = *result.svbrdf;
    text +=
        "lit planes " + Number(svbrdf.psnr_db, 2) + " dB, MAE " + Number(svbrdf.image_mae, 5) +
        ", SSIM " + Number(svbrdf.image_ssim, 5) + ", log1p MAE " + Number(svbrdf.log1p_mae, 5) +
        "\n  " + BytesText(static_cast<double>(result.bytes)) + ", " +
        (svbrdf.ratio > 0 ? Number(svbrdf.ratio, 0) + " times smaller than the images as halves, "
                          : "");
  }
  text += DurationText(result.seconds) + "\n  " + result.container + "\n";
  return text;
}

std::string SummaryText(std::span<const JobResult> results, size_t planned) {
  size_t done = 0;
  std::string others;
  for (const JobResult& result : results) {
    if (!result.error) {
      ++done;
    } else {
      others += "  " + result.asset + ": " + FirstLine(result.error->message) + "\n";
    }
  }
  std::string text = std::to_string(done) + " of " + std::to_string(planned) + " assets baked";
  if (results.size() < planned)
    text += ", " + std::to_string(planned - results.size()) + " not begun";
  return text + (others.empty() ? "\n" : "; not baked:\n" + others);
}

std::string ResultsToJson(std::span<const JobResult> results, int exit_code) {
  std::string json = "{\"version\":1,\"exit_code\":" + std::to_string(exit_code) + ",\"assets\":[";
  for (size_t i = 0; i < results.size(); ++i)
    json += (i > 0 ? "," : "") + JobResultToJson(results[i], -1);
  return json + "]}";
}

}  // namespace patina
