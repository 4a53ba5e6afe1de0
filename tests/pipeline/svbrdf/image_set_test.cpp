// Lists of measured images: what they say, and that nothing that is wrong with them gets through.
#include "pipeline/svbrdf/image_set.h"

#include <gmock/gmock.h>

#include <cstring>
#include <limits>

#include "formats/schema_check.h"
#include "pipeline/svbrdf/texel_pool.h"
#include "tests/pipeline/svbrdf/set_files.h"

namespace patina::svbrdf {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing_support::ListOf;
using testing_support::WriteList;
using testing_support::WriteSet;

void Grey(int i, int x, int y, float rgb[3]) {
  rgb[0] = 0.1f * static_cast<float>(i + 1);
  rgb[1] = static_cast<float>(x);
  rgb[2] = static_cast<float>(y);
}

TEST(ImageSet, ReadsWhatTheListAndItsImagesSay) {
  test::TemporaryDirectory folder;
  json list = json::parse(std::ifstream(WriteSet(folder.path(), 3, 5, 2, Grey, "wrap")));
  list["values"] = "brdf_cosine";
  list["scale"] = 2;
  const auto set = ReadImageSet(WriteList(folder.path(), list));
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_EQ(set->width, 5);
  EXPECT_EQ(set->height, 2);
  EXPECT_EQ(set->address, AddressMode::kWrap);
  ASSERT_EQ(set->images.size(), 3u);
  EXPECT_EQ(set->images[1].file, "i1.exr");
  const auto image = ReadSetImage(*set, 1);
  ASSERT_TRUE(image) << image.error().message;
  const float factor = 2 / set->images[1].light.z;
  EXPECT_FLOAT_EQ(image->Row(0, 0)[0], 0.2f * factor);
  EXPECT_FLOAT_EQ(image->Row(1, 1)[4], 4 * factor);
  EXPECT_FLOAT_EQ(image->Row(2, 1)[4], factor);
}

TEST(ImageSet, RefusesListsWithPointerAndRemedy) {
  struct Bad {
    const char* pointer;  // of what is changed
    json value;           // null: it is taken away
    const char *said, *remedy;
  };
  const Bad cases[] = {
      {"/version", 2, "/version: 2", "reads 1"},
      {"/width", 0, "/width: 0", "within 1 to 4096"},
      {"/width", nullptr, "\"width\" is missing", "image-set.schema.json"},
      {"/address", "mirror", "/address: \"mirror\"", "\"clamp\""},
      {"/values", "radiance", "/values: \"radiance\"", "\"brdf_cosine\""},
      {"/scale", 0, "/scale: 0", "leave it out"},
      {"/scale", 1e300, "/scale", "too large"},
      {"/images", json::array(), "/images: is empty", "at least one"},
      {"/images/1/light", json({0, 0, -1}), "/images/1/light", "above the horizon"},
      {"/images/1/view", json({1, 0, 0}), "/images/1/view", "above the horizon"},
      {"/images/2/view", json({0, 0, 2}), "/images/2/view: (0, 0, 2) has length 2", "unit vector"},
      {"/images/2/view", json({0, 1}), "/images/2/view: 2 numbers", "x, y and z"},
      {"/images/2/view", json({0, 0, 0, 1}), "/images/2/view", "more than 3"},
      {"/images/0/light", "up", "/images/0/light", "instead of an array"},
      {"/images/1/file", "i0.exr", "/images/1/file: \"i0.exr\" is that of /images/0", "once"},
      {"/images/1/file", "../i1.exr", "/images/1/file", "below the folder"},
      {"/images/1/file", "/etc/passwd", "/images/1/file", "below the folder"},
      {"/images/1/file", "i7.exr", "/images/1/file: there is no file \"i7.exr\"", "take its entry"},
      {"/images/1/brightness", 3, "/images/1/brightness", "file, light, view"},
  };
  test::TemporaryDirectory folder;
  const json good = json::parse(std::ifstream(WriteSet(folder.path(), 3, 4, 4, Grey)));
  ASSERT_TRUE(ReadImageSet(WriteList(folder.path(), good)));
  for (const Bad& bad : cases) {
    json list = good;
    const json::json_pointer pointer(bad.pointer);
    if (bad.value.is_null()) {
      list[pointer.parent_pointer()].erase(pointer.back());
    } else {
      list[pointer] = bad.value;
    }
    const auto set = ReadImageSet(WriteList(folder.path(), list));
    ASSERT_FALSE(set) << bad.pointer << " " << bad.value;
    EXPECT_EQ(set.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(set.error().message,
                AllOf(HasSubstr("set.btf.json: "), HasSubstr(bad.said), HasSubstr(bad.remedy)));
  }
}

TEST(ImageSet, RefusesPairsOfDirectionsThatStandTwiceAndLinksThatLeadOut) {
  test::TemporaryDirectory folder, elsewhere;
  json list = json::parse(std::ifstream(WriteSet(folder.path(), 3, 4, 4, Grey)));
  json twice = list;
  twice["images"][2]["light"] = twice["images"][0]["light"];
  twice["images"][2]["view"] = twice["images"][0]["view"];
  auto set = ReadImageSet(WriteList(folder.path(), twice));
  ASSERT_FALSE(set);
  EXPECT_THAT(set.error().message, HasSubstr("/images/2: light and view are those of /images/0"));
  std::filesystem::rename(folder / "i1.exr", elsewhere / "i1.exr");
  std::filesystem::create_symlink(elsewhere / "i1.exr", folder / "i1.exr");
  set = ReadImageSet(WriteList(folder.path(), list));
  ASSERT_FALSE(set);
  EXPECT_THAT(set.error().message, HasSubstr("leads out of the folder"));
}

TEST(ImageSet, RefusesTextThatIsNoListAtEveryTruncation) {
  test::TemporaryDirectory folder;
  const std::string path = WriteSet(folder.path(), 1, 1, 1, Grey);
  std::string text;
  {
    std::ifstream file(path);
    text.assign(std::istreambuf_iterator<char>(file), {});
  }
  for (size_t length = 0; length < text.size(); ++length) {
    std::ofstream(path) << text.substr(0, length);
    EXPECT_FALSE(ReadImageSet(path)) << length;
  }
  std::ofstream(path) << text << "}";
  EXPECT_FALSE(ReadImageSet(path));
  std::ofstream(path) << "{\"version\": 1, \"version\": 1}";
  EXPECT_FALSE(ReadImageSet(path));
}

// What the schema refuses the reader refuses, and the other way round but for what no schema says.
TEST(ImageSet, AgreesWithItsSchema) {
  test::TemporaryDirectory folder;
  const json good = json::parse(std::ifstream(WriteSet(folder.path(), 2, 3, 3, Grey)));
  EXPECT_TRUE(CheckAgainstSchema("image-set", good));
  const std::pair<const char*, json> bad[] = {
      {"/version", 2},
      {"/width", 5000},
      {"/height", 1.5},
      {"/scale", -1},
      {"/address", "mirror"},
      {"/values", "x"},
      {"/images", json::array()},
      {"/images/0/light", json({0, 1})},
      {"/images/0/view", json({0, 0, "1"})},
      {"/images/0/extra", 1},
      {"/extra", 1},
  };
  for (const auto& [pointer, value] : bad) {
    json list = good;
    list[json::json_pointer(pointer)] = value;
    EXPECT_FALSE(CheckAgainstSchema("image-set", list)) << pointer;
    EXPECT_FALSE(ReadImageSet(WriteList(folder.path(), list))) << pointer;
  }
}

std::string ProblemOfImages(const std::string& list) {
  const auto set = ReadImageSet(list);
  EXPECT_TRUE(set) << set.error().message;
  TexelPoolOptions options;
  options.count = 100;
  ThreadPool pool(2);
  const auto drawn = DrawTexels(*set, options, pool);
  return drawn ? "" : drawn.error().message;
}

TEST(TexelPool, RefusesBadImagesWithTheirEntry) {
  test::TemporaryDirectory folder;
  const std::string list = WriteSet(folder.path(), 4, 4, 3, Grey);
  EXPECT_EQ(ProblemOfImages(list), "");
  std::vector<float> rgb(3 * 16, 0.5f);
  // The first in the list is named, whichever thread meets which.
  ASSERT_TRUE(WriteImage(folder / "i3.exr", WriteFormat::kExrHalf, 4, 4, 3, rgb.data()));
  ASSERT_TRUE(WriteImage(folder / "i2.exr", WriteFormat::kExrHalf, 2, 2, 3, rgb.data()));
  EXPECT_THAT(ProblemOfImages(list), AllOf(HasSubstr("/images/2/file: i2.exr: 2 x 2 pixels"),
                                           HasSubstr("bring all images to one size")));
  ASSERT_TRUE(WriteImage(folder / "i2.exr", WriteFormat::kExrHalf, 4, 3, 1, rgb.data()));
  EXPECT_THAT(ProblemOfImages(list), HasSubstr("/images/2/file: i2.exr: 1 channels"));
  std::filesystem::copy_file(folder / "i0.exr", folder / "i2.exr",
                             std::filesystem::copy_options::overwrite_existing);
  rgb[7] = std::numeric_limits<float>::quiet_NaN();
  ASSERT_TRUE(WriteImage(folder / "i1.exr", WriteFormat::kExrFloat, 4, 3, 3, rgb.data()));
  EXPECT_THAT(ProblemOfImages(list),
              AllOf(HasSubstr("/images/1/file: i1.exr: 1 samples are NaN or infinite, the first "
                              "at x 2, y 0, channel 1"),
                    HasSubstr("mend the pixels")));
  std::ofstream(folder / "i0.exr") << "no image";
  EXPECT_THAT(ProblemOfImages(list), HasSubstr("/images/0/file"));
}

TEST(TexelPool, Refuses8BitImages) {
  test::TemporaryDirectory folder;
  json list = ListOf(1, 4, 3);
  list["images"][0]["file"] = "a.png";
  const std::vector<float> rgb(3 * 12, 0.5f);
  ASSERT_TRUE(WriteImage(folder / "a.png", WriteFormat::kPng8, 4, 3, 3, rgb.data()));
  EXPECT_THAT(ProblemOfImages(WriteList(folder.path(), list)),
              AllOf(HasSubstr("8-bit samples"), HasSubstr("OpenEXR")));
  ASSERT_TRUE(WriteImage(folder / "a.png", WriteFormat::kPng16, 4, 3, 3, rgb.data()));
  EXPECT_EQ(ProblemOfImages(WriteList(folder.path(), list)), "");
}

// Samples are what the images have at their places: a plane in x and y is met exactly wherever no
// edge is near, in every mip and between them.
TEST(TexelPool, SamplesAreTheFilteredImages) {
  test::TemporaryDirectory folder;
  const auto set = ReadImageSet(WriteSet(folder.path(), 3, 16, 8, Grey));
  ASSERT_TRUE(set);
  TexelPoolOptions options;
  options.count = 6000;
  options.levels = 3;
  ThreadPool one(1), three(3);
  const auto drawn = DrawTexels(*set, options, one), again = DrawTexels(*set, options, three);
  ASSERT_TRUE(drawn && again);
  EXPECT_EQ(drawn->samples.size(), 6000u);
  int inner = 0, between = 0;
  for (size_t s = 0; s < drawn->samples.size(); ++s) {
    const TexelSample& sample = drawn->samples[s];
    EXPECT_EQ(0, std::memcmp(&sample, &again->samples[s], sizeof sample));
    EXPECT_NEAR(sample.value[0], 0.1f * static_cast<float>(sample.pair + 1), 1e-6f);
    const float margin = std::exp2(std::ceil(sample.s)) / 2;  // half a texel of the coarser level
    const float x = sample.u * 16, y = sample.v * 8;
    if (x < margin || x > 16 - margin || y < margin || y > 8 - margin) continue;
    ++inner;
    between += sample.s != std::floor(sample.s) ? 1 : 0;
    EXPECT_NEAR(sample.value[1], x - 0.5f, 2e-5f);
    EXPECT_NEAR(sample.value[2], y - 0.5f, 2e-5f);
  }
  EXPECT_GT(inner, 3000);
  EXPECT_GT(between, 1000);
  EXPECT_FLOAT_EQ(drawn->lookups[2].cosine, set->images[2].light.z);
}

}  // namespace
}  // namespace patina::svbrdf
