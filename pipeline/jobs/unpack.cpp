#include "pipeline/jobs/unpack.h"

#include <algorithm>
#include <cmath>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/container.h"
#include "formats/decoder/patina_decoder.h"
#include "pipeline/base/aligned_buffer.h"
#include "pipeline/color/color.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/decoder_status.h"

namespace patina {
namespace {

constexpr int kRowsPerTask = 16;

// A decoded mip: coded values of the network's outputs, [output][y][x].
struct DecodedMip {
  int width = 0;
  int height = 0;
  AlignedBuffer<float> values;
};

DecodedMip Decode(const Decoder& decoder, int mip, ThreadPool& pool) {
  DecodedMip decoded;
  decoded.width = decoder.MipWidth(mip);
  decoded.height = decoder.MipHeight(mip);
  const size_t plane = static_cast<size_t>(decoded.width) * static_cast<size_t>(decoded.height);
  decoded.values.Reset(plane * static_cast<size_t>(decoder.outputs()));
  pool.ParallelFor((decoded.height + kRowsPerTask - 1) / kRowsPerTask, [&](int task, int) {
    const int begin = task * kRowsPerTask;
    decoder.DecodeRows(mip, begin, std::min(decoded.height, begin + kRowsPerTask),
                       decoded.values.data() + static_cast<size_t>(begin) * decoded.width, plane);
  });
  return decoded;
}

// One map as it goes to a file: interleaved values.
struct Picture {
  int channels = 0;
  std::vector<float> values;
};

// color: three channels of colour, whose transfer curve depends on the file format.
Picture Assemble(const std::vector<const Decoder::Channel*>& channels, const DecodedMip& mip,
                 bool color, UnpackFormat format, ThreadPool& pool) {
  const bool normal = channels[0]->encoding == Decoder::Encoding::kNormalXy;
  const size_t plane = static_cast<size_t>(mip.width) * static_cast<size_t>(mip.height);
  Picture picture;
  // Two channels would be taken for grey and alpha.
  picture.channels = channels.size() == 2 ? 3 : static_cast<int>(channels.size());
  picture.values.resize(plane * static_cast<size_t>(picture.channels));
  pool.ParallelFor(mip.height, [&](int y, int) {
    for (size_t i = static_cast<size_t>(y) * mip.width; i < static_cast<size_t>(y + 1) * mip.width;
         ++i) {
      float* pixel = picture.values.data() + i * static_cast<size_t>(picture.channels);
      for (size_t c = 0; c < channels.size(); ++c) {
        const Decoder::Channel& channel = *channels[c];
        float value = channel.output < 0
                          ? channel.constant
                          : mip.values[static_cast<size_t>(channel.output) * plane + i];
        if (channel.encoding == Decoder::Encoding::kLinear)
          value = Decoder::ToPhysical(channel, value);
        if (color) {
          const bool coded = channel.encoding == Decoder::Encoding::kSrgb;
          if (coded && format == UnpackFormat::kExr)
            value = static_cast<float>(SrgbToLinear(value));
          if (!coded && format == UnpackFormat::kPng)
            value = static_cast<float>(LinearToSrgb(value));
        }
        pixel[c] = value;
      }
      if (normal && channels.size() == 2) {
        const float x = 2 * pixel[0] - 1;
        const float z = Decoder::NormalZ(x, 2 * pixel[1] - 1);
        pixel[2] = 0.5f + 0.5f * z;
      }
    }
  });
  return picture;
}

WriteFormat FormatFor(UnpackFormat format, const std::string& source_type) {
  if (format == UnpackFormat::kPng)
    return source_type == "uint8" ? WriteFormat::kPng8 : WriteFormat::kPng16;
  return source_type == "uint8" || source_type == "half" ? WriteFormat::kExrHalf
                                                         : WriteFormat::kExrFloat;
}

}  // namespace

Result<Unpacked> UnpackContainer(const std::string& container, const std::string& folder, int mip,
                                 UnpackFormat format, ThreadPool& pool, const CancelToken& cancel) {
  PATINA_ASSIGN(const Container opened, OpenContainer(container));
  if (opened.manifest.kind != "material") {
    return Fail(ErrorCode::kUnsupported,
                opened.directory +
                    ": holds a measured BRDF, which has no maps; `patina eval` gives "
                    "its values, and its preview.png shows it");
  }
  PATINA_TRY(VerifyPayloads(opened));
  Decoder decoder;
  std::string problem;
  PATINA_TRY(DecoderStatus(Decoder::Load(opened.directory, &decoder, &problem), problem));
  if (mip < 0 || mip >= decoder.levels()) {
    return Fail(ErrorCode::kOutOfRange, opened.directory + ": there is no mip " +
                                            std::to_string(mip) + "; its mips are 0 to " +
                                            std::to_string(decoder.levels() - 1));
  }
  PATINA_TRY(MakeDirectories(folder));
  const DecodedMip decoded = Decode(decoder, mip, pool);
  Unpacked unpacked;
  const std::vector<Decoder::Channel>& channels = decoder.channels();
  for (size_t first = 0; first < channels.size();) {
    if (cancel.cancelled())
      return Fail(ErrorCode::kCancelled, "interrupted; the images before this one are complete");
    const std::string& role = channels[first].map;
    std::vector<const Decoder::Channel*> members;
    while (first < channels.size() && channels[first].map == role)
      members.push_back(&channels[first++]);
    // The role comes from a file that anybody may have written.
    PATINA_TRY(CheckPlainName(role, opened.directory + ": the map's name"));
    std::string type = "uint8";
    for (const ManifestMap& map : opened.manifest.maps) {
      if (map.role == role) type = map.type;
    }
    const bool color = members.size() >= 3;
    const Picture picture = Assemble(members, decoded, color, format, pool);
    const std::string path = folder + "/" + role + (format == UnpackFormat::kPng ? ".png" : ".exr");
    if (format == UnpackFormat::kPng) {
      const bool clipped =
          std::any_of(picture.values.begin(), picture.values.end(),
                      [](float value) { return value < -1e-4f || value > 1 + 1e-4f; });
      if (clipped) {
        unpacked.warnings.push_back(
            path + ": values outside 0 to 1 are clipped; unpack with --format exr to keep them");
      }
    }
    PATINA_TRY(WriteImage(path, FormatFor(format, type), decoded.width, decoded.height,
                          picture.channels, picture.values.data()));
    unpacked.paths.push_back(path);
  }
  return unpacked;
}

}  // namespace patina
