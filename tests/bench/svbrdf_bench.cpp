// A synthetic BTF, a layered material with maps or a texture set as a spatially varying neural
// BRDF: renders of a plane and a sphere against the surface that it was made from, with the neural
// texture as BC6H blocks and as uncompressed halves; bytes, compression ratio, cost of learning and
// of decoding. In the manner of Dou 2023, figures 8 to 10.
//
//   patina_svbrdf_bench [--source btf|layers|set] [--size 128] [--images 2500] [--textures 4]
//   [--steps-scale 1] [--seed 1]
//                       [--threads 0] [--out DIR]
//
// layers: also the paths for each place and pair of directions with which a simulated plane is as
// good as the learned one, and their time over that of decoding.
//
// Times of one program on one machine: what counts are their ratios. DIR gets the renders.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "formats/dds.h"
#include "formats/half.h"
#include "formats/index_pack.h"
#include "formats/layered/varying_stack.h"
#include "formats/weights.h"
#include "pipeline/base/cpu_time.h"
#include "pipeline/brdf/batch_evaluator.h"
#include "pipeline/brdf/sphere_render.h"
#include "pipeline/color/color.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/sample_btf.h"
#include "pipeline/jobs/sample_set.h"
#include "pipeline/jobs/sample_stack.h"
#include "pipeline/jobs/sheet.h"
#include "pipeline/jobs/svbrdf_source.h"
#include "pipeline/svbrdf/modelled_source.h"
#include "pipeline/svbrdf/stack_model.h"
#include "pipeline/svbrdf/train_svbrdf.h"

