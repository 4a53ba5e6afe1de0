#include "formats/model_bytes.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/page_parts.h"
#include "pipeline/jobs/page_time.h"
#include "pipeline/jobs/report_page.h"
#include "pipeline/material/trainer.h"
#include "pipeline/report/page.h"
#include "pipeline/report/quantity.h"
#include "pipeline/report/table.h"

namespace patina {
namespace {

constexpr const char* kMiddleDot = " \xC2\xB7 ";
constexpr const char* kTimes = "\xC3\x97";
constexpr const char* kDegree = "\xC2\xB0";

double Ratio(const PageFacts& facts) {
  return CompressionRatio(*facts.manifest.brdf, ModelBytes(facts.manifest.payloads));
}

bool IsMeasured(const PageFacts& facts) { return facts.manifest.brdf->images->images > 0; }

std::string SizeText(const ManifestImageSet& images) {
  if (images.images == 0) {
    return "maps of " + std::to_string(images.width) + " " + kTimes + " " +
           std::to_string(images.height);
  }
  return std::to_string(images.images) + " images of " + std::to_string(images.width) + " " +
         kTimes + " " + std::to_string(images.height);
}

std::string Angles(const SvbrdfPlane& plane) {
  return "light " + ShortText(plane.light_deg, 3) + kDegree + ", view " +
         ShortText(plane.view_deg, 3) + kDegree;
}

std::string Listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

std::string Verdict(const PageFacts& facts, const SvbrdfMeasurement& measurement) {
  const bool measured = IsMeasured(facts);
  return std::string(measured ? "Planes lit as in the images" : "Lit planes") + " come to " +
         FixedText(PsnrOfMse(measurement.mse), 2) + " dB and an SSIM of " +
         FixedText(measurement.error.ssim, 4) + ". " +
         BytesText(ModelBytes(facts.manifest.payloads)) + " to load" +
         (measured ? ", " + CountText(Ratio(facts)) + " times less than the images as half floats"
                   : "") +
         ". Baked in " + SecondsText(facts.run.seconds) + "; the training stopped because " +
         StopText(facts.stopped_by) + ".";
}

std::string KindLine(const Manifest& m) {
  return "Spatially varying neural BRDF" + std::string(kMiddleDot) + "from " +
         m.brdf->files[0].path + ", " + SizeText(*m.brdf->images) + kMiddleDot + "quality " +
         m.quality_setting + kMiddleDot + "recipe " + m.tool.recipe + " " +
         std::to_string(m.tool.recipe_version) + kMiddleDot + "seed " + std::to_string(m.seed);
}

void AddPlanes(const PageFacts& facts, const SvbrdfMeasurement& measurement,
               const std::vector<PageTrio>& planes, Html* html) {
  OpenSection("pictures", "The lit plane", html);
  html->Add(
      "p", std::string(IsMeasured(facts) ? "Light and view of three of the source's images: those "
                                           "whose steeper direction is nearest to "
                                           "the normal, in the middle, and farthest"
                                         : "Three of 64 pairs of light and view") +
               ". A white diffuse surface that "
               "faces the light would be white. Point at a decoded picture, or move to it with the "
               "Tab key, and the source lies in its place. The difference is the largest of the "
               "channels, times " +
               ShortText(kSheetDifferenceGain, 3) + ": black is no difference.");
  for (size_t i = 0; i < planes.size(); ++i) {
    html->Open("div", {{"class", "spheres"}});
    AddTrio(planes[i], Angles(measurement.planes[i]), false, html);
    html->Close();
  }
  html->Close();
}

void AddErrors(const SvbrdfMeasurement& measurement, Html* html) {
  OpenSection("quality", "Quality", html);
  Table table;
  table.caption =
      "Errors of the lit planes, from the written files: squared and dB of linear values within "
      "[0, 1], the others coded with the sRGB curve.";
  table.heads = {"plane", "mean square", "dB", "mean, sRGB", "SSIM"};
  for (const SvbrdfPlane& plane : measurement.planes) {
    table.rows.push_back({Angles(plane),
                          {{ShortText(plane.mse, 3)},
                           {FixedText(PsnrOfMse(plane.mse), 2)},
                           {ShortText(plane.error.mae_srgb, 3)},
                           {FixedText(plane.error.ssim, 4)}}});
  }
  table.rows.push_back({"mean",
                        {{ShortText(measurement.mse, 3)},
                         {FixedText(PsnrOfMse(measurement.mse), 2)},
                         {ShortText(measurement.error.mae_srgb, 3)},
                         {FixedText(measurement.error.ssim, 4)}},
                        true});
  AddTable(table, html);
  html->Add("p", "Mean error of log(1 + f) over " +
                     CountText(static_cast<double>(measurement.log1p.pairs)) +
                     " texels under up to 64 pairs of light and view: " +
                     ShortText(measurement.log1p.mae, 3) + ".");
  html->Close();
}

void AddModel(const PageFacts& facts, const svbrdf::TrainedSvbrdf& model, Html* html) {
  const ManifestBrdf& brdf = *facts.manifest.brdf;
  const svbrdf::TextureShape& texture = model.shape.texture;
  const bool blocks = model.texels.empty();
  OpenSection("training", "Model and training", html);
  std::string layers;
  for (const int width : brdf.layers)
    layers += (layers.empty() ? "" : " \xE2\x86\x92 ") + std::to_string(width);
  std::vector<std::pair<std::string, std::string>> rows = {{"file", brdf.files[0].path}};
  if (brdf.simulation) {
    rows.emplace_back("simulated", CountText(static_cast<double>(brdf.simulation->paths)) +
                                       " paths for " +
                                       CountText(static_cast<double>(brdf.simulation->pairs)) +
                                       " places and pairs of directions, standard error " +
                                       ShortText(brdf.simulation->standard_error, 3));
    rows.emplace_back("effects", Listed(brdf.simulation->effects));
    rows.emplace_back("left out", Listed(brdf.simulation->left_out));
  }
  rows.insert(
      rows.end(),
      {{"neural texture",
        std::to_string(texture.textures) + (blocks ? " BC6H" : " uncompressed fp16") +
            " textures of " + std::to_string(texture.width) + " " + kTimes + " " +
            std::to_string(texture.height) + ", " + std::to_string(texture.levels) + " mips, " +
            AddressModeName(texture.address)},
       {"grid", "Nside " + std::to_string(brdf.nside) + ", " + Spaced(brdf.interpolation)},
       {"codes in use, by perplexity", CountText(model.used_codes)},
       {"network", layers + ", " + brdf.activation},
       {"samples", CountText(model.samples)},
       {"error of log(1 + f cos) of free features and texels", ShortText(model.free_loss, 3)},
       {blocks ? "the same of codes and blocks" : "the same of codes and free texels",
        ShortText(model.block_loss, 3)},
       {blocks ? "the same at the end, behind legal blocks"
               : "the same at the end, behind texels of half precision",
        ShortText(model.final_loss, 3)},
       {"steps left out because a value was not finite", std::to_string(model.rollbacks)}});
  AddTrainingFacts(rows, html);
  html->Close();
}

}  // namespace

std::string SvbrdfReportPage(const PageFacts& facts, const SvbrdfMeasurement& measurement,
                             const svbrdf::TrainedSvbrdf& model,
                             const std::vector<PageTrio>& planes) {
  const uint64_t cells = facts.manifest.brdf->cells;
  std::vector<HeadFact> figures = {
      {FixedText(PsnrOfMse(measurement.mse), 2) + " dB", "of the lit planes"},
      {FixedText(measurement.error.ssim, 4), "SSIM of the lit planes (1 is perfect)"},
      {ShortText(measurement.log1p.mae, 3), "mean error of log(1 + f)"},
      {BytesText(ModelBytes(facts.manifest.payloads)), "to load"}};
  if (IsMeasured(facts))
    figures.push_back({CountText(Ratio(facts)), "times smaller than the images"});
  figures.push_back({SecondsText(facts.run.seconds), "to bake"});
  Html html = BeginReportPage(facts, KindLine(facts.manifest), Verdict(facts, measurement),
                              std::move(figures));
  AddWarnings(facts, &html);
  AddPlanes(facts, measurement, planes, &html);
  AddTimeSection(facts, &html);
  AddSimulation(facts, &html);
  AddErrors(measurement, &html);
  if (IsMeasured(facts)) {
    AddBytesSection(
        facts, {{"the images as half floats", 6 * cells}, {"the images as floats", 12 * cells}},
        "Against the images that it was made from: three numbers a texel, without "
        "headers.",
        &html);
  }
  AddModel(facts, model, &html);
  return FinishReportPage(facts, std::move(html));
}

}  // namespace patina
