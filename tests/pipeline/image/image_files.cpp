#include "tests/pipeline/image/image_files.h"

#include <OpenImageIO/imageio.h>
#include <stdlib.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "pipeline/base/rng.h"

namespace patina::test {
namespace {

[[noreturn]] void Die(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::abort();
}

}  // namespace

TempFolder::TempFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "patina_test_XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) Die("cannot make a temporary folder");
  path_ = pattern;
}

TempFolder::~TempFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

void WriteWithLibrary(const std::string& path, const FileContent& content) {
  OIIO::TypeDesc type;
  switch (content.stored) {
    case Stored::kUint8:
      type = OIIO::TypeDesc::UINT8;
      break;
    case Stored::kUint16:
      type = OIIO::TypeDesc::UINT16;
      break;
    case Stored::kUint32:
      type = OIIO::TypeDesc::UINT32;
      break;
    case Stored::kHalf:
      type = OIIO::TypeDesc::HALF;
      break;
    case Stored::kFloat:
      type = OIIO::TypeDesc::FLOAT;
      break;
  }
  auto output = OIIO::ImageOutput::create(path);
  if (!output) Die(path + ": " + OIIO::geterror());
  OIIO::ImageSpec spec(content.width, content.height, content.channels, type);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  spec.attribute("CompressionQuality", 100);
  spec.tile_width = spec.tile_height = content.tile;
  if (!content.channel_names.empty()) {
    spec.channelnames = content.channel_names;
    spec.alpha_channel = -1;
  }
  if (!output->open(path, spec) ||
      !output->write_image(OIIO::TypeDesc::FLOAT, content.values.data()) || !output->close()) {
    Die(path + ": " + output->geterror());
  }
}

FileContent Flat(int width, int height, std::vector<float> pixel, Stored stored) {
  FileContent content{width, height, static_cast<int>(pixel.size()), stored, {}, 0, {}};
  for (int i = 0; i < width * height; ++i)
    content.values.insert(content.values.end(), pixel.begin(), pixel.end());
  return content;
}

FileContent Noise(int width, int height, int channels, Stored stored, uint64_t seed) {
  FileContent content{width, height, channels, stored, {}, 0, {}};
  Rng rng(seed);
  content.values.resize(static_cast<size_t>(width) * height * channels);
  for (float& value : content.values) value = rng.Uniform();
  return content;
}

std::vector<uint8_t> ReadBytes(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return std::vector<uint8_t>(std::istreambuf_iterator<char>(stream),
                              std::istreambuf_iterator<char>());
}

void WriteBytes(const std::string& path, const std::vector<uint8_t>& bytes) {
  // Some file systems flush a file that is written over, which costs milliseconds; a new one they
  // do not.
  std::filesystem::remove(path);
  std::ofstream stream(path, std::ios::binary);
  stream.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
}

std::string SharedData(const std::string& folder) {
  const std::string path = std::string(PATINA_SOURCE_DIR) + "/../shared/data/" + folder;
  return std::filesystem::is_directory(path) ? path : "";
}

}  // namespace patina::test
