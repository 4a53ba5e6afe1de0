// The header-only decoder against a slow evaluation in double precision that shares nothing with it
// but the formats.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/decoder/patina_decoder.h"
#include "tests/formats/sample_container.h"

namespace patina {
namespace {

using test::Random;
using test::SampleOptions;
using test::StageSample;
using test::TemporaryDirectory;
using LoadStatus = Decoder::LoadStatus;

std::string Publish(const TemporaryDirectory& out, uint64_t seed,
                    const SampleOptions& options = {}) {
  auto staging = StageSample(out.path(), "asset", seed, options);
  if (!staging) return staging.error().message;
  const auto published = staging->Publish();
  return published ? published->directory : published.error().message;
}

// Written from the sampling rules of FORMATS.md, term by term, in double.
class SlowDecoder {
 public:
  explicit SlowDecoder(const std::string& path) : container_(*OpenContainer(path)) {
    for (const auto& feature : container_.manifest.features) {
      const DdsTexture texture = *ReadDds(container_.PathOf(feature.payload));
      std::vector<std::vector<uint16_t>> levels;
      for (int level = 0; level < feature.levels; ++level)
        levels.push_back(DecodeDdsLevel(texture, level));
      textures_.push_back(std::move(levels));
    }
    if (container_.manifest.network)
      network_ = *UnpackNetwork(*ReadWeights(container_.PathOf("decoder.weights")));
  }

  // Coded values of all channels, and bounds on the rounding error of a float evaluation.
  void Coded(double u, double v, double s, std::vector<double>* values,
             std::vector<double>* bounds) const {
    std::vector<double> x;
    for (size_t i = 0; i < textures_.size(); ++i) {
      const auto& feature = container_.manifest.features[i];
      const double level = std::clamp(s + feature.lod_bias, 0.0, feature.levels - 1.0);
      const int low = static_cast<int>(level);
      for (int c = 0; c < 3; ++c) {
        const double a = Bilinear(i, low, c, u, v);
        const double b = Bilinear(i, std::min(low + 1, feature.levels - 1), c, u, v);
        x.push_back(a + (b - a) * (level - low));
      }
    }
    values->clear();
    bounds->clear();
    std::vector<double> h(16), h_size(16);
    for (int j = 0; j < network_.hidden; ++j) {
      h[j] = network_.b1[j];
      h_size[j] = std::abs(h[j]);
      for (int i = 0; i < network_.inputs; ++i) {
        h[j] += static_cast<double>(network_.w1[j * network_.inputs + i]) * x[i];
        h_size[j] += std::abs(network_.w1[j * network_.inputs + i] * x[i]);
      }
      h[j] = std::max(h[j], 0.0);
    }
    for (const auto& channel : container_.manifest.channels) {
      if (channel.output < 0) {
        values->push_back(channel.constant);
        bounds->push_back(0);
        continue;
      }
      double y = network_.b2[channel.output];
      double size = std::abs(y);
      for (int j = 0; j < network_.hidden; ++j) {
        const double weight = network_.w2[channel.output * network_.hidden + j];
        y += weight * h[j];
        size += std::abs(weight) * h_size[j];
      }
      values->push_back(std::clamp(y, static_cast<double>(channel.range_min),
                                   static_cast<double>(channel.range_max)));
      // At most 3 roundings for the taps and their weights in each of three interpolations, 13 for
      // a sum of 12 products and a bias, 17 for one of 16: less than 48 half ulps of the sum of
      // magnitudes.
      bounds->push_back(size * 48 * 0x1p-24);
    }
  }

 private:
  double Bilinear(size_t texture, int level, int channel, double u, double v) const {
    const auto& feature = container_.manifest.features[texture];
    const int width = DdsLevelSide(feature.width, level);
    const int height = DdsLevelSide(feature.height, level);
    const double x = (u - std::floor(u)) * width - 0.5;
    const double y = (v - std::floor(v)) * height - 0.5;
    const auto texel = [&](double tx, double ty) -> double {
      int ix = static_cast<int>(tx);
      int iy = static_cast<int>(ty);
      if (container_.manifest.source.address == "wrap") {
        ix = (ix % width + width) % width;
        iy = (iy % height + height) % height;
      } else {
        ix = std::clamp(ix, 0, width - 1);
        iy = std::clamp(iy, 0, height - 1);
      }
      return HalfToFloat(
          textures_[texture][level][(static_cast<size_t>(iy) * width + ix) * 3 + channel]);
    };
    const double fx = x - std::floor(x);
    const double fy = y - std::floor(y);
    const double x0 = std::floor(x);
    const double y0 = std::floor(y);
    return (texel(x0, y0) * (1 - fx) + texel(x0 + 1, y0) * fx) * (1 - fy) +
           (texel(x0, y0 + 1) * (1 - fx) + texel(x0 + 1, y0 + 1) * fx) * fy;
  }

