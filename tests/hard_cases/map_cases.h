// Maps that are hard to learn, each with the reason.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipeline/material/target_pyramid.h"

namespace patina::test {

struct MapCase {
  std::string name;
  std::string why;  // it is hard
  int width = 32, height = 32, channels = 3;
  Encoding encoding = Encoding::kLinear;
  std::function<float(double u, double v, int channel)> value;  // coded, at texel centres
};

// What an ordinary map looks like: waves of several lengths with some grain.
MapCase OrdinaryMap(int width, int height, int channels);
std::vector<MapCase> MapCases();

MaterialReference ReferenceOf(const MapCase& map);

}  // namespace patina::test