namespace patina {
namespace {

using Clock = std::chrono::steady_clock;
using brdf::Direction;

struct Arguments {
  int size = 128, images = 2500, textures = 4, threads = 0;
  double steps_scale = 1;
  uint64_t seed = 1;
  std::string source = "btf";
  std::string out;
};

[[noreturn]] void Die(const std::string& message) {
  std::fprintf(stderr, "patina_svbrdf_bench: %s\n", message.c_str());
  std::exit(1);
}

template <class T>
T Must(Result<T> result) {
  if (!result) Die(result.error().message);
  return std::move(*result);
}

double Since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// One place of a picture under one light.
struct Shade {
  int pixel;
  Direction wi, wo;
  float u, v;
  float power;  // irradiance, times the cosine
};

struct View {
  const char* name;
  int side;
  std::vector<Shade> shades;
};

Direction Unit(double x, double y, double z) {
  const double length = std::sqrt(x * x + y * y + z * z);
  return {static_cast<float>(x / length), static_cast<float>(y / length),
          static_cast<float>(z / length)};
}

float Dot(const Direction& a, const Direction& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// The middle of a texel: what is compared is the model, not the interpolation between texels.
float Snap(double coordinate, int size) {
  const double wrapped = coordinate - std::floor(coordinate);
  return static_cast<float>((std::min(std::floor(wrapped * size), size - 1.0) + 0.5) / size);
}

// Three lamps, in the frame of the camera, which looks along -z.
struct Lamp {
  Direction direction;
  float power;
};
const Lamp kLamps[] = {
    {Unit(-0.5, 0.6, 0.8), 0.8f}, {Unit(0.9, 0.1, 0.5), 0.5f}, {Unit(0.1, -0.6, 0.9), 0.3f}};

// A plane that is turned away from the camera by 35 degrees, seen in perspective.
View PlaneView(int side, int size) {
  View view = {"plane", side, {}};
  const double tilt = 35 * std::numbers::pi / 180, c = std::cos(tilt), s = std::sin(tilt);
  const Direction tangent = {1, 0, 0}, bitangent = Unit(0, c, -s), normal = Unit(0, s, c);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const double px = 2 * (x + 0.5) / side - 1, py = 1 - 2 * (y + 0.5) / side;
      // Camera at z = 4; the plane goes through the origin.
      const Direction ray = Unit(px * 0.3, py * 0.3, -1);
      const double t = -4 * static_cast<double>(normal.z) / static_cast<double>(Dot(ray, normal));
      const double hx = t * static_cast<double>(ray.x), hy = t * static_cast<double>(ray.y),
                   hz = 4 + t * static_cast<double>(ray.z);
      const Direction out = {-ray.x, -ray.y, -ray.z};
      const double a = hx, b = hy * static_cast<double>(bitangent.y) +
                               hz * static_cast<double>(bitangent.z);
      for (const Lamp& lamp : kLamps) {
        const auto local = [&](const Direction& d) {
          return Direction{Dot(d, tangent), Dot(d, bitangent), Dot(d, normal)};
        };
        const Direction wi = local(lamp.direction), wo = local(out);
        if (!(wi.z > 0) || !(wo.z > 0)) continue;
        view.shades.push_back({y * side + x, wi, wo, Snap(0.5 + a / 2, size),
                               Snap(0.5 - b / 2, size), lamp.power * wi.z});
      }
    }
  }
  return view;
}

// A sphere in parallel projection with the texture around it, down to where light and view are 75
// degrees from the normal: further the images have nothing to say.
View SphereView(int side, int size) {
  View view = {"sphere", side, {}};
  const float lowest = static_cast<float>(std::cos(75 * std::numbers::pi / 180));
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const double px = 2 * (x + 0.5) / side - 1, py = 1 - 2 * (y + 0.5) / side;
      const double rest = 1 - (px * px + py * py) / 0.9;
      if (!(rest > 0)) continue;
      const Direction normal = Unit(px, py, std::sqrt(0.9 * rest));
      const Direction tangent =
          Unit(static_cast<double>(normal.z), 0, -static_cast<double>(normal.x));
      const Direction bitangent = {normal.y * tangent.z - normal.z * tangent.y,
                                   normal.z * tangent.x - normal.x * tangent.z,
                                   normal.x * tangent.y - normal.y * tangent.x};
      const double phi = std::atan2(static_cast<double>(normal.x), static_cast<double>(normal.z));
      const double theta = std::asin(static_cast<double>(normal.y));
      for (const Lamp& lamp : kLamps) {
        const auto local = [&](const Direction& d) {
          return Direction{Dot(d, tangent), Dot(d, bitangent), Dot(d, normal)};
        };
        const Direction wi = local(lamp.direction), wo = local({0, 0, 1});
        if (!(wi.z > lowest) || !(wo.z > lowest)) continue;
        view.shades.push_back({y * side + x, wi, wo, Snap(2 * phi / std::numbers::pi, size),
                               Snap(-2 * theta / std::numbers::pi, size), lamp.power * wi.z});
      }
    }
  }
  return view;
}

// Linear, 1 for a white diffuse surface that faces a light of power 1.
std::vector<float> Compose(const View& view, const std::vector<float>& f) {
  std::vector<float> image(3 * static_cast<size_t>(view.side) * view.side);
  for (size_t s = 0; s < view.shades.size(); ++s) {
    const Shade& shade = view.shades[s];
    for (size_t c = 0; c < 3; ++c)
      image[3 * static_cast<size_t>(shade.pixel) + c] +=
          std::numbers::pi_v<float> * shade.power * f[3 * s + c];
  }
  return image;
}

double Mse(const View& view, const std::vector<float>& a, const std::vector<float>& b) {
  std::vector<uint8_t> seen(static_cast<size_t>(view.side) * view.side);
  for (const Shade& shade : view.shades) seen[static_cast<size_t>(shade.pixel)] = 1;
  double sum = 0, count = 0;
  for (size_t p = 0; p < seen.size(); ++p) {
    if (seen[p] == 0) continue;
    for (size_t c = 3 * p; c < 3 * p + 3; ++c) {
      const double d = static_cast<double>(std::clamp(a[c], 0.0f, 1.0f)) -
                       static_cast<double>(std::clamp(b[c], 0.0f, 1.0f));
      sum += d * d;
      ++count;
    }
  }
  return sum / count;
}

double Decibels(double mse) { return -10 * std::log10(std::max(mse, 1e-12)); }

