// The whole trainer on analytic materials: it learns, the codebook costs little, what is written
// evaluates alike.
#include "pipeline/brdf/train_brdf.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/half.h"
#include "pipeline/brdf/batch_evaluator.h"
#include "pipeline/brdf/sphere_render.h"
#include "tests/pipeline/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

TrainOptions Quick() {
  TrainOptions options;
  options.pool = 100000;
  options.free_steps = 1500;
  options.codebook_steps = 800;
  return options;
}

ModelShape Small() {
  ModelShape shape;
  shape.grid.nside = 16;
  shape.index_bits = 8;
  return shape;
}

Source PlasticSource(float alpha) {
  return SourceOf([alpha](const Direction& wi, const Direction& wo, float* rgb) {
    return Plastic(alpha, wi, wo, rgb);
  });
}

TrainedBrdf MustTrain(const Source& source, const ModelShape& shape, const TrainOptions& options,
                      int threads) {
  ThreadPool pool(threads);
  auto trained = TrainBrdf(source, shape, options, pool, NoProgress());
  EXPECT_TRUE(trained) << (trained ? "" : trained.error().message);
  return trained ? std::move(*trained) : TrainedBrdf{};
}

BatchEvaluator Evaluator(const TrainedBrdf& trained) {
  auto features = ExpandCorners(trained.pack, {trained.pack.primitive_size, trained.pack.codebook});
  EXPECT_TRUE(features);
  auto evaluator = BatchEvaluator::Create(trained.pack, *features, trained.network);
  EXPECT_TRUE(evaluator) << (evaluator ? "" : evaluator.error().message);
  return std::move(*evaluator);
}

ImageError SphereError(const Source& source, const TrainedBrdf& trained) {
  ThreadPool pool(2);
  const Environment environment = StudioEnvironment(24, 12);
  const BatchEvaluator evaluator = Evaluator(trained);
  std::vector<BatchEvaluator::Scratch> scratch;
  for (int t = 0; t < pool.threads(); ++t) scratch.emplace_back(evaluator);
  const SphereImage truth = RenderSphere(
      [&](int, size_t count, const Direction* wi, const Direction* wo, float* rgb) {
        for (size_t k = 0; k < count; ++k) source.table->Evaluate(wi[k], wo[k], rgb + 3 * k);
      },
      environment, 48, 2, pool);
  const SphereImage image =
      RenderSphere([&](int worker, size_t count, const Direction* wi, const Direction* wo,
                       float* rgb) { evaluator.Evaluate(&scratch[worker], count, wi, wo, rgb); },
                   environment, 48, 2, pool);
  return CompareSpheres(truth, image, pool);
}

TEST(TrainBrdf, LearnsAGlossyMaterial) {
  const Source source = PlasticSource(0.15f);
  const TrainedBrdf trained = MustTrain(source, Small(), Quick(), 2);
  const ImageError error = SphereError(source, trained);
  EXPECT_LT(error.mae_srgb, 0.01);
  EXPECT_GT(error.ssim, 0.99);
  EXPECT_GT(trained.used_codes, 20) << "most codes must be in use";
  EXPECT_LT(trained.final_loss, 1.5 * trained.free_loss) << "the codebook must cost little";
}

// Features and hidden units are padded to whole vectors in training and not in the container.
TEST(TrainBrdf, SizesThatFillNoVectorAreWrittenAsTheyWereTrained) {
  const Source source = PlasticSource(0.2f);
  ModelShape shape = Small();
  shape.primitive_size = 5;
  shape.hidden = 20;
  const ImageError error = SphereError(source, MustTrain(source, shape, Quick(), 2));
  EXPECT_LT(error.mae_srgb, 0.012);
  EXPECT_GT(error.ssim, 0.99);
}

TEST(TrainBrdf, IsTheSameForAnyNumberOfThreads) {
  const Source source = PlasticSource(0.3f);
  TrainOptions options = Quick();
  options.free_steps = 150;
  options.codebook_steps = 120;
  const TrainedBrdf one = MustTrain(source, Small(), options, 1),
                    three = MustTrain(source, Small(), options, 3);
  EXPECT_EQ(one.pack.indices, three.pack.indices);
  EXPECT_EQ(one.pack.codebook, three.pack.codebook);
  ASSERT_EQ(one.network.tensors.size(), three.network.tensors.size());
  for (size_t t = 0; t < one.network.tensors.size(); ++t)
    EXPECT_EQ(one.network.tensors[t].elements, three.network.tensors[t].elements);
}

