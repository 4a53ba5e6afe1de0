// A plot of lines as SVG that can be read on paper, in the dark and without colours: lines differ
// in dashes and in the shape of their points, too.
#pragma once

#include <string>
#include <vector>

#include "pipeline/report/html.h"

namespace patina {

struct PlotPoint {
  double x = 0;
  double y = 0;
};

struct PlotLine {
  std::string label;
  std::vector<PlotPoint> points;  // those that are not finite are left out
  bool thin = false;              // of less interest
  int color = -1;                 // 0 to 5 of the style sheet; negative: by its place
  bool only_points = false;       // nothing is drawn between them
};

// A straight line across the plot: a budget, a target, an end.
struct PlotRule {
  bool vertical = true;
  double at = 0;  // not drawn if not finite
  std::string label;
};

struct LinePlot {
  std::string title;    // for who cannot see it
  std::string summary;  // what it shows, in a sentence
  std::string x_label, y_label;
  std::vector<PlotLine> lines;
  std::vector<PlotRule> rules;
  bool log_x = false;  // values that are not above 0 are then left out
  bool log_y = false;  // likewise
  bool from_zero_x = true;
};

// Positions of about `wanted` round numbers in [low, high]: multiples of 1, 2 or 5 times a power of
// ten. low == high gives that one. Both finite, low <= high.
std::vector<double> RoundTicks(double low, double high, int wanted);

// The figure with its legend; a sentence in place of it if no point can be drawn.
void AddLinePlot(const LinePlot& plot, Html* html);

}  // namespace patina
