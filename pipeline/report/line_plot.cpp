#include "pipeline/report/line_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "pipeline/report/quantity.h"

namespace patina {
namespace {

constexpr double kWidth = 600, kHeight = 330;
constexpr double kLeft = 76, kRight = 18, kTop = 14, kBottom = 50;
constexpr double kLabelHeight = 17;
constexpr double kPointRadius = 4;
constexpr size_t kColors = 6;  // of the style sheet: c0 to c5
constexpr int kTicks = 6;

std::string At(double value) { return FixedText(value, 1); }

// One direction of a plot, from values to pixels.
struct Axis {
  double low = 0, high = 1;  // of values, or of their logarithms
  double from = 0, to = 1;   // pixels
  bool logarithmic = false;

  double Inner(double value) const { return logarithmic ? std::log10(value) : value; }
  bool Shows(double value) const { return std::isfinite(value) && (!logarithmic || value > 0); }
  double Pixel(double value) const {
    return from + (Inner(value) - low) / (high - low) * (to - from);
  }
  bool Inside(double value) const {
    return Shows(value) && Inner(value) >= low && Inner(value) <= high;
  }
};

void Widen(Axis* axis, double share) {
  const double span = axis->high - axis->low;
  if (span > 0) {
    axis->low -= share * span;
    axis->high += share * span;
    return;
  }
  const double around = std::max(std::fabs(axis->low) * 0.1, axis->logarithmic ? 0.2 : 0.5);
  axis->low -= around;
  axis->high += around;
}

struct Frame {
  Axis x, y;
  size_t points = 0;  // that can be drawn
};

Frame FrameOf(const LinePlot& plot) {
  Frame frame;
  frame.x.logarithmic = plot.log_x;
  frame.y.logarithmic = plot.log_y;
  constexpr double kFar = std::numeric_limits<double>::infinity();
  frame.x.low = frame.y.low = kFar;
  frame.x.high = frame.y.high = -kFar;
  const auto include = [](double value, Axis* axis) {
    if (!axis->Shows(value)) return;
    axis->low = std::min(axis->low, axis->Inner(value));
    axis->high = std::max(axis->high, axis->Inner(value));
  };
  for (const PlotLine& line : plot.lines) {
    for (const PlotPoint& point : line.points) {
      if (!frame.x.Shows(point.x) || !frame.y.Shows(point.y)) continue;
      include(point.x, &frame.x);
      include(point.y, &frame.y);
      ++frame.points;
    }
  }
  if (frame.points == 0) return frame;
  for (const PlotRule& rule : plot.rules) include(rule.at, rule.vertical ? &frame.x : &frame.y);
  const bool from_zero = plot.from_zero_x && !plot.log_x;
  if (from_zero && frame.x.low > 0) frame.x.low = 0;
  if (from_zero && frame.x.low == 0 && frame.x.high > 0) {
    frame.x.high *= 1.04;
  } else {
    Widen(&frame.x, 0.04);
  }
  Widen(&frame.y, 0.08);
  frame.x.from = kLeft;
  frame.x.to = kWidth - kRight;
  frame.y.from = kHeight - kBottom;
  frame.y.to = kTop;
  return frame;
}

// Ticks of a logarithmic axis: 1, 2 and 5 times powers of ten, powers alone where those are many,
// or what a linear axis would have where they are few.
std::vector<double> LogTicks(const Axis& axis) {
  std::vector<double> ticks;
  const bool powers = axis.high - axis.low > 3;
  for (int power = static_cast<int>(std::floor(axis.low)); power <= axis.high; ++power) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      if (powers && factor != 1.0) continue;
      const double value = factor * std::pow(10.0, power);
      if (axis.Inside(value)) ticks.push_back(value);
    }
  }
  if (ticks.size() < 2) return RoundTicks(std::pow(10, axis.low), std::pow(10, axis.high), kTicks);
  return ticks;
}

void AddText(const std::string& text, double x, double y, const char* anchor, const char* style,
             Html* html) {
  html->Add("text", text, {{"x", At(x)}, {"y", At(y)}, {"text-anchor", anchor}, {"class", style}});
}

