#include "pipeline/brdf/sample_pool.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>

#include "pipeline/brdf/angle_inputs.h"
#include "tests/pipeline/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

Direction At(double theta, double phi) {
  return {static_cast<float>(std::sin(theta) * std::cos(phi)),
          static_cast<float>(std::sin(theta) * std::sin(phi)), static_cast<float>(std::cos(theta))};
}

TEST(AngleInputs, AreTheSameForExchangedDirections) {
  Rng rng(1);
  for (int n = 0; n < 2000; ++n) {
    Direction wi, wo;
    DrawPair(n % 2 ? Draw::kHalfAngles : Draw::kDirections, &rng, &wi, &wo);
    float a[3], b[3];
    AngleInputs(wi, wo, a);
    AngleInputs(wo, wi, b);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], 1e-5f);
  }
}

TEST(AngleInputs, StayFiniteAndInRangeAtThePolesAndAtTheHorizon) {
  const double angles[] = {0, 1e-8, 1e-4, 0.7, 1.5707, 1.57079632};
  for (const double a : angles) {
    for (const double b : angles) {
      for (const double phi : {0.0, 1e-7, 1.0, 3.14159265}) {
        float out[3];
        AngleInputs(At(a, 0.3), At(b, 0.3 + phi), out);
        for (const float v : out)
          EXPECT_TRUE(v >= -1.01f && v <= 1.01f) << a << " " << b << " " << phi << " " << v;
      }
    }
  }
}

TEST(AngleInputs, KnowAnglesByTheirDefinition) {
  // Half vector at 30 degrees in the plane y = 0, difference angle 20 degrees, azimuth of the
  // difference 45 degrees.
  const double th = 0.5235987756, td = 0.3490658504, pd = 0.7853981634;
  const Direction d = At(td, pd);
  const auto turned = [&](float x, float y, float z) {
    return Direction{static_cast<float>(std::cos(th)) * x + static_cast<float>(std::sin(th)) * z, y,
                     -static_cast<float>(std::sin(th)) * x + static_cast<float>(std::cos(th)) * z};
  };
  float out[3];
  AngleInputs(turned(d.x, d.y, d.z), turned(-d.x, -d.y, d.z), out);
  EXPECT_NEAR(out[0], 2 * std::log(1 + 200 * th) / 5.75 - 1, 1e-5);
  EXPECT_NEAR(out[1], 4 * td / 3.14159265 - 1, 1e-5);
  EXPECT_NEAR(out[2], 1.0, 1e-5);
}

TEST(HalfVectorInputs, FollowTheHalfVector) {
  const double tilt = 0.3, turn = 2;
  const double x = std::sin(tilt) * std::cos(turn), y = std::sin(tilt) * std::sin(turn);
  // Both directions along h, then on either side of it.
  const Direction h = At(tilt, turn);
  float out[2], other[2];
  HalfVectorInputs(h, h, out);
  EXPECT_NEAR(out[0], -std::log(1 - 200 * x) / std::log(201.0), 1e-5);
  EXPECT_NEAR(out[1], std::log(1 + 200 * y) / std::log(201.0), 1e-5);
  HalfVectorInputs(At(tilt - 0.2, turn), At(tilt + 0.2, turn), other);
  for (int d = 0; d < 2; ++d) EXPECT_NEAR(other[d], out[d], 1e-5);
  HalfVectorInputs({0, 0, 1}, {0, 0, 1}, out);
  for (const float v : out) EXPECT_EQ(v, 0.0f);
  HalfVectorInputs({1, 0, 0}, {-1, 0, 0}, out);  // no half vector
  for (const float v : out) EXPECT_TRUE(std::isfinite(v));
}

TEST(SamplePool, IsotropicLookupsDoNotChangeWhenThePairTurns) {
  GridShape shape;
  Rng rng(3);
  for (int n = 0; n < 500; ++n) {
    Direction wi, wo;
    DrawPair(Draw::kDirections, &rng, &wi, &wo);
    const float turn = 6.2831853f * rng.Uniform(), c = std::cos(turn), s = std::sin(turn);
    const auto turned = [&](const Direction& w) {
      return Direction{c * w.x - s * w.y, s * w.x + c * w.y, w.z};
    };
    PoolSample a = {}, b = {};
    LookUpPair(shape, wi, wo, &a);
    LookUpPair(shape, turned(wi), turned(wo), &b);
    // Corners may differ on an edge of a pixel, where the weights of those that differ vanish.
    double sum[2] = {0, 0};
    for (int k = 0; k < 8; ++k) {
      sum[0] += static_cast<double>(a.weight[k]) * std::sin(static_cast<double>(a.corner[k]));
      sum[1] += static_cast<double>(b.weight[k]) * std::sin(static_cast<double>(b.corner[k]));
    }
    EXPECT_NEAR(sum[0], sum[1], 2e-3);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(a.extra[k], b.extra[k], 2e-4f);
  }
}

