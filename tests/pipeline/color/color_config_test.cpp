#include "pipeline/color/color_config.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>

#include "pipeline/color/color.h"
#include "tests/formats/test_support.h"

namespace patina {
namespace {

// Values that a map may hold: dark, ordinary, beyond 1, out of gamut, and the largest half.
const std::vector<std::array<float, 3>>& Colors() {
  static const std::vector<std::array<float, 3>> colors{
      {0, 0, 0},
      {1, 1, 1},
      {0.18f, 0.18f, 0.18f},
      {1e-6f, 2e-5f, 3e-4f},
      {0.04f, 0.0405f, 0.081f},
      {0.9f, 0.05f, 0.3f},
      {-0.02f, 0.4f, 1.7f},
      {-3, 12, 400},
      {65504, 0.5f, 1},
      {65504, 65504, 65504},
  };
  return colors;
}

std::array<float, 3> Apply(const ColorTransformPtr& transform, std::array<float, 3> rgb) {
  transform->Apply(&rgb[0], &rgb[1], &rgb[2], 1);
  return rgb;
}

ConfigSpace SpaceOf(const ColorConfig& config, const std::string& name) {
  auto found = config.Find(name);
  EXPECT_TRUE(found) << name;
  return found ? *found : ConfigSpace{};
}

ColorTransformPtr To(const ColorConfig& config, const std::string& name, WorkingSpace working) {
  auto made = config.ToWorking(SpaceOf(config, name), working);
  EXPECT_TRUE(made) << (made ? "" : made.error().message);
  return made ? *made : nullptr;
}

ColorTransformPtr From(const ColorConfig& config, const std::string& name, WorkingSpace working) {
  auto made = config.FromWorking(SpaceOf(config, name), working);
  EXPECT_TRUE(made) << (made ? "" : made.error().message);
  return made ? *made : nullptr;
}

float Largest(const std::array<float, 3>& rgb) {
  return std::max({std::fabs(rgb[0]), std::fabs(rgb[1]), std::fabs(rgb[2])});
}

TEST(BuiltinConfig, ListsItsSpaces) {
  std::vector<std::string> names;
  for (const ConfigSpace& space : ColorConfig::Builtin().Spaces()) names.push_back(space.name);
  EXPECT_EQ(names, (std::vector<std::string>{"ACES2065-1", "ACEScg", "lin_rec709", "sRGB",
                                             "Rec.709", "raw"}));
  EXPECT_TRUE(SpaceOf(ColorConfig::Builtin(), "raw").is_data);
  EXPECT_EQ(SpaceOf(ColorConfig::Builtin(), "SRGB_Texture").name, "sRGB");
}

TEST(BuiltinConfig, ComesBackFromEverySpace) {
  const ColorConfig config = ColorConfig::Builtin();
  for (const WorkingSpace working : {WorkingSpace::kLinearRec709, WorkingSpace::kAcesCg}) {
    for (const ConfigSpace& space : config.Spaces()) {
      if (space.is_data) continue;
      const ColorTransformPtr to = To(config, space.name, working);
      const ColorTransformPtr from = From(config, space.name, working);
      for (const std::array<float, 3>& color : Colors()) {
        if (space.name == "sRGB" || space.name == "Rec.709") {
          // Codes as large as a linear value may be stand for more than a float holds.
          if (Largest(color) > 20) continue;
        }
        const std::array<float, 3> back = Apply(from, Apply(to, color));
        // 1e-5 of the colour: matrices carry rounding from the largest component to the others.
        const float bound = 1e-5f * std::max(1e-2f, Largest(color));
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(back[c], color[c], bound) << space.name << " " << WorkingSpaceName(working);
      }
    }
  }
}

TEST(BuiltinConfig, BringsEvery8BitCodeBackToItself) {
  const ColorConfig config = ColorConfig::Builtin();
  for (const WorkingSpace working : {WorkingSpace::kLinearRec709, WorkingSpace::kAcesCg}) {
    const ColorTransformPtr to = To(config, "sRGB", working);
    const ColorTransformPtr from = From(config, "sRGB", working);
    for (int code = 0; code < 256; ++code) {
      const std::array<float, 3> in{static_cast<float>(code) / 255,
                                    static_cast<float>(255 - code) / 255, 0.6f};
      const std::array<float, 3> back = Apply(from, Apply(to, in));
      for (int c = 0; c < 3; ++c)
        EXPECT_EQ(std::lround(back[c] * 255), std::lround(in[c] * 255)) << code;
    }
  }
}

// Solves for the matrix in another way than the code does: from the XYZ of primaries and white.
TEST(BuiltinConfig, AcesCgAgreesWithTheMatrixOfThePrimaries) {
  const ColorConfig config = ColorConfig::Builtin();
  const ColorTransformPtr to = To(config, "ACEScg", WorkingSpace::kLinearRec709);
  // Published to six digits by the Academy and by colour-science, Bradford.
  const double published[9] = {1.70505,  -0.62179, -0.08326, -0.13026, 1.14080,
                               -0.01055, -0.02400, -0.12897, 1.15297};
  // And derived: a space's white is its (1, 1, 1), so after adaptation white stays white.
  const std::array<float, 3> white = Apply(to, {1, 1, 1});
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(white[c], 1, 1e-6);
  const Matrix3 derived = *ConversionMatrix(kAp1Primaries, kRec709Primaries);
  for (int j = 0; j < 3; ++j) {
    std::array<float, 3> unit{};
    unit[j] = 1;
    const std::array<float, 3> got = Apply(to, unit);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(got[i], published[3 * i + j], 6e-6);
      EXPECT_NEAR(got[i], derived[3 * i + j], 2e-7);
    }
  }
}

TEST(BuiltinConfig, PrimariesKeepTheirChromaticitiesWithoutAdaptation) {
  // Same white, so no adaptation: the XYZ of each primary must be on its chromaticity.
  const Matrix3 xyz = *RgbToXyz(kAp1Primaries);
  const Chromaticity expected[3] = {kAp1Primaries.red, kAp1Primaries.green, kAp1Primaries.blue};
  for (int j = 0; j < 3; ++j) {
    const double sum = xyz[j] + xyz[3 + j] + xyz[6 + j];
    EXPECT_NEAR(xyz[j] / sum, expected[j].x, 1e-12);
    EXPECT_NEAR(xyz[3 + j] / sum, expected[j].y, 1e-12);
  }
  EXPECT_NEAR(xyz[3] + xyz[4] + xyz[5], 1, 1e-12);
}

TEST(BuiltinConfig, CurvesAreExactInTheToe) {
  const ColorConfig config = ColorConfig::Builtin();
  const ColorTransformPtr srgb = To(config, "sRGB", WorkingSpace::kLinearRec709);
  const ColorTransformPtr rec709 = To(config, "Rec.709", WorkingSpace::kLinearRec709);
  for (int i = 1; i <= 400; ++i) {
    const float code = 0.0404f * static_cast<float>(i) / 400;
    // Grey, so that the two matrices, each other's inverse in double, add nothing but rounding.
    EXPECT_NEAR(Apply(srgb, {code, code, code})[1] / (code / 12.92f), 1, 2e-6) << code;
    const float camera = 0.0812f * static_cast<float>(i) / 400;
    EXPECT_NEAR(Apply(rec709, {camera, camera, camera})[1] / (camera / 4.5f), 1, 2e-6) << camera;
  }
}

TEST(BuiltinConfig, CurvesAreThePublishedOnes) {
  const ColorConfig config = ColorConfig::Builtin();
  const ColorTransformPtr srgb = To(config, "sRGB", WorkingSpace::kLinearRec709);
  const ColorTransformPtr rec709 = To(config, "Rec.709", WorkingSpace::kLinearRec709);
  for (int i = 1; i <= 1000; ++i) {
    const float x = 2.0f * static_cast<float>(i) / 1000;
    const double linear = SrgbToLinear(static_cast<double>(x));
    EXPECT_NEAR(Apply(srgb, {x, x, x})[0] / linear, 1, 5e-6) << x;
    EXPECT_NEAR(Apply(rec709, {x, x, x})[2] / Rec709ToLinear(static_cast<double>(x)), 1, 5e-6) << x;
    // Both curves are odd.
    EXPECT_NEAR(Apply(srgb, {-x, -x, -x})[0] / -linear, 1, 5e-6) << x;
  }
  // BT.709 rounds its constants to 1.099 and 0.018.
  EXPECT_NEAR(Rec709ToLinear(0.5), std::pow((0.5 + 0.099) / 1.099, 1 / 0.45), 2e-4);
  EXPECT_NEAR(LinearToRec709(0.018053968510807), 4.5 * 0.018053968510807, 1e-12);
}

TEST(ColorTransform, NonFinitePixelsBecomeNaN) {
  const float inf = std::numeric_limits<float>::infinity();
  for (const char* name : {"sRGB", "ACEScg"}) {
    const ColorTransformPtr to = To(ColorConfig::Builtin(), name, WorkingSpace::kLinearRec709);
    for (const float bad : {NAN, inf, -inf}) {
      float r[3] = {0.5f, bad, 0.5f}, g[3] = {0.5f, 0.1f, 0.5f}, b[3] = {0.5f, 0.2f, 0.5f};
      to->Apply(r, g, b, 3);
      EXPECT_TRUE(std::isnan(r[1]) && std::isnan(g[1]) && std::isnan(b[1])) << name << bad;
      EXPECT_TRUE(std::isfinite(r[0]));
      EXPECT_EQ(r[0], r[2]);
    }
  }
}

TEST(ColorTransform, APixelGivesTheSameBitsInAnyRow) {
  const ColorTransformPtr to = To(ColorConfig::Builtin(), "Rec.709", WorkingSpace::kAcesCg);
  std::vector<float> r, g, b;
  for (int i = 0; i < 2500; ++i) {
    r.push_back(static_cast<float>(i) / 1500);
    g.push_back(static_cast<float>(i % 97) / 97 - 0.1f);
    b.push_back(static_cast<float>(i % 13));
  }
  std::vector<float> rr = r, gg = g, bb = b;
  to->Apply(rr.data(), gg.data(), bb.data(), rr.size());
  for (size_t i = 0; i < r.size(); i += 7) {
    const std::array<float, 3> one = Apply(to, {r[i], g[i], b[i]});
    EXPECT_EQ(one, (std::array<float, 3>{rr[i], gg[i], bb[i]})) << i;
  }
}

TEST(ColorTransform, TagsOfP3AndGammaAreFollowed) {
  // Display P3: primaries of DCI-P3, white D65.
  const Primaries p3{{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.3127, 0.3290}};
  const ColorTransformPtr transform = TransformFromTag(SrgbCurve(), p3, kRec709Primaries);
  ASSERT_NE(transform, nullptr);
  const std::array<float, 3> red = Apply(transform, {1, 0, 0});
  EXPECT_NEAR(red[0], 1.22494, 1e-4);
  EXPECT_NEAR(red[1], -0.04206, 1e-4);
  EXPECT_NEAR(red[2], -0.01964, 1e-4);
  const ColorTransformPtr power =
      TransformFromTag(PowerCurve(1.8), kRec709Primaries, kRec709Primaries);
  EXPECT_NEAR(Apply(power, {0.5f, 0, 2})[0], std::pow(0.5, 1.8), 1e-6);
  EXPECT_NEAR(Apply(power, {0.5f, -0.5f, 2})[1], -std::pow(0.5, 1.8), 1e-6);
  EXPECT_NEAR(Apply(power, {0.5f, -0.5f, 2})[2], std::pow(2, 1.8), 1e-5);
}

TEST(ColorTransform, PrimariesOnALineGiveNone) {
  const Primaries line{{0.1, 0.1}, {0.2, 0.2}, {0.3, 0.3}, {0.3127, 0.3290}};
  EXPECT_EQ(TransformFromTag(TransferCurve(), line, kRec709Primaries), nullptr);
  const Primaries black{{0.64, 0.33}, {0.3, 0.6}, {0.15, 0.06}, {0.3, 0}};
  EXPECT_EQ(TransformFromTag(TransferCurve(), black, kRec709Primaries), nullptr);
  const Primaries nan{{NAN, 0.33}, {0.3, 0.6}, {0.15, 0.06}, {0.3127, 0.3290}};
  EXPECT_EQ(TransformFromTag(TransferCurve(), nan, kRec709Primaries), nullptr);
}

// A configuration of a user: log space by a table, a file rule, aces_interchange.
constexpr const char* kUserConfig = R"(ocio_profile_version: 2
search_path: luts
roles:
  aces_interchange: ap0
  scene_linear: lin709
file_rules:
  - !<Rule> {name: Plates, colorspace: gamma2, pattern: "*plate*", extension: "*"}
  - !<Rule> {name: Default, colorspace: lin709}
displays:
  sRGB:
    - !<View> {name: Raw, colorspace: gamma2}
colorspaces:
  - !<ColorSpace>
    name: ap0
  - !<ColorSpace>
    name: lin709
    aliases: [scene_709]
    to_scene_reference: !<MatrixTransform> {matrix: [0.4396, 0.3830, 0.1774, 0, 0.0898, 0.8134, 0.0968, 0, 0.0175, 0.1115, 0.8709, 0, 0, 0, 0, 1]}
  - !<ColorSpace>
    name: gamma2
    to_scene_reference: !<GroupTransform>
      children:
        - !<FileTransform> {src: square.spi1d, interpolation: linear}
        - !<ColorSpaceTransform> {src: lin709, dst: ap0}
  - !<ColorSpace>
    name: Utility
    isdata: true
)";

