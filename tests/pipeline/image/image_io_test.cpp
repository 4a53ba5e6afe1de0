#include "pipeline/image/image_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <limits>
#include <thread>

#include "formats/half.h"
#include "tests/pipeline/image/image_files.h"

namespace patina {
namespace {

using test::FileContent;
using test::Flat;
using test::Noise;
using test::Stored;
using test::TempFolder;
using testing::HasSubstr;

std::vector<float> AllSamples(const Image& image) {
  std::vector<float> all(static_cast<size_t>(image.width()) * image.height() * image.channels());
  std::vector<float> row(image.width());
  for (int y = 0; y < image.height(); ++y) {
    for (int c = 0; c < image.channels(); ++c) {
      LoadRow(image, y, c, row.data());
      for (int x = 0; x < image.width(); ++x) {
        all[(static_cast<size_t>(y) * image.width() + x) * image.channels() + c] = row[x];
      }
    }
  }
  return all;
}

struct FormatCase {
  const char* file;
  Stored stored;
  int channels;
  const char* format;
  SampleType type;
  float tolerance;  // of the stored precision
};
void PrintTo(const FormatCase& c, std::ostream* out) { *out << c.file << " " << c.channels; }

class ImageFormats : public testing::TestWithParam<FormatCase> {};

TEST_P(ImageFormats, GiveBackWhatWasWritten) {
  const FormatCase& c = GetParam();
  TempFolder folder;
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 1}, {1, 9}, {13, 5}, {64, 33}}) {
    const std::string path = folder / c.file;
    const FileContent content = Noise(width, height, c.channels, c.stored);
    test::WriteWithLibrary(path, content);
    const auto image = ReadImage(path);
    ASSERT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->width(), width);
    EXPECT_EQ(image->height(), height);
    EXPECT_EQ(image->channels(), c.channels);
    EXPECT_EQ(image->info.format, c.format);
    EXPECT_EQ(image->info.type, c.type);
    EXPECT_EQ(image->info.has_alpha(),
              c.channels == 4 || (c.channels == 2 && std::string(c.format) == "png"));
    const std::vector<float> samples = AllSamples(*image);
    for (size_t i = 0; i < samples.size(); ++i)
      EXPECT_NEAR(samples[i], content.values[i], c.tolerance);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, ImageFormats,
    testing::Values(FormatCase{"a.png", Stored::kUint8, 1, "png", SampleType::kUint8, 0.002f},
                    FormatCase{"a.png", Stored::kUint8, 2, "png", SampleType::kUint8, 0.002f},
                    FormatCase{"a.png", Stored::kUint8, 3, "png", SampleType::kUint8, 0.002f},
                    FormatCase{"a.png", Stored::kUint8, 4, "png", SampleType::kUint8, 0.002f},
                    FormatCase{"a.png", Stored::kUint16, 3, "png", SampleType::kUint16, 8e-6f},
                    FormatCase{"a.png", Stored::kUint16, 4, "png", SampleType::kUint16, 8e-6f},
                    FormatCase{"a.tga", Stored::kUint8, 3, "targa", SampleType::kUint8, 0.002f},
                    FormatCase{"a.tga", Stored::kUint8, 4, "targa", SampleType::kUint8, 0.002f},
                    FormatCase{"a.TGA", Stored::kUint8, 3, "targa", SampleType::kUint8, 0.002f},
                    FormatCase{"a.tif", Stored::kUint8, 3, "tiff", SampleType::kUint8, 0.002f},
                    FormatCase{"a.tif", Stored::kUint16, 4, "tiff", SampleType::kUint16, 8e-6f},
                    FormatCase{"a.tif", Stored::kFloat, 3, "tiff", SampleType::kFloat, 0},
                    FormatCase{"a.exr", Stored::kHalf, 3, "openexr", SampleType::kHalf, 0.0005f},
                    FormatCase{"a.exr", Stored::kHalf, 4, "openexr", SampleType::kHalf, 0.0005f},
                    FormatCase{"a.exr", Stored::kFloat, 1, "openexr", SampleType::kFloat, 0},
                    FormatCase{"a.exr", Stored::kFloat, 3, "openexr", SampleType::kFloat, 0},
                    FormatCase{"a.hdr", Stored::kFloat, 3, "hdr", SampleType::kFloat, 0.004f}));

