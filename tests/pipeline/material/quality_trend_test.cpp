#include "pipeline/material/quality_trend.h"

#include <gtest/gtest.h>

#include <limits>

namespace patina {
namespace {

TEST(QualityTrend, FollowsTheLastSeconds) {
  QualityTrend trend;
  for (int k = 0; k < 5; ++k) trend.Add(0.2 * k, 20 + k);
  EXPECT_EQ(trend.GainWithin(10), 0);  // too few readings
  for (int k = 0; k <= 100; ++k) trend.Add(1 + 0.2 * k, 30 + 0.01 * k);
  EXPECT_NEAR(trend.GainWithin(10), 0.5, 1e-9);
  EXPECT_NEAR(trend.GainWithin(1), 0.05, 1e-9);
}

TEST(QualityTrend, NeverPromisesALoss) {
  QualityTrend trend;
  for (int k = 0; k < 20; ++k) trend.Add(k, 30 - 0.1 * k);
  EXPECT_EQ(trend.GainWithin(10), 0);
}

TEST(QualityTrend, PassesOverReadingsThatAreNone) {
  QualityTrend trend;
  for (int k = 0; k < 20; ++k) {
    trend.Add(0.2 * k, 30);
    trend.Add(0.2 * k, 0);
    trend.Add(0.2 * k, -std::numeric_limits<double>::infinity());
    trend.Add(0.2 * k, std::numeric_limits<double>::quiet_NaN());
  }
  EXPECT_EQ(trend.GainWithin(10), 0);
  QualityTrend still;
  for (int k = 0; k < 20; ++k) still.Add(3, 30 + k);  // a clock that stands
  EXPECT_EQ(still.GainWithin(10), 0);
}

}  // namespace
}  // namespace patina
