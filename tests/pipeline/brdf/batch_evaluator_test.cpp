// The batch evaluator against the model's definition, for grids small enough to have the first
// layer folded into their corners and for one that is not.
#include "pipeline/brdf/batch_evaluator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "formats/half.h"
#include "tests/pipeline/brdf/brdf_samples.h"

namespace patina::brdf {
namespace {

struct Case {
  int nside, primitive_size, hidden, hidden_layers;
  bool angle_inputs, half_vector_inputs;
  healpix::Interpolation rule;
};

struct Model {
  GridShape grid;
  IndexPack pack;
  std::vector<float> features;
  WeightBuffer network;
};

WeightTensor RandomTensor(std::string name, std::vector<uint32_t> shape, float range, Rng* rng) {
  WeightTensor tensor;
  tensor.name = std::move(name);
  size_t count = 1;
  for (const uint32_t n : shape) count *= n;
  tensor.shape = std::move(shape);
  for (size_t i = 0; i < count; ++i)
    tensor.elements.push_back(FloatToHalf(range * (2 * rng->Uniform() - 1)));
  return tensor;
}

Model RandomModel(const Case& c) {
  Rng rng(11);
  Model model;
  model.pack.nside = model.grid.nside = c.nside;
  model.pack.primitive_size = c.primitive_size;
  model.pack.interpolation = model.grid.interpolation = c.rule;
  model.pack.angle_inputs = model.grid.angle_inputs = c.angle_inputs;
  model.pack.half_vector_inputs = model.grid.half_vector_inputs = c.half_vector_inputs;
  for (int i = 0; i < 2 * model.grid.corners() * c.primitive_size; ++i)
    model.features.push_back(2 * rng.Uniform() - 1);
  auto inputs = static_cast<uint32_t>(2 * c.primitive_size + model.grid.extra_inputs());
  for (int l = 0; l <= c.hidden_layers; ++l) {
    const auto outputs = static_cast<uint32_t>(l < c.hidden_layers ? c.hidden : kOutputs);
    const std::string name = "layer" + std::to_string(l);
    const float range = 2 / std::sqrt(static_cast<float>(inputs));
    model.network.tensors.push_back(RandomTensor(name + ".weight", {outputs, inputs}, range, &rng));
    model.network.tensors.push_back(RandomTensor(name + ".bias", {outputs}, 0.5f, &rng));
    inputs = outputs;
  }
  return model;
}

std::vector<double> ByDefinition(const Model& model, const Direction& wi, const Direction& wo) {
  PoolSample sample = {};
  LookUpPair(model.grid, wi, wo, &sample);
  const int k = model.pack.primitive_size;
  std::vector<double> x(static_cast<size_t>(2 * k));
  for (int c = 0; c < 8; ++c) {
    for (int i = 0; i < k; ++i) {
      x[static_cast<size_t>(c / 4 * k + i)] +=
          static_cast<double>(sample.weight[c]) *
          static_cast<double>(model.features[static_cast<size_t>(sample.corner[c] * k + i)]);
    }
  }
  x.insert(x.end(), sample.extra, sample.extra + model.grid.extra_inputs());
  for (size_t t = 0; t < model.network.tensors.size(); t += 2) {
    const WeightTensor &weight = model.network.tensors[t], &bias = model.network.tensors[t + 1];
    const bool last = t + 2 == model.network.tensors.size();
    std::vector<double> y;
    for (size_t o = 0; o < weight.shape[0]; ++o) {
      double sum = static_cast<double>(HalfToFloat(bias.elements[o]));
      for (size_t i = 0; i < x.size(); ++i)
        sum += static_cast<double>(HalfToFloat(weight.elements[o * x.size() + i])) * x[i];
      y.push_back(last ? sum : std::max(0.0, sum));
    }
    x = y;
  }
  for (double& y : x) y = std::expm1(std::clamp(y, 0.0, static_cast<double>(kMaxLogValue)));
  return x;
}

TEST(BatchEvaluator, AgreesWithTheDefinition) {
  constexpr auto kBilinear = healpix::Interpolation::kBilinear;
  // The last grid's first layer would take 12 MB.
  for (const Case& c :
       {Case{16, 16, 32, 3, true, false, kBilinear}, Case{12, 16, 64, 3, true, true, kBilinear},
        Case{5, 7, 20, 1, false, false, healpix::Interpolation::kUniform},
        Case{8, 24, 48, 2, true, false, healpix::Interpolation::kInverseDistance},
        Case{64, 16, 64, 2, true, false, kBilinear}}) {
    const Model model = RandomModel(c);
    auto evaluator = BatchEvaluator::Create(model.pack, model.features, model.network);
    ASSERT_TRUE(evaluator) << evaluator.error().message;
    BatchEvaluator::Scratch scratch(*evaluator);
    constexpr size_t kPairs = 300;  // two chunks and a part
    std::vector<Direction> wi(kPairs), wo(kPairs);
    std::vector<float> rgb(3 * kPairs);
    Rng rng(12);
    for (size_t n = 0; n < kPairs; ++n) DrawPair(Draw::kDirections, &rng, &wi[n], &wo[n]);
    evaluator->Evaluate(&scratch, kPairs, wi.data(), wo.data(), rgb.data());
    for (size_t n = 0; n < kPairs; ++n) {
      const std::vector<double> wanted = ByDefinition(model, wi[n], wo[n]);
      // Scalars of the kernels differ by up to 2e-5; weights carry that on.
      for (size_t o = 0; o < 3; ++o)
        EXPECT_NEAR(static_cast<double>(rgb[3 * n + o]), wanted[o], 2e-3 * (1 + wanted[o]))
            << "Nside " << c.nside << ", pair " << n;
    }
  }
}

}  // namespace
}  // namespace patina::brdf
