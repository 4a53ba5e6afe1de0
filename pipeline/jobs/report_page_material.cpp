#include <algorithm>

#include "pipeline/jobs/package.h"
#include "formats/model_bytes.h"
#include "pipeline/jobs/page_parts.h"
#include "pipeline/jobs/page_time.h"
#include "pipeline/jobs/report_page.h"
#include "pipeline/report/page.h"
#include "pipeline/report/quantity.h"
#include "pipeline/report/table.h"

namespace patina {
namespace {

constexpr const char* kTimes = "\xC3\x97";
constexpr const char* kMiddleDot = " \xC2\xB7 ";

std::string Decibels(double db) { return db >= kCappedPsnrDb ? "exact" : FixedText(db, 1) + " dB"; }
std::string DecibelCell(double db) { return db >= kCappedPsnrDb ? "exact" : FixedText(db, 1); }

// What the numbers mean to an eye. FLIP is made to be the share of difference that a person sees
// on flipping between the two; without it, the PSNR has to do.
std::string Impression(const metrics::QualityResult& quality) {
  const char* words[] = {"Hard to tell from the source", "Close to the source",
                         "Visibly softer or noisier than the source",
                         "Visibly different from the source"};
  if (quality.flip) {
    const double limits[] = {0.05, 0.09, 0.15};
    size_t i = 0;
    while (i < 3 && !(*quality.flip <= limits[i])) ++i;
    return std::string(words[i]) + " (FLIP " + FixedText(*quality.flip, 3) + ")";
  }
  const double limits[] = {40, 33, 27};
  size_t i = 0;
  while (i < 3 && !(quality.psnr.mip0_db >= limits[i])) ++i;
  return std::string(words[i]) + " (by its PSNR)";
}

// The map whose mip 0 is worst; -1 if all are exact, or there is only one.
int WorstMap(const metrics::QualityResult& quality) {
  int worst = -1;
  for (size_t i = 0; i < quality.maps.size(); ++i) {
    const double db = quality.maps[i].psnr.mip0_db;
    if (!(db < kCappedPsnrDb)) continue;
    if (worst < 0 || db < quality.maps[static_cast<size_t>(worst)].psnr.mip0_db)
      worst = static_cast<int>(i);
  }
  return quality.maps.size() > 1 ? worst : -1;
}

// The usual choice, to be compared with: a BC4 for each channel needs no agreement on packing.
const TextureBytes* UsualChoice(const std::vector<TextureBytes>& peers) {
  return peers.size() > 1 ? &peers[1] : nullptr;
}

std::string Verdict(const PageFacts& facts, const Measurement& measurement,
                    const std::vector<TextureBytes>& peers) {
  const metrics::QualityResult& quality = measurement.quality;
  const uint64_t bytes = ModelBytes(facts.manifest.payloads);
  if (bytes == 0) {
    return "Every channel is a number in the manifest: nothing had to be learned, and there is "
           "nothing to load. Baked in " +
           SecondsText(facts.run.seconds) + ".";
  }
  std::string text = Impression(quality) + ": " + Decibels(quality.psnr.overall_db) +
                     " over all maps and mips, " + Decibels(quality.psnr.mip0_db) + " at full size";
  const int worst = WorstMap(quality);
  if (worst >= 0) {
    const metrics::MapQuality& map = quality.maps[static_cast<size_t>(worst)];
    text += "; the weakest map is " + map.name + " with " + Decibels(map.psnr.mip0_db);
  }
  text += ". " + BytesText(bytes);
  if (const TextureBytes* usual = UsualChoice(peers); usual != nullptr && bytes > 0) {
    text += ", where BC1, BC5 and BC4 would take " +
            ShortText(static_cast<double>(usual->bytes) / static_cast<double>(bytes), 2) +
            " times as much";
  }
  text += ". Baked in " + SecondsText(facts.run.seconds) + "; the training stopped because " +
          StopText(facts.stopped_by) + ".";
  if (const auto& choice = facts.manifest.training.choice) {
    text += " What was asked for was " + std::string(choice->met ? "met" : "missed") + "; " +
            choice->reason + ".";
  }
  if (facts.manifest.quality.gate_min_psnr_db) {
    text += " The quality gate of " + FixedText(*facts.manifest.quality.gate_min_psnr_db, 1) +
            " dB was " + (facts.manifest.quality.gate_met ? "met." : "missed.");
  }
  return text;
}

std::string KindLine(const Manifest& m) {
  return "Neural material" + std::string(kMiddleDot) + std::to_string(m.source.width) + " " +
         kTimes + " " + std::to_string(m.source.height) + kMiddleDot + "profile " + m.profile +
         kMiddleDot + "quality " + m.quality_setting + kMiddleDot + "recipe " + m.tool.recipe +
         " " + std::to_string(m.tool.recipe_version) + kMiddleDot + "seed " +
         std::to_string(m.seed);
}

std::vector<HeadFact> HeadFacts(const PageFacts& facts, const Measurement& measurement,
                                const std::vector<TextureBytes>& peers) {
  const metrics::QualityResult& quality = measurement.quality;
  const uint64_t bytes = ModelBytes(facts.manifest.payloads);
  std::vector<HeadFact> head = {{Decibels(quality.psnr.overall_db), "PSNR over all mips"},
                                {Decibels(quality.psnr.mip0_db), "PSNR of mip 0"}};
  if (quality.ssim) head.push_back({FixedText(*quality.ssim, 3), "SSIM (1 is perfect)"});
  if (quality.flip) head.push_back({FixedText(*quality.flip, 3), "FLIP (0 is perfect)"});
  head.push_back({BytesText(bytes), "to load"});
  if (const TextureBytes* usual = UsualChoice(peers); usual != nullptr && bytes > 0) {
    head.push_back(
        {ShortText(static_cast<double>(usual->bytes) / static_cast<double>(bytes), 3) + kTimes,
         "smaller than BC1, BC5, BC4"});
  }
  head.push_back({SecondsText(facts.run.seconds), "to bake"});
  return head;
}

std::string SizeText(int width, int height) {
  return std::to_string(width) + " " + kTimes + " " + std::to_string(height);
}

void AddPictures(const PageFacts& facts, const Measurement& measurement,
                 const std::vector<PageTrio>& pictures, Html* html) {
  if (pictures.empty()) return;
  OpenSection("pictures", "Source and decoded", html);
  html->Add("p",
            "Point at a decoded picture, or move to it with the Tab key, and the source lies in "
            "its place. Differences are those of the shown values, the largest of the channels, "
            "times " +
                ShortText(kSheetDifferenceGain, 3) + ": black is no difference.");
  const int first = facts.manifest.lod_range ? (*facts.manifest.lod_range)[0] : 0;
  const auto add = [&](const PageTrio& trio) {
    const bool smaller = trio.width < trio.mip_width || trio.height < trio.mip_height;
    std::string caption = "Mip " + std::to_string(first + trio.mip) + ", " +
                          SizeText(trio.mip_width, trio.mip_height);
    if (smaller) caption += trio.texels ? ": the middle, texel for texel" : ": all of it, reduced";
    AddTrio(trio, caption, trio.texels, html);
  };
  for (size_t begin = 0, end = 0; begin < pictures.size(); begin = end) {
    const std::string& map = pictures[begin].map;
    html->Open("div", {{"class", "map"}});
    std::string heading = map;
    for (const metrics::MapQuality& quality : measurement.quality.maps) {
      if (quality.name == map) heading += kMiddleDot + Decibels(quality.psnr.mip0_db) + " at mip 0";
    }
    html->Add("h3", heading);
    for (end = begin; end < pictures.size() && pictures[end].map == map; ++end) {
      if (pictures[end].mip == 0) add(pictures[end]);
    }
    html->Open("div", {{"class", "coarse"}});
    for (size_t i = begin; i < end; ++i) {
      if (pictures[i].mip != 0) add(pictures[i]);
    }
    html->Close().Close();
  }
  html->Close();
}

void AddMapTable(const metrics::QualityResult& quality, Html* html) {
  Table table;
  table.caption =
      "By map. PSNR in dB of coded values; SSIM, FLIP and the mean angle between normals at mip 0.";
  table.heads = {"map", "all mips", "mip 0", "mean of mips", "SSIM", "FLIP", "normals"};
  const auto row = [&](const std::string& name, const metrics::PsnrTable& psnr,
                       const std::optional<double>& ssim, const std::optional<double>& flip,
                       const std::optional<double>& angle) {
    TableRow cells{name,
                   {{DecibelCell(psnr.overall_db)},
                    {DecibelCell(psnr.mip0_db)},
                    {DecibelCell(psnr.mean_mips_db)},
                    {MeasureText(ssim, 3)},
                    {MeasureText(flip, 3)},
                    {angle ? FixedText(*angle, 2) + "\xC2\xB0" : std::string(kNoValue)}}};
    table.rows.push_back(std::move(cells));
  };
  for (const metrics::MapQuality& map : quality.maps)
    row(map.name, map.psnr, map.ssim, map.flip, map.normal_angle_deg);
  row("all", quality.psnr, quality.ssim, quality.flip, quality.normal_angle_deg);
  table.rows.back().strong = true;
  if (const int worst = WorstMap(quality); worst >= 0) {
    TableCell& cell = table.rows[static_cast<size_t>(worst)].cells[1];
    cell.mark = "worst";
    cell.mark_text = "worst";
  }
  AddTable(table, html);
}

// The mip with the lowest PSNR; -1 if all are exact, or there is only one.
int WorstMip(const metrics::PsnrTable& psnr) {
  int worst = -1;
  for (size_t i = 0; i < psnr.psnr_db.size(); ++i) {
    if (!(psnr.psnr_db[i] < kCappedPsnrDb)) continue;
    if (worst < 0 || psnr.psnr_db[i] < psnr.psnr_db[static_cast<size_t>(worst)])
      worst = static_cast<int>(i);
  }
  return psnr.psnr_db.size() > 1 ? worst : -1;
}

void AddMipTable(const Manifest& manifest, const metrics::QualityResult& quality, Html* html) {
  const int first = manifest.lod_range ? (*manifest.lod_range)[0] : 0;
  Table table;
  table.caption = "By mip, PSNR in dB; \xE2\x96\xBE marks the worst mip of each map.";
  table.heads = {"mip", "all"};
  for (const metrics::MapQuality& map : quality.maps) table.heads.push_back(map.name);
  for (size_t mip = 0; mip < quality.psnr.psnr_db.size(); ++mip) {
    const int level = first + static_cast<int>(mip);
    TableRow row;
    row.head = std::to_string(level) + kMiddleDot +
               SizeText(std::max(1, manifest.source.width >> level),
                        std::max(1, manifest.source.height >> level));
    const auto add = [&](const metrics::PsnrTable& psnr) {
      TableCell cell{DecibelCell(psnr.psnr_db[mip])};
      if (WorstMip(psnr) == static_cast<int>(mip)) {
        cell.mark = "worst";
        cell.mark_text = "\xE2\x96\xBE";
      }
      row.cells.push_back(cell);
    };
    add(quality.psnr);
    for (const metrics::MapQuality& map : quality.maps) add(map.psnr);
    table.rows.push_back(std::move(row));
  }
  AddTable(table, html);
}

void AddQuality(const PageFacts& facts, const Measurement& measurement, Html* html) {
  const metrics::QualityResult& quality = measurement.quality;
  OpenSection("quality", "Quality by map and mip", html);
  AddMapTable(quality, html);
  LinePlot plot;
  plot.title = "PSNR by mip";
  plot.summary = "PSNR of each map by mip; 0 is the finest. Mips without error are not drawn.";
  plot.x_label = "mip";
  plot.y_label = "PSNR, dB (higher is better)";
  const int first = facts.manifest.lod_range ? (*facts.manifest.lod_range)[0] : 0;
  for (const metrics::MapQuality& map : quality.maps) {
    PlotLine line{map.name, {}, false};
    for (size_t mip = 0; mip < map.psnr.psnr_db.size(); ++mip) {
      const double db = map.psnr.psnr_db[mip];
      if (db < kCappedPsnrDb)
        line.points.push_back({static_cast<double>(first) + static_cast<double>(mip), db});
    }
    if (!line.points.empty()) plot.lines.push_back(std::move(line));
  }
  // Few columns leave room for the plot beside them.
  html->Open("div", {{"class", quality.maps.size() <= 5 ? "side" : ""}});
  html->Open("div");
  AddMipTable(facts.manifest, quality, html);
  html->Close().Open("div");
  AddLinePlot(plot, html);
  html->Close().Close().Close();
}

std::string RuleText(const std::string& rule) {
  if (rule == "list") return "its entry in the list of maps";
  if (rule == "option") return "--color-space, or color_space of the job";
  if (rule == "name") return "a word of the file's name";
  if (rule == "tag") return "the file itself";
  if (rule == "file_rule") return "a file rule of the configuration";
  if (rule == "default") return "nobody: the default for its type";
  return Spaced(rule);
}

void AddInputs(const PageFacts& facts, const JobSource& source, Html* html) {
  const Manifest& m = facts.manifest;
  OpenSection("inputs", "Inputs and colour", html);
  Table files;
  files.caption = "Files of the source, and what became of each.";
  files.heads = {"file", "", "what"};
  files.numbers = false;
  for (const MapNote& note : source.reference.notes)
    files.rows.push_back({note.file, {{MapNoteKindName(note.kind)}, {note.text}}});
  if (!files.rows.empty()) AddTable(files, html);

  std::string text;
  if (m.scene) {
    text = "Material " + std::to_string(m.scene->index) + " of " + m.scene->file + ", called \"" +
           m.scene->material + "\", alpha " + m.scene->alpha_mode + ". ";
  }
  text += "Physical colours are in " + m.working_space + ".";
  if (m.color_config) {
    text += " Configuration of colours: ";
    text += m.color_config->file.empty() ? "built in" : m.color_config->file;
    if (m.color_config->source == "environment") text += " (of $OCIO)";
    text += ", SHA-256 " + m.color_config->sha256.substr(0, 12) + "\xE2\x80\xA6.";
  }
  html->Add("p", text);
  Table colors;
  colors.caption = "Colour maps, the space that their numbers are in, and who said so.";
  colors.heads = {"map", "space", "by"};
  colors.numbers = false;
  for (const ManifestMap& map : m.maps) {
    if (!map.color_space.empty())
      colors.rows.push_back({map.role, {{map.color_space}, {RuleText(map.color_rule)}}});
  }
  if (!colors.rows.empty()) AddTable(colors, html);
  html->Close();
}

// How the profile followed from what was asked for.
void AddChoice(const ManifestChoice& choice, Html* html) {
  std::string asked;
  if (choice.target_psnr_db > 0) asked = Decibels(choice.target_psnr_db) + " at full size";
  if (choice.most_bytes > 0)
    asked += (asked.empty() ? "" : ", ") + std::string("at most ") + BytesText(choice.most_bytes);
  Table table;
  table.caption = "Asked for: " + asked + ". Profiles that could have been chosen:";
  table.heads = {"profile", "size", "reached", ""};
  for (const ManifestCandidate& candidate : choice.candidates) {
    const bool chosen = candidate.profile == choice.chosen;
    std::string said = chosen ? "chosen" : "";
    if (candidate.reached_db) said = candidate.given_up ? "given up on the way" : "not enough";
    if (choice.most_bytes > 0 && candidate.bytes > choice.most_bytes)
      said += (said.empty() ? "" : ", ") + std::string("too large");
    table.rows.push_back({candidate.profile,
                          {{BytesText(candidate.bytes)},
                           {candidate.reached_db ? Decibels(*candidate.reached_db)
                                                 : std::string(kNoValue)},
                           {said}},
                          chosen});
  }
  AddTable(table, html);
}

void AddTraining(const PageFacts& facts, const TrainedMaterial* model, Html* html) {
  if (model == nullptr) return;
  OpenSection("training", "Training and export", html);
  AddTrainingFacts(
      {{"samples", CountText(model->samples)},
       {"stopped because", StopText(model->stopped_by)},
       {"steps undone because a value was not finite", std::to_string(model->rollbacks)},
       {"learned channels", std::to_string(model->outputs)}},
      html);
  if (facts.manifest.training.choice) AddChoice(*facts.manifest.training.choice, html);
  Table table;
  table.caption =
      "What the export to BC6H textures and half-precision weights costs: PSNR in dB of the "
      "learned "
      "channels, before and after.";
  table.heads = {"", "float model", "as written", "change"};
  const auto row = [&](const char* name, double before, double after) {
    const bool known = before < kCappedPsnrDb && after < kCappedPsnrDb;
    table.rows.push_back({name,
                          {{DecibelCell(before)},
                           {DecibelCell(after)},
                           {known ? SignedText(after - before, 2) : std::string(kNoValue)}}});
  };
  row("mip 0", model->float_psnr_mip0_db, model->exported_psnr_mip0_db);
  row("mean of mips", model->float_psnr_mean_mips_db, model->exported_psnr_mean_mips_db);
  row("between texels and mips", model->float_psnr_off_grid_db, model->exported_psnr_off_grid_db);
  AddTable(table, html);
  html->Close();
}

}  // namespace

std::string MaterialReportPage(const PageFacts& facts, const JobSource& source,
                               const Measurement& measurement, const TrainedMaterial* model,
                               const std::vector<PageTrio>& pictures) {
  const std::vector<TextureBytes> peers = UsualTextures(facts.manifest);
  Html html = BeginReportPage(facts, KindLine(facts.manifest), Verdict(facts, measurement, peers),
                              HeadFacts(facts, measurement, peers));
  AddWarnings(facts, &html);
  AddPictures(facts, measurement, pictures, &html);
  AddTimeSection(facts, &html);
  AddQuality(facts, measurement, &html);
  AddBytesSection(facts, peers,
                  "Against textures of the same maps, at the same size and with the same mips: "
                  "computed from 4 \xC3\x97 4 blocks of 8 bytes (BC1, BC4) or 16 (BC5, BC6H, BC7), "
                  "without headers. Maps that are constant count nowhere.",
                  &html);
  AddEffects(facts, "channel", &html);
  AddInputs(facts, source, &html);
  AddTraining(facts, model, &html);
  return FinishReportPage(facts, std::move(html));
}

}  // namespace patina