std::string Table(double power) {
  std::string text = "Version 1\nFrom 0.0 1.0\nLength 257\nComponents 1\n{\n";
  for (int i = 0; i <= 256; ++i) text += std::to_string(std::pow(i / 256.0, power)) + "\n";
  return text + "}\n";
}

class UserConfig : public testing::Test {
 protected:
  void Write(const std::string& name, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  std::string Path(const std::string& name) const { return folder_ / name; }
  void WriteAll(const std::string& config = kUserConfig, double power = 2) {
    Write("config.ocio", config);
    Write("luts/square.spi1d", Table(power));
  }
  Error ErrorOf(const std::string& name) const {
    auto loaded = ColorConfig::Load(Path(name));
    EXPECT_FALSE(loaded) << name;
    return loaded ? Error{} : loaded.error();
  }
  test::TemporaryDirectory folder_;
};

TEST_F(UserConfig, ConvertsByItsTables) {
  WriteAll();
  auto config = ColorConfig::Load(Path("config.ocio"));
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->source(), ConfigSource::kFile);
  // lin709 itself is found as the working space, so nothing is lost to its short matrix.
  const ColorTransformPtr to = To(*config, "gamma2", WorkingSpace::kLinearRec709);
  const std::array<float, 3> got = Apply(to, {0.5f, 0.25f, 1});
  EXPECT_NEAR(got[0], 0.25, 2e-4);
  EXPECT_NEAR(got[1], 0.0625, 2e-4);
  EXPECT_NEAR(got[2], 1, 2e-4);
  const std::array<float, 3> same =
      Apply(To(*config, "scene_709", WorkingSpace::kLinearRec709), {0.7f, 0.1f, -0.2f});
  EXPECT_NEAR(same[0], 0.7, 1e-6);
  EXPECT_NEAR(same[2], -0.2, 1e-6);
  // ACEScg is not in it: through aces_interchange and our matrix.
  const std::array<float, 3> aces = Apply(To(*config, "lin709", WorkingSpace::kAcesCg), {1, 1, 1});
  for (const float c : aces) EXPECT_NEAR(c, 1, 1e-3);
}

