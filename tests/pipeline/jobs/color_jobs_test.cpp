// Colours through whole jobs: baked, described, unpacked, compared.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/container.h"
#include "formats/decoder/patina_decoder.h"
#include "formats/schema_check.h"
#include "pipeline/base/rng.h"
#include "pipeline/color/color.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/compare.h"
#include "pipeline/jobs/describe.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/ingest.h"
#include "pipeline/jobs/job_runner.h"
#include "pipeline/jobs/job_sets.h"
#include "pipeline/jobs/unpack.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr const char* kConfig = R"(ocio_profile_version: 2
roles:
  aces_interchange: ap0
  default: ap0
displays:
  sRGB:
    - !<View> {name: Raw, colorspace: ap0}
colorspaces:
  - !<ColorSpace>
    name: ap0
  - !<ColorSpace>
    name: half light
    to_scene_reference: !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}
)";

class ColorJobs : public testing::Test {
 protected:
  ColorJobs() : folder_(testing::TempDir() + "patina_color_jobs") {
    fs::remove_all(folder_);
    fs::create_directories(folder_ + "/in");
    job_.asset = "wall";
    job_.folder = folder_ + "/in";
    job_.out = folder_ + "/out";
    job_.threads = 2;
    job_.quality = Quality::kPreview;
  }
  ~ColorJobs() override { fs::remove_all(folder_); }

  // One colour, so that nothing is learned and everything is exact.
  void Constant(const std::string& name, WriteFormat format, std::array<float, 3> rgb) {
    std::vector<float> values;
    for (int i = 0; i < 16; ++i) values.insert(values.end(), rgb.begin(), rgb.end());
    const Status written = WriteImage(folder_ + "/in/" + name, format, 4, 4, 3, values.data());
    ASSERT_TRUE(written) << written.error().message;
  }
  void Config(const std::string& text) {
    ASSERT_TRUE(WriteFileDurably(folder_ + "/config.ocio", std::string_view(text)));
    job_.ocio = folder_ + "/config.ocio";
  }
  JobResult Bake() {
    ObserverList observer;
    CancelToken cancel;
    return RunJob(job_, observer, cancel);
  }
  Container Baked() {
    const JobResult result = Bake();
    EXPECT_FALSE(result.error) << (result.error ? result.error->message : "");
    auto opened = OpenContainer(job_.out + "/wall");
    EXPECT_TRUE(opened) << (opened ? "" : opened.error().message);
    return opened ? *opened : Container{};
  }
  Result<Unpacked> Unpack(const UnpackOptions& options) {
    ThreadPool pool(2);
    CancelToken cancel;
    fs::remove_all(folder_ + "/maps");
    return UnpackContainer(job_.out + "/wall", folder_ + "/maps", options, pool, cancel);
  }
  // The first pixel of an unpacked map, and its type.
  std::array<float, 3> Pixel(const std::string& file, SampleType type) {
    auto image = ReadImage(folder_ + "/maps/" + file);
    EXPECT_TRUE(image) << (image ? "" : image.error().message);
    if (!image) return {};
    EXPECT_EQ(image->info.type, type);
    std::array<float, 3> rgb{};
    for (int c = 0; c < 3; ++c) {
      std::vector<float> row(static_cast<size_t>(image->width()));
      LoadRow(*image, 0, c, row.data());
      rgb[static_cast<size_t>(c)] = row[0];
    }
    return rgb;
  }
  std::string Fingerprint() {
    auto set = MapsOfJob(job_);
    if (!set) return set.error().message;
    ThreadPool pool(1);
    CancelToken cancel;
    auto source = ReadSource(job_, *set, pool, cancel, NoProgress());
    return source ? source->fingerprint : source.error().message;
  }

  std::string folder_;
  Job job_;
};

TEST_F(ColorJobs, TheManifestSaysSpaceRuleAndConfiguration) {
  Constant("wall_albedo.png", WriteFormat::kPng8, {0.2f, 0.4f, 0.6f});
  Constant("wall_roughness.png", WriteFormat::kPng8, {0.5f, 0.5f, 0.5f});
  const Container container = Baked();
  const Manifest& manifest = container.manifest;
  EXPECT_EQ(manifest.working_space, "lin_rec709");
  EXPECT_EQ(FormatVersionOf(manifest), 1);
  ASSERT_TRUE(manifest.color_config);
  EXPECT_EQ(manifest.color_config->source, "builtin");
  EXPECT_EQ(manifest.color_config->sha256, ColorConfig::Builtin().sha256());
  ASSERT_EQ(manifest.maps.size(), 2u);
  EXPECT_EQ(manifest.maps[0].color_space, "sRGB");
  EXPECT_EQ(manifest.maps[0].color_rule, "default");
  EXPECT_EQ(manifest.maps[1].color_space, "");
  const std::string text = ContainerText(container);
  EXPECT_THAT(text, HasSubstr("working space lin_rec709, configuration built in"));
  EXPECT_THAT(text, HasSubstr("sRGB (by default)"));
}

