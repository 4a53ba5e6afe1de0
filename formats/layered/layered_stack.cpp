#include "formats/layered/layered_stack.h"

namespace patina::layered {

const std::vector<Metal>& Metals() {
  static const std::vector<Metal> metals = {
      {"aluminium", {1.45, 0.94, 0.62}, {7.54, 6.41, 5.50}},
      {"copper", {0.21, 1.04, 1.17}, {3.59, 2.59, 2.42}},
      {"chromium", {3.12, 3.18, 2.17}, {3.31, 3.33, 3.25}},
      {"gold", {0.18, 0.54, 1.33}, {3.43, 2.25, 1.88}},
      {"iron", {2.89, 2.90, 2.65}, {3.07, 2.93, 2.81}},
      {"silver", {0.14, 0.14, 0.14}, {4.02, 3.13, 2.58}},
      {"titanium", {2.70, 2.44, 2.10}, {3.75, 3.36, 2.92}},
  };
  return metals;
}

}  // namespace patina::layered
