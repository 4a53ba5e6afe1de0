// Window kernels against the scalar model: values, complex-step gradients, and the same bits on every target.
#include "pipeline/material/window.h"

#include <complex>
#include <cstring>
#include <memory>

#include <gtest/gtest.h>

#include "pipeline/base/rng.h"
#include "pipeline/material/reference_model.h"
#include "pipeline/material/window_kernels.h"

namespace patina {
namespace {

using Complex = std::complex<double>;

struct Scene {
  TargetPyramid target;
  ModelShape shape;
  FeatureStore store;
  AlignedBuffer<float> network;
  std::vector<float> weight;
};

Scene MakeScene(int width, int height, int channels, AddressMode address, BlockForm form, Profile profile, uint64_t seed) {
  Scene scene;
  Rng rng(seed);
  scene.target.channels = channels;
  scene.target.address = address;
  for (int w = width, h = height;; w = std::max(1, w / 2), h = std::max(1, h / 2)) {
    TargetLevel level;
    level.Allocate(w, h, channels);
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        for (int c = 0; c < channels; ++c) level.Set(x, y, c, rng.Uniform());
      }
    }
    level.FillPadding(address);
    scene.target.levels.push_back(std::move(level));
    if (w == 1 && h == 1) break;
  }
  scene.shape = ShapeForProfile(profile, width, height);
  scene.store.Allocate(scene.shape, form, StoreUse::kAccumulate);
  for (auto& texture : scene.store.textures) {
    for (FeatureLevel& level : texture) {
      for (size_t k = 0; k < level.params.size(); ++k) {
        const bool endpoint = form == BlockForm::kSegments && k % 32 < 16;
        level.params[k] = endpoint ? 14 + 2.5f * rng.Uniform() : rng.Uniform();
      }
      for (int b = 0; b < level.block_count(); ++b) level.partition[b] = static_cast<uint8_t>(rng.Below(32));
    }
  }
  scene.network.Reset(mlp::ParameterCount(channels) + 16);
  for (int k = 0; k < mlp::ParameterCount(channels); ++k) scene.network[k] = rng.Uniform() - 0.45f;
  for (int c = 0; c < channels; ++c) scene.weight.push_back(0.5f + rng.Uniform());
  return scene;
}

template <class S>
ReferenceParameters<S> CopyParameters(const Scene& scene, int channels) {
  ReferenceParameters<S> params;
  for (int t = 0; t < kFeatureTextures; ++t) {
    for (const FeatureLevel& level : scene.store.textures[t]) {
      params.features[t].emplace_back(level.params.data(), level.params.data() + level.params.size());
    }
  }
  params.network.assign(scene.network.data(), scene.network.data() + mlp::ParameterCount(channels));
  return params;
}

// The filtered target by its definition, in double.
double FilteredTarget(const Scene& scene, const WindowSpec& spec, double u, double v, int channel) {
  double sum = 0;
  for (int k = 0; k < 2; ++k) {
    const double blend = k == 0 ? 1.0 - spec.fraction : spec.fraction;
    if (blend == 0) continue;
    const TargetLevel& level = scene.target.levels[spec.mip + k];
    const double x = u * level.width - 0.5, y = v * level.height - 0.5;
    const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
    const auto weight = [](double d) {
      d = std::abs(d);
      return d < 1 ? 1 - 2.5 * d * d + 1.5 * d * d * d : d < 2 ? 2 - 4 * d + 2.5 * d * d - 0.5 * d * d * d : 0.0;
    };
    for (int dy = -1; dy <= 2; ++dy) {
      for (int dx = -1; dx <= 2; ++dx) {
        sum += blend * weight(x - (ix + dx)) * weight(y - (iy + dy)) *
               static_cast<double>(level.At(ReferenceAddress(ix + dx, level.width, scene.target.address),
                                            ReferenceAddress(iy + dy, level.height, scene.target.address), channel));
      }
    }
  }
  return sum;
}