TEST(ReadImage, ReadsJpegClosely) {
  TempFolder folder;
  test::WriteWithLibrary(folder / "a.jpg", Flat(31, 17, {0.8f, 0.4f, 0.2f}));
  const auto image = ReadImage(folder / "a.jpg");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->info.format, "jpeg");
  const std::vector<float> samples = AllSamples(*image);
  EXPECT_NEAR(samples[0], 0.8f, 0.02f);
  EXPECT_NEAR(samples[1], 0.4f, 0.02f);
  EXPECT_NEAR(samples[2], 0.2f, 0.02f);
}

TEST(ReadImage, ReadsUncompressedDds) {
  // A DDS header by hand: 2 x 1 texels of 32 bits, masks for RGBA.
  std::vector<uint8_t> bytes(128, 0);
  const auto put = [&](size_t offset, uint32_t value) { std::memcpy(&bytes[offset], &value, 4); };
  std::memcpy(bytes.data(), "DDS ", 4);
  put(4, 124);
  put(8, 0x100F);  // caps, height, width, pitch, pixel format
  put(12, 1);
  put(16, 2);
  put(20, 8);
  put(76, 32);
  put(80, 0x41);  // RGB with alpha
  put(88, 32);
  put(92, 0x000000FF);
  put(96, 0x0000FF00);
  put(100, 0x00FF0000);
  put(104, 0xFF000000);
  put(108, 0x1000);
  const std::vector<uint8_t> texels = {10, 20, 30, 40, 50, 60, 70, 80};
  bytes.insert(bytes.end(), texels.begin(), texels.end());
  TempFolder folder;
  test::WriteBytes(folder / "a.dds", bytes);
  const auto image = ReadImage(folder / "a.dds");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->info.format, "dds");
  ASSERT_EQ(image->channels(), 4);
  EXPECT_EQ(std::vector<uint8_t>(image->bytes.data(), image->bytes.data() + image->bytes.size()),
            texels);
}

TEST(ReadImage, DoesNotMultiplyColourByAlpha) {
  TempFolder folder;
  test::WriteWithLibrary(folder / "a.png", Flat(3, 3, {1.0f, 0.4f, 0.2f, 0.0f}));
  const auto image = ReadImage(folder / "a.png");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->info.alpha_channel, 3);
  EXPECT_EQ(AllSamples(*image)[0], 1.0f);
  EXPECT_EQ(AllSamples(*image)[3], 0.0f);
}

TEST(ReadImage, KeepsHalfExtremes) {
  TempFolder folder;
  FileContent content = Flat(1, 1, {65504.0f, -65504.0f, 0x1p-24f}, Stored::kHalf);
  test::WriteWithLibrary(folder / "a.exr", content);
  const auto image = ReadImage(folder / "a.exr");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(AllSamples(*image), content.values);
}

TEST(ReadImage, TellsTheFormatByContent) {
  TempFolder folder;
  test::WriteWithLibrary(folder / "a.png", Noise(5, 5, 3));
  std::filesystem::rename(folder / "a.png", folder / "a.jpg");
  const auto image = ReadImage(folder / "a.jpg");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->info.format, "png");
  ASSERT_EQ(image->info.warnings.size(), 1u);
  EXPECT_THAT(image->info.warnings[0], HasSubstr("named .jpg but holds png"));
}

