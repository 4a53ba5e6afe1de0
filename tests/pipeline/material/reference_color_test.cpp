// Colours on their way into the reference: who says what they are, and how they are learned.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "pipeline/color/color.h"
#include "pipeline/image/image_io.h"
#include "pipeline/material/reference.h"
#include "tests/pipeline/image/image_files.h"

namespace patina {
namespace {

using test::FileContent;
using test::Stored;
using test::TempFolder;
using testing::HasSubstr;

constexpr const char* kConfig = R"(ocio_profile_version: 2
roles:
  aces_interchange: ap0
file_rules:
  - !<Rule> {name: Albedo, colorspace: half, pattern: "*albedo*", extension: "*"}
  - !<Rule> {name: Default, colorspace: ap0}
displays:
  sRGB:
    - !<View> {name: Raw, colorspace: ap0}
colorspaces:
  - !<ColorSpace>
    name: ap0
  - !<ColorSpace>
    name: acescg
    from_scene_reference: !<BuiltinTransform> {style: ACEScg_to_ACES2065-1, direction: inverse}
  - !<ColorSpace>
    name: half
    to_scene_reference: !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}
  - !<ColorSpace>
    name: log
    to_scene_reference: !<LogTransform> {base: 10, direction: inverse}
)";

class ColorReference : public testing::Test {
 protected:
  // A gradient: r and g grow to the right, b downwards, up to `top`.
  void Add(const std::string& file, Stored stored, float top = 1, const Primaries* tag = nullptr) {
    FileContent content{8, 8, 3, stored, {}, 0, {}};
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) {
        content.values.push_back(top * static_cast<float>(x) / 7);
        content.values.push_back(top * static_cast<float>(x + 1) / 16);
        content.values.push_back(top * static_cast<float>(y + 2) / 9);
      }
    }
    values_ = content.values;
    if (tag != nullptr) {
      ASSERT_TRUE(WriteImage(folder_ / file, WriteFormat::kExrFloat, 8, 8, 3, values_.data(), tag));
    } else {
      test::WriteWithLibrary(folder_ / file, content);
    }
  }
  void List(const std::string& role, const std::string& file, const std::string& space = "auto") {
    MapRequest request;
    request.role = role;
    request.file = file;
    request.color_space = space;
    requests_.push_back(request);
  }
  void UseConfig() {
    std::ofstream(folder_ / "config.ocio") << kConfig;
    auto config = ColorConfig::Load(folder_ / "config.ocio");
    ASSERT_TRUE(config) << config.error().message;
    options_.color.config = *config;
  }
  Result<SourceReference> Build(int threads = 2) {
    ThreadPool pool(threads);
    auto listed = ResolveMaps(requests_, folder_.path(), "set");
    if (!listed) return Fail(listed.error());
    return BuildReference(*listed, options_, pool, NoProgress());
  }
  SourceReference MustBuild(int threads = 2) {
    auto built = Build(threads);
    EXPECT_TRUE(built) << (built ? "" : built.error().message);
    return built ? std::move(*built) : SourceReference();
  }
  // Physical value of component c of map 0 at (x, y).
  static double Physical(const SourceReference& reference, int x, int y, int c) {
    const TargetChannel& channel = reference.material.channels[c];
    const double coded = static_cast<double>(
        channel.constant ? channel.constant_value
                         : reference.material.pyramid.levels[0].At(x, y, channel.learned_index));
    const double scale = static_cast<double>(channel.scale);
    switch (channel.encoding) {
      case Encoding::kSrgb:
        return SrgbToLinear(coded);
      case Encoding::kSignedLog:
        return SignedLogToLinear(coded, scale);
      default:
        return coded * scale;
    }
  }
  // What map 0 must hold if its values are linear with those primaries.
  void ExpectConverted(const SourceReference& reference, const Primaries& from, const Primaries& to,
                       double tolerance) const {
    const Matrix3 m = *ConversionMatrix(from, to);
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) {
        const float* in = &values_[3 * (8 * y + x)];
        for (int c = 0; c < 3; ++c) {
          const double wanted = m[3 * c] * static_cast<double>(in[0]) +
                                m[3 * c + 1] * static_cast<double>(in[1]) +
                                m[3 * c + 2] * static_cast<double>(in[2]);
          ASSERT_NEAR(Physical(reference, x, y, c), wanted, tolerance) << x << " " << y << " " << c;
        }
      }
    }
  }

  TempFolder folder_;
  std::vector<MapRequest> requests_;
  std::vector<float> values_;
  ReferenceOptions options_;
};