TEST(TrainBrdf, LearnsABrushedMaterialByItsAzimuth) {
  // Bright where the half vector tilts along x, dark along y.
  const Source source = SourceOf(
      [](const Direction& wi, const Direction& wo, float* rgb) {
        const float hx = wi.x + wo.x, hy = wi.y + wo.y, hz = wi.z + wo.z;
        const float e = (hx * hx / 0.16f + hy * hy / 0.01f) / (hz * hz);
        rgb[0] = rgb[1] = rgb[2] = 0.05f + std::exp(-e);
        return true;
      },
      false);
  const ModelShape shape = DefaultShape(KindOf(source));
  EXPECT_TRUE(shape.grid.half_vector_inputs);
  TrainOptions options = Quick();
  options.free_steps = 3000;
  const ImageError error = SphereError(source, MustTrain(source, shape, options, 2));
  EXPECT_GT(error.ssim, 0.97);
}

// Lobes ten times as wide along x as along y, and narrow: only the half vector's place tells where.
TEST(TrainBrdf, LearnsALobeThatIsNarrowInOneDirection) {
  const Source source = SourceOf(
      [](const Direction& wi, const Direction& wo, float* rgb) {
        const float hx = wi.x + wo.x, hy = wi.y + wo.y, hz = wi.z + wo.z;
        const float e = (hx * hx / 0.04f + hy * hy / 0.0004f) / (hz * hz);
        rgb[0] = rgb[1] = rgb[2] = 0.05f + 20 * std::exp(-e);
        return true;
      },
      false);
  TrainOptions options = DefaultTraining(KindOf(source));
  options.pool = 200000;
  options.free_steps = 2000;
  options.codebook_steps = 1000;
  ModelShape shape = DefaultShape(KindOf(source));
  const ImageError with = SphereError(source, MustTrain(source, shape, options, 2));
  EXPECT_GT(with.ssim, 0.95);
  shape.grid.half_vector_inputs = false;
  const ImageError without = SphereError(source, MustTrain(source, shape, options, 2));
  EXPECT_LT(with.mae_srgb, 0.5 * without.mae_srgb);
}

// 448 measurements: more would fit the corners of a fine grid one by one, and show them.
// A mirror of 0.1 degrees passes the cap of the outputs at grazing angles; away from its lobe it is
// black, and has to stay that.
TEST(TrainBrdf, AMirrorGrowsNoGhosts) {
  const Source source = PlasticSource(0.00175f);
  const TrainedBrdf trained = MustTrain(source, Small(), Quick(), 2);
  const BatchEvaluator evaluator = Evaluator(trained);
  BatchEvaluator::Scratch scratch(evaluator);
  Rng rng(9);
  double ghosts = 0;
  constexpr int kPairs = 20000;
  for (int n = 0; n < kPairs; ++n) {
    Direction wi, wo;
    DrawPair(Draw::kDirections, &rng, &wi, &wo);
    float rgb[3], truth[3];
    source.table->Evaluate(wi, wo, truth);
    evaluator.Evaluate(&scratch, 1, &wi, &wo, rgb);
    if (truth[0] < 1) ghosts += static_cast<double>(std::max(0.0f, rgb[0] - truth[0]));
  }
  EXPECT_LT(ghosts / kPairs, 0.01);
}

TEST(TrainBrdf, AListOfSomeHundredMeasurementsBecomesSmooth) {
  const Source table = PlasticSource(0.15f);
  Source list;
  Rng rng(7);
  while (list.samples.size() < 448) {
    Sample sample;
    DrawPair(list.samples.size() % 2 ? Draw::kHalfAngles : Draw::kDirections, &rng, &sample.wi,
             &sample.wo);
    if (!table.table->Evaluate(sample.wi, sample.wo, sample.rgb)) continue;
    list.samples.push_back(sample);
  }
  const SourceKind kind = KindOf(list);
  EXPECT_TRUE(kind.list);
  const TrainedBrdf trained = MustTrain(list, DefaultShape(kind), DefaultTraining(kind), 2);
  EXPECT_GT(SphereError(table, trained).ssim, 0.98);
  EXPECT_LT(trained.pack.codebook.size(), 242u * 16) << "codes that no corner uses are left out";
}