TEST_F(UserConfig, FileRulesOtherThanTheDefaultOneCount) {
  WriteAll();
  auto config = ColorConfig::Load(Path("config.ocio"));
  ASSERT_TRUE(config);
  const auto plate = config->FileRule("/a/b/wall_plate_albedo.png");
  ASSERT_TRUE(plate);
  EXPECT_EQ(plate->name, "gamma2");
  EXPECT_FALSE(config->FileRule("/a/b/wall_albedo.png"));
  EXPECT_FALSE(ColorConfig::Builtin().FileRule("/a/b/sRGB_plate.png"));
}

TEST_F(UserConfig, UnknownSpacesNameTheNearest) {
  WriteAll();
  auto config = ColorConfig::Load(Path("config.ocio"));
  ASSERT_TRUE(config);
  auto found = config->Find("gama2");
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(found.error().message.find("\"gama2\""), std::string::npos);
  EXPECT_NE(found.error().message.find("nearest names are gamma2"), std::string::npos)
      << found.error().message;
  EXPECT_FALSE(config->Find(""));
  EXPECT_FALSE(config->Find(std::string("gamma2\0x", 8)));
  EXPECT_FALSE(config->Find(std::string(100000, 'g')));
}

TEST_F(UserConfig, TheHashCoversTextAndTables) {
  WriteAll();
  const auto hash = [&] {
    auto config = ColorConfig::Load(Path("config.ocio"));
    return config ? config->sha256() : config.error().message;
  };
  const std::string first = hash();
  EXPECT_EQ(first.size(), 64u);
  EXPECT_EQ(first, hash());
  Write("luts/square.spi1d", Table(2.0));  // same content, other time
  EXPECT_EQ(first, hash());
  Write("luts/square.spi1d", Table(2.1));
  const std::string other_table = hash();
  EXPECT_NE(first, other_table);
  std::filesystem::remove(folder_ / "luts/square.spi1d");
  const std::string no_table = hash();
  EXPECT_NE(no_table, other_table);
  EXPECT_NE(no_table, first);
  WriteAll(std::string(kUserConfig) + "# a word\n");
  EXPECT_NE(first, hash());
  EXPECT_NE(ColorConfig::Builtin().sha256(), first);
}