void AddAxes(const LinePlot& plot, const Frame& frame, Html* html) {
  const auto ticks = [](const Axis& axis) {
    return axis.logarithmic ? LogTicks(axis) : RoundTicks(axis.low, axis.high, kTicks);
  };
  for (const double tick : ticks(frame.y)) {
    const std::string y = At(frame.y.Pixel(tick));
    html->AddEmpty(
        "line",
        {{"class", "grid"}, {"x1", At(kLeft)}, {"x2", At(kWidth - kRight)}, {"y1", y}, {"y2", y}});
    AddText(ShortText(tick, 6), kLeft - 7, frame.y.Pixel(tick) + 4.5, "end", "tick", html);
  }
  for (const double tick : ticks(frame.x)) {
    const std::string x = At(frame.x.Pixel(tick));
    html->AddEmpty("line", {{"class", "axis"},
                            {"x1", x},
                            {"x2", x},
                            {"y1", At(kHeight - kBottom)},
                            {"y2", At(kHeight - kBottom + 5)}});
    AddText(ShortText(tick, 6), frame.x.Pixel(tick), kHeight - kBottom + 20, "middle", "tick",
            html);
  }
  html->AddEmpty("path", {{"class", "axis"},
                          {"d", "M" + At(kLeft) + " " + At(kTop) + "V" + At(kHeight - kBottom) +
                                    "H" + At(kWidth - kRight)}});
  AddText(plot.x_label, (kLeft + kWidth - kRight) / 2, kHeight - 8, "middle", "label", html);
  html->Add(
      "text", plot.y_label,
      {{"class", "label"},
       {"text-anchor", "middle"},
       {"transform", "translate(14 " + At((kTop + kHeight - kBottom) / 2) + ") rotate(-90)"}});
}

void AddRules(const LinePlot& plot, const Frame& frame, Html* html) {
  int row = 0;
  for (const PlotRule& rule : plot.rules) {
    const Axis& axis = rule.vertical ? frame.x : frame.y;
    if (!axis.Inside(rule.at)) continue;
    const double at = axis.Pixel(rule.at);
    if (rule.vertical) {
      html->AddEmpty("line", {{"class", "rule"},
                              {"x1", At(at)},
                              {"x2", At(at)},
                              {"y1", At(kTop)},
                              {"y2", At(kHeight - kBottom)}});
      // Below the lines, which rise to the upper right; each label in a row of its own.
      const bool left = at > (kLeft + kWidth) / 2;
      AddText(rule.label, at + (left ? -6 : 6), kHeight - kBottom - 9 - kLabelHeight * row++,
              left ? "end" : "start", "note", html);
    } else {
      html->AddEmpty("line", {{"class", "rule"},
                              {"x1", At(kLeft)},
                              {"x2", At(kWidth - kRight)},
                              {"y1", At(at)},
                              {"y2", At(at)}});
      AddText(rule.label, kLeft + 8, at - 6, "start", "note", html);
    }
  }
}

// The shape of a line's points, by its number.
std::string ShapePath(size_t line, double x, double y, double r) {
  const std::string left = At(x - r), right = At(x + r), top = At(y - r), bottom = At(y + r);
  switch (line / kColors % 2 * 4 + line % 4) {
    case 1:
    case 6:
      return "M" + left + " " + top + "H" + right + "V" + bottom + "H" + left + "Z";
    case 2:
    case 7:
      return "M" + At(x) + " " + At(y - 1.3 * r) + "L" + At(x + 1.3 * r) + " " + At(y) + "L" +
             At(x) + " " + At(y + 1.3 * r) + "L" + At(x - 1.3 * r) + " " + At(y) + "Z";
    case 3:
    case 4:
      return "M" + At(x) + " " + At(y - 1.2 * r) + "L" + At(x + 1.2 * r) + " " + bottom + "L" +
             At(x - 1.2 * r) + " " + bottom + "Z";
    default:
      return "M" + left + " " + At(y) + "a" + At(r) + " " + At(r) + " 0 1 0 " + At(2 * r) + " 0a" +
             At(r) + " " + At(r) + " 0 1 0 " + At(-2 * r) + " 0Z";
  }
}