TEST_F(ColorReference, AcesCgComesToRec709ByTheMatrixOfThePrimaries) {
  Add("a.exr", Stored::kFloat);
  List("albedo", "a.exr", "ACEScg");
  const SourceReference reference = MustBuild();
  ExpectConverted(reference, kAp1Primaries, kRec709Primaries, 2e-6);
  EXPECT_EQ(reference.maps[0].color_space, "ACEScg");
  EXPECT_EQ(reference.maps[0].color_rule, "list");
  EXPECT_TRUE(reference.maps[0].converted);
  // Out of gamut is kept.
  EXPECT_LT(reference.material.channels[0].min_value, -0.01f);
}

TEST_F(ColorReference, SrgbComesToAcesCgAndIsLearnedCoded) {
  Add("a.png", Stored::kUint16);
  List("albedo", "a.png");
  options_.color.working = WorkingSpace::kAcesCg;
  const SourceReference reference = MustBuild();
  for (float& value : values_)
    value =
        static_cast<float>(SrgbToLinear(std::round(static_cast<double>(value) * 65535) / 65535));
  ExpectConverted(reference, kRec709Primaries, kAp1Primaries, 2e-6);
  EXPECT_EQ(reference.material.channels[0].encoding, Encoding::kSrgb);
  EXPECT_EQ(reference.maps[0].color_space, "sRGB");
}

TEST_F(ColorReference, CodesBelowTheToeAreLearnedLinear) {
  // A saturated P3 green is negative in Rec.709, and decoders do not mirror the curve.
  test::WriteWithLibrary(folder_ / "a.png", test::Noise(8, 8, 3, Stored::kUint8));
  FileContent green = test::Flat(8, 8, {0.0f, 1.0f, 0.0f});
  green.values[0] = 1;
  test::WriteWithLibrary(folder_ / "g.png", green);
  UseConfig();
  List("albedo", "g.png", "log");
  const SourceReference logs = MustBuild();
  EXPECT_EQ(logs.material.channels[0].encoding, Encoding::kLinear);
  EXPECT_LT(logs.material.channels[0].min_value, 0);
}

TEST_F(ColorReference, TagsOfExrAreFollowedUnlessSomebodySaysOtherwise) {
  Add("a.exr", Stored::kFloat, 1, &kAp1Primaries);
  List("albedo", "a.exr");
  SourceReference reference = MustBuild();
  ExpectConverted(reference, kAp1Primaries, kRec709Primaries, 2e-6);
  EXPECT_EQ(reference.maps[0].color_space, "ACEScg");
  EXPECT_EQ(reference.maps[0].color_rule, "tag");
  // In the working space of the file nothing is done at all.
  options_.color.working = WorkingSpace::kAcesCg;
  reference = MustBuild();
  ExpectConverted(reference, kAp1Primaries, kAp1Primaries, 1e-7);
  EXPECT_FALSE(reference.maps[0].converted);
}

TEST_F(ColorReference, TheFirstRuleThatSaysAnythingCounts) {
  UseConfig();
  Add("wall_albedo.exr", Stored::kFloat, 1, &kAp1Primaries);
  const auto rule = [&] {
    const SourceReference reference = MustBuild();
    return reference.maps.empty()
               ? ""
               : reference.maps[0].color_rule + " " + reference.maps[0].color_space;
  };
  List("albedo", "wall_albedo.exr", "raw");
  options_.color.space = "linear";
  EXPECT_EQ(rule(), "list raw");
  requests_[0].color_space = "auto";
  EXPECT_EQ(rule(), "option lin_rec709");
  options_.color.space = "auto";
  EXPECT_EQ(rule(), "tag ACEScg");
  Add("wall_albedo.exr", Stored::kFloat);
  EXPECT_EQ(rule(), "file_rule half");
  Add("wall_base.exr", Stored::kFloat);
  requests_[0].file = "wall_base.exr";
  EXPECT_EQ(rule(), "default lin_rec709");
  Add("wall_base.png", Stored::kUint8);
  requests_[0].file = "wall_base.png";
  EXPECT_EQ(rule(), "default sRGB");
}