  Container container_;
  std::vector<std::vector<std::vector<uint16_t>>> textures_;
  NetworkWeights network_;
};

std::vector<SampleOptions> Variants() {
  std::vector<SampleOptions> variants;
  const int sizes[][2] = {{64, 48}, {1, 1}, {37, 5}, {128, 1}, {50, 70}};
  for (const auto& size : sizes) {
    for (const char* address : {"wrap", "clamp"}) {
      for (const bool fine : {false, true}) {
        SampleOptions options;
        options.width = size[0];
        options.height = size[1];
        options.address = address;
        if (fine) options.shifts[0] = options.shifts[1] = 0;
        variants.push_back(options);
      }
    }
  }
  return variants;
}

TEST(Decoder, MatchesTheSlowEvaluationWithinItsRounding) {
  Random random(41);
  int clamped = 0;
  int samples = 0;
  for (const SampleOptions& options : Variants()) {
    const TemporaryDirectory out;
    const std::string path = Publish(out, 42, options);
    Decoder decoder;
    std::string message;
    ASSERT_EQ(Decoder::Load(path, &decoder, &message), LoadStatus::kOk) << message;
    const SlowDecoder slow(path);
    std::vector<float> values(decoder.channels().size());
    std::vector<double> wanted, bounds;
    for (int i = 0; i < 200; ++i) {
      // Beyond the texture only where it wraps: clamping is told from wrapping by the addresses
      // below.
      const double u = random.Unit();
      const double v = random.Unit();
      const double s = i % 4 == 0 ? random.Below(9) : random.Unit() * 10 - 1;
      decoder.Coded(u, v, s, values.data());
      slow.Coded(u, v, s, &wanted, &bounds);
      for (size_t c = 0; c < values.size(); ++c) {
        ASSERT_NEAR(values[c], wanted[c], bounds[c])
            << options.width << "x" << options.height << " " << options.address << " u " << u
            << " v " << v << " s " << s << " channel " << c;
        ++samples;
        if (values[c] == 30.0f || values[c] == -30.0f) ++clamped;
      }
    }
  }
  EXPECT_GT(clamped, 0);
  EXPECT_LT(clamped, samples / 2);
}

TEST(Decoder, WholeMipsEqualSingleSamplesToTheBit) {
  for (const SampleOptions& options : Variants()) {
    const TemporaryDirectory out;
    Decoder decoder;
    std::string message;
    ASSERT_EQ(Decoder::Load(Publish(out, 43, options), &decoder, &message), LoadStatus::kOk)
        << message;
    std::vector<float> values(decoder.channels().size());
    for (int level = 0; level < decoder.levels(); ++level) {
      const std::vector<float> mip = decoder.DecodeMip(level);
      const int width = decoder.MipWidth(level);
      const int height = decoder.MipHeight(level);
      ASSERT_EQ(mip.size(), values.size() * width * height);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          decoder.Coded((x + 0.5) / width, (y + 0.5) / height, level, values.data());
          for (size_t c = 0; c < values.size(); ++c) {
            const float other = mip[(c * height + y) * width + x];
            ASSERT_EQ(std::memcmp(&values[c], &other, sizeof other), 0)
                << width << "x" << height << " at " << x << ", " << y << ": " << values[c] << " / "
                << other;
          }
        }
      }
    }
  }
}

TEST(Decoder, RowsCanBeDecodedInAnyPieces) {
  const TemporaryDirectory out;
  Decoder decoder;
  std::string message;
  ASSERT_EQ(Decoder::Load(Publish(out, 44), &decoder, &message), LoadStatus::kOk) << message;
  const size_t plane = 64 * 48;
  std::vector<float> whole(plane * 5), pieces(plane * 5);
  decoder.DecodeRows(0, 0, 48, whole.data(), plane);
  for (int y = 0; y < 48; y += 7)
    decoder.DecodeRows(0, y, std::min(48, y + 7), pieces.data() + y * 64, plane);
  EXPECT_EQ(whole, pieces);
}

