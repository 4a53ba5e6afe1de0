#include "pipeline/image/image_io.h"

#include <OpenImageIO/imageio.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <memory>
#include <new>
#include <string_view>
#include <utility>

#include "formats/base/file_io.h"
#include "formats/half.h"
#include "pipeline/image/file_tags.h"

namespace patina {
namespace {

// No lossless coder in these formats gets beyond about 1000:1 except zstd and LERC inside TIFF. A
// header that promises more is a lie, and believing it costs minutes and gigabytes.
constexpr double kMaxExpansion = 4096;
constexpr double kMaxExpansionTiff = 65536;
constexpr double kExpansionGrace = 1 << 20;

// A reader allocates whole tiles, however small the image is.
constexpr uint64_t kMaxTilePixels = uint64_t{1} << 24;

constexpr const char* kReadable = "PNG, JPEG, TGA, TIFF, OpenEXR, HDR and DDS are read";

struct Magic {
  std::string_view bytes;
  const char* format;
  std::array<const char*, 3> extensions;
};
constexpr std::array<Magic, 9> kMagics = {{
    {{"\x89PNG\r\n\x1a\n", 8}, "png", {"png", "", ""}},
    {{"\xFF\xD8\xFF", 3}, "jpeg", {"jpg", "jpeg", "jpe"}},
    {{"II*\0", 4}, "tiff", {"tif", "tiff", ""}},
    {{"MM\0*", 4}, "tiff", {"tif", "tiff", ""}},
    {{"II+\0", 4}, "tiff", {"tif", "tiff", ""}},
    {{"MM\0+", 4}, "tiff", {"tif", "tiff", ""}},
    {{"\x76\x2f\x31\x01", 4}, "openexr", {"exr", "", ""}},
    {{"#?", 2}, "hdr", {"hdr", "rgbe", ""}},
    {{"DDS ", 4}, "dds", {"dds", "", ""}},
}};

std::string LowerExtension(const std::string& path) {
  const size_t dot = path.find_last_of("./");
  if (dot == std::string::npos || path[dot] != '.') return "";
  std::string extension = path.substr(dot + 1);
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

// Runs body and turns what libraries throw into errors.
template <class Body>
auto Guarded(const std::string& path, Body&& body) -> decltype(body()) {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return Fail(ErrorCode::kResourceExhausted,
                path + ": not enough memory for this image; use smaller maps or a larger machine");
  } catch (const std::exception& e) {
    return Fail(ErrorCode::kCorruptData, path + ": the image library gave up: " + e.what() +
                                             "; replace the file by an intact copy");
  } catch (...) {
    return Fail(ErrorCode::kCorruptData,
                path + ": the image library gave up; replace the file by an intact copy");
  }
}

// Library messages may hold several lines and bytes of the file.
std::string OneLine(const std::string& text) {
  std::string line;
  for (const char c : text) {
    const unsigned char byte = static_cast<unsigned char>(c);
    if (c == '\n') {
      line += "; ";
    } else if (byte >= 0x20 && byte < 0x7F) {
      line += c;
    } else {
      line += '?';
    }
  }
  if (line.size() > 400) line = line.substr(0, 400) + "...";
  return line;
}

tl::unexpected<Error> Damaged(const std::string& path, const std::string& format,
                              const std::string& why) {
  return Fail(ErrorCode::kCorruptData, path + ": this " + format +
                                           " file is truncated or damaged (" + OneLine(why) +
                                           "); replace it by an intact copy");
}

struct SourceFile {
  uint64_t bytes = 0;
  std::string format;
  std::string warning;
};

Result<SourceFile> Identify(const std::string& path) {
  struct stat status;
  if (stat(path.c_str(), &status) != 0) return FailErrno(errno, "cannot read image", path);
  if (!S_ISREG(status.st_mode)) {
    return Fail(ErrorCode::kInvalidArgument, path + ": not a regular file; name an image file");
  }
  SourceFile file;
  file.bytes = static_cast<uint64_t>(status.st_size);
  if (file.bytes == 0) {
    return Fail(ErrorCode::kCorruptData,
                path + ": the file is empty; replace it by an intact copy");
  }
  std::ifstream stream(path, std::ios::binary);
  std::array<char, 16> head{};
  stream.read(head.data(), head.size());
  if (stream.gcount() == 0) return FailErrno(errno == 0 ? EIO : errno, "cannot read image", path);
  const std::string_view start(head.data(), static_cast<size_t>(stream.gcount()));
  const std::string extension = LowerExtension(path);
  for (const Magic& magic : kMagics) {
    if (start.substr(0, magic.bytes.size()) != magic.bytes) continue;
    file.format = magic.format;
    const auto& names = magic.extensions;
    if (!extension.empty() && std::find(names.begin(), names.end(), extension) == names.end()) {
      file.warning = "The file is named ." + extension + " but holds " + magic.format + " data.";
    }
    return file;
  }
  if (extension == "tga") {
    file.format = "targa";
    return file;
  }
  std::string found;
  for (size_t i = 0; i < std::min<size_t>(4, start.size()); ++i) {
    char text[8];
    std::snprintf(text, sizeof text, "%s%02x", i == 0 ? "" : " ",
                  static_cast<unsigned char>(start[i]));
    found += text;
  }
  return Fail(ErrorCode::kUnsupported, path + ": not an image that is known by its first bytes (" +
                                           found + "); " + kReadable);
}

struct OpenImage {
  std::unique_ptr<OIIO::ImageInput> input;
  ImageInfo info;
  OIIO::TypeDesc read_type;
};

// What samples of a library type become; false for a type that is not read.
bool SampleTypeOf(const OIIO::TypeDesc& type, SampleType* sample_type) {
  switch (type.basetype) {
    case OIIO::TypeDesc::UINT8:
      *sample_type = SampleType::kUint8;
      return true;
    case OIIO::TypeDesc::UINT16:
      *sample_type = SampleType::kUint16;
      return true;
    case OIIO::TypeDesc::HALF:
      *sample_type = SampleType::kHalf;
      return true;
    case OIIO::TypeDesc::FLOAT:
      *sample_type = SampleType::kFloat;
      return true;
    default:
      return false;
  }
}

Status CheckSize(const std::string& path, const OIIO::ImageSpec& spec, const SourceFile& file) {
  const std::string size = std::to_string(spec.width) + " x " + std::to_string(spec.height);
  if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1) {
    return Fail(ErrorCode::kCorruptData, path + ": the header says " + size + " pixels of " +
                                             std::to_string(spec.nchannels) +
                                             " channels; replace the file by an intact copy");
  }
  if (spec.width > kMaxImageSide || spec.height > kMaxImageSide ||
      static_cast<uint64_t>(spec.width) * spec.height > kMaxImagePixels) {
    return Fail(ErrorCode::kOutOfRange, path + ": the header says " + size + " pixels; at most " +
                                            std::to_string(kMaxImageSide) + " a side and " +
                                            std::to_string(kMaxImagePixels) +
                                            " in all are read; scale the map down");
  }
  const double decoded = static_cast<double>(spec.image_bytes(true));
  const double factor = file.format == "tiff" ? kMaxExpansionTiff : kMaxExpansion;
  if (decoded > kExpansionGrace + factor * static_cast<double>(file.bytes)) {
    return Fail(ErrorCode::kCorruptData,
                path + ": the header says " + size + " pixels, which cannot come from " +
                    std::to_string(file.bytes) + " bytes; replace the file by an intact copy");
  }
  if (spec.tile_width > 0 && spec.tile_height > 0 &&
      static_cast<uint64_t>(spec.tile_width) * spec.tile_height > kMaxTilePixels) {
    return Fail(ErrorCode::kCorruptData,
                path + ": the header says tiles of " + std::to_string(spec.tile_width) + " x " +
                    std::to_string(spec.tile_height) + " pixels for an image of " + size +
                    "; save it with smaller tiles or as scanlines");
  }
  return {};
}

// The library's own "oiio:ColorSpace" does not count: its readers make one up where a file is
// silent.
ColorTag TagOf(const std::string& path, const std::string& format, const OIIO::ImageSpec& spec) {
  ColorTag tag;
  const OIIO::ParamValue* icc = spec.find_attribute("ICCProfile");
  if (icc != nullptr && icc->type().basetype == OIIO::TypeDesc::UINT8) {
    tag = TagFromIccProfile({static_cast<const uint8_t*>(icc->data()), icc->type().size()});
    if (!tag.empty()) return tag;
  }
  ColorTag other;
  if (format == "png") other = TagFromPngChunks(path);
  if (format == "openexr") {
    const OIIO::ParamValue* found = spec.find_attribute("chromaticities");
    if (found != nullptr && found->type().basetype == OIIO::TypeDesc::FLOAT &&
        found->type().basevalues() == 8) {
      other = TagFromChromaticities(
          std::span<const float, 8>(static_cast<const float*>(found->data()), 8));
    }
  }
  if (other.problem.empty()) other.problem = tag.problem;
  return other;
}

// Opens the first part and leaves it selected.
Result<OpenImage> Open(const std::string& path) {
  PATINA_ASSIGN(const SourceFile file, Identify(path));
  OpenImage open;
  open.input = OIIO::ImageInput::create(file.format);
  if (!open.input) {
    const std::string why = OIIO::geterror();
    return Fail(ErrorCode::kUnsupported, path + ": the image library has no reader for " +
                                             file.format + " (" + OneLine(why) + ")");
  }
  OIIO::ImageSpec wishes, spec;
  wishes.attribute("oiio:UnassociatedAlpha", 1);
  if (!open.input->open(path, spec, wishes))
    return Damaged(path, file.format, open.input->geterror());

  ImageInfo& info = open.info;
  info.format = file.format;
  info.file_bytes = file.bytes;
  if (!file.warning.empty()) info.warnings.push_back(file.warning);
  if (spec.deep) {
    return Fail(ErrorCode::kUnsupported,
                path + ": a deep image has no single value for a pixel; flatten it");
  }
  if (spec.depth > 1) {
    return Fail(ErrorCode::kUnsupported, path + ": a volume of " + std::to_string(spec.depth) +
                                             " slices; save one slice as an image");
  }
  PATINA_TRY(CheckSize(path, spec, file));
  info.width = spec.width;
  info.height = spec.height;
  info.channels = spec.nchannels;
  info.color_tag = TagOf(path, file.format, spec);
  for (int c = 0; c < std::min(spec.nchannels, kMaxLoadedChannels); ++c) {
    SampleType type;
    if (!SampleTypeOf(spec.channelformat(c), &type)) {
      if (c > 0) break;
      return Fail(ErrorCode::kUnsupported, path + ": samples of type " +
                                               spec.channelformat(c).c_str() +
                                               "; save it with 8 or 16 bits, half or float");
    }
    if (c == 0 || type == SampleType::kFloat) info.type = type;
    info.loaded_channels = c + 1;
  }
  if (info.loaded_channels < info.channels) {
    info.warnings.push_back("Of its " + std::to_string(info.channels) + " channels the first " +
                            std::to_string(info.loaded_channels) + " are used.");
  }
  if (spec.alpha_channel >= 0 && spec.alpha_channel < info.loaded_channels) {
    info.alpha_channel = spec.alpha_channel;
  }
  if (file.format == "openexr" &&
      (spec.full_width != spec.width || spec.full_height != spec.height || spec.full_x != spec.x ||
       spec.full_y != spec.y)) {
    info.warnings.push_back(
        "Its data window differs from its display window; the data window is used.");
  }
  if (!spec.get_string_attribute("jpeg:ColorSpace").empty()) {
    info.warnings.push_back("Its colours are " +
                            OneLine(spec.get_string_attribute("jpeg:ColorSpace")) +
                            " and were converted to RGB without a profile.");
  }
  info.subimages = std::max(1, spec.get_int_attribute("oiio:subimages", 1));
  if (info.subimages > 1) {
    info.warnings.push_back("It has " + std::to_string(info.subimages) +
                            " parts; the first one is used.");
  }
  switch (info.type) {
    case SampleType::kUint8:
      open.read_type = OIIO::TypeDesc::UINT8;
      break;
    case SampleType::kUint16:
      open.read_type = OIIO::TypeDesc::UINT16;
      break;
    case SampleType::kHalf:
      open.read_type = OIIO::TypeDesc::HALF;
      break;
    case SampleType::kFloat:
      open.read_type = OIIO::TypeDesc::FLOAT;
      break;
  }
  return open;
}

// libjpeg reports stray bytes between two markers, which harm no pixel, the same way as lost data.
bool IsHarmless(const std::string& format, const std::string& error) {
  return format == "jpeg" && error.find("extraneous bytes before marker") != std::string::npos &&
         error.find('\n') == std::string::npos;
}

uint8_t ToUnorm8(float value) {
  return value > 0 ? static_cast<uint8_t>(std::lround(std::min(value, 1.0f) * 255.0f)) : uint8_t{0};
}
uint16_t ToUnorm16(float value) {
  return value > 0 ? static_cast<uint16_t>(std::lround(std::min(value, 1.0f) * 65535.0f))
                   : uint16_t{0};
}

template <class T, class Convert>
Status WriteRows(OIIO::ImageOutput* output, const OIIO::TypeDesc& type, int height,
                 size_t row_values, const float* values, const std::string& path, Convert convert) {
  std::vector<T> row(row_values);
  for (int y = 0; y < height; ++y) {
    const float* from = values + static_cast<size_t>(y) * row_values;
    std::transform(from, from + row_values, row.begin(), convert);
    if (!output->write_scanline(y, 0, type, row.data())) {
      return Fail(ErrorCode::kIo, path + ": cannot write row " + std::to_string(y) + " (" +
                                      OneLine(output->geterror()) +
                                      "); check space and permissions");
    }
  }
  return {};
}

Status WriteOpened(OIIO::ImageOutput* output, const std::string& path, WriteFormat format,
                   int width, int height, int channels, const float* values,
                   const Primaries* primaries) {
  OIIO::TypeDesc type;
  switch (format) {
    case WriteFormat::kPng8:
      type = OIIO::TypeDesc::UINT8;
      break;
    case WriteFormat::kPng16:
      type = OIIO::TypeDesc::UINT16;
      break;
    case WriteFormat::kExrHalf:
      type = OIIO::TypeDesc::HALF;
      break;
    case WriteFormat::kExrFloat:
      type = OIIO::TypeDesc::FLOAT;
      break;
  }
  OIIO::ImageSpec spec(width, height, channels, type);
  if (channels == 1) spec.channelnames = {"Y"};
  if (channels == 2) spec.channelnames = {"Y", "A"};
  spec.alpha_channel = channels == 2 ? 1 : channels == 4 ? 3 : -1;
  // Writers put the current time in where there is none.
  spec.attribute("DateTime", "2000:01:01 00:00:00");
  spec.attribute("Software", "patina");
  spec.attribute("oiio:UnassociatedAlpha", 1);
  if (primaries != nullptr) {
    std::array<float, 8> xy{};
    size_t i = 0;
    for (const Chromaticity& c :
         {primaries->red, primaries->green, primaries->blue, primaries->white}) {
      xy[i++] = static_cast<float>(c.x);
      xy[i++] = static_cast<float>(c.y);
    }
    spec.attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), xy.data());
  }
  if (!output->open(path, spec)) {
    return Fail(ErrorCode::kIo, path + ": cannot create the image (" + OneLine(output->geterror()) +
                                    "); check the folder, space and permissions");
  }
  const size_t row_values = static_cast<size_t>(width) * channels;
  Status status;
  switch (format) {
    case WriteFormat::kPng8:
      status = WriteRows<uint8_t>(output, type, height, row_values, values, path, ToUnorm8);
      break;
    case WriteFormat::kPng16:
      status = WriteRows<uint16_t>(output, type, height, row_values, values, path, ToUnorm16);
      break;
    case WriteFormat::kExrHalf:
      status = WriteRows<uint16_t>(output, type, height, row_values, values, path, FloatToHalf);
      break;
    case WriteFormat::kExrFloat:
      status = WriteRows<float>(output, type, height, row_values, values, path,
                                [](float v) { return v; });
      break;
  }
  const bool closed = output->close();
  if (status && !closed) {
    return Fail(ErrorCode::kIo, path + ": cannot finish the image (" + OneLine(output->geterror()) +
                                    "); check space and permissions");
  }
  return status;
}