TEST_F(ColorReference, AWordInTheNameGoesBeforeTheTag) {
  Add("wall_albedo_linear.png", Stored::kUint8);
  auto sets = FindMaps(folder_.path());
  ASSERT_TRUE(sets);
  ThreadPool pool(1);
  auto reference = BuildReference(sets->front(), options_, pool, NoProgress());
  ASSERT_TRUE(reference) << reference.error().message;
  EXPECT_EQ(reference->maps[0].color_rule, "name");
  EXPECT_EQ(reference->maps[0].color_space, "lin_rec709");
  options_.color.space = "srgb";
  reference = BuildReference(sets->front(), options_, pool, NoProgress());
  ASSERT_TRUE(reference);
  EXPECT_EQ(reference->maps[0].color_rule, "option");
}

TEST_F(ColorReference, DataIsNeverConverted) {
  for (const char* file : {"n.png", "r.png", "d.exr"}) {
    const bool exr = std::string(file) == "d.exr";
    Add(file, exr ? Stored::kFloat : Stored::kUint8, 1, exr ? &kAp0Primaries : nullptr);
  }
  List("normal", "n.png");
  List("roughness", "r.png");
  List("displacement", "d.exr");
  const SourceReference plain = MustBuild();
  options_.color.working = WorkingSpace::kAcesCg;
  options_.color.space = "ACES2065-1";
  const SourceReference other = MustBuild();
  ASSERT_EQ(plain.material.pyramid.levels.size(), other.material.pyramid.levels.size());
  for (size_t i = 0; i < plain.material.pyramid.levels.size(); ++i) {
    const TargetLevel& a = plain.material.pyramid.levels[i];
    const TargetLevel& b = other.material.pyramid.levels[i];
    EXPECT_EQ(
        std::memcmp(a.data.data(), b.data.data(),
                    sizeof(float) * static_cast<size_t>(a.height) * a.row_blocks * a.channels * 16),
        0);
  }
  for (const ReferenceMap& map : other.maps) EXPECT_EQ(map.color_space + map.color_rule, "");
}