TEST(Decoder, RepeatsWhenItWrapsAndHoldsTheEdgeWhenItClamps) {
  for (const char* address : {"wrap", "clamp"}) {
    const TemporaryDirectory out;
    SampleOptions options;
    options.address = address;
    Decoder decoder;
    std::string message;
    ASSERT_EQ(Decoder::Load(Publish(out, 45, options), &decoder, &message), LoadStatus::kOk)
        << message;
    const auto at = [&](double u, double v) {
      std::vector<float> values(decoder.channels().size());
      decoder.Coded(u, v, 0, values.data());
      return values;
    };
    if (options.address == "wrap") {
      EXPECT_EQ(at(0.25, 0.75), at(3.25, -1.25));
      EXPECT_EQ(at(0, 0), at(1, 1));
      EXPECT_NE(at(-0.3, 0.5), at(0, 0.5));
    } else {
      EXPECT_EQ(at(-0.3, 0.5), at(0, 0.5));
      EXPECT_EQ(at(7, 7), at(1, 1));
      EXPECT_NE(at(0, 0), at(1, 1));
    }
  }
}

TEST(Decoder, TakesAnyCoordinates) {
  const TemporaryDirectory out;
  Decoder decoder;
  std::string message;
  ASSERT_EQ(Decoder::Load(Publish(out, 46), &decoder, &message), LoadStatus::kOk) << message;
  std::vector<float> values(decoder.channels().size());
  for (const double wild :
       {-1e300, 1e300, 1e17, -1e-300, -1e-17, 0.0, -0.0, double{INFINITY}, double{NAN}}) {
    decoder.Coded(wild, 0.5, 0, values.data());
    decoder.Coded(0.5, wild, 0, values.data());
    decoder.Coded(0.5, 0.5, wild, values.data());
    for (const float value : values) EXPECT_TRUE(std::isfinite(value));
  }
}

Decoder::Channel ChannelOf(Decoder::Encoding encoding, float scale = 1) {
  Decoder::Channel channel;
  channel.encoding = encoding;
  channel.scale = scale;
  return channel;
}

TEST(Decoder, GivesPhysicalValues) {
  EXPECT_EQ(Decoder::ToPhysical(ChannelOf(Decoder::Encoding::kLinear, 65536.0f), 0.5f), 32768.0f);
  EXPECT_EQ(Decoder::ToPhysical(ChannelOf(Decoder::Encoding::kLinear), 0.3f), 0.3f);
  EXPECT_EQ(Decoder::ToPhysical(ChannelOf(Decoder::Encoding::kNormalXy), 0.75f), 0.5f);
  EXPECT_EQ(Decoder::ToPhysical(ChannelOf(Decoder::Encoding::kSrgb), 0.0f), 0.0f);
  EXPECT_FLOAT_EQ(Decoder::ToPhysical(ChannelOf(Decoder::Encoding::kSrgb), 1.0f), 1.0f);
  EXPECT_NEAR(Decoder::ToPhysical(ChannelOf(Decoder::Encoding::kSrgb), 0.5f), 0.21404114,
              1e-7);  // IEC 61966-2-1
  EXPECT_NEAR(Decoder::ToPhysical(ChannelOf(Decoder::Encoding::kSrgb), 0.04f), 0.04 / 12.92, 1e-9);
  const auto log_of = [](float coded, float scale) {
    return Decoder::ToPhysical(ChannelOf(Decoder::Encoding::kSignedLog, scale), coded);
  };
  EXPECT_EQ(log_of(0, 0.25f), 0.0f);
  EXPECT_EQ(log_of(3, 0.25f), 1.75f);
  EXPECT_EQ(log_of(-3, 0.25f), -1.75f);
  EXPECT_FLOAT_EQ(log_of(17.609641f, 0.5f), 99999.5f);
  EXPECT_FLOAT_EQ(Decoder::NormalZ(0.6f, 0.0f), 0.8f);
  EXPECT_EQ(Decoder::NormalZ(0.9f, 0.9f), 0.0f);

  const TemporaryDirectory out;
  Decoder decoder;
  std::string message;
  ASSERT_EQ(Decoder::Load(Publish(out, 47), &decoder, &message), LoadStatus::kOk) << message;
  std::vector<float> coded(decoder.channels().size()), physical(decoder.channels().size());
  decoder.Coded(0.1, 0.2, 0.3, coded.data());
  decoder.Physical(0.1, 0.2, 0.3, physical.data());
  for (size_t c = 0; c < coded.size(); ++c) {
    EXPECT_EQ(physical[c], Decoder::ToPhysical(decoder.channels()[c], coded[c]));
  }
  EXPECT_EQ(decoder.channels()[2].output, -1);
  EXPECT_EQ(coded[2], 0.25f);
}