TEST(TrainBrdf, CodesCostLittleWhereFeaturesAreDrawnToThem) {
  // The plain model: far fewer codes than corners, and nothing but the corners tells directions.
  const Source source = PlasticSource(0.15f);
  ModelShape shape = Small();
  shape.grid.nside = 32;
  shape.grid.angle_inputs = false;
  TrainOptions options = Quick();
  options.decay = 0;
  const double with = MustTrain(source, shape, options, 2).final_loss;
  options.pull = 0;
  const double without = MustTrain(source, shape, options, 2).final_loss;
  EXPECT_LT(with, 0.9 * without);
}

TEST(TrainBrdf, EveryWayToIndicesLearns) {
  const Source source = PlasticSource(0.15f);
  ModelShape shape = Small();
  shape.grid.nside = 8;
  for (const IndexTraining way :
       {IndexTraining::kClusters, IndexTraining::kSoftmax, IndexTraining::kClustersThenSoftmax}) {
    TrainOptions options = Quick();
    options.index_training = way;
    const TrainedBrdf trained = MustTrain(source, shape, options, 2);
    EXPECT_GT(SphereError(source, trained).ssim, 0.97) << static_cast<int>(way);
    const TrainedBrdf again = MustTrain(source, shape, options, 3);
    EXPECT_EQ(trained.pack.indices, again.pack.indices) << static_cast<int>(way);
  }
}

TEST(TrainBrdf, EveryRuleAndShapeTrainsAndEvaluatesFinite) {
  const Source source = PlasticSource(0.05f);
  TrainOptions options = Quick();
  options.free_steps = 60;
  options.codebook_steps = 60;
  options.pool = 20000;
  for (const auto rule :
       {healpix::Interpolation::kBilinear, healpix::Interpolation::kInverseDistance,
        healpix::Interpolation::kUniform}) {
    for (const bool plain : {false, true}) {
      ModelShape shape;
      shape.grid.nside = plain ? 7 : 8;
      shape.grid.interpolation = rule;
      shape.grid.angle_inputs = shape.grid.canonical_order = !plain;
      shape.primitive_size = plain ? 5 : 16;
      shape.hidden = plain ? 20 : 32;
      shape.hidden_layers = plain ? 3 : 1;
      shape.index_bits = plain ? 3 : 6;
      const TrainedBrdf trained = MustTrain(source, shape, options, 2);
      const BatchEvaluator evaluator = Evaluator(trained);
      BatchEvaluator::Scratch scratch(evaluator);
      const double edge = 1.5707963;
      std::vector<Direction> wi, wo;
      for (const double a : {0.0, 1e-6, 0.8, 1.569, edge}) {
        for (const double b : {0.0, 0.8, 1.569, edge}) {
          wi.push_back({static_cast<float>(std::sin(a)), 0, static_cast<float>(std::cos(a))});
          wo.push_back({static_cast<float>(-std::sin(b)), 0, static_cast<float>(std::cos(b))});
        }
      }
      wi.push_back({0, 0, -1});
      wo.push_back({0, 0, 1});
      std::vector<float> rgb(3 * wi.size(), -1);
      evaluator.Evaluate(&scratch, wi.size(), wi.data(), wo.data(), rgb.data());
      for (const float v : rgb) {
        EXPECT_TRUE(std::isfinite(v));
        EXPECT_GE(v, 0.0f);
      }
      EXPECT_EQ(rgb[rgb.size() - 1], 0.0f) << "below the horizon";
    }
  }
}

TEST(TrainBrdf, RefusesWhatItCannotTrain) {
  ThreadPool pool(1);
  const Source nothing = SourceOf([](const Direction&, const Direction&, float*) { return false; });
  auto trained = TrainBrdf(nothing, Small(), Quick(), pool, NoProgress());
  ASSERT_FALSE(trained);
  EXPECT_EQ(trained.error().code, ErrorCode::kCorruptData);
  ModelShape shape = Small();
  shape.grid.nside = 0;
  trained = TrainBrdf(PlasticSource(0.2f), shape, Quick(), pool, NoProgress());
  ASSERT_FALSE(trained);
  EXPECT_EQ(trained.error().code, ErrorCode::kInvalidArgument);
  CancelToken cancel;
  cancel.Cancel();
  TrainOptions options = Quick();
  options.cancel = &cancel;
  trained = TrainBrdf(PlasticSource(0.2f), Small(), options, pool, NoProgress());
  ASSERT_FALSE(trained);
  EXPECT_EQ(trained.error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace patina::brdf
