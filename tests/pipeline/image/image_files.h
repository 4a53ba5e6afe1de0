// Folders and image files that tests make.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace patina::test {

// A new empty folder that is removed with everything in it at the end.
class TempFolder {
 public:
  TempFolder();
  ~TempFolder();
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string operator/(const std::string& file) const { return path_ + "/" + file; }

 private:
  std::string path_;
};

// Samples as the file shall store them; interleaved rows from the top.
enum class Stored { kUint8, kUint16, kUint32, kHalf, kFloat };

struct FileContent {
  int width = 1;
  int height = 1;
  int channels = 3;
  Stored stored = Stored::kUint8;
  std::vector<float> values;               // integers as value / maximum
  int tile = 0;                            // side of tiles, or 0 for scanlines
  std::vector<std::string> channel_names;  // or empty for the usual ones
};

// Writes with the image library, format by extension. Aborts the test program on failure.
void WriteWithLibrary(const std::string& path, const FileContent& content);

// An image of one colour.
FileContent Flat(int width, int height, std::vector<float> pixel, Stored stored = Stored::kUint8);
// Reproducible noise in [0, 1].
FileContent Noise(int width, int height, int channels, Stored stored = Stored::kUint8,
                  uint64_t seed = 1);

std::vector<uint8_t> ReadBytes(const std::string& path);
void WriteBytes(const std::string& path, const std::vector<uint8_t>& bytes);

// Where the real data are, or "" when they are not there.
std::string SharedData(const std::string& folder);

}  // namespace patina::test