TEST(Decoder, DecodesAMaterialOfConstants) {
  const TemporaryDirectory out;
  SampleOptions options;
  options.all_constant = true;
  Decoder decoder;
  std::string message;
  ASSERT_EQ(Decoder::Load(Publish(out, 48, options), &decoder, &message), LoadStatus::kOk)
      << message;
  EXPECT_EQ(decoder.outputs(), 0);
  const std::vector<float> mip = decoder.DecodeMip(1);
  EXPECT_EQ(mip.size(), 6u * 32 * 24);
  for (const float value : mip) EXPECT_EQ(value, 0.5f);
}

TEST(Decoder, OpensAnAssetByItsCurrentRevision) {
  const TemporaryDirectory out;
  Publish(out, 49);
  Decoder decoder;
  std::string message;
  EXPECT_EQ(Decoder::Load(out / "asset", &decoder, &message), LoadStatus::kOk) << message;
  EXPECT_EQ(decoder.width(), 64);
  EXPECT_EQ(decoder.levels(), 7);
}

TEST(DecoderBc6h, DecodesEveryBlockLikeTheLibrary) {
  Random random(50);
  for (int mode = 0; mode < 18; ++mode) {
    for (int i = 0; i < 3000; ++i) {
      const bc6h::Block block = test::RandomBlock(random, mode);
      for (const bool is_signed : {false, true}) {
        uint16_t ours[16][3], library[16][3];
        decoder_detail::DecodeBc6h(block.data(), is_signed, ours);
        bc6h::Decode(block.data(), is_signed ? bc6h::Format::kSf16 : bc6h::Format::kUf16, library);
        ASSERT_EQ(std::memcmp(ours, library, sizeof ours), 0) << "mode " << mode;
      }
    }
  }
}

TEST(DecoderHalf, ConvertsEveryFiniteHalfLikeTheLibrary) {
  for (int half = 0; half < 65536; ++half) {
    if (!HalfIsFinite(static_cast<uint16_t>(half))) continue;
    ASSERT_EQ(decoder_detail::HalfToFloat(static_cast<uint16_t>(half)),
              HalfToFloat(static_cast<uint16_t>(half)));
  }
}

// What a damaged container does to Load.
class DecoderLoad : public testing::Test {
 protected:
  void SetUp() override { directory_ = Publish(out_, 51); }
  LoadStatus Load() {
    Decoder decoder;
    return Decoder::Load(directory_, &decoder, &message_);
  }
  std::vector<uint8_t> Bytes(const std::string& name) {
    return *ReadFile(directory_ + "/" + name, 1 << 24);
  }
  void Write(const std::string& name, const std::vector<uint8_t>& bytes) {
    ASSERT_EQ(RealFileSystem().WriteSynced(directory_ + "/" + name, bytes), 0);
  }
  void EditManifest(const std::string& pointer, const nlohmann::json& value) {
    const auto bytes = Bytes("manifest.json");
    auto document = nlohmann::json::parse(bytes.begin(), bytes.end());
    document[nlohmann::json::json_pointer(pointer)] = value;
    const std::string text = document.dump();
    Write("manifest.json", {text.begin(), text.end()});
  }

  TemporaryDirectory out_;
  std::string directory_;
  std::string message_;
};

TEST_F(DecoderLoad, LeavesTheDecoderAsItWasOnFailure) {
  Decoder decoder;
  ASSERT_EQ(Decoder::Load(directory_, &decoder, &message_), LoadStatus::kOk);
  EXPECT_EQ(Decoder::Load(out_ / "absent", &decoder, &message_), LoadStatus::kNotFound);
  EXPECT_NE(message_.find("absent"), std::string::npos);
  EXPECT_EQ(decoder.width(), 64);
}

TEST_F(DecoderLoad, ReportsMissingFiles) {
  std::filesystem::remove(directory_ + "/features_3.dds");
  EXPECT_EQ(Load(), LoadStatus::kNotFound);
  EXPECT_NE(message_.find("features_3.dds"), std::string::npos);
}

