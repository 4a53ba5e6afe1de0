// The trainer of materials, its exporter and the decoder on hard maps: finite, within a bound, the
// same bytes everywhere.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/hard_cases/everywhere.h"
#include "tests/hard_cases/map_cases.h"
#include "tests/hard_cases/material_runs.h"

namespace patina {
namespace {

using test::DecodeMip0;
using test::Everywhere;
using test::MapCase;
using test::MustTrain;
using test::SameModel;

class HardMaps : public testing::TestWithParam<size_t> {
 public:
  static const std::vector<MapCase>& Cases() {
    static const std::vector<MapCase> cases = test::MapCases();
    return cases;
  }
};

// A constant of the channel's mean errs by its standard deviation: no training may end worse, give
// or take the 2 % that rates which have not quite settled leave. What is below an 8-bit code, of
// the channel's range where that is larger than 1, is as good as exact.
TEST_P(HardMaps, AreLearnedNoWorseThanByAConstant) {
  const MapCase& map = Cases()[GetParam()];
  SCOPED_TRACE(map.name + ": " + map.why);
  const MaterialReference reference = test::ReferenceOf(map);
  TrainOptions options;
  options.samples = 4e5;
  const TrainedMaterial model =
      Everywhere([&](int threads) { return MustTrain(reference, options, threads); }, SameModel);
  EXPECT_EQ(model.rollbacks, 0);
  const auto decoded = DecodeMip0(model, reference);
  const TargetLevel& base = reference.pyramid.levels[0];
  for (int c = 0; c < map.channels; ++c) {
    ASSERT_EQ(decoded[c].size(), static_cast<size_t>(base.width) * base.height);
    double sum = 0, squares = 0, errors = 0, lowest = 1e30, highest = -1e30;
    for (int y = 0; y < base.height; ++y) {
      for (int x = 0; x < base.width; ++x) {
        const double wanted = base.At(x, y, c);
        const double error =
            static_cast<double>(decoded[c][static_cast<size_t>(y) * base.width + x]) - wanted;
        sum += wanted;
        squares += wanted * wanted;
        errors += error * error;
        lowest = std::min(lowest, wanted);
        highest = std::max(highest, wanted);
      }
    }
    const double count = static_cast<double>(base.width) * base.height;
    const double deviation =
        std::sqrt(std::max(0.0, squares / count - sum / count * (sum / count)));
    const double code = std::max(1.0, highest - lowest) / 255;
    EXPECT_LE(std::sqrt(errors / count), std::max(1.02 * deviation, code)) << "channel " << c;
  }
}

INSTANTIATE_TEST_SUITE_P(All, HardMaps, testing::Range(size_t{0}, HardMaps::Cases().size()),
                         [](const auto& given) {
                           std::string name;
                           for (const char c : HardMaps::Cases()[given.param].name) {
                             if (std::isalnum(static_cast<unsigned char>(c))) name += c;
                           }
                           return name;
                         });

}  // namespace
}  // namespace patina