TEST_F(UserConfig, AMissingTableIsAnErrorOfTheSpaceThatNeedsIt) {
  WriteAll();
  std::filesystem::remove(folder_ / "luts/square.spi1d");
  auto config = ColorConfig::Load(Path("config.ocio"));
  ASSERT_TRUE(config);
  EXPECT_TRUE(config->ToWorking(SpaceOf(*config, "lin709"), WorkingSpace::kLinearRec709));
  auto made = config->ToWorking(SpaceOf(*config, "gamma2"), WorkingSpace::kLinearRec709);
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kCorruptData);
  EXPECT_NE(made.error().message.find("square.spi1d"), std::string::npos) << made.error().message;
}

TEST_F(UserConfig, ATableThatIsNoRegularFileIsRefused) {
  WriteAll();
  std::filesystem::remove(folder_ / "luts/square.spi1d");
  std::filesystem::create_symlink("/dev/zero", folder_ / "luts/square.spi1d");
  EXPECT_EQ(ErrorOf("config.ocio").code, ErrorCode::kCorruptData);
}

TEST_F(UserConfig, WithoutAnInterchangeItNeedsAKnownName) {
  std::string text = kUserConfig;
  text.replace(text.find("  aces_interchange: ap0\n"), 24, "");
  WriteAll(text);
  auto config = ColorConfig::Load(Path("config.ocio"));
  ASSERT_TRUE(config) << config.error().message;
  auto made = config->ToWorking(SpaceOf(*config, "gamma2"), WorkingSpace::kLinearRec709);
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(made.error().message.find("aces_interchange"), std::string::npos);
  text.replace(text.find("[scene_709]"), 11, "[lin_rec709]");
  WriteAll(text);
  config = ColorConfig::Load(Path("config.ocio"));
  ASSERT_TRUE(config);
  EXPECT_TRUE(config->ToWorking(SpaceOf(*config, "gamma2"), WorkingSpace::kLinearRec709));
}