TEST(ReadImage, SaysWhatIsWrongWithTheFile) {
  TempFolder folder;
  const auto code = [&](const std::string& path) {
    const auto image = ReadImage(path);
    EXPECT_FALSE(image) << path;
    EXPECT_THAT(image.error().message, HasSubstr(path));
    return image.error().code;
  };
  EXPECT_EQ(code(folder / "missing.png"), ErrorCode::kNotFound);
  EXPECT_EQ(code(folder.path()), ErrorCode::kInvalidArgument);
  test::WriteBytes(folder / "empty.png", {});
  EXPECT_EQ(code(folder / "empty.png"), ErrorCode::kCorruptData);
  test::WriteBytes(folder / "text.png", {'h', 'e', 'l', 'l', 'o'});
  EXPECT_EQ(code(folder / "text.png"), ErrorCode::kUnsupported);
  test::WriteBytes(folder / "one.exr", {0x76});
  EXPECT_EQ(code(folder / "one.exr"), ErrorCode::kUnsupported);
  test::WriteBytes(folder / "magic.exr", {0x76, 0x2f, 0x31, 0x01});
  EXPECT_EQ(code(folder / "magic.exr"), ErrorCode::kCorruptData);
  test::WriteBytes(folder / "zeros.tga", std::vector<uint8_t>(100, 0));
  EXPECT_EQ(code(folder / "zeros.tga"), ErrorCode::kCorruptData);
  ASSERT_EQ(mkfifo((folder / "pipe.png").c_str(), 0600), 0);
  EXPECT_EQ(code(folder / "pipe.png"), ErrorCode::kInvalidArgument);
}

TEST(ReadImage, RefusesImpossibleSizesBeforeAllocating) {
  TempFolder folder;
  test::WriteWithLibrary(folder / "a.png", Noise(4, 4, 3));
  const std::vector<uint8_t> good = test::ReadBytes(folder / "a.png");
  struct Case {
    uint32_t width, height;
    ErrorCode code;
  };
  for (const Case& c :
       {Case{60000, 4000, ErrorCode::kCorruptData}, Case{70000, 1, ErrorCode::kOutOfRange},
        Case{65000, 65000, ErrorCode::kOutOfRange}, Case{0, 4, ErrorCode::kCorruptData},
        Case{0x7FFFFFFF, 0x7FFFFFFF, ErrorCode::kOutOfRange}}) {
    std::vector<uint8_t> bytes = good;
    for (int i = 0; i < 4; ++i) {
      bytes[16 + i] = static_cast<uint8_t>(c.width >> (24 - 8 * i));
      bytes[20 + i] = static_cast<uint8_t>(c.height >> (24 - 8 * i));
    }
    // The checksum of the header chunk (CRC-32 of type and data), so that nothing else is wrong.
    uint32_t crc = 0xFFFFFFFFu;
    for (int i = 12; i < 29; ++i) {
      crc ^= bytes[i];
      for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    crc = ~crc;
    for (int i = 0; i < 4; ++i) bytes[29 + i] = static_cast<uint8_t>(crc >> (24 - 8 * i));
    test::WriteBytes(folder / "big.png", bytes);
    const auto image = ReadImage(folder / "big.png");
    ASSERT_FALSE(image) << c.width << " x " << c.height;
    // libpng itself refuses what it takes for out of bounds; either way it is our error.
    EXPECT_THAT(image.error().code, testing::AnyOf(c.code, ErrorCode::kCorruptData))
        << image.error().message;
  }
}

TEST(ReadImage, TakesLongThinImages) {
  TempFolder folder;
  test::WriteWithLibrary(folder / "a.png", Flat(13569, 1, {0.5f}));
  const auto image = ReadImage(folder / "a.png");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->width(), 13569);
}

class Truncation : public testing::TestWithParam<const char*> {};

// Every prefix of a file gives an error, or (where only the trailer is lost) the image.
TEST_P(Truncation, NeverPassesForAnImage) {
  TempFolder folder;
  const std::string path = folder / GetParam();
  const std::string extension = std::filesystem::path(path).extension();
  const Stored stored = extension == ".exr"   ? Stored::kHalf
                        : extension == ".hdr" ? Stored::kFloat
                                              : Stored::kUint8;
  test::WriteWithLibrary(path, Noise(12, 9, 3, stored));
  const auto whole = ReadImage(path);
  ASSERT_TRUE(whole) << whole.error().message;
  const std::vector<float> expected = AllSamples(*whole);
  const std::vector<uint8_t> bytes = test::ReadBytes(path);
  int errors = 0;
  for (size_t length = 0; length < bytes.size(); ++length) {
    test::WriteBytes(path, {bytes.begin(), bytes.begin() + static_cast<long>(length)});
    const auto image = ReadImage(path);
    if (!image) {
      ++errors;
      EXPECT_THAT(image.error().message, HasSubstr(path));
    } else {
      EXPECT_EQ(AllSamples(*image), expected)
          << "at " << length << " of " << bytes.size() << " bytes";
    }
  }
  // 12 x 9 texels of three samples; some writers append hundreds of bytes that readers do not need.
  EXPECT_GT(errors, 12 * 9 * 3);
}