// Corners that differ on the edge of a pixel have weights that vanish: so compare smooth functions
// of the corners.
TEST(SamplePool, TheKernelsLookUpPairsAsTheScalarCodeDoes) {
  for (const SimdTarget target : {SimdTarget::kAvx2, SimdTarget::kAvx512}) {
    if (!SimdTargetSupported(target)) continue;
    for (const int nside : {1, 2, 3, 8, 32, 64}) {
      for (const int flags : {0, 1, 2, 4, 7, 12, 14}) {
        GridShape shape;
        shape.nside = nside;
        shape.isotropic = (flags & 1) != 0;
        shape.canonical_order = (flags & 2) != 0;
        shape.angle_inputs = (flags & 4) != 0;
        shape.half_vector_inputs = (flags & 8) != 0;
        const LookUpGrid grid = {nside,
                                 shape.corners(),
                                 shape.isotropic,
                                 shape.canonical_order,
                                 shape.angle_inputs,
                                 shape.half_vector_inputs};
        std::vector<Direction> wi, wo;
        Rng rng(static_cast<uint64_t>(nside));
        for (int n = 0; n < 1000; ++n) {
          Direction a, b;
          DrawPair(n % 2 ? Draw::kHalfAngles : Draw::kDirections, &rng, &a, &b);
          wi.push_back(a);
          wo.push_back(b);
        }
        for (const double theta : {0.0, 1e-6, 0.8410687, 1.5707963}) {
          for (int k = 0; k < 8; ++k) {
            wi.push_back(At(theta, k * 0.7853981634));
            wo.push_back(At(0.5, 1.0));
            wi.push_back(At(0.5, 1.0));
            wo.push_back(At(theta, k * 0.7853981634));
          }
        }
        std::vector<PoolSample> samples(wi.size());
        PairLookups pairs;
        for (size_t first = 0; first < wi.size(); first += kChunkRows) {
          const size_t used = std::min<size_t>(kChunkRows, wi.size() - first);
          KernelsFor(target).look_up_pairs(grid, &wi[first], &wo[first], static_cast<int>(used),
                                           &pairs);
          for (size_t s = 0; s < used; ++s) {
            PoolSample& sample = samples[first + s];
            for (int c = 0; c < 8; ++c) sample.corner[c] = pairs.corner[c][s];
            for (int c = 0; c < 8; ++c) sample.weight[c] = pairs.weight[c][s];
            for (int e = 0; e < shape.extra_inputs(); ++e) sample.extra[e] = pairs.extra[e][s];
          }
        }
        for (size_t s = 0; s < wi.size(); ++s) {
          PoolSample wanted = {};
          LookUpPair(shape, wi[s], wo[s], &wanted);
          for (int side = 0; side < 2; ++side) {
            double sum[2][4] = {};
            for (int c = 4 * side; c < 4 * side + 4; ++c) {
              const PoolSample* both[2] = {&samples[s], &wanted};
              for (int k = 0; k < 2; ++k) {
                const int corner = both[k]->corner[c] - side * shape.corners();
                ASSERT_TRUE(corner >= 0 && corner < shape.corners()) << nside << " " << s;
                double xyz[3];
                healpix::CornerDirection(nside, healpix::CornerOf(nside, corner), xyz);
                for (int d = 0; d < 3; ++d)
                  sum[k][d] += static_cast<double>(both[k]->weight[c]) * xyz[d];
                sum[k][3] += static_cast<double>(both[k]->weight[c]);
              }
            }
            for (int d = 0; d < 4; ++d)
              EXPECT_NEAR(sum[0][d], sum[1][d], 5e-6)
                  << nside << " " << flags << " " << s << " " << side;
          }
          for (int e = 0; e < shape.extra_inputs(); ++e)
            EXPECT_NEAR(samples[s].extra[e], wanted.extra[e], 2e-5f) << e;
        }
      }
    }
  }
}