// The library's PNG writer does not notice a full disk: a whole file ends in an IEND chunk.
bool EndsAsPng(const std::string& path) {
  static constexpr std::array<char, 12> kEnd = {0,   0,   0,      0,   'I',    'E',
                                                'N', 'D', '\xAE', 'B', '\x60', '\x82'};
  std::ifstream file(path, std::ios::binary);
  std::array<char, kEnd.size()> tail{};
  file.seekg(-static_cast<std::streamoff>(tail.size()), std::ios::end);
  file.read(tail.data(), tail.size());
  return file.good() && tail == kEnd;
}

}  // namespace

void SetImageIoThreads(int threads) {
  OIIO::attribute("threads", std::max(1, threads));
  OIIO::attribute("exr_threads", std::max(1, threads));
}

Result<ImageInfo> ReadImageInfo(const std::string& path) {
  return Guarded(path, [&]() -> Result<ImageInfo> {
    PATINA_ASSIGN(OpenImage open, Open(path));
    return std::move(open.info);
  });
}

Result<Image> ReadImage(const std::string& path) {
  return Guarded(path, [&]() -> Result<Image> {
    PATINA_ASSIGN(OpenImage open, Open(path));
    Image image;
    image.path = path;
    image.info = std::move(open.info);
    image.Allocate();
    const bool read =
        open.input->read_image(0, 0, 0, image.channels(), open.read_type, image.bytes.data());
    // Readers report lost data here even where they return true.
    const std::string error = open.input->geterror();
    if (!read || (!error.empty() && !IsHarmless(image.info.format, error))) {
      return Damaged(path, image.info.format, error.empty() ? "no reason given" : error);
    }
    if (!error.empty()) image.info.warnings.push_back(OneLine(error) + ".");
    return image;
  });
}

Status WriteImage(const std::string& path, WriteFormat format, int width, int height, int channels,
                  const float* values, const Primaries* primaries) {
  if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide || channels < 1 ||
      channels > 4) {
    return Fail(ErrorCode::kInvalidArgument,
                path + ": cannot write an image of " + std::to_string(width) + " x " +
                    std::to_string(height) + " x " + std::to_string(channels));
  }
  return Guarded(path, [&]() -> Status {
    const bool png = format == WriteFormat::kPng8 || format == WriteFormat::kPng16;
    std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(png ? "png" : "openexr");
    if (!output) {
      return Fail(ErrorCode::kUnsupported, path + ": the image library cannot write this format (" +
                                               OneLine(OIIO::geterror()) + ")");
    }
    Status status =
        WriteOpened(output.get(), path, format, width, height, channels, values, primaries);
    output.reset();
    if (status && png && !EndsAsPng(path)) {
      status = Fail(ErrorCode::kIo,
                    path + ": the image was not written to its end; check space on the disk");
    }
    if (!status) {
      std::remove(path.c_str());
    }
    return status;
  });
}

}  // namespace patina
