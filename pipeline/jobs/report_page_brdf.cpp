#include <algorithm>

#include "formats/model_bytes.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/page_parts.h"
#include "pipeline/jobs/page_time.h"
#include "pipeline/jobs/report_page.h"
#include "pipeline/report/page.h"
#include "pipeline/report/quantity.h"
#include "pipeline/report/table.h"

namespace patina {
namespace {

constexpr const char* kMiddleDot = " \xC2\xB7 ";
constexpr const char* kTimes = "\xC3\x97";
constexpr const char* kDegree = "\xC2\xB0";

// What the numbers mean to an eye, of spheres of which 1 is the same.
std::string Impression(double ssim) {
  const char* words[] = {"Hard to tell from the source", "Close to the source",
                         "Visibly different from the source in places",
                         "Visibly different from the source"};
  const double limits[] = {0.998, 0.99, 0.96};
  size_t i = 0;
  while (i < 3 && !(ssim >= limits[i])) ++i;
  return words[i];
}

std::string Verdict(const PageFacts& facts, const BrdfMeasurement& measurement) {
  std::string text;
  if (measurement.image) {
    text = Impression(measurement.image->ssim) + ": on a lit sphere, SSIM " +
           FixedText(measurement.image->ssim, 4) + " and a mean error of " +
           FixedText(100 * measurement.image->mae_srgb, 2) + " % of full scale. ";
  } else {
    text = "A list of measurements, met with a mean error of log(1 + f) of " +
           ShortText(measurement.all.mae, 3) + ". ";
  }
  text += BytesText(ModelBytes(facts.manifest.payloads)) + " to load";
  if (!facts.manifest.brdf->shared_codebook_file.empty())
    text += ", and a codebook that it shares with others";
  text += ". Baked in " + SecondsText(facts.run.seconds) + "; the training stopped because " +
          StopText(facts.stopped_by) + ".";
  return text;
}

std::string KindLine(const Manifest& m) {
  const ManifestBrdf& brdf = *m.brdf;
  return "Neural BRDF" + std::string(kMiddleDot) + "from " + brdf.files[0].path + " (" +
         brdf.source_format + ")" + kMiddleDot + (brdf.isotropic ? "isotropic" : "anisotropic") +
         kMiddleDot + "quality " + m.quality_setting + kMiddleDot + "recipe " + m.tool.recipe +
         " " + std::to_string(m.tool.recipe_version) + kMiddleDot + "seed " +
         std::to_string(m.seed);
}

std::vector<HeadFact> HeadFacts(const PageFacts& facts, const BrdfMeasurement& measurement) {
  std::vector<HeadFact> head;
  if (measurement.image) {
    head.push_back({FixedText(measurement.image->ssim, 4), "SSIM of the sphere (1 is perfect)"});
    head.push_back({ShortText(measurement.image->mae_srgb, 3), "mean error of the sphere, sRGB"});
  }
  head.push_back({ShortText(measurement.all.mae, 3), "mean error of log(1 + f)"});
  head.push_back({ShortText(measurement.reciprocity, 2), "reciprocity error"});
  head.push_back({BytesText(ModelBytes(facts.manifest.payloads)), "to load"});
  head.push_back({SecondsText(facts.run.seconds), "to bake"});
  return head;
}

void AddSphere(const BrdfMeasurement& measurement, const PageTrio& sphere, Html* html) {
  OpenSection("pictures", "A lit sphere", html);
  std::string text =
      "Under a sky, a ground and three soft lamps, seen from the front, without Monte Carlo noise.";
  if (!sphere.source.empty()) {
    text +=
        " Point at the decoded picture, or move to it with the Tab key, and the source lies "
        "in its place. The difference is the largest of the channels, times " +
        ShortText(kSheetDifferenceGain, 3) + ": black is no difference.";
  } else {
    text += " A list of measurements has no picture of its own to compare with.";
  }
  html->Add("p", text);
  html->Open("div", {{"class", "spheres"}});
  std::string caption = "Lit sphere";
  if (measurement.image) {
    caption += ", " + std::to_string(sphere.width) + " " + kTimes + " " +
               std::to_string(sphere.height) + " pixels";
  }
  AddTrio(sphere, caption, false, html);
  html->Close().Close();
}

void AddErrors(const BrdfMeasurement& measurement, bool list, Html* html) {
  OpenSection("quality", "Quality", html);
  Table pairs;
  pairs.caption =
      "Error of log(1 + f), over pairs of directions, by how the pairs were drawn; from the "
      "written files.";
  pairs.heads = {"pairs", "number", "mean", "mean square"};
  const auto row = [&](const char* name, const Log1pError& error) {
    if (error.pairs == 0) return;
    pairs.rows.push_back({name,
                          {{CountText(static_cast<double>(error.pairs))},
                           {ShortText(error.mae, 3)},
                           {ShortText(error.mse, 3)}}});
  };
  if (list) {
    row("the measurements", measurement.half_angles);
  } else {
    row("by half angles, where peaks are", measurement.half_angles);
    row("by directions, everywhere alike", measurement.directions);
  }
  row("all", measurement.all);
  pairs.rows.back().strong = true;
  const bool differ = measurement.half_angles.pairs > 0 && measurement.directions.pairs > 0;
  if (differ) {
    TableCell& worst =
        pairs.rows[measurement.half_angles.mae >= measurement.directions.mae ? 0 : 1].cells[1];
    worst.mark = "worst";
    worst.mark_text = "worst";
  }
  AddTable(pairs, html);
  if (measurement.image) {
    const brdf::ImageError& image = *measurement.image;
    Table sphere;
    sphere.caption = "Errors of the lit sphere, of values clamped to [0, 1].";
    sphere.heads = {"", "mean", "root mean square"};
    sphere.rows = {
        {"linear", {{ShortText(image.mae_linear, 3)}, {ShortText(image.rmse_linear, 3)}}},
        {"sRGB", {{ShortText(image.mae_srgb, 3)}, {ShortText(image.rmse_srgb, 3)}}}};
    AddTable(sphere, html);
  }
  html->Close();
}

void AddAlbedo(const BrdfMeasurement& measurement, Html* html) {
  OpenSection("albedo", "Light that it reflects", html);
  LinePlot plot;
  plot.title = "Directional albedo";
  plot.summary =
      "Share of the light from one direction that the decoded BRDF reflects, by the angle from the "
      "normal. Above 1, it would give off more than comes in.";
  plot.x_label = "angle of the light from the normal, degrees";
  plot.y_label = "albedo";
  const std::pair<const char*, int> names[] = {{"red", 1}, {"green", 2}, {"blue", 0}};
  double highest = 0;
  Table table;
  table.caption = "Directional albedo of what is decoded.";
  table.heads = {"angle", "red", "green", "blue"};
  for (const auto& [name, color] : names) plot.lines.push_back({name, {}, false, color});
  for (size_t i = 0; i < kAlbedoDegrees.size(); ++i) {
    TableRow row{ShortText(kAlbedoDegrees[i], 3) + kDegree, {}};
    for (size_t c = 0; c < 3; ++c) {
      const double albedo = measurement.albedo[i][c];
      highest = std::max(highest, albedo);
      plot.lines[c].points.push_back({kAlbedoDegrees[i], albedo});
      TableCell cell{FixedText(albedo, 3)};
      if (albedo > 1) {
        cell.mark = "bad";
        cell.mark_text = "above 1";
      }
      row.cells.push_back(cell);
    }
    table.rows.push_back(std::move(row));
  }
  if (highest > 0.8) plot.rules.push_back({false, 1, "all light"});
  html->Open("div", {{"class", "side"}});
  html->Open("div");
  AddLinePlot(plot, html);
  html->Close().Open("div");
  AddTable(table, html);
  html->Close().Close().Close();
}

void AddModel(const PageFacts& facts, const brdf::TrainedBrdf& model, Html* html) {
  const ManifestBrdf& brdf = *facts.manifest.brdf;
  OpenSection("training", "Model and training", html);
  std::string layers;
  for (const int width : brdf.layers)
    layers += (layers.empty() ? "" : " \xE2\x86\x92 ") + std::to_string(width);
  std::string inputs = brdf.half_vector_inputs ? "angles and where the half vector lies"
                       : brdf.angle_inputs     ? "angles"
                                               : "none";
  const auto codes = model.pack.codebook.size() / static_cast<size_t>(brdf.primitive_size);
  AddTrainingFacts(
      {{"file", brdf.files[0].path},
       {"colours in the file", CountText(static_cast<double>(brdf.cells)) + ", of which " +
                                   CountText(static_cast<double>(brdf.invalid_cells)) +
                                   " are not valid"},
       {"grid", "Nside " + std::to_string(brdf.nside) + ", " + Spaced(brdf.interpolation)},
       {"codebook", std::to_string(codes) + " entries of " + std::to_string(brdf.primitive_size) +
                        " numbers; in use, by perplexity: " + CountText(model.used_codes)},
       {"network", layers + ", " + brdf.activation},
       {"further inputs", inputs},
       {"reciprocal by construction", brdf.canonical_order ? "yes" : "no"},
       {"samples", CountText(model.samples)},
       {"error of log(1 + f) before features became codes", ShortText(model.free_loss, 3)},
       {"the same at the end", ShortText(model.final_loss, 3)},
       {"steps left out because a value was not finite", std::to_string(model.rollbacks)}},
      html);
  html->Close();
}

// The file's colours as plain numbers.
std::vector<TextureBytes> PlainTables(const ManifestBrdf& brdf) {
  constexpr uint64_t kChannels = 3;
  return {{"the file's colours as half floats", 2 * kChannels * brdf.cells},
          {"the file's colours as floats", 4 * kChannels * brdf.cells}};
}

}  // namespace

std::string BrdfReportPage(const PageFacts& facts, const BrdfSource& source,
                           const BrdfMeasurement& measurement, const brdf::TrainedBrdf& model,
                           const PageTrio& sphere) {
  Html html = BeginReportPage(facts, KindLine(facts.manifest), Verdict(facts, measurement),
                              HeadFacts(facts, measurement));
  AddWarnings(facts, &html);
  AddSphere(measurement, sphere, &html);
  AddTimeSection(facts, &html);
  AddSimulation(facts, &html);
  AddErrors(measurement, source.data.table == nullptr, &html);
  AddAlbedo(measurement, &html);
  AddBytesSection(facts, PlainTables(*facts.manifest.brdf),
                  "Against the table that it was made from: three numbers for each colour in the "
                  "file, without headers.",
                  &html);
  AddEffects(facts, "part of the data", &html);
  AddModel(facts, model, &html);
  return FinishReportPage(facts, std::move(html));
}

}  // namespace patina
