// Accuracy against time, as report pages show it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/jobs/report_page.h"
#include "pipeline/report/html.h"
#include "pipeline/report/line_plot.h"

namespace patina {

// What is known of a measure of the training.
struct CurveMeasure {
  std::string label;
  bool decibels = false;  // else an error, which falls
  bool thin = false;      // not one of the two or three that the training goes by
};

// Of its name in RunCurvePoint: "psnr_mip0_db", ... Names that came later are taken apart:
// decibels end in "_db". None for what is no quality: seconds, counts.
std::optional<CurveMeasure> MeasureOf(const std::string& name);

// How much a measure gains with every doubling of the time, over the last part of the training
// that about doubled it; none if there is no such part.
std::optional<double> GainPerDoubling(const std::vector<PlotPoint>& points);

// The section: the curve, what more time would bring, and where the time went.
void AddTimeSection(const PageFacts& facts, Html* html);

}  // namespace patina