TEST_F(UserConfig, WrongFilesAreRefused) {
  EXPECT_EQ(ErrorOf("absent.ocio").code, ErrorCode::kNotFound);
  EXPECT_NE(ErrorOf("absent.ocio").message.find(Path("absent.ocio")), std::string::npos);
  std::filesystem::create_directory(folder_ / "folder.ocio");
  EXPECT_EQ(ErrorOf("folder.ocio").code, ErrorCode::kInvalidArgument);
  Write("empty.ocio", "");
  Write("text.ocio", "hello, this is no configuration\n");
  Write("later.ocio", "ocio_profile_version: 99\n");
  Write("bare.ocio", "ocio_profile_version: 2\n");
  Write("nested.ocio", std::string(100000, '['));
  Write("binary.ocio", std::string("\0\xff\xfe\x00PK\x03\x04", 8));
  for (const char* name :
       {"empty.ocio", "text.ocio", "later.ocio", "bare.ocio", "nested.ocio", "binary.ocio"}) {
    const Error error = ErrorOf(name);
    EXPECT_EQ(error.code, ErrorCode::kCorruptData) << name << ": " << error.message;
    EXPECT_NE(error.message.find(Path(name)), std::string::npos) << error.message;
    EXPECT_EQ(error.message.find('\n'), std::string::npos) << error.message;
  }
}