RgbImage ForAPerson(const std::vector<float>& linear, int side) {
  RgbImage picture{side, side, std::vector<float>(linear.size())};
  std::vector<float> clamped(linear.size());
  for (size_t i = 0; i < linear.size(); ++i) clamped[i] = std::clamp(linear[i], 0.0f, 1.0f);
  LinearToSrgbRow(clamped.data(), clamped.size(), picture.rgb.data());
  return picture;
}

struct System {
  const char* name;
  svbrdf::TextureForm form;
  double wall_s = 0, cpu_s = 0, decode_ns = 0;
  uint64_t texture_bytes = 0, bytes = 0;
  std::vector<double> mse = {}, ssim = {};  // of each view
  std::vector<std::vector<float>> images = {};
};

// Rows of texels as a decoder has them.
std::vector<float> RowsOf(const svbrdf::TrainedSvbrdf& model) {
  if (!model.texels.empty()) return model.texels;
  const svbrdf::TextureShape& shape = model.shape.texture;
  std::vector<float> rows(static_cast<size_t>(shape.texels()) * svbrdf::kRowFloats);
  for (int t = 0; t < shape.textures; ++t) {
    DdsTexture dds{TextureFormat::kBc6hUf16, shape.width, shape.height,
                   model.blocks[static_cast<size_t>(t)], {}};
    size_t row = 0;
    for (int l = 0; l < shape.levels; ++l) {
      const std::vector<uint16_t> halves = DecodeDdsLevel(dds, l);
      for (size_t i = 0; i < halves.size(); i += 3, ++row) {
        for (size_t c = 0; c < 3; ++c)
          rows[row * svbrdf::kRowFloats + 3 * static_cast<size_t>(t) + c] =
              HalfToFloat(halves[i + c]);
      }
    }
  }
  return rows;
}

class Runner {
 public:
  explicit Runner(const Arguments& arguments) : arguments_(arguments), pool_(arguments.threads) {}

  void Run() {
    MakeSource();
    constexpr int kPlaneSide = kSheetTile, kSphereSide = kSheetTile;
    views_ = {PlaneView(kPlaneSide, arguments_.size), SphereView(kSphereSide, arguments_.size)};
    for (const View& view : views_) truth_.push_back(Compose(view, TruthOf(view)));
    std::vector<System> systems = {{"BC6H blocks", svbrdf::TextureForm::kBlocks},
                                   {"halves", svbrdf::TextureForm::kHalves}};
    for (System& system : systems) RunSystem(&system);
    Print(systems);
    if (stack_ != nullptr) PrintSpeedup(systems[0]);
    if (!arguments_.out.empty()) WriteSheets(systems);
    std::filesystem::remove_all(set_folder_);
  }

 private:
  void MakeSource() {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "patina-svbrdf-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) Die("cannot make a temporary folder");
    set_folder_ = pattern;
    SetImageIoThreads(1);
    Job job;
    job.kind = JobKind::kSvbrdf;
    job.seed = arguments_.seed;
    if (arguments_.source == "btf") {
      const auto paths =
          Must(WriteSampleBtf(set_folder_, {arguments_.size, arguments_.images, arguments_.seed},
                              pool_, CancelToken(), NoProgress()));
      job.file = paths[0];
    } else if (arguments_.source == "layers") {
      job.file = Must(WriteSampleStack(set_folder_, arguments_.size, arguments_.seed))[0];
      const auto stack = Must(layered::ReadVaryingStack(job.file));
      stack_ = Must(svbrdf::StackModel::Load(stack, job.file, {}, pool_));
    } else {
      Must(WriteSampleSet(set_folder_, arguments_.size, arguments_.seed, pool_));
      job.folder = set_folder_;
    }
    source_ = Must(ReadSvbrdfSource(job, "", pool_, CancelToken(), NoProgress()));
    const svbrdf::VaryingSource& texels = *source_.texels;
    shape_ = svbrdf::DefaultSvbrdfShape(texels.width(), texels.height(), texels.address(),
                                        texels.isotropic());
    shape_.texture.textures = arguments_.textures;
    options_.seed = arguments_.seed;
    for (int* steps : {&options_.free_steps, &options_.block_steps, &options_.final_steps})
      *steps = std::max(1, static_cast<int>(*steps * arguments_.steps_scale));
    svbrdf::TexelPoolOptions drawing;
    drawing.count = WantedSamples(options_, shape_.texture, texels);
    drawing.levels = shape_.texture.levels;
    drawing.features = shape_.texture.features();
    drawing.grid = shape_.model.grid;
    drawing.seed = arguments_.seed;
    const Clock::time_point start = Clock::now();
    const double start_cpu = ProcessCpuSeconds();
    texels_ = Must(texels.Draw(drawing, pool_));
    std::printf("%s; drawing %.2f M samples: %.1f s, %.1f s of CPU time\n", source_.found.c_str(),
                1e-6 * static_cast<double>(texels_.samples.size()), Since(start),
                ProcessCpuSeconds() - start_cpu);
  }

