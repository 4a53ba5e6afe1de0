// Layered materials to start from.
#pragma once

#include <string>
#include <vector>

#include "formats/layered/layered_stack.h"

namespace patina::layered {

struct Preset {
  std::string name;   // of its file, without the suffix
  std::string about;  // in a few words
  Stack stack;
};

// lacquered_wood, car_paint, coated_metal, frosted_glass, fabric, brushed_coated.
const std::vector<Preset>& Presets();

}  // namespace patina::layered
