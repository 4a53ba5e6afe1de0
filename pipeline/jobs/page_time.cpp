#include "pipeline/jobs/page_time.h"

#include <algorithm>
#include <cmath>

#include "pipeline/jobs/page_parts.h"
#include "pipeline/report/page.h"
#include "pipeline/report/quantity.h"
#include "pipeline/report/table.h"

namespace patina {
namespace {

constexpr double kNearlyDoubled = 1.7;
constexpr size_t kMostLines = 12;  // that can be told apart

bool EndsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

// When the stage of the training began and ended, in seconds of the job.
struct TrainSpan {
  double began = 0, ended = 0;
};

TrainSpan TrainSpanOf(const RunRecord& run) {
  double seconds = 0;
  for (const StageCost& stage : run.stages) {
    if (stage.stage == "train") return {seconds, seconds + stage.seconds};
    seconds += stage.seconds;
  }
  return {};
}

struct Curve {
  std::string name;
  CurveMeasure measure;
  std::vector<PlotPoint> points;  // x: seconds of the training
};

std::vector<Curve> CurvesOf(const RunRecord& run) {
  std::vector<Curve> curves;
  for (const RunCurvePoint& point : run.curve) {
    for (const auto& [key, value] : point.measures) {
      const std::string name = key;
      const std::optional<CurveMeasure> measure = MeasureOf(name);
      if (!measure) continue;
      auto known = std::find_if(curves.begin(), curves.end(),
                                [&](const Curve& curve) { return curve.name == name; });
      if (known == curves.end()) known = curves.insert(curves.end(), {name, *measure, {}});
      // What stands for no error at all would squeeze the rest together.
      const bool exact = measure->decibels && value >= kCappedPsnrDb;
      known->points.push_back({point.seconds, exact ? std::nan("") : value});
    }
  }
  return curves;
}

// What twice the time would bring, in words.
std::string NextStepText(const std::vector<Curve>& curves) {
  for (const Curve& curve : curves) {
    if (curve.measure.thin) continue;
    const std::optional<double> gain = GainPerDoubling(curve.points);
    if (!gain) continue;
    const std::string time = SecondsText(curve.points.back().x);
    if (curve.measure.decibels) {
      return "At the end, the PSNR of " + curve.measure.label + ", changed by " +
             SignedText(*gain, 2) + " dB with every doubling of the training time: the next " +
             time + " would bring about that much.";
    }
    const double before = curve.points.back().y;
    const double change = before > 0 ? 100 * *gain / before : 0;
    return "At the end, the " + curve.measure.label + " changed by " + SignedText(change, 1) +
           " % with every doubling of the training time: the next " + time +
           " would bring about that much.";
  }
  return "";
}

void AddPlot(const PageFacts& facts, const std::vector<Curve>& curves, bool decibels, Html* html) {
  const auto [began, ended] = TrainSpanOf(facts.run);
  LinePlot plot;
  plot.title = decibels ? "PSNR against time" : "Error against time";
  plot.x_label = "seconds since the job began";
  plot.y_label = decibels ? "PSNR, dB (higher is better)" : "error (lower is better)";
  plot.log_y = !decibels;
  double last = 0;
  size_t left_out = 0;
  for (const Curve& curve : curves) {
    if (curve.measure.decibels != decibels) continue;
    if (plot.lines.size() == kMostLines) {
      ++left_out;
      continue;
    }
    PlotLine line{curve.measure.label, {}, curve.measure.thin};
    for (const PlotPoint& point : curve.points) {
      line.points.push_back({began + point.x, point.y});
      last = std::max(last, began + point.x);
    }
    plot.lines.push_back(std::move(line));
  }
  if (plot.lines.empty()) return;
  plot.rules.push_back({true, last, "stopped: " + facts.stopped_by});
  if (ended > last) plot.rules.push_back({true, ended, "exported"});
  if (facts.job.time_budget_s > 0)
    plot.rules.push_back({true, facts.job.time_budget_s, "time budget"});
  if (decibels && facts.job.target_psnr_db > 0)
    plot.rules.push_back({false, facts.job.target_psnr_db, "target for mip 0"});
  plot.summary = decibels ? "PSNR of the learned channels along the training"
                          : "Error along the training, on samples that it does not learn from";
  plot.summary += ", which began after " + SecondsText(began) + " and stopped at " +
                  SecondsText(last) + " because " + StopText(facts.stopped_by) + ".";
  if (left_out > 0)
    plot.summary += " Not drawn: " + std::to_string(left_out) + " more, which are in run.json.";
  AddLinePlot(plot, html);
}

void AddStages(const PageFacts& facts, Html* html) {
  double longest = 0;
  for (const StageCost& stage : facts.run.stages) longest = std::max(longest, stage.seconds);
  Table table;
  table.caption = "Where the time went";
  table.heads = {"stage", "time", "CPU time", ""};
  for (const StageCost& stage : facts.run.stages) {
    const double share = longest > 0 ? stage.seconds / longest : 0;
    table.rows.push_back(
        {stage.stage,
         {{SecondsText(stage.seconds)}, {SecondsText(stage.cpu_seconds)}, {"", "", "", share}}});
  }
  AddTable(table, html);
}

}  // namespace

std::optional<CurveMeasure> MeasureOf(const std::string& name) {
  if (name == "psnr_mip0_db") return CurveMeasure{"all maps, mip 0", true, false};
  if (name == "psnr_mean_mips_db") return CurveMeasure{"all maps, mean of the mips", true, false};
  if (name == "log1p_mae") return CurveMeasure{"mean error of log(1 + f)", false, false};
  if (EndsWith(name, "_db")) {
    std::string label = name.substr(0, name.size() - 3);
    if (label.rfind("psnr_", 0) == 0) label = label.substr(5);
    return CurveMeasure{Spaced(label), true, true};
  }
  for (const char* quality : {"mae", "mse", "rmse", "error", "loss", "flip"}) {
    if (EndsWith(name, quality)) return CurveMeasure{Spaced(name), false, true};
  }
  return std::nullopt;
}

std::optional<double> GainPerDoubling(const std::vector<PlotPoint>& points) {
  if (points.empty()) return std::nullopt;
  const PlotPoint& end = points.back();
  for (size_t i = points.size(); i-- > 0;) {
    const PlotPoint& begin = points[i];
    if (!(begin.x > 0) || !std::isfinite(begin.y) || !std::isfinite(end.y)) continue;
    if (end.x >= kNearlyDoubled * begin.x) return (end.y - begin.y) / std::log2(end.x / begin.x);
  }
  return std::nullopt;
}

void AddTimeSection(const PageFacts& facts, Html* html) {
  OpenSection("time", "Accuracy against time", html);
  const std::vector<Curve> curves = CurvesOf(facts.run);
  html->Open("div", {{"class", "side"}});
  html->Open("div");
  AddPlot(facts, curves, true, html);
  AddPlot(facts, curves, false, html);
  if (curves.empty())
    html->Add("p", "Nothing had to be learned, so that there is no curve.", {{"class", "quiet"}});
  html->Close();
  html->Open("div");
  const std::string next = NextStepText(curves);
  if (!next.empty()) html->Add("p", next);
  AddStages(facts, html);
  html->Close().Close().Close();
}

}  // namespace patina