  // f of each shade, of simulated ones the mean of many paths.
  std::vector<float> TruthOf(const View& view) {
    return arguments_.source == "btf" ? OfSurface(view) : OfModel(view, {0.02, 32, 64, 1024}, 1);
  }

  std::vector<float> OfSurface(const View& view) {
    const SampleBtf btf(arguments_.seed);
    std::vector<float> f(3 * view.shades.size());
    ForShades(view, [&](size_t s, const Shade& shade) {
      btf.Evaluate(static_cast<double>(shade.u), static_cast<double>(shade.v), shade.wi, shade.wo,
                   f.data() + 3 * s);
    });
    return f;
  }

  std::vector<float> OfModel(const View& view, const layered::Accuracy& accuracy, uint64_t seed) {
    const auto& model = static_cast<const svbrdf::ModelledSource&>(*source_.texels);
    const svbrdf::FootprintFinder finder = model.Finder(1);
    std::vector<float> f(3 * view.shades.size());
    ForShades(view, [&](size_t s, const Shade& shade) {
      Rng rng(seed, s);
      const auto estimate = model.Estimate(finder, model.FootprintAt(finder, shade.u, shade.v, 0),
                                           shade.wi, shade.wo, accuracy, &rng);
      for (size_t c = 0; c < 3; ++c) f[3 * s + c] = static_cast<float>(estimate.f[c]);
    });
    return f;
  }

  template <class Visit>
  void ForShades(const View& view, Visit&& visit) {
    pool_.ParallelFor(static_cast<int>((view.shades.size() + 1023) / 1024), [&](int task, int) {
      const size_t first = static_cast<size_t>(task) * 1024;
      for (size_t s = first; s < std::min(first + 1024, view.shades.size()); ++s)
        visit(s, view.shades[s]);
    });
  }