TEST_F(ColorJobs, UnpackGivesTheSourceBackWhateverTheWorkingSpace) {
  const std::array<float, 3> rgb{51 / 255.0f, 102 / 255.0f, 204 / 255.0f};
  Constant("wall_albedo.png", WriteFormat::kPng8, rgb);
  for (const WorkingSpace working : {WorkingSpace::kLinearRec709, WorkingSpace::kAcesCg}) {
    job_.working_space = working;
    const Container container = Baked();
    EXPECT_EQ(container.manifest.working_space, WorkingSpaceName(working));
    EXPECT_EQ(FormatVersionOf(container.manifest), working == WorkingSpace::kAcesCg ? 2 : 1);
    ASSERT_TRUE(Unpack({}));
    EXPECT_EQ(Pixel("albedo.png", SampleType::kUint8), rgb);
    UnpackOptions exr;
    exr.format = UnpackFormat::kExr;
    ASSERT_TRUE(Unpack(exr));
    const std::array<float, 3> linear = Pixel("albedo.exr", SampleType::kHalf);
    for (size_t c = 0; c < 3; ++c) {
      // Half floats round to 1/2048.
      EXPECT_NEAR(linear[c] / SrgbToLinear(static_cast<double>(rgb[c])), 1, 6e-4);
    }
  }
}

TEST_F(ColorJobs, UnpackWritesAnySpaceOfTheConfiguration) {
  Constant("wall_emissive.exr", WriteFormat::kExrFloat, {-0.5f, 2.0f, 70000.0f});
  Constant("wall_roughness.png", WriteFormat::kPng8, {0.2f, 0.2f, 0.2f});
  Baked();
  UnpackOptions options;
  options.space = "acescg";
  auto unpacked = Unpack(options);
  ASSERT_TRUE(unpacked) << unpacked.error().message;
  const std::array<float, 3> aces = Pixel("emissive.exr", SampleType::kFloat);
  const Matrix3 m = *ConversionMatrix(kRec709Primaries, kAp1Primaries);
  const double in[3] = {-0.5, 2, 70000};
  for (size_t c = 0; c < 3; ++c) {
    const double wanted = m[3 * c] * in[0] + m[3 * c + 1] * in[1] + m[3 * c + 2] * in[2];
    EXPECT_NEAR(aces[c] / wanted, 1, 1e-5);
  }
  // It names its primaries, so that it is read back as what it is.
  EXPECT_EQ(ReadImageInfo(folder_ + "/maps/emissive.exr")->color_tag.origin, "chromaticities");
  // Data are the same in every space.
  EXPECT_EQ(Pixel("roughness.png", SampleType::kUint8)[0], 51 / 255.0f);
  // Values beyond 1 do not fit PNG, though the space has a curve.
  options.space = "Rec.709";
  ASSERT_TRUE(Unpack(options));
  EXPECT_TRUE(fs::exists(folder_ + "/maps/emissive.exr"));
  options.format = UnpackFormat::kPng;
  unpacked = Unpack(options);
  ASSERT_TRUE(unpacked);
  ASSERT_EQ(unpacked->warnings.size(), 1u);
  EXPECT_THAT(unpacked->warnings[0], HasSubstr("clipped"));
  // A space of somebody's configuration, and one that is not there.
  Config(kConfig);
  options = {};
  options.ocio = job_.ocio;
  options.space = "half light";
  ASSERT_TRUE(Unpack(options));
  const Matrix3 ap0 = *ConversionMatrix(kRec709Primaries, kAp0Primaries);
  EXPECT_NEAR(Pixel("emissive.exr", SampleType::kFloat)[2] /
                  (2 * (ap0[6] * in[0] + ap0[7] * in[1] + ap0[8] * in[2])),
              1, 1e-5);
  options.space = "half lite";
  unpacked = Unpack(options);
  ASSERT_FALSE(unpacked);
  EXPECT_THAT(unpacked.error().message, HasSubstr("--space: \"half lite\""));
  EXPECT_THAT(unpacked.error().message, HasSubstr("half light"));
  options.ocio = folder_ + "/absent.ocio";
  unpacked = Unpack(options);
  ASSERT_FALSE(unpacked);
  EXPECT_THAT(unpacked.error().message, HasSubstr("absent.ocio"));
}

TEST_F(ColorJobs, TheFingerprintKnowsTheColours) {
  Constant("wall_albedo.png", WriteFormat::kPng8, {0.2f, 0.4f, 0.6f});
  const std::string plain = Fingerprint();
  EXPECT_EQ(plain.size(), 64u);
  job_.color_space = "srgb";
  const std::string same_but_asked = Fingerprint();
  EXPECT_NE(same_but_asked, plain);
  job_.color_space = "auto";
  job_.working_space = WorkingSpace::kAcesCg;
  EXPECT_NE(Fingerprint(), plain);
  job_.working_space = WorkingSpace::kLinearRec709;
  Config(kConfig);
  const std::string with_config = Fingerprint();
  EXPECT_NE(with_config, plain);
  EXPECT_EQ(with_config, Fingerprint());
  Config(std::string(kConfig) + "# edited\n");
  EXPECT_NE(Fingerprint(), with_config);
  // Where it lies does not matter.
  ASSERT_TRUE(WriteFileDurably(folder_ + "/moved.ocio", std::string_view(kConfig)));
  job_.ocio = folder_ + "/moved.ocio";
  EXPECT_EQ(Fingerprint(), with_config);
}