TEST_F(ColorReference, ErrorsPointAtTheFieldOfTheJob) {
  Add("a.png", Stored::kUint8);
  List("albedo", "a.png");
  List("roughness", "a.png", "ACEScg");
  auto built = Build();
  ASSERT_FALSE(built);
  EXPECT_EQ(built.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(built.error().message, HasSubstr("/maps/1/color_space: roughness is data"));
  requests_.pop_back();
  requests_[0].color_space = "ACEScc";
  built = Build();
  ASSERT_FALSE(built);
  EXPECT_THAT(built.error().message, HasSubstr("/maps/0/color_space: \"ACEScc\""));
  EXPECT_THAT(built.error().message, HasSubstr("nearest names are ACEScg"));
  requests_[0].color_space = "auto";
  options_.color.space = "nowhere";
  built = Build();
  ASSERT_FALSE(built);
  EXPECT_THAT(built.error().message, HasSubstr("/color_space: \"nowhere\""));
}

TEST_F(ColorReference, AConversionBeyondFloatsIsRefused) {
  UseConfig();
  Add("a.exr", Stored::kFloat, 400);
  List("emissive", "a.exr", "log");  // 10^400
  const auto built = Build();
  ASSERT_FALSE(built);
  EXPECT_EQ(built.error().code, ErrorCode::kCorruptData);
  EXPECT_THAT(built.error().message, HasSubstr("\"log\""));
}

TEST_F(ColorReference, IsTheSameForAnyNumberOfThreads) {
  FileContent content = test::Noise(67, 45, 3, Stored::kFloat, 5);
  content.values[300] = 9e4f;
  content.values[301] = -50;
  test::WriteWithLibrary(folder_ / "a.exr", content);
  List("emissive", "a.exr", "ACEScg");
  const SourceReference one = MustBuild(1), two = MustBuild(2);
  EXPECT_EQ(one.material.channels[0].encoding, Encoding::kSignedLog);
  for (size_t i = 0; i < one.material.pyramid.levels.size(); ++i) {
    const TargetLevel& a = one.material.pyramid.levels[i];
    const TargetLevel& b = two.material.pyramid.levels[i];
    EXPECT_EQ(
        std::memcmp(a.data.data(), b.data.data(),
                    sizeof(float) * static_cast<size_t>(a.height) * a.row_blocks * a.channels * 16),
        0)
        << i;
  }
}

class HdrReference : public ColorReference {
 protected:
  // Ordinary values around 0.5, and one texel of `peak`.
  void AddPeak(float peak, Stored stored = Stored::kFloat) {
    FileContent content = test::Noise(16, 16, 3, stored, 3);
    for (float& value : content.values) value = 0.25f + 0.5f * value;
    content.values[3 * 77] = peak;
    content.values[3 * 77 + 1] = -peak / 2;
    values_ = content.values;
    test::WriteWithLibrary(folder_ / "e.exr", content);
    requests_.clear();
    List("emissive", "e.exr");
  }
};

TEST_F(HdrReference, LargeRangesAreLearnedAsLogarithms) {
  AddPeak(1e5f);
  const SourceReference reference = MustBuild();
  const TargetChannel& red = reference.material.channels[0];
  EXPECT_EQ(red.encoding, Encoding::kSignedLog);
  EXPECT_EQ(red.scale, 0.25f);  // the power of two at the median
  EXPECT_NEAR(red.max_value, std::log2(1 + 1e5 / 0.25), 1e-4);
  EXPECT_EQ(CodedPeak(red), red.max_value);
  for (int i = 0; i < 256; ++i) {
    for (int c = 0; c < 3; ++c) {
      const double value = static_cast<double>(values_[3 * i + c]);
      // A float of 18 has a unit of 2e-6, which is as much of the value.
      ASSERT_NEAR(Physical(reference, i % 16, i / 16, c), value, 2e-6 * (std::fabs(value) + 0.25));
    }
  }
}

TEST_F(HdrReference, MipsAreMeansOfLight) {
  AddPeak(1e5f);
  const SourceReference reference = MustBuild();
  double sum = 0;
  for (size_t i = 0; i < values_.size(); i += 3) sum += static_cast<double>(values_[i]);
  const TargetLevel& last = reference.material.pyramid.levels.back();
  EXPECT_NEAR(SignedLogToLinear(static_cast<double>(last.At(0, 0, 0)), 0.25), sum / 256,
              1e-5 * sum / 256);
}

TEST_F(HdrReference, OrdinaryFloatsStayAsTheyWere) {
  for (const float peak : {0.9f, 3.9f, 20.0f}) {
    AddPeak(peak);
    EXPECT_EQ(MustBuild().material.channels[0].encoding, Encoding::kLinear) << peak;
  }
  // Integers never are, whatever their range.
  Add("a.png", Stored::kUint16);
  requests_.clear();
  List("emissive", "a.png", "linear");
  EXPECT_EQ(MustBuild().material.channels[0].encoding, Encoding::kLinear);
}

TEST_F(HdrReference, ExtremesOfHalfAndFloatHold) {
  for (const float peak : {65504.0f, 3e38f}) {
    AddPeak(peak, peak > 65504 ? Stored::kFloat : Stored::kHalf);
    const SourceReference reference = MustBuild();
    const TargetChannel& red = reference.material.channels[0];
    ASSERT_EQ(red.encoding, Encoding::kSignedLog);
    EXPECT_TRUE(std::isfinite(red.max_value));
    EXPECT_NEAR(
        SignedLogToLinear(static_cast<double>(red.max_value), static_cast<double>(red.scale)) /
            static_cast<double>(peak),
        1, 2e-5);
  }
}

TEST(SignedLog, RoundTripsEveryMagnitude) {
  for (const float scale : {0x1p-100f, 0.25f, 1.0f, 0x1p40f}) {
    for (double x = 1e-10; x < 1e10; x *= 1.7) {
      for (const double sign : {-1.0, 1.0}) {
        const auto in = static_cast<float>(sign * x);
        float coded = 0;
        SignedLogRow(&in, 1, scale, &coded);
        const double back =
            SignedLogToLinear(static_cast<double>(coded), static_cast<double>(scale));
        // A coded value of up to 256 has a unit of 3e-5.
        EXPECT_NEAR(back, static_cast<double>(in), 1.1e-5 * x + 1e-7 * static_cast<double>(scale));
      }
    }
  }
  float zero = -0.0f;
  SignedLogRow(&zero, 1, 1, &zero);
  EXPECT_EQ(zero, 0.0f);
}

}  // namespace
}  // namespace patina