  // The error of a simulated picture falls as one over its paths.
  void PrintSpeedup(const System& learned) {
    constexpr int kPaths = 32;
    const View& plane = views_[0];
    std::vector<float> f(3 * plane.shades.size());
    double cpu_s = 0;
    const auto size = static_cast<size_t>(arguments_.size);
    const double start = ProcessCpuSeconds();
    ForShades(plane, [&](size_t s, const Shade& shade) {
      Rng rng(77, s);
      double sum[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
      const auto x = static_cast<size_t>(shade.u * static_cast<float>(size)),
                 y = static_cast<size_t>(shade.v * static_cast<float>(size));
      stack_->AddDraws(y * size + x, shade.wi, shade.wo, kPaths, &rng, sum, squares);
      for (size_t c = 0; c < 3; ++c) f[3 * s + c] = static_cast<float>(sum[c] / kPaths);
    });
    cpu_s = ProcessCpuSeconds() - start;
    const double mse = Mse(plane, truth_[0], Compose(plane, f));
    const double ns_path = 1e9 * cpu_s / static_cast<double>(plane.shades.size()) / kPaths;
    const double paths = kPaths * mse / learned.mse[0];
    std::printf(
        "simulating the plane: MSE %.7f with %d paths; as good as learned with %.0f, at %.0f ns "
        "each: %.0f times the time of decoding\n",
        mse, kPaths, paths, ns_path, paths * ns_path / learned.decode_ns);
  }

  void RunSystem(System* system) {
    svbrdf::SvbrdfOptions options = options_;
    options.form = system->form;
    const Clock::time_point start = Clock::now();
    const double start_cpu = ProcessCpuSeconds();
    const svbrdf::TrainedSvbrdf model =
        Must(svbrdf::TrainSvbrdf(texels_, shape_, options, pool_, NoProgress()));
    system->wall_s = Since(start);
    system->cpu_s = ProcessCpuSeconds() - start_cpu;
    std::printf("%s: mean error of log(1 + f cos) free %.5f, trained %.5f, at the end %.5f\n",
                system->name, model.free_loss, model.block_loss, model.final_loss);
    system->texture_bytes = model.texture_bytes();
    system->bytes = model.texture_bytes() + Must(EncodeIndexPack(model.pack)).size() +
                    Must(EncodeWeights(model.network)).size();
    const Codebook codebook{model.pack.primitive_size, model.pack.codebook};
    const auto evaluator =
        Must(brdf::BatchEvaluator::Create(model.pack, Must(ExpandCorners(model.pack, codebook)),
                                          model.network, shape_.texture.features()));
    const SimdTarget target = Must(ActiveSimdTarget());
    const svbrdf::NeuralTexture places(shape_.texture, evaluator.layout(), brdf::KernelsFor(target),
                                       svbrdf::TextureKernelsFor(target));
    const std::vector<float> rows = RowsOf(model);
    AlignedBuffer<float> texture(rows.size());
    std::copy(rows.begin(), rows.end(), texture.data());
    brdf::BatchEvaluator::Scratch scratch(evaluator);
    for (size_t v = 0; v < views_.size(); ++v) {
      const View& view = views_[v];
      const size_t count = view.shades.size();
      std::vector<Direction> wi, wo;
      AlignedBuffer<brdf::TexelTaps> taps(count);
      for (const Shade& shade : view.shades) {
        wi.push_back(shade.wi);
        wo.push_back(shade.wo);
      }
      std::vector<float> f(3 * count);
      constexpr int kRounds = 7;
      std::vector<double> seconds;
      for (int round = 0; round < kRounds; ++round) {
        const double begin = ProcessCpuSeconds();  // of this one thread
        for (size_t s = 0; s < count; ++s)
          taps[s] = places.LookUp(view.shades[s].u, view.shades[s].v, 0);
        evaluator.Evaluate(&scratch, count, wi.data(), wo.data(), f.data(), texture.data(),
                           taps.data());
        seconds.push_back(ProcessCpuSeconds() - begin);
      }
      std::nth_element(seconds.begin(), seconds.begin() + kRounds / 2, seconds.end());
      system->decode_ns = 1e9 * seconds[kRounds / 2] / static_cast<double>(count);
      system->images.push_back(Compose(view, f));
      system->mse.push_back(Mse(view, truth_[v], system->images.back()));
      system->ssim.push_back(Ssim(view, truth_[v], system->images.back()));
    }
  }

  double Ssim(const View& view, const std::vector<float>& a, const std::vector<float>& b) {
    brdf::SphereImage wanted{view.side, a, {}}, learned{view.side, b, {}};
    wanted.inside.assign(static_cast<size_t>(view.side) * view.side, 0);
    for (const Shade& shade : view.shades) wanted.inside[static_cast<size_t>(shade.pixel)] = 1;
    learned.inside = wanted.inside;
    return brdf::CompareSpheres(wanted, learned, pool_).ssim;
  }

  void Print(const std::vector<System>& systems) const {
    const double raw = 6.0 * shape_.texture.width * shape_.texture.height *
                       static_cast<double>(source_.images);  // none of maps: no ratio
    if (source_.images > 0) std::printf("the images as halves: %.1f MB\n\n", 1e-6 * raw);
    std::printf(
        "| texture | plane MSE | dB | SSIM | sphere MSE | dB | SSIM | texture kB | all kB | ratio "
        "| "
        "training s | CPU s | ns/decode "
        "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (const System& system : systems) {
      std::printf(
          "| %s | %.6f | %.2f | %.4f | %.6f | %.2f | %.4f | %.1f | %.1f | %.0f | %.0f | %.0f | "
          "%.0f |\n",
          system.name, system.mse[0], Decibels(system.mse[0]), system.ssim[0], system.mse[1],
          Decibels(system.mse[1]), system.ssim[1], 1e-3 * static_cast<double>(system.texture_bytes),
          1e-3 * static_cast<double>(system.bytes), raw / static_cast<double>(system.bytes),
          system.wall_s, system.cpu_s, system.decode_ns);
    }
    const System &blocks = systems[0], &halves = systems[1];
    std::printf(
        "\nBC6H against halves: plane %+.2f dB, sphere %+.2f dB, %.3f of the texture's "
        "bytes\n",
        Decibels(blocks.mse[0]) - Decibels(halves.mse[0]),
        Decibels(blocks.mse[1]) - Decibels(halves.mse[1]),
        static_cast<double>(blocks.texture_bytes) / static_cast<double>(halves.texture_bytes));
  }

  void WriteSheets(const std::vector<System>& systems) const {
    std::filesystem::create_directories(arguments_.out);
    for (size_t v = 0; v < views_.size(); ++v) {
      const RgbImage truth = ForAPerson(truth_[v], views_[v].side);
      std::vector<RgbImage> pictures;
      for (const System& system : systems) {
        pictures.push_back(ForAPerson(system.images[v], views_[v].side));
        pictures.push_back(DifferenceOf(truth, pictures.back()));
      }
      std::vector<SheetRow> rows;
      for (size_t s = 0; s < systems.size(); ++s) {
        rows.push_back({systems[s].name, {&truth, &pictures[2 * s], &pictures[2 * s + 1]}});
      }
      const std::string heads[] = {"reference", "learned", "difference x8"};
      const RgbImage sheet = ComposeSheet(views_[v].name, heads, rows);
      const std::string path = arguments_.out + "/" + views_[v].name + ".png";
      const Status written =
          WriteImage(path, WriteFormat::kPng8, sheet.width, sheet.height, 3, sheet.rgb.data());
      if (!written) Die(written.error().message);
      std::printf("%s\n", path.c_str());
    }
  }

  Arguments arguments_;
  ThreadPool pool_;
  std::string set_folder_;
  SvbrdfSource source_;
  std::shared_ptr<const svbrdf::StackModel> stack_;  // of a layered material
  svbrdf::SvbrdfShape shape_;
  svbrdf::SvbrdfOptions options_;
  svbrdf::TexelPool texels_;
  std::vector<View> views_;
  std::vector<std::vector<float>> truth_;
};

}  // namespace
}  // namespace patina

int main(int argc, char** argv) {
  patina::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (i + 1 == argc) patina::Die(name + ": unknown, or without its value");
    const std::string value = argv[++i];
    if (name == "--size") {
      arguments.size = std::clamp(std::atoi(value.c_str()), 4, patina::kMaxSampleBtfSide);
    } else if (name == "--source") {
      if (value != "btf" && value != "layers" && value != "set")
        patina::Die("--source: " + value + " is not one of btf, layers, set");
      arguments.source = value;
    } else if (name == "--images") {
      arguments.images = std::clamp(std::atoi(value.c_str()), 1, patina::kMaxSampleBtfImages);
    } else if (name == "--textures") {
      arguments.textures = std::clamp(std::atoi(value.c_str()), 1, patina::kFeatureTextures);
    } else if (name == "--steps-scale") {
      arguments.steps_scale = std::atof(value.c_str());
    } else if (name == "--seed") {
      arguments.seed = std::strtoull(value.c_str(), nullptr, 10);
    } else if (name == "--threads") {
      arguments.threads = std::atoi(value.c_str());
    } else if (name == "--out") {
      arguments.out = value;
    } else {
      patina::Die(name + ": no such option");
    }
  }
  patina::Runner(arguments).Run();
  return 0;
}