TEST_F(ColorJobs, ErrorsPointAtTheJob) {
  Constant("wall_albedo.png", WriteFormat::kPng8, {0.2f, 0.4f, 0.6f});
  job_.ocio = folder_ + "/absent.ocio";
  JobResult result = Bake();
  ASSERT_TRUE(result.error);
  EXPECT_THAT(result.error->message, HasSubstr("/ocio: colour configuration " + job_.ocio));
  EXPECT_EQ(result.exit_code, kExitBadInput);
  Config(std::string(kConfig).substr(0, 150));
  result = Bake();
  ASSERT_TRUE(result.error);
  EXPECT_EQ(result.error->code, ErrorCode::kCorruptData);
  EXPECT_EQ(result.exit_code, kExitBadInput);
  job_.ocio.clear();
  job_.color_space = "nothing";
  result = Bake();
  ASSERT_TRUE(result.error);
  EXPECT_THAT(result.error->message, HasSubstr("/color_space: \"nothing\""));
  EXPECT_EQ(result.exit_code, kExitBadInput);
}

TEST_F(ColorJobs, HdrSurvivesTraining) {
  std::vector<float> values;
  for (int i = 0; i < 32 * 32; ++i) {
    const float x = static_cast<float>(i % 32) / 32;
    values.insert(values.end(), {0.2f + x, 0.3f, i == 500 ? 1e5f : 0.1f + 0.5f * x});
  }
  values[3 * 500] = -3;
  ASSERT_TRUE(WriteImage(folder_ + "/in/wall_emissive.exr", WriteFormat::kExrFloat, 32, 32, 3,
                         values.data()));
  job_.samples = 2e5;
  const Container container = Baked();
  EXPECT_EQ(FormatVersionOf(container.manifest), 2);
  EXPECT_EQ(container.manifest.channels[0].encoding, "signed_log");
  auto text = ReadTextFile(container.PathOf("manifest.json"), kMaxManifestBytes);
  ASSERT_TRUE(text);
  const Status valid = CheckAgainstSchema("manifest", nlohmann::json::parse(*text));
  EXPECT_TRUE(valid) << valid.error().message;
  Decoder decoder;
  std::string problem;
  ASSERT_EQ(Decoder::Load(container.directory, &decoder, &problem), Decoder::LoadStatus::kOk)
      << problem;
  // The range holds the spike, and the manifest's scale brings it back.
  EXPECT_NEAR(Decoder::ToPhysical(decoder.channels()[2], decoder.channels()[2].max), 1e5, 10);
  ASSERT_TRUE(Unpack({.mip = 0, .format = UnpackFormat::kExr, .space = "", .ocio = ""}));
  // Compared from the files alone, as the bake measured it.
  ThreadPool pool(2);
  CancelToken cancel;
  auto comparison = CompareContainer(job_.out + "/wall", job_, pool, cancel, NoProgress());
  ASSERT_TRUE(comparison) << comparison.error().message;
  EXPECT_DOUBLE_EQ(comparison->measurement.quality.psnr.overall_db,
                   container.manifest.quality.psnr_overall_db);
  // Ordinary texels are not lost beside the spike: the peak of the measure is that of the
  // logarithms, and even 2e5 samples are within a tenth of it.
  EXPECT_GT(container.manifest.quality.psnr_overall_db, 20);
  // Other colours are another source.
  Job other = job_;
  other.color_space = "ACEScg";
  comparison = CompareContainer(job_.out + "/wall", other, pool, cancel, NoProgress());
  ASSERT_FALSE(comparison);
  EXPECT_EQ(comparison.error().code, ErrorCode::kConflict);
}

// Red, green and blue share an output, and so the planes that are measured.
TEST_F(ColorJobs, GreyHdrIsMeasuredOnce) {
  std::vector<float> values;
  Rng rng(8);
  for (int i = 0; i < 64 * 64; ++i) {
    const float value = i == 1000 ? 1e5f : 0.5f + rng.Uniform();
    values.insert(values.end(), {value, value, value});
  }
  ASSERT_TRUE(WriteImage(folder_ + "/in/wall_emissive.exr", WriteFormat::kExrFloat, 64, 64, 3,
                         values.data()));
  job_.samples = 2e5;
  const Container container = Baked();
  ASSERT_EQ(container.manifest.channels[0].encoding, "signed_log");
  ASSERT_TRUE(container.manifest.network);
  EXPECT_EQ(container.manifest.network->outputs, 1);
  EXPECT_GT(container.manifest.quality.psnr_overall_db, 20);
}

}  // namespace
}  // namespace patina