// sum over the window's samples of weight * error^2 / 2.
template <class S>
S WindowLoss(const Scene& scene, const WindowSpec& spec, const ReferenceParameters<S>& params, int channels) {
  const TargetLevel& mip = scene.target.levels[spec.mip];
  S loss(0);
  for (int r = 0; r < spec.rows; ++r) {
    for (int k = 0; k < spec.cols; ++k) {
      const double u = (spec.x0 + k + 0.5 + static_cast<double>(spec.phase_x)) / mip.width;
      const double v = (spec.y0 + r + 0.5 + static_cast<double>(spec.phase_y)) / mip.height;
      S x[kNetworkInputs], y[kMaxOutputs];
      ReferenceInputs(scene.store, scene.shape, params, scene.target.address, u, v,
                      spec.mip + static_cast<double>(spec.fraction), x);
      mlp::ForwardReference(params.network.data(), channels, x, y);
      for (int c = 0; c < channels; ++c) {
        const S error = y[c] - S(FilteredTarget(scene, spec, u, v, c));
        loss += 0.5 * static_cast<double>(scene.weight[c]) * error * error;
      }
    }
  }
  return loss;
}

std::vector<SimdTarget> Targets() {
  std::vector<SimdTarget> targets;
  for (const SimdTarget t : {SimdTarget::kAvx2, SimdTarget::kAvx512}) {
    if (SimdTargetSupported(t)) targets.push_back(t);
  }
  return targets;
}

struct Case {
  const char* name;
  int width, height, channels;
  AddressMode address;
  BlockForm form;
  Profile profile;
  WindowSpec spec;
};

WindowSpec Spec(int mip, int x0, int y0, int cols, int rows, float px = 0, float py = 0, float fraction = 0) {
  WindowSpec spec;
  spec.mip = mip;
  spec.x0 = x0;
  spec.y0 = y0;
  spec.cols = cols;
  spec.rows = rows;
  spec.phase_x = px;
  spec.phase_y = py;
  spec.fraction = fraction;
  return spec;
}

std::vector<Case> Cases() {
  constexpr auto kW = AddressMode::kWrap;
  constexpr auto kC = AddressMode::kClamp;
  constexpr auto kS = BlockForm::kSegments;
  constexpr auto kF = BlockForm::kFree;
  return {
      {"power of two, texel centres, inside", 128, 128, 9, kW, kS, Profile::kBcf1k, Spec(0, 32, 40, 64, 64)},
      {"across the wrapped edge", 128, 128, 5, kW, kS, Profile::kBcf1k, Spec(0, 112, 96, 64, 64)},
      {"between texels and mips", 128, 128, 4, kW, kS, Profile::kBcf1k, Spec(0, 112, 104, 64, 64, 0.3f, 0.8f, 0.4f)},
      {"full-size features", 96, 128, 3, kW, kS, Profile::kBcf2kPlus, Spec(0, 16, 72, 64, 64, 0.6f, 0.1f, 0.7f)},
      {"odd sizes, wrap", 83, 71, 7, kW, kS, Profile::kBcf1k, Spec(0, 64, 56, 64, 64)},
      {"odd sizes between mips", 83, 71, 2, kW, kS, Profile::kBcf05k, Spec(1, 32, 8, 48, 35, 0.9f, 0.5f, 0.5f)},
      {"odd sizes, clamp", 83, 71, 6, kC, kS, Profile::kBcf1k, Spec(0, 64, 24, 64, 64)},
      {"clamp between texels at the corner", 83, 71, 1, kC, kS, Profile::kBcf1k, Spec(0, 0, 0, 64, 64, 0.2f, 0.7f, 0.1f)},
      {"a mip smaller than the window", 64, 64, 9, kW, kS, Profile::kBcf1k, Spec(3, 0, 0, 16, 8)},
      {"a mip of 3 x 5 texels", 24, 40, 3, kW, kS, Profile::kBcf1k, Spec(3, 0, 0, 16, 5, 0.5f, 0.25f, 0.5f)},
      {"the last mip", 32, 16, 9, kW, kS, Profile::kBcf1k, Spec(5, 0, 0, 16, 1)},
      {"one texel", 1, 1, 3, kW, kS, Profile::kBcf1k, Spec(0, 0, 0, 16, 1)},
      {"one row", 100, 1, 3, kW, kS, Profile::kBcf1k, Spec(0, 48, 0, 64, 1)},
      {"free texels", 128, 64, 8, kW, kF, Profile::kBcf1k, Spec(0, 32, 0, 64, 64, 0.4f, 0.6f, 0.3f)},
      {"many channels", 64, 64, 37, kW, kS, Profile::kBcf1k, Spec(0, 16, 0, 32, 40)},
      {"a chunk that is not full", 64, 64, 9, kW, kS, Profile::kBcf1k, Spec(0, 0, 8, 16, 13)},
  };
}