std::string ColorClass(const PlotLine& line, size_t number) {
  return "c" + std::to_string(line.color >= 0 ? static_cast<size_t>(line.color) % kColors
                                              : number % kColors);
}

std::string LineClass(const PlotLine& line, size_t number) {
  return "line " + ColorClass(line, number) + " d" + std::to_string(number % 4) +
         (line.thin ? " thin" : "");
}

std::string PointClass(const PlotLine& line, size_t number) {
  return "point " + ColorClass(line, number);
}

void AddLine(const PlotLine& line, size_t number, const Frame& frame, Html* html) {
  std::string path;
  std::string shapes;
  // A step over points that cannot be drawn is drawn straight: they are said to be left out.
  for (const PlotPoint& point : line.points) {
    if (!frame.x.Shows(point.x) || !frame.y.Shows(point.y)) continue;
    const double x = frame.x.Pixel(point.x), y = frame.y.Pixel(point.y);
    path += (path.empty() ? "M" : "L") + At(x) + " " + At(y);
    shapes += ShapePath(number, x, y, line.thin ? kPointRadius * 0.7 : kPointRadius);
  }
  if (path.empty()) return;
  if (!line.only_points)
    html->AddEmpty("path", {{"class", LineClass(line, number)}, {"d", path}});
  html->AddEmpty("path", {{"class", PointClass(line, number)}, {"d", shapes}});
}

void AddLegend(const LinePlot& plot, Html* html) {
  html->Open("ul", {{"class", "legend"}});
  for (size_t i = 0; i < plot.lines.size(); ++i) {
    html->Open("li");
    html->Open("svg", {{"viewBox", "0 0 36 14"},
                       {"width", "36"},
                       {"height", "14"},
                       {"aria-hidden", "true"},
                       {"focusable", "false"}});
    if (!plot.lines[i].only_points)
      html->AddEmpty("path", {{"class", LineClass(plot.lines[i], i)}, {"d", "M1.0 7.0H35.0"}});
    html->AddEmpty("path", {{"class", PointClass(plot.lines[i], i)},
                            {"d", ShapePath(i, 18, 7, kPointRadius)}});
    html->Close();
    html->Text(plot.lines[i].label);
    html->Close();
  }
  html->Close();
}

}  // namespace

std::vector<double> RoundTicks(double low, double high, int wanted) {
  if (!(high > low)) return {low};
  const double rough = (high - low) / std::max(1, wanted);
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (const double factor : {5.0, 2.0, 1.0}) {
    if (factor * power >= rough) step = factor * power;
  }
  std::vector<double> ticks;
  const double first = std::ceil(low / step);
  // Counted, not summed up: far from zero a sum might not move at all.
  for (int i = 0; i <= 2 * wanted + 2; ++i) {
    const double tick = (first + i) * step;
    if (!(tick <= high + 1e-9 * step)) break;
    ticks.push_back(tick);
  }
  return ticks;
}

void AddLinePlot(const LinePlot& plot, Html* html) {
  const Frame frame = FrameOf(plot);
  if (frame.points == 0) {
    html->Add("p", plot.title + ": there is nothing to plot.", {{"class", "quiet"}});
    return;
  }
  html->Open("figure", {{"class", "plot"}});
  html->Open("svg", {{"viewBox", "0 0 " + FixedText(kWidth, 0) + " " + FixedText(kHeight, 0)},
                     {"role", "img"},
                     {"aria-label", plot.title + ". " + plot.summary}});
  AddAxes(plot, frame, html);
  AddRules(plot, frame, html);
  for (size_t i = 0; i < plot.lines.size(); ++i) AddLine(plot.lines[i], i, frame, html);
  html->Close();
  html->Open("figcaption");
  AddLegend(plot, html);
  html->Text(plot.summary);
  html->Close().Close();
}

}  // namespace patina
