// What an image file says of itself about its colours.
#pragma once

#include <string>
#include <vector>

#include "pipeline/color/primaries.h"

namespace patina {

// A transfer curve from coded to linear: y = (a x + b)^gamma + e for x >= d, else c x + f, which is
// the parametric curve of ICC with all its members; or, if not empty, a table over 0..1, linear
// between. Odd for negative x; the parametric part also beyond 1, the table with its last slope.
struct TransferCurve {
  double gamma = 1, a = 1, b = 0, c = 1, d = 0, e = 0, f = 0;
  std::vector<float> table;

  double Decode(double coded) const;
  bool operator==(const TransferCurve&) const = default;
};

TransferCurve SrgbCurve();
TransferCurve PowerCurve(double gamma);
// Whether they differ by at most `tolerance` everywhere in 0..1.
bool AreClose(const TransferCurve& a, const TransferCurve& b, double tolerance);

// Empty (`origin` empty): the file says nothing that can be followed.
struct ColorTag {
  std::string origin;  // for messages: "gAMA and cHRM", "ICC profile \"Display P3\""
  Primaries primaries = kRec709Primaries;
  TransferCurve curve;
  std::string problem;  // why something that is there is not followed; a sentence's end

  bool empty() const { return origin.empty(); }
};

}  // namespace patina