class WindowKernels : public testing::TestWithParam<int> {};

TEST_P(WindowKernels, MatchTheScalarModelAndItsComplexStepGradient) {
  const Case test = Cases()[GetParam()];
  SCOPED_TRACE(test.name);
  for (const SimdTarget target : Targets()) {
    SCOPED_TRACE(SimdTargetName(target));
    Scene scene = MakeScene(test.width, test.height, test.channels, test.address, test.form, test.profile, 11);
    const auto scratch = std::make_unique<WindowScratch>();
    std::memset(static_cast<void*>(scratch.get()), 0xFF, sizeof *scratch);  // NaN: nothing may depend on old content
    const auto result = std::make_unique<WindowResult>();
    WindowPlan plan;
    PlanWindow(scene.target, scene.shape, &scene.store, test.spec, &plan);
    WindowTask task;
    task.plan = &plan;
    task.network = scene.network.data();
    task.outputs = test.channels;
    task.form = test.form;
    task.channel_weight = scene.weight.data();
    task.update = FeatureUpdate::kAccumulate;
    task.network_gradient = true;
    KernelsFor(target).run_window(task, scratch.get(), result.get());
    ASSERT_TRUE(result->finite);
    ASSERT_EQ(result->samples, test.spec.cols * test.spec.rows);

    auto params = CopyParameters<Complex>(scene, test.channels);
    double loss = 0;
    for (int c = 0; c < test.channels; ++c) loss += 0.5 * scene.weight[c] * result->squared_error[c];
    const double expected_loss = WindowLoss(scene, test.spec, params, test.channels).real();
    EXPECT_NEAR(loss, expected_loss, 2e-5 * expected_loss);

    // Sums of some thousand float terms: bounded by the size of the terms, not of the sum, so the absolute bound is a share of
    // the loss.
    constexpr double kStep = 1e-30;
    const auto check = [&](Complex* at, double gradient, const std::string& what) {
      *at += Complex(0, kStep);
      const double expected = WindowLoss(scene, test.spec, params, test.channels).imag() / kStep;
      *at -= Complex(0, at->imag());
      EXPECT_NEAR(gradient, expected, 1e-4 * std::abs(expected) + 2e-6 * expected_loss) << what;
    };
    Rng rng(3);
    std::vector<float> folded(mlp::ParameterCount(test.channels));
    const float* lanes = result->gradient.sum;
    KernelsFor(target).fold_gradient(&lanes, 1, mlp::ParameterCount(test.channels), folded.data());
    for (int n = 0; n < 10; ++n) {
      const int k = static_cast<int>(rng.Below(static_cast<uint32_t>(folded.size())));
      check(&params.network[k], folded[k], "network parameter " + std::to_string(k));
    }
    int checked = 0;
    for (int n = 0; n < 2000 && checked < 16; ++n) {
      const LevelTaps& taps = plan.levels[rng.Below(static_cast<uint32_t>(plan.level_count))];
      if (taps.x.span_count == 0 || taps.y.span_count == 0) continue;
      const int bx = taps.x.spans[rng.Below(static_cast<uint32_t>(taps.x.span_count))].block;
      const int by = taps.y.spans[rng.Below(static_cast<uint32_t>(taps.y.span_count))].block;
      const int stride = BlockStride(test.form);
      const int k = static_cast<int>(rng.Below(static_cast<uint32_t>(stride)));
      if (test.form == BlockForm::kSegments && k >= 12 && k < 16) continue;
      const size_t at = static_cast<size_t>(by * taps.level->blocks_x + bx) * stride + k;
      const size_t level_index = taps.level - scene.store.textures[taps.texture].data();
      check(&params.features[taps.texture][level_index][at], taps.level->gradient[at],
            "texture " + std::to_string(taps.texture) + " level " + std::to_string(level_index) + " parameter " + std::to_string(at));
      ++checked;
    }
    EXPECT_EQ(checked, 16);
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, WindowKernels, testing::Range(0, static_cast<int>(Cases().size())));

TEST(WindowKernels, GiveTheSameBitsOnEveryTarget) {
  if (Targets().size() < 2) GTEST_SKIP() << "this CPU runs one target only";
  for (const Case& test : Cases()) {
    SCOPED_TRACE(test.name);
    std::vector<Scene> scenes;
    std::vector<std::unique_ptr<WindowResult>> results;
    for (const SimdTarget target : Targets()) {
      scenes.push_back(MakeScene(test.width, test.height, test.channels, test.address, test.form, test.profile, 5));
      results.push_back(std::make_unique<WindowResult>());
      Scene& scene = scenes.back();
      const auto scratch = std::make_unique<WindowScratch>();
      WindowTask task;
      WindowPlan plan;
      PlanWindow(scene.target, scene.shape, &scene.store, test.spec, &plan);
      task.plan = &plan;
      task.network = scene.network.data();
      task.outputs = test.channels;
      task.form = test.form;
      task.channel_weight = scene.weight.data();
      task.update = FeatureUpdate::kAdam;
      task.network_gradient = true;
      task.rates = {.endpoint = 0.08f, .index = 0.08f, .beta1 = 0.8f, .beta2 = 0.99f, .epsilon = 1e-7f};
      for (int n = 0; n < 3; ++n) KernelsFor(target).run_window(task, scratch.get(), results.back().get());
    }
    for (int c = 0; c < test.channels; ++c) EXPECT_EQ(results[0]->squared_error[c], results[1]->squared_error[c]);
    EXPECT_EQ(0, std::memcmp(results[0]->gradient.sum, results[1]->gradient.sum,
                             sizeof(float) * 16 * mlp::ParameterCount(test.channels)));
    for (int t = 0; t < kFeatureTextures; ++t) {
      for (size_t l = 0; l < scenes[0].store.textures[t].size(); ++l) {
        const auto& a = scenes[0].store.textures[t][l].params;
        const auto& b = scenes[1].store.textures[t][l].params;
        EXPECT_EQ(0, std::memcmp(a.data(), b.data(), a.size() * sizeof(float))) << "texture " << t << " level " << l;
      }
    }
  }
}

TEST(WindowKernels, LeaveEverythingAloneWhenTheLossIsNotFinite) {
  Scene scene = MakeScene(64, 64, 3, AddressMode::kWrap, BlockForm::kSegments, Profile::kBcf1k, 9);
  scene.network[5] = std::numeric_limits<float>::quiet_NaN();
  const auto scratch = std::make_unique<WindowScratch>();
  const auto result = std::make_unique<WindowResult>();
  WindowPlan plan;
  PlanWindow(scene.target, scene.shape, &scene.store, Spec(0, 0, 0, 64, 64), &plan);
  std::vector<float> before(scene.store.textures[0][0].params.data(),
                            scene.store.textures[0][0].params.data() + scene.store.textures[0][0].params.size());
  WindowTask task;
  task.plan = &plan;
  task.network = scene.network.data();
  task.outputs = 3;
  task.channel_weight = scene.weight.data();
  task.update = FeatureUpdate::kAdam;
  task.network_gradient = true;
  task.rates.endpoint = task.rates.index = 0.1f;
  for (const SimdTarget target : Targets()) {
    KernelsFor(target).run_window(task, scratch.get(), result.get());
    EXPECT_FALSE(result->finite);
    EXPECT_EQ(0, std::memcmp(before.data(), scene.store.textures[0][0].params.data(), before.size() * sizeof(float)));
  }
}

// The pass of the exporter: J^T r is the gradient by the texels, which complex steps give; J^T J with linear weights must
// not be below the true diagonal.
TEST(WindowKernels, SensitivityMatchesComplexStep) {
  constexpr int kChannels = 7;
  for (const SimdTarget target : Targets()) {
    Scene scene = MakeScene(64, 64, kChannels, AddressMode::kWrap, BlockForm::kFree, Profile::kBcf1k, 21);
    const auto scratch = std::make_unique<WindowScratch>();
    const WindowSpec spec = Spec(0, 0, 0, 64, 64);
    WindowPlan plan;
    PlanWindow(scene.target, scene.shape, &scene.store, spec, &plan);
    WindowTask task;
    task.plan = &plan;
    task.network = scene.network.data();
    task.outputs = kChannels;
    task.form = BlockForm::kFree;
    task.channel_weight = scene.weight.data();
    for (const int texture : {0, 2}) {
      const FeatureLevel& level = scene.store.textures[texture][0];
      AlignedBuffer<float> planes(static_cast<size_t>(9) * level.width * level.height);
      KernelsFor(target).sensitivity(task, texture, scratch.get(), {planes.data(), level.width, level.height});
      auto params = CopyParameters<Complex>(scene, kChannels);
      const double loss = WindowLoss(scene, spec, params, kChannels).real();
      Rng rng(2);
      for (int n = 0; n < 6; ++n) {
        const int x = static_cast<int>(rng.Below(static_cast<uint32_t>(level.width)));
        const int y = static_cast<int>(rng.Below(static_cast<uint32_t>(level.height)));
        const size_t pixel = static_cast<size_t>(y) * level.width + x, plane = static_cast<size_t>(level.width) * level.height;
        for (int c = 0; c < 3; ++c) {
          Complex& p = params.features[texture][0][((y / 4) * level.blocks_x + x / 4) * 48 + c * 16 + (y % 4) * 4 + x % 4];
          p += Complex(0, 1e-30);
          const double expected = WindowLoss(scene, spec, params, kChannels).imag() / 1e-30;
          // A second difference of the (piecewise quadratic) loss bounds the curvature from below.
          p = Complex(p.real() + 1e-4, 0);
          const double up = WindowLoss(scene, spec, params, kChannels).real();
          p -= 2e-4;
          const double down = WindowLoss(scene, spec, params, kChannels).real();
          p += 1e-4;
          EXPECT_NEAR(planes[c * plane + pixel], expected, 1e-4 * std::abs(expected) + 2e-6 * loss);
          const double curvature = (up - 2 * loss + down) / 1e-8;
          const int diagonal = c == 0 ? 3 : c == 1 ? 6 : 8;
          EXPECT_GE(planes[diagonal * plane + pixel], 0.98 * curvature - 0.05 * std::abs(curvature) - 1e-3);
        }
      }
    }
  }
}

TEST(WindowPlan, FindsEveryConflict) {
  Scene scene = MakeScene(512, 512, 2, AddressMode::kWrap, BlockForm::kSegments, Profile::kBcf1k, 4);
  Rng rng(8);
  int conflicts = 0;
  for (int n = 0; n < 300; ++n) {
    WindowPlan plans[2];
    for (WindowPlan& plan : plans) {
      WindowSpec spec = Spec(static_cast<int>(rng.Below(3)), 0, 0, 64, 64);
      spec.x0 = 16 * static_cast<int>(rng.Below(static_cast<uint32_t>(scene.target.levels[spec.mip].width / 16)));
      spec.y0 = static_cast<int>(rng.Below(static_cast<uint32_t>(scene.target.levels[spec.mip].height)));
      if (rng.Below(2)) spec.fraction = rng.Uniform();
      PlanWindow(scene.target, scene.shape, &scene.store, spec, &plan);
    }
    // Brute force: the blocks that each decodes.
    bool common = false;
    for (int i = 0; i < plans[0].level_count; ++i) {
      for (int j = 0; j < plans[1].level_count; ++j) {
        const LevelTaps &a = plans[0].levels[i], &b = plans[1].levels[j];
        if (a.level != b.level) continue;
        bool x = false, y = false;
        for (int p = 0; p < a.x.decode_count; ++p)
          for (int q = 0; q < b.x.decode_count; ++q) x |= a.x.decode[p].block == b.x.decode[q].block;
        for (int p = 0; p < a.y.decode_count; ++p)
          for (int q = 0; q < b.y.decode_count; ++q) y |= a.y.decode[p].block == b.y.decode[q].block;
        common |= x && y;
      }
    }
    conflicts += common;
    EXPECT_TRUE(!common || WindowsConflict(plans[0], plans[1]));
  }
  EXPECT_GT(conflicts, 10);
  EXPECT_LT(conflicts, 290);
}

}  // namespace
}  // namespace patina