TEST_F(DecoderLoad, NoticesEveryTruncation) {
  for (const char* name : {"features_3.dds", "decoder.weights", "manifest.json"}) {
    const auto bytes = Bytes(name);
    // The last byte of the manifest is the final newline.
    const size_t end = bytes.size() - (std::string(name) == "manifest.json" ? 1 : 0);
    for (size_t size = 0; size < end; size += size < 200 ? 1 : 37) {
      std::ofstream(directory_ + "/" + name, std::ios::binary | std::ios::trunc)
          .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(size));
      ASSERT_EQ(Load(), LoadStatus::kCorrupt) << name << " " << size;
    }
    std::vector<uint8_t> longer = bytes;
    longer.push_back('x');
    Write(name, longer);
    EXPECT_EQ(Load(), LoadStatus::kCorrupt) << name;
    Write(name, bytes);
    EXPECT_EQ(Load(), LoadStatus::kOk) << message_;
  }
}

TEST_F(DecoderLoad, RefusesHeadersThatDoNotMatchTheManifest) {
  const auto bytes = Bytes("features_0.dds");
  for (const size_t offset : {0, 4, 12, 16, 28, 76, 84, 128, 132, 140}) {
    std::vector<uint8_t> changed = bytes;
    changed[offset] ^= 3;
    Write("features_0.dds", changed);
    EXPECT_EQ(Load(), LoadStatus::kCorrupt) << offset;
  }
}

TEST_F(DecoderLoad, RefusesDamagedWeights) {
  const auto bytes = Bytes("decoder.weights");
  for (size_t offset = 0; offset < bytes.size(); offset += 5) {
    std::vector<uint8_t> changed = bytes;
    changed[offset] ^= 0x40;
    Write("decoder.weights", changed);
    EXPECT_NE(Load(), LoadStatus::kOk) << offset;
  }
}

TEST_F(DecoderLoad, RefusesInfiniteTexels) {
  // One region of 16 bits, signed, both endpoints -32768: minus infinity.
  EditManifest("/features/3/format", "BC6H_SF16");
  std::vector<uint8_t> bytes = Bytes("features_3.dds");
  bytes[128] = 96;
  bc6h::BlockFields fields;
  fields.mode = 13;
  for (auto& endpoint : fields.endpoints) endpoint[0] = endpoint[1] = endpoint[2] = -32768;
  const auto block = bc6h::Pack(fields, bc6h::Format::kSf16);
  ASSERT_OK(block);
  std::copy(block->begin(), block->end(), bytes.begin() + 148);
  Write("features_3.dds", bytes);
  EXPECT_EQ(Load(), LoadStatus::kCorrupt);
  EXPECT_NE(message_.find("a texel is not finite"), std::string::npos);
}

TEST_F(DecoderLoad, RefusesWhatItCannotDecode) {
  const auto original = Bytes("manifest.json");
  for (const auto& [pointer, value] : std::initializer_list<std::pair<const char*, nlohmann::json>>{
           {"/format_version", 3},
           {"/kind", "brdf"},
           {"/source/address", "mirror"},
           {"/network/activation", "gelu"},
           {"/channels/0/encoding", "pq"},
           {"/features/0/format", "BC7"}}) {
    EditManifest(pointer, value);
    EXPECT_EQ(Load(), LoadStatus::kUnsupported) << pointer;
    Write("manifest.json", original);
  }
}

TEST_F(DecoderLoad, RefusesImpossibleManifests) {
  const auto original = Bytes("manifest.json");
  for (const auto& [pointer, value] : std::initializer_list<std::pair<const char*, nlohmann::json>>{
           {"", 7},
           {"/format", "other"},
           {"/source/width", 0},
           {"/source/width", 1e300},
           {"/source/height", 70000},
           {"/features", nlohmann::json::array()},
           {"/features", "none"},
           {"/features/1", 5},
           {"/features/0/payload", "../features_0.dds"},
           {"/features/0/width", 64},
           {"/features/0/levels", 18},
           {"/features/0/lod_bias", 1},
           {"/network/inputs", 9},
           {"/network/hidden", 1 << 20},
           {"/network/outputs", 6},
           {"/network/payload", ""},
           {"/network", nullptr},
           {"/channels", nlohmann::json::array()},
           {"/channels/0", "r"},
           {"/channels/0/output", 0},
           {"/channels/0/output", 5},
           {"/channels/0/range", nlohmann::json::array({1, 0})},
           {"/channels/0/range", nlohmann::json::array({0, 1e300})},
           {"/channels/2/constant", "x"}}) {
    EditManifest(pointer, value);
    EXPECT_NE(Load(), LoadStatus::kOk) << pointer << " " << value;
    Write("manifest.json", original);
  }
  EXPECT_EQ(Load(), LoadStatus::kOk) << message_;
}

}  // namespace
}  // namespace patina