// Whatever is cut off: an error, or a configuration whose spaces convert or say why not.
TEST_F(UserConfig, EveryTruncationIsAnErrorOrAConfiguration) {
  Write("luts/square.spi1d", Table(2));
  const std::string whole = kUserConfig;
  int refused = 0;
  for (size_t size = 0; size < whole.size(); size += 3) {
    Write("config.ocio", whole.substr(0, size));
    auto config = ColorConfig::Load(Path("config.ocio"));
    if (!config) {
      ++refused;
      continue;
    }
    for (const ConfigSpace& space : config->Spaces()) {
      auto made = config->ToWorking(space, WorkingSpace::kLinearRec709);
      EXPECT_TRUE(made || made.error().code != ErrorCode::kInternal);
    }
  }
  EXPECT_GT(refused, 10);
}

TEST_F(UserConfig, TheEnvironmentNamesOneUnlessAFileDoes) {
  WriteAll();
  Write("other.ocio", std::string(kUserConfig) + "# other\n");
  ::setenv("OCIO", Path("config.ocio").c_str(), 1);
  auto from_environment = ColorConfig::Load("");
  auto from_file = ColorConfig::Load(Path("other.ocio"));
  ::setenv("OCIO", Path("absent.ocio").c_str(), 1);
  auto wrong = ColorConfig::Load("");
  ::setenv("OCIO", "", 1);
  auto empty = ColorConfig::Load("");
  ::unsetenv("OCIO");
  ASSERT_TRUE(from_environment && from_file && empty);
  EXPECT_EQ(from_environment->source(), ConfigSource::kEnvironment);
  EXPECT_EQ(from_file->source(), ConfigSource::kFile);
  EXPECT_EQ(empty->source(), ConfigSource::kBuiltin);
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().message.find("$OCIO"), std::string::npos);
}

TEST(BlenderConfig, ConvertsAndComesBack) {
  const std::string path = "/usr/share/blender/datafiles/colormanagement/config.ocio";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "blender-data is not installed";
  auto config = ColorConfig::Load(path);
  ASSERT_TRUE(config) << config.error().message;
  // Its scene_linear is Rec.709: found as the working space, and so converted to itself.
  const std::array<float, 3> same =
      Apply(To(*config, "Linear", WorkingSpace::kLinearRec709), {0.3f, 40, -1});
  EXPECT_NEAR(same[0], 0.3, 1e-6);
  EXPECT_NEAR(same[1], 40, 1e-5);
  // Its sRGB is a table of 65536 entries.
  const ColorTransformPtr srgb = To(*config, "sRGB", WorkingSpace::kLinearRec709);
  for (int code = 0; code < 256; ++code) {
    const float x = static_cast<float>(code) / 255;
    EXPECT_NEAR(Apply(srgb, {x, x, x})[1], SrgbToLinear(static_cast<double>(x)), 2e-5) << code;
  }
  for (const char* name : {"sRGB", "Linear ACEScg", "Linear ACES", "XYZ"}) {
    for (const WorkingSpace working : {WorkingSpace::kLinearRec709, WorkingSpace::kAcesCg}) {
      const std::array<float, 3> in{0.2f, 0.5f, 0.7f};
      const std::array<float, 3> back =
          Apply(From(*config, name, working), Apply(To(*config, name, working), in));
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(back[c], in[c], 5e-5) << name;
    }
  }
  // 2.8e-4 off the Academy's matrix, so no nearer to ours than that.
  const std::array<float, 3> red =
      Apply(To(*config, "Linear ACEScg", WorkingSpace::kLinearRec709), {1, 0, 0});
  EXPECT_NEAR(red[0], 1.70505, 2e-3);
}

}  // namespace
}  // namespace patina
