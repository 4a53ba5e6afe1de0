#include <algorithm>
#include <cstdio>

#include "pipeline/jobs/machine.h"
#include "pipeline/report/line_plot.h"
#include "pipeline/report/page.h"
#include "pipeline/report/table.h"
#include "pipeline/tradeoff/sweep_files.h"

namespace patina {
namespace {

std::string Number(double value, const char* format) {
  char text[48];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// One of the three costs.
struct Cost {
  const char* name;    // in a sentence
  const char* x_label;
  double (*of)(const SweepRow&);
  bool SweepRow::*front;
};

const Cost kCosts[] = {
    {"encode time", "Seconds to bake", [](const SweepRow& r) { return r.encode_s; },
     &SweepRow::front_encode},
    {"bytes", "Bytes for an engine to load",
     [](const SweepRow& r) { return static_cast<double>(r.bytes); }, &SweepRow::front_bytes},
    {"decode time", "Nanoseconds of one lookup on one core",
     [](const SweepRow& r) { return r.decode_ns; }, &SweepRow::front_decode},
};

std::string QualityName(JobKind kind) {
  return kind == JobKind::kMaterial ? "PSNR over all mips, dB" : "PSNR of the lit sphere, dB";
}

void AddPlot(const Cost& cost, JobKind kind, const std::vector<const SweepRow*>& rows, Html* html) {
  LinePlot plot;
  plot.title = std::string("Quality against ") + cost.name;
  plot.x_label = cost.x_label;
  plot.y_label = QualityName(kind);
  plot.log_x = true;
  plot.from_zero_x = false;
  PlotLine front{"the front", {}, false, 0}, behind{"behind it", {}, true, 5};
  behind.only_points = true;
  for (const SweepRow* row : rows) {
    (row->*cost.front ? front : behind).points.push_back({cost.of(*row), row->quality_db});
  }
  std::sort(front.points.begin(), front.points.end(),
            [](const PlotPoint& a, const PlotPoint& b) { return a.x < b.x; });
  const auto least = std::min_element(
      rows.begin(), rows.end(), [&](auto* a, auto* b) { return cost.of(*a) < cost.of(*b); });
  const auto best = std::max_element(rows.begin(), rows.end(), [](auto* a, auto* b) {
    return a->quality_db < b->quality_db;
  });
  plot.summary = std::string("The least ") + cost.name + " is that of " + (*least)->variant + " (" +
                 Number((*least)->quality_db, "%.1f") + " dB), the best quality that of " +
                 (*best)->variant + " (" + Number((*best)->quality_db, "%.1f") + " dB).";
  plot.lines.push_back(std::move(front));
  if (!behind.points.empty()) plot.lines.push_back(std::move(behind));
  AddLinePlot(plot, html);
}

Table TableOf(const std::string& caption, const char* head,
              const std::vector<const SweepRow*>& rows) {
  Table table;
  table.caption = caption;
  table.heads = {head,       "Quality, dB", "Bake, s",  "CPU, s",
                 "Bytes",    "Lookup, ns",  "On the front of"};
  for (const SweepRow* row : rows) {
    TableRow line;
    line.head = row->asset.empty() ? row->variant : row->asset + ", " + row->variant;
    if (!row->problem.empty()) {
      line.cells.push_back({"failed: " + row->problem, "bad"});
      line.cells.resize(table.heads.size() - 1);
      table.rows.push_back(std::move(line));
      continue;
    }
    std::string fronts;
    for (const Cost& cost : kCosts) {
      if (row->*cost.front) fronts += (fronts.empty() ? "" : ", ") + std::string(cost.name);
    }
    line.cells = {{Number(row->quality_db, "%.2f")},
                  {Number(row->encode_s, "%.1f")},
                  {Number(row->encode_cpu_s, "%.1f")},
                  {std::to_string(row->bytes)},
                  {Number(row->decode_ns, "%.1f")},
                  {fronts, fronts.empty() ? "" : "good"}};
    line.strong = !fronts.empty();
    table.rows.push_back(std::move(line));
  }
  return table;
}

std::vector<const SweepRow*> OfKind(const std::vector<SweepRow>& rows, JobKind kind) {
  std::vector<const SweepRow*> found;
  for (const SweepRow& row : rows) {
    if (row.kind == kind) found.push_back(&row);
  }
  return found;
}

}  // namespace

std::string SweepPage(const std::vector<SweepRow>& rows, const std::vector<SweepRow>& means) {
  Html html = BeginPage("What accuracy costs");
  html.Add("h1", "What accuracy costs");
  html.Add("p",
           "Each point is one configuration, as the mean of all inputs. On a front are those than "
           "which no other has as much quality for as little. Times are of this machine: " +
               CpuName() + ", " + std::to_string(UsableCpus()) + " CPUs.");
  for (const JobKind kind : {JobKind::kMaterial, JobKind::kBrdf}) {
    const std::vector<const SweepRow*> shown = OfKind(means, kind), all = OfKind(rows, kind);
    if (all.empty()) continue;
    const bool materials = kind == JobKind::kMaterial;
    OpenSection(materials ? "materials" : "brdfs", materials ? "Materials" : "BRDFs", &html);
    if (!shown.empty()) {
      for (const Cost& cost : kCosts) AddPlot(cost, kind, shown, &html);
      AddTable(TableOf("Means of " + std::to_string(shown[0]->inputs) + " inputs", "Configuration",
                       shown),
               &html);
    }
    if (shown.empty() || shown[0]->inputs > 1)
      AddTable(TableOf("Each input", "Input, configuration", all), &html);
    html.Close();
  }
  return FinishPage(std::move(html));
}

}  // namespace patina
