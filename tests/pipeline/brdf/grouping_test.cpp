// Which materials share a codebook, and that they can.
#include "pipeline/brdf/grouping.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "formats/brdf/angles.h"
#include "pipeline/brdf/batch_evaluator.h"
#include "pipeline/brdf/train_brdf.h"
#include "tests/pipeline/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

Source PlasticSource(float alpha) {
  return SourceOf([alpha](const Direction& wi, const Direction& wo, float* rgb) {
    return Plastic(alpha, wi, wo, rgb);
  });
}

Source Matte(float albedo) {
  return SourceOf([albedo](const Direction&, const Direction&, float* rgb) {
    rgb[0] = rgb[1] = rgb[2] = albedo / kPi;
    return true;
  });
}

using Groups = std::vector<std::vector<size_t>>;

TEST(GroupAlike, PutsLooksTogetherAndKindsApart) {
  Source brushed = PlasticSource(0.1f);
  brushed.isotropic = false;
  Source list;
  list.samples.resize(3);
  const Source glossy1 = PlasticSource(0.05f), matte1 = Matte(0.2f), glossy2 = PlasticSource(0.06f),
               matte2 = Matte(0.25f), matte3 = Matte(0.3f);
  const Source* sources[] = {&glossy1, &matte1, &glossy2, &matte2, &brushed, &list, &matte3};
  EXPECT_EQ(GroupAlike(sources, 3).size(), 4u);
  const Groups pairs = GroupAlike(sources, 2);
  EXPECT_NE(std::find(pairs.begin(), pairs.end(), std::vector<size_t>({0, 2})), pairs.end())
      << "the two glossy ones";
  EXPECT_NE(std::find(pairs.begin(), pairs.end(), std::vector<size_t>({4})), pairs.end());
  EXPECT_NE(std::find(pairs.begin(), pairs.end(), std::vector<size_t>({5})), pairs.end());
  EXPECT_EQ(GroupAlike(sources, 1).size(), 7u);
  EXPECT_TRUE(GroupAlike({}, 4).empty());
}

TEST(TrainShared, SeveralMaterialsOnOneCodebookKeepTheirLooks) {
  const Source glossy = PlasticSource(0.1f), rough = PlasticSource(0.4f), matte = Matte(0.5f);
  const Source* sources[] = {&glossy, &rough, &matte};
  TrainOptions options;
  options.pool = 60000;
  options.free_steps = 1500;
  options.codebook_steps = 800;
  ModelShape shape;
  shape.index_bits = 8;
  ThreadPool pool(2);
  auto trained = TrainShared(sources, shape, options, pool, NoProgress());
  ASSERT_TRUE(trained) << trained.error().message;
  ASSERT_EQ(trained->size(), 3u);
  for (size_t m = 0; m < 3; ++m) {
    const TrainedBrdf& one = (*trained)[m];
    EXPECT_EQ(one.pack.codebook, (*trained)[0].pack.codebook);
    EXPECT_EQ(one.network.tensors[0].elements, (*trained)[0].network.tensors[0].elements);
    auto features = ExpandCorners(one.pack, {one.pack.primitive_size, one.pack.codebook});
    ASSERT_TRUE(features) << features.error().message;
    auto evaluator = BatchEvaluator::Create(one.pack, *features, one.network);
    ASSERT_TRUE(evaluator) << evaluator.error().message;
    BatchEvaluator::Scratch scratch(*evaluator);
    double error = 0;
    int count = 0;
    Rng rng(9);
    for (int n = 0; n < 2000; ++n) {
      Direction wi, wo;
      DrawPair(n % 2 ? Draw::kHalfAngles : Draw::kDirections, &rng, &wi, &wo);
      float wanted[3], got[3];
      if (!sources[m]->table->Evaluate(wi, wo, wanted)) continue;
      evaluator->Evaluate(&scratch, 1, &wi, &wo, got);
      for (int c = 0; c < 3; ++c) {
        const double cosine = static_cast<double>(std::max(wi.z, wo.z));
        error += std::abs(std::log1p(static_cast<double>(got[c]) * cosine) -
                          std::log1p(static_cast<double>(wanted[c]) * cosine));
        ++count;
      }
    }
    EXPECT_LT(error / count, 0.02) << m;
  }
  ThreadPool other(3);
  auto again = TrainShared(sources, shape, options, other, NoProgress());
  ASSERT_TRUE(again);
  EXPECT_EQ((*again)[2].pack.indices, (*trained)[2].pack.indices);
}

}  // namespace
}  // namespace patina::brdf