INSTANTIATE_TEST_SUITE_P(Formats, Truncation,
                         testing::Values("a.png", "a.jpg", "a.exr", "a.tga", "a.tif", "a.hdr"));

// Flipped bytes may give another image, never anything worse than an error.
TEST(ReadImage, SurvivesDamagedBytes) {
  TempFolder folder;
  for (const char* file : {"a.png", "a.jpg", "a.exr", "a.tga", "a.tif", "a.hdr"}) {
    const std::string path = folder / file;
    const std::string extension = std::filesystem::path(path).extension();
    test::WriteWithLibrary(path, Noise(12, 9, 3,
                                       extension == ".exr"   ? Stored::kHalf
                                       : extension == ".hdr" ? Stored::kFloat
                                                             : Stored::kUint8));
    const std::vector<uint8_t> good = test::ReadBytes(path);
    int refused = 0;
    for (size_t i = 0; i < good.size(); i += 3) {
      std::vector<uint8_t> bytes = good;
      bytes[i] ^= static_cast<uint8_t>(1u << (i % 8));
      test::WriteBytes(path, bytes);
      const auto image = ReadImage(path);
      refused += !image;
      if (!image) continue;
      EXPECT_LE(static_cast<uint64_t>(image->width()) * image->height(), kMaxImagePixels);
    }
    EXPECT_GT(refused, 0) << file;
  }
}

TEST(ReadImage, RefusesIntegerSamplesOf32Bits) {
  TempFolder folder;
  test::WriteWithLibrary(folder / "a.tif", Noise(4, 4, 1, Stored::kUint32));
  const auto image = ReadImage(folder / "a.tif");
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(image.error().message, HasSubstr("samples of type uint;"));
}

TEST(ReadImage, UsesTheFirstFourOfManyChannels) {
  TempFolder folder;
  FileContent content = Noise(6, 4, 6, Stored::kHalf);
  content.channel_names = {"R", "G", "B", "A", "Z", "id"};
  test::WriteWithLibrary(folder / "a.exr", content);
  const auto image = ReadImage(folder / "a.exr");
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->info.channels, 6);
  EXPECT_EQ(image->channels(), 4);
  ASSERT_EQ(image->info.warnings.size(), 1u);
  EXPECT_THAT(image->info.warnings[0], HasSubstr("first 4"));
}

TEST(ReadImage, ReadsTiles) {
  TempFolder folder;
  FileContent content = Noise(70, 50, 3, Stored::kHalf);
  content.tile = 32;
  test::WriteWithLibrary(folder / "a.exr", content);
  const auto image = ReadImage(folder / "a.exr");
  ASSERT_TRUE(image) << image.error().message;
  const std::vector<float> samples = AllSamples(*image);
  for (size_t i = 0; i < samples.size(); ++i) EXPECT_NEAR(samples[i], content.values[i], 0.0005f);
}

TEST(ReadImage, IsTheSameFromManyThreads) {
  TempFolder folder;
  test::WriteWithLibrary(folder / "a.png", Noise(64, 64, 3));
  test::WriteWithLibrary(folder / "a.exr", Noise(64, 64, 3, Stored::kHalf));
  std::vector<std::thread> threads;
  std::vector<int> failures(4, 0);
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 20; ++i)
        failures[t] += !ReadImage(folder / (i % 2 == 0 ? "a.png" : "a.exr"));
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(failures, std::vector<int>(4, 0));
}

TEST(ReadImageInfo, NeedsNoPixels) {
  TempFolder folder;
  test::WriteWithLibrary(folder / "a.png", Noise(200, 100, 4, Stored::kUint16));
  std::vector<uint8_t> bytes = test::ReadBytes(folder / "a.png");
  bytes.resize(bytes.size() / 2);
  test::WriteBytes(folder / "a.png", bytes);
  const auto info = ReadImageInfo(folder / "a.png");
  ASSERT_TRUE(info) << info.error().message;
  EXPECT_EQ(info->width, 200);
  EXPECT_EQ(info->height, 100);
  EXPECT_EQ(info->type, SampleType::kUint16);
  EXPECT_EQ(info->file_bytes, bytes.size());
  EXPECT_FALSE(ReadImage(folder / "a.png"));
}