TEST(SamplePool, CanonicalOrderMakesExchangedPairsEqual) {
  GridShape shape;
  Rng rng(4);
  for (int n = 0; n < 500; ++n) {
    Direction wi, wo;
    DrawPair(Draw::kHalfAngles, &rng, &wi, &wo);
    PoolSample a = {}, b = {};
    LookUpPair(shape, wi, wo, &a);
    LookUpPair(shape, wo, wi, &b);
    EXPECT_EQ(0, std::memcmp(&a, &b, sizeof a));
  }
}

TEST(SamplePool, IsTheSameForAnyNumberOfThreadsAndLeavesOutWhatIsInvalid) {
  const Source source = SourceOf([](const Direction& wi, const Direction& wo, float* rgb) {
    return wi.z + wo.z > 1 && Plastic(0.3f, wi, wo, rgb);
  });
  PoolOptions options;
  options.count = 20000;
  GridShape shape;
  ThreadPool one(1), three(3);
  const auto a = DrawPool(source, shape, options, one), b = DrawPool(source, shape, options, three);
  ASSERT_EQ(a.size(), b.size());
  EXPECT_GT(a.size(), 19000u);
  EXPECT_EQ(0, std::memcmp(a.data(), b.data(), a.size() * sizeof(PoolSample)));
  for (size_t s = 0; s < a.size(); ++s) {
    for (const float v : a[s].value) EXPECT_GT(v, 0.0f);
    for (int c = 0; c < 8; ++c) {
      EXPECT_GE(a[s].corner[c], c < 4 ? 0 : shape.corners());
      EXPECT_LT(a[s].corner[c], c < 4 ? shape.corners() : 2 * shape.corners());
    }
  }
}

// Beyond the cap of the outputs a wish can't be met, and outputs would grow for ever.
TEST(SamplePool, AsksForNothingThatNoOutputReaches) {
  const Source source = SourceOf([](const Direction&, const Direction&, float* rgb) {
    rgb[0] = 1e9f, rgb[1] = kMaxValue, rgb[2] = 1;
    return true;
  });
  PoolOptions options;
  options.count = 100;
  ThreadPool pool(1);
  const auto samples = DrawPool(source, {}, options, pool);
  ASSERT_EQ(samples.size(), 100u);
  for (size_t s = 0; s < samples.size(); ++s) {
    EXPECT_EQ(samples[s].value[0], kMaxValue);
    EXPECT_EQ(samples[s].value[1], kMaxValue);
    EXPECT_EQ(samples[s].value[2], 1);
  }
  EXPECT_NEAR(std::log1p(kMaxValue), kMaxLogValue, 1e-6f);
}

TEST(SamplePool, OfATableWithoutDataIsEmpty) {
  const Source source = SourceOf([](const Direction&, const Direction&, float*) { return false; });
  ThreadPool pool(1);
  PoolOptions options;
  options.count = 100;
  EXPECT_EQ(DrawPool(source, GridShape{}, options, pool).size(), 0u);
}

// Values of the left half are noisy.
class NoisyTable : public Table {
 public:
  bool Evaluate(const Direction&, const Direction&, float rgb[3]) const override {
    rgb[0] = rgb[1] = rgb[2] = 1;
    return true;
  }
  bool EvaluateToLearn(const Direction& wi, const Direction& wo, float rgb[3],
                       float* weight) const override {
    *weight = wi.x + wo.x < 0 ? 0.25f : 1;
    return Evaluate(wi, wo, rgb);
  }
};

TEST(SamplePool, TakesTheWeightOfEachValueAndTellsHowFarItIs) {
  Source source;
  source.table = std::make_shared<NoisyTable>();
  ThreadPool pool(1);
  PoolOptions options;
  options.count = 4096;
  double last = 0;
  options.on_progress = [&](double fraction) {
    EXPECT_GT(fraction, last);
    last = fraction;
  };
  const auto samples = DrawPool(source, {}, options, pool);
  EXPECT_EQ(last, 1);
  int noisy = 0;
  for (size_t s = 0; s < samples.size(); ++s) {
    EXPECT_TRUE(samples[s].importance == 1 || samples[s].importance == 0.25f);
    noisy += samples[s].importance < 1 ? 1 : 0;
  }
  EXPECT_NEAR(noisy, 2048, 6 * 32);  // six standard deviations
  CancelToken cancel;
  cancel.Cancel();
  options.cancel = &cancel;
  EXPECT_EQ(DrawPool(source, {}, options, pool).size(), 0u);
}

}  // namespace
}  // namespace patina::brdf
