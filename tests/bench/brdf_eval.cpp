// Quality of neural BRDFs over a folder of tables, by the frozen protocol: a sphere of radius 0.5
// seen from (0, 0, -2) with 30 degrees field of view, 256 x 256 pixels, exposure 2, lit by the
// whole environment map (averaged to 64 x 32 texels, deterministic); MAE and RMSE on the sphere's
// pixels, linear and sRGB, clamped to [0, 1]; SSIM on sRGB over the frame.
//
// usage: patina_brdf_eval --tables DIR [--env FILE.hdr] [--only NAME,...] [--variants NAME,...]
// [--seeds N,...] [--side N]
//
// Without --env a procedural studio lights the sphere. One line a material and variant, then means
// and the worst SSIM.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "pipeline/brdf/batch_evaluator.h"
#include "pipeline/brdf/sphere_render.h"
#include "pipeline/brdf/train_brdf.h"
#include "pipeline/image/image_io.h"

namespace patina::brdf {
namespace {

constexpr int kColumns = 64, kRows = 32;
constexpr float kExposure = 2;

struct Variant {
  const char* name;
  void (*apply)(ModelShape* shape, TrainOptions* options);
};

const Variant kVariants[] = {
    {"default", [](ModelShape*, TrainOptions*) {}},
    {"reference",
     [](ModelShape*, TrainOptions* options) {
       options->free_steps *= 3, options->codebook_steps *= 3;
     }},
    {"8-bit", [](ModelShape* shape, TrainOptions*) { shape->index_bits = 8; }},
    {"k8", [](ModelShape* shape, TrainOptions*) { shape->primitive_size = 8; }},
    {"nside16", [](ModelShape* shape, TrainOptions*) { shape->grid.nside = 16; }},
    {"nside64", [](ModelShape* shape, TrainOptions*) { shape->grid.nside = 64; }},
    {"64x3",
     [](ModelShape* shape, TrainOptions*) { shape->hidden = 64, shape->hidden_layers = 3; }},
    {"inverse-distance",
     [](ModelShape* shape, TrainOptions*) {
       shape->grid.interpolation = healpix::Interpolation::kInverseDistance;
     }},
    {"uniform",
     [](ModelShape* shape, TrainOptions*) {
       shape->grid.interpolation = healpix::Interpolation::kUniform;
     }},
    {"no-order", [](ModelShape* shape, TrainOptions*) { shape->grid.canonical_order = false; }},
    {"no-scalars", [](ModelShape* shape, TrainOptions*) { shape->grid.angle_inputs = false; }},
    {"plain",
     [](ModelShape* shape, TrainOptions*) {
       shape->grid.angle_inputs = shape->grid.canonical_order = false;
       shape->grid.nside = 64, shape->hidden = 64;
     }},
};

std::vector<std::string> Words(const std::string& text) {
  std::vector<std::string> words;
  std::stringstream stream(text);
  for (std::string word; std::getline(stream, word, ',');) words.push_back(word);
  return words;
}

bool Listed(const std::vector<std::string>& list, const std::string& name) {
  return list.empty() || std::find(list.begin(), list.end(), name) != list.end();
}

struct Arguments {
  std::string tables, env;
  std::vector<std::string> only, variants = {"default"}, seeds = {"1"};
  int side = 256;
};

struct Mean {
  double mae = 0, rmse = 0, mae_srgb = 0, ssim = 0, worst_ssim = 1, bytes = 0, seconds = 0,
         free_loss = 0, final_loss = 0, codes = 0;
  int count = 0;
};

Result<Environment> Light(const std::string& file) {
  if (file.empty()) return StudioEnvironment(kColumns, kRows);
  PATINA_ASSIGN(const Image map, ReadImage(file));
  if (map.info.loaded_channels < 3)
    return Fail(ErrorCode::kInvalidArgument, file + ": an environment map has three channels");
  std::vector<float> values(static_cast<size_t>(map.width()) * map.height() * 3), row(map.width());
  for (int y = 0; y < map.height(); ++y) {
    for (int c = 0; c < 3; ++c) {
      LoadRow(map, y, c, row.data());
      for (int x = 0; x < map.width(); ++x)
        values[(static_cast<size_t>(y) * map.width() + x) * 3 + c] = row[x];
    }
  }
  return ReduceEnvironment(values, map.width(), map.height(), 3, kColumns, kRows);
}

Status Evaluate(const Arguments& arguments) {
  ThreadPool pool(0);
  PATINA_ASSIGN(const Environment environment, Light(arguments.env));
  std::vector<std::string> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(arguments.tables, error)) {
    if (HasBrdfExtension(entry.path().string()) &&
        Listed(arguments.only, entry.path().stem().string()))
      files.push_back(entry.path().string());
  }
  if (files.empty())
    return Fail(ErrorCode::kNotFound, arguments.tables + ": no BRDF files of these names");
  std::sort(files.begin(), files.end());
  std::map<std::string, Mean> means;
  std::printf(
      "| material | variant | seed | KB | s | codes | loss free / codes | MAE | RMSE | MAE sRGB | "
      "SSIM |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const std::string& file : files) {
    PATINA_ASSIGN(const Source source, OpenBrdf(file));
    if (source.table == nullptr) continue;
    const SphereImage truth = RenderSphere(
        [&](int, size_t count, const Direction* wi, const Direction* wo, float* rgb) {
          for (size_t k = 0; k < count; ++k) source.table->Evaluate(wi[k], wo[k], rgb + 3 * k);
        },
        environment, arguments.side, kExposure, pool);
    for (const Variant& variant : kVariants) {
      if (!Listed(arguments.variants, variant.name)) continue;
      for (const std::string& seed : arguments.seeds) {
        ModelShape shape;
        shape.grid.isotropic = source.isotropic;
        TrainOptions options;
        options.seed = std::strtoull(seed.c_str(), nullptr, 10);
        variant.apply(&shape, &options);
        const auto start = std::chrono::steady_clock::now();
        PATINA_ASSIGN(const TrainedBrdf trained,
                      TrainBrdf(source, shape, options, pool, NoProgress()));
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        PATINA_ASSIGN(const auto pack, EncodeIndexPack(trained.pack));
        PATINA_ASSIGN(const auto weights, EncodeWeights(trained.network));
        PATINA_ASSIGN(const auto features, ExpandCorners(trained.pack, {trained.pack.primitive_size,
                                                                        trained.pack.codebook}));
        PATINA_ASSIGN(const BatchEvaluator evaluator,
                      BatchEvaluator::Create(trained.pack, features, trained.network));
        std::vector<BatchEvaluator::Scratch> scratch;
        for (int t = 0; t < pool.threads(); ++t) scratch.emplace_back(evaluator);
        const SphereImage image = RenderSphere(
            [&](int worker, size_t count, const Direction* wi, const Direction* wo, float* rgb) {
              evaluator.Evaluate(&scratch[worker], count, wi, wo, rgb);
            },
            environment, arguments.side, kExposure, pool);
        const ImageError e = CompareSpheres(truth, image, pool);
        const double kilobytes = static_cast<double>(pack.size() + weights.size()) * 1e-3;
        std::printf(
            "| %s | %s | %s | %.1f | %.1f | %.0f | %.5f / %.5f | %.5f | %.5f | %.5f | %.5f |\n",
            std::filesystem::path(file).stem().c_str(), variant.name, seed.c_str(), kilobytes,
            seconds, trained.used_codes, trained.free_loss, trained.final_loss, e.mae_linear,
            e.rmse_linear, e.mae_srgb, e.ssim);
        std::fflush(stdout);
        Mean& mean = means[variant.name];
        ++mean.count;
        mean.mae += e.mae_linear;
        mean.rmse += e.rmse_linear;
        mean.mae_srgb += e.mae_srgb;
        mean.ssim += e.ssim;
        mean.worst_ssim = std::min(mean.worst_ssim, e.ssim);
        mean.bytes += kilobytes;
        mean.seconds += seconds;
        mean.free_loss += trained.free_loss;
        mean.final_loss += trained.final_loss;
        mean.codes += trained.used_codes;
      }
    }
  }
  for (const auto& [name, m] : means) {
    const double n = m.count;
    std::printf(
        "| **mean of %d** | %s | | %.1f | %.1f | %.0f | %.5f / %.5f | %.5f | %.5f | %.5f | %.5f, "
        "worst %.5f |\n",
        m.count, name.c_str(), m.bytes / n, m.seconds / n, m.codes / n, m.free_loss / n,
        m.final_loss / n, m.mae / n, m.rmse / n, m.mae_srgb / n, m.ssim / n, m.worst_ssim);
  }
  return {};
}

int Usage() {
  std::fprintf(stderr,
               "usage: patina_brdf_eval --tables DIR [--env FILE.hdr] [--only NAME,...] "
               "[--variants NAME,...] [--seeds N,...] [--side N]\nvariants:");
  for (const Variant& variant : kVariants) std::fprintf(stderr, " %s", variant.name);
  std::fprintf(stderr, "\n");
  return 2;
}

}  // namespace
}  // namespace patina::brdf

int main(int argc, char** argv) {
  patina::brdf::Arguments arguments;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string option = argv[i], value = argv[i + 1];
    if (option == "--tables") {
      arguments.tables = value;
    } else if (option == "--env") {
      arguments.env = value;
    } else if (option == "--only") {
      arguments.only = patina::brdf::Words(value);
    } else if (option == "--variants") {
      arguments.variants = patina::brdf::Words(value);
    } else if (option == "--seeds") {
      arguments.seeds = patina::brdf::Words(value);
    } else if (option == "--side") {
      arguments.side = std::atoi(value.c_str());
    } else {
      return patina::brdf::Usage();
    }
  }
  if (arguments.tables.empty() || argc % 2 == 0 || arguments.side < 16)
    return patina::brdf::Usage();
  const patina::Status status = patina::brdf::Evaluate(arguments);
  if (status) return 0;
  std::fprintf(stderr, "patina_brdf_eval: %s\n", status.error().message.c_str());
  return 1;
}