TEST(WriteImage, GoesThereAndBackInEveryFormat) {
  TempFolder folder;
  struct Case {
    WriteFormat format;
    const char* file;
    float tolerance;
  };
  for (const Case& c :
       {Case{WriteFormat::kPng8, "a.png", 0.5f / 255 + 1e-6f},
        Case{WriteFormat::kPng16, "b.png", 0.5f / 65535 + 1e-7f},
        Case{WriteFormat::kExrHalf, "a.exr", 0.0005f}, Case{WriteFormat::kExrFloat, "b.exr", 0}}) {
    for (int channels = 1; channels <= 4; ++channels) {
      const FileContent content = Noise(17, 3, channels);
      const Status status =
          WriteImage(folder / c.file, c.format, 17, 3, channels, content.values.data());
      ASSERT_TRUE(status) << status.error().message;
      const auto image = ReadImage(folder / c.file);
      ASSERT_TRUE(image) << image.error().message;
      ASSERT_EQ(image->channels(), channels);
      const std::vector<float> samples = AllSamples(*image);
      for (size_t i = 0; i < samples.size(); ++i)
        EXPECT_NEAR(samples[i], content.values[i], c.tolerance);
    }
  }
}

TEST(WriteImage, ClampsAndRoundsIntegers) {
  TempFolder folder;
  const float values[6] = {-1,           2, std::numeric_limits<float>::quiet_NaN(), 127.4f / 255,
                           127.6f / 255, 1};
  ASSERT_TRUE(WriteImage(folder / "a.png", WriteFormat::kPng8, 6, 1, 1, values));
  const auto image = ReadImage(folder / "a.png");
  ASSERT_TRUE(image);
  const std::vector<uint8_t> texels(image->bytes.data(), image->bytes.data() + image->bytes.size());
  EXPECT_EQ(texels, (std::vector<uint8_t>{0, 255, 0, 127, 128, 255}));
}

TEST(WriteImage, GivesTheSameBytesForTheSameInput) {
  TempFolder folder;
  const FileContent content = Noise(40, 30, 3);
  for (const WriteFormat format : {WriteFormat::kPng8, WriteFormat::kExrHalf}) {
    SetImageIoThreads(1);
    ASSERT_TRUE(WriteImage(folder / "a", format, 40, 30, 3, content.values.data()));
    SetImageIoThreads(2);
    ASSERT_TRUE(WriteImage(folder / "b", format, 40, 30, 3, content.values.data()));
    const std::vector<uint8_t> bytes = test::ReadBytes(folder / "a");
    EXPECT_EQ(bytes, test::ReadBytes(folder / "b"));
    // No clock: the year of now is nowhere in the file. (Bytes made within one second would be
    // equal anyway.)
    const std::string text(bytes.begin(), bytes.end());
    const std::time_t now = std::time(nullptr);
    EXPECT_EQ(text.find(std::to_string(1900 + std::gmtime(&now)->tm_year) + ":"),
              std::string::npos);
  }
}

TEST(WriteImage, LeavesNothingBehindWhereItCannotWrite) {
  TempFolder folder;
  const float value = 0.5f;
  const Status missing = WriteImage(folder / "no/such/a.png", WriteFormat::kPng8, 1, 1, 1, &value);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kIo);
  EXPECT_THAT(missing.error().message, HasSubstr("no/such/a.png"));
  const Status bad = WriteImage(folder / "a.png", WriteFormat::kPng8, 0, 1, 1, &value);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(WriteImage, ReportsAFullDisk) {
  if (access("/dev/full", W_OK) != 0) GTEST_SKIP() << "no /dev/full here";
  TempFolder folder;
  std::filesystem::create_symlink("/dev/full", folder / "a.exr");
  const FileContent content = Noise(64, 64, 3);
  const Status status =
      WriteImage(folder / "a.exr", WriteFormat::kExrFloat, 64, 64, 3, content.values.data());
  ASSERT_FALSE(status);
  EXPECT_TRUE(std::filesystem::exists("/dev/full"));
}

}  // namespace
}  // namespace patina
