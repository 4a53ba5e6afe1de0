#include "pipeline/jobs/page_parts.h"

#include <algorithm>

#include "formats/base/file_io.h"
#include "formats/base/zstd_frame.h"
#include "formats/model_bytes.h"
#include "pipeline/effects/effects.h"
#include "pipeline/jobs/package.h"
#include "pipeline/report/page.h"
#include "pipeline/report/quantity.h"
#include "pipeline/report/table.h"

namespace patina {
namespace {

constexpr const char* kMiddleDot = " \xC2\xB7 ";
constexpr const char* kTimes = "\xC3\x97";

// What the manifest has in place of a channel that was not learned.
std::string ConstantOf(const Manifest& manifest, const std::string& channel) {
  for (const ManifestChannel& entry : manifest.channels) {
    if (entry.output < 0 && ChannelName(entry.map, entry.component) == channel)
      return ShortText(static_cast<double>(entry.constant), 4);
  }
  return kNoValue;
}

std::string StateText(const std::string& state) {
  return state == "left_out" ? "left out" : Spaced(state);
}

}  // namespace

std::string Spaced(std::string name) {
  std::replace(name.begin(), name.end(), '_', ' ');
  return name;
}

Html BeginReportPage(const PageFacts& facts, const std::string& kind, const std::string& verdict,
                     const std::vector<HeadFact>& head) {
  Html html = BeginPage(facts.manifest.asset + " " + kNoValue + " Patina report");
  html.Open("header");
  html.Add("p", kind, {{"class", "kind"}});
  html.Add("h1", facts.manifest.asset);
  html.Add("p", verdict, {{"class", "verdict"}});
  if (!facts.manifest.quality.gate_met)
    html.Add("p", "Rejected by its quality gate: nothing was published.", {{"class", "bad"}});
  html.Open("dl", {{"class", "facts"}});
  for (const HeadFact& fact : head)
    html.Open("div").Add("dt", fact.name).Add("dd", fact.value).Close();
  html.Close().Close();
  return html;
}

void AddWarnings(const PageFacts& facts, Html* html) {
  if (facts.warnings.empty()) return;
  OpenSection("warnings", "Warnings", html);
  html->Open("ul", {{"class", "warnings"}});
  for (const std::string& warning : facts.warnings) html->Add("li", warning);
  html->Close().Close();
}

void AddTrio(const PageTrio& trio, const std::string& caption, bool texels, Html* html) {
  html->Open("figure", {{"class", texels ? "trio texels" : "trio"}});
  html->Add("figcaption", caption);
  html->Open("div", {{"class", "row"}});
  const std::string kDecoded = "decoded";
  const bool flips = !trio.source.empty();
  const auto view = [&](const std::string& kind, const std::string& name, const std::string& uri) {
    if (uri.empty()) return;
    html->Open("div", {{"class", "view " + kind}});
    const std::string alt = trio.map + ", " + caption + ": " + name;
    const std::string width = std::to_string(trio.width), height = std::to_string(trio.height);
    // The keyboard can ask for the source in a decoded picture's place, too.
    if (flips && kind == kDecoded) {
      html->AddEmpty(
          "img",
          {{"src", uri}, {"alt", alt}, {"width", width}, {"height", height}, {"tabindex", "0"}});
    } else {
      html->AddEmpty("img", {{"src", uri}, {"alt", alt}, {"width", width}, {"height", height}});
    }
    html->Add("span", name);
    html->Close();
  };
  view("source", "source", trio.source);
  view(kDecoded, kDecoded, trio.decoded);
  view("difference", "difference " + std::string(kTimes) + ShortText(kSheetDifferenceGain, 3),
       trio.difference);
  html->Close().Close();
}

Result<std::vector<uint64_t>> ZstdSizes(const std::string& directory,
                                        const std::vector<ManifestPayload>& payloads) {
  constexpr int kLevel = 3;
  std::vector<uint64_t> sizes;
  for (const ManifestPayload& payload : payloads) {
    sizes.push_back(0);
    if (ModelBytes({payload}) == 0) continue;
    PATINA_ASSIGN(const std::vector<uint8_t> bytes,
                  ReadFile(directory + "/" + payload.name, payload.bytes));
    PATINA_ASSIGN(const std::vector<uint8_t> frame, CompressZstd(bytes, kLevel));
    sizes.back() = frame.size();
  }
  return sizes;
}

std::string StopText(const std::string& stopped_by) {
  if (stopped_by == "budget") return "it had drawn the samples that this quality stands for";
  if (stopped_by == "slope") return "it had stopped getting better";
  if (stopped_by == "target") return "it had reached its target";
  if (stopped_by == "time") return "its schedule followed the time budget";
  if (stopped_by == "none") return "nothing had to be learned";
  return Spaced(stopped_by);
}

void AddBytesSection(const PageFacts& facts, const std::vector<TextureBytes>& peers,
                     const std::string& how_counted, Html* html) {
  OpenSection("bytes", "Bytes", html);
  const uint64_t total = ModelBytes(facts.manifest.payloads);
  uint64_t largest = total;
  for (const TextureBytes& peer : peers) largest = std::max(largest, peer.bytes);
  const auto share = [&](uint64_t bytes) {
    return largest > 0 ? static_cast<double>(bytes) / static_cast<double>(largest) : 0.0;
  };
  const auto ratio = [&](uint64_t bytes) {
    if (total == 0) return std::string(kNoValue);
    return ShortText(static_cast<double>(bytes) / static_cast<double>(total), 3) + kTimes;
  };
  Table against;
  against.caption = how_counted;
  against.heads = {"the same, stored as", "size", "relative", ""};
  against.rows.push_back(
      {"this container", {{BytesText(total)}, {ratio(total)}, {"", "", "", share(total)}}, true});
  for (const TextureBytes& peer : peers) {
    against.rows.push_back(
        {peer.name,
         {{BytesText(peer.bytes)}, {ratio(peer.bytes)}, {"", "", "", share(peer.bytes)}}});
  }
  AddTable(against, html);

  Table files;
  files.caption =
      "Files of the container. An engine loads features, grid, codebook, weights and sampler as "
      "they are; zstd (level 3) is what an archive of them would take.";
  files.heads = {"file", "what", "size", "as zstd"};
  uint64_t compressed = 0;
  for (size_t i = 0; i < facts.manifest.payloads.size(); ++i) {
    const ManifestPayload& payload = facts.manifest.payloads[i];
    const uint64_t zstd = i < facts.zstd_bytes.size() ? facts.zstd_bytes[i] : 0;
    compressed += zstd;
    files.rows.push_back({payload.name,
                          {{payload.role},
                           {BytesText(payload.bytes)},
                           {zstd > 0 ? BytesText(zstd) : std::string(kNoValue)}}});
  }
  files.rows.push_back(
      {"what an engine loads", {{""}, {BytesText(total)}, {BytesText(compressed)}}, true});
  AddTable(files, html);
  html->Close();
}

void AddEffects(const PageFacts& facts, const char* subject, Html* html) {
  OpenSection("effects", "What was learned, and what did not have to be", html);
  Table table;
  table.caption =
      "Values are as coded. Savings are against learning it: bytes to load, multiply-adds of one "
      "lookup, samples of the "
      "training.";
  table.heads = {subject, "state", "value", "reason", "bytes", "multiply-adds", "samples"};
  table.numbers = false;
  const auto saved = [](uint64_t value, std::string (*text)(double)) {
    return value > 0 ? text(static_cast<double>(value)) : std::string(kNoValue);
  };
  const auto bytes = [](double value) { return BytesText(static_cast<uint64_t>(value)); };
  for (const ManifestEffect& effect : facts.manifest.effects) {
    TableRow row{
        effect.what,
        {{StateText(effect.state)}, {ConstantOf(facts.manifest, effect.what)}, {effect.reason}}};
    const ManifestSavings savings = effect.saved.value_or(ManifestSavings());
    row.cells.push_back({saved(savings.bytes, bytes)});
    row.cells.push_back({saved(savings.decode_multiply_adds, CountText)});
    row.cells.push_back({saved(savings.train_samples, CountText)});
    table.rows.push_back(std::move(row));
  }
  AddTable(table, html);
  html->Close();
}

void AddSimulation(const PageFacts& facts, Html* html) {
  if (facts.run.simulation.empty()) return;
  Table table;
  table.caption = "What the accuracy of the simulation costs";
  table.heads = {"paths for a pair of directions", "standard error of log(1 + f)",
                 "microseconds of one core"};
  for (const SimulationPoint& point : facts.run.simulation) {
    table.rows.push_back(
        {std::to_string(point.paths),
         {{ShortText(point.standard_error, 3)}, {ShortText(1e6 * point.seconds, 3)}}});
  }
  AddTable(table, html);
}

void AddTrainingFacts(const std::vector<std::pair<std::string, std::string>>& facts, Html* html) {
  Table table;
  table.caption = "The training";
  table.heads = {"what", "value"};
  table.numbers = false;
  for (const auto& [name, value] : facts) table.rows.push_back({name, {{value}}});
  AddTable(table, html);
}

std::string FinishReportPage(const PageFacts& facts, Html html) {
  const RunRecord& run = facts.run;
  html.Open("footer");
  html.Add("p", "Patina " + run.version + kMiddleDot + run.cpu + kMiddleDot +
                    std::to_string(run.threads) + " of " + std::to_string(run.cpus) + " CPUs used" +
                    kMiddleDot + run.simd + kMiddleDot + SecondsText(run.seconds) + ", " +
                    SecondsText(run.cpu_seconds) + " of CPU time" + kMiddleDot +
                    BytesText(run.peak_memory_bytes) + " of memory at most" + kMiddleDot +
                    CountText(run.samples_per_s) + " samples a second");
  html.Add("p", "Fingerprint " + facts.manifest.fingerprint);
  html.Add("p",
           "Times are of the moment this page was written; run.json has them all. Measures are "
           "those of manifest.json and report.json, taken from the written files.");
  html.Close();
  return FinishPage(std::move(html));
}

}  // namespace patina
