#include "pipeline/jobs/unpack.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/container.h"
#include "formats/decoder/patina_decoder.h"
#include "pipeline/base/aligned_buffer.h"
#include "pipeline/color/color.h"
#include "pipeline/color/color_config.h"
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

// What colours are written as.
struct ColorTarget {
  bool srgb = false;            // the last step is the sRGB curve
  ColorTransformPtr transform;  // before it, from the working space; null: none
  bool linear_light = true;
  const Primaries* primaries = nullptr;  // to be named in the file
};

// Of a container whose working space is `working`.
Result<ColorTarget> TargetOf(const UnpackOptions& options, WorkingSpace working) {
  ColorTarget target;
  auto config = ColorConfig::Load(options.ocio);
  if (!config) return Fail(std::move(config).error(), "--ocio");
  auto space = config->Find(options.space);
  if (!space) return Fail(std::move(space).error(), "--space");
  if (space->is_data) return target;
  const bool builtin = config->source() == ConfigSource::kBuiltin;
  target.srgb = builtin && space->name == "sRGB";
  if (target.srgb || (builtin && space->name == "lin_rec709")) {
    if (working != WorkingSpace::kLinearRec709)
      target.transform = TransformFromTag({}, PrimariesOf(working), kRec709Primaries);
    target.linear_light = !target.srgb;
    return target;
  }
  auto transform = config->FromWorking(*space, working);
  if (!transform) return Fail(std::move(transform).error(), "--space");
  target.transform = std::move(*transform);
  target.linear_light = IsProportional(*target.transform);
  if (builtin && space->name == "ACEScg") target.primaries = &kAp1Primaries;
  if (builtin && space->name == "ACES2065-1") target.primaries = &kAp0Primaries;
  return target;
}

// What is written where no space is asked for.
ColorTarget DefaultTarget(UnpackFormat format, WorkingSpace working) {
  ColorTarget target;
  target.srgb = format != UnpackFormat::kExr;
  target.linear_light = !target.srgb;
  if (working != WorkingSpace::kLinearRec709)
    target.transform = TransformFromTag({}, PrimariesOf(working), kRec709Primaries);
  return target;
}

using Channels = std::vector<const Decoder::Channel*>;

// Coded values of row y of one channel.
void CodedRow(const Decoder::Channel& channel, const DecodedMip& mip, int y, float* row) {
  const size_t plane = static_cast<size_t>(mip.width) * static_cast<size_t>(mip.height);
  if (channel.output < 0) {
    std::fill_n(row, mip.width, channel.constant);
  } else {
    std::copy_n(mip.values.data() + static_cast<size_t>(channel.output) * plane +
                    static_cast<size_t>(y) * mip.width,
                mip.width, row);
  }
}

// As the working space has it. Of decoders for engines this is Decoder::ToPhysical, in float.
void LinearRow(const Decoder::Channel& channel, int count, float* row) {
  for (int x = 0; x < count; ++x) {
    if (channel.encoding == Decoder::Encoding::kSrgb) {
      row[x] = static_cast<float>(SrgbToLinear(static_cast<double>(row[x])));
    } else {
      row[x] = Decoder::ToPhysical(channel, row[x]);
    }
  }
}

void ColorRow(const Channels& channels, int count, const ColorTarget& target,
              float* const rows[3]) {
  // Codes that nothing is to be done to are written as they are.
  const bool keep = target.srgb && target.transform == nullptr;
  std::array<bool, 3> coded{};
  for (size_t c = 0; c < 3; ++c) {
    coded[c] = keep && channels[c]->encoding == Decoder::Encoding::kSrgb;
    if (!coded[c]) LinearRow(*channels[c], count, rows[c]);
  }
  if (target.transform != nullptr)
    target.transform->Apply(rows[0], rows[1], rows[2], static_cast<size_t>(count));
  for (size_t c = 0; target.srgb && c < 3; ++c) {
    if (coded[c]) continue;
    for (int x = 0; x < count; ++x)
      rows[c][x] = static_cast<float>(LinearToSrgb(static_cast<double>(rows[c][x])));
  }
}

// target: of a colour; null for data.
Picture Assemble(const Channels& channels, const DecodedMip& mip, const ColorTarget* target,
                 ThreadPool& pool) {
  const size_t count = channels.size();
  const bool normal = channels[0]->encoding == Decoder::Encoding::kNormalXy && count == 2;
  const auto width = static_cast<size_t>(mip.width);
  Picture picture;
  // Two channels would be taken for grey and alpha.
  picture.channels = count == 2 ? 3 : static_cast<int>(count);
  picture.values.resize(width * static_cast<size_t>(mip.height) *
                        static_cast<size_t>(picture.channels));
  std::vector<std::vector<float>> scratch(static_cast<size_t>(pool.threads()));
  pool.ParallelFor(mip.height, [&](int y, int worker) {
    std::vector<float>& rows = scratch[static_cast<size_t>(worker)];
    rows.resize(count * width);
    for (size_t c = 0; c < count; ++c) {
      float* row = rows.data() + c * width;
      CodedRow(*channels[c], mip, y, row);
      if (target == nullptr && channels[c]->encoding == Decoder::Encoding::kLinear)
        LinearRow(*channels[c], mip.width, row);
    }
    if (target != nullptr) {
      float* const planes[3] = {rows.data(), rows.data() + width, rows.data() + 2 * width};
      ColorRow(channels, mip.width, *target, planes);
    }
    float* pixel = picture.values.data() +
                   static_cast<size_t>(y) * width * static_cast<size_t>(picture.channels);
    for (size_t x = 0; x < width; ++x, pixel += picture.channels) {
      for (size_t c = 0; c < count; ++c) pixel[c] = rows[c * width + x];
      if (normal) {
        const float z = Decoder::NormalZ(2 * pixel[0] - 1, 2 * pixel[1] - 1);
        pixel[2] = 0.5f + 0.5f * z;
      }
    }
  });
  return picture;
}

bool GoesBeyondCodes(const Picture& picture) {
  return std::any_of(picture.values.begin(), picture.values.end(),
                     [](float value) { return value < -1e-4f || value > 1 + 1e-4f; });
}

WriteFormat FormatFor(bool png, const std::string& source_type, const Picture& picture) {
  if (png) return source_type == "uint8" ? WriteFormat::kPng8 : WriteFormat::kPng16;
  constexpr float kLargestHalf = 65504;
  const bool fits = std::all_of(picture.values.begin(), picture.values.end(),
                                [](float value) { return std::fabs(value) <= kLargestHalf; });
  return fits && (source_type == "uint8" || source_type == "half") ? WriteFormat::kExrHalf
                                                                   : WriteFormat::kExrFloat;
}

}  // namespace

Result<Unpacked> UnpackContainer(const std::string& container, const std::string& folder,
                                 const UnpackOptions& options, ThreadPool& pool,
                                 const CancelToken& cancel) {
  PATINA_ASSIGN(const Container opened, OpenContainer(container));
  if (opened.manifest.kind != "material") {
    return Fail(ErrorCode::kUnsupported,
                opened.directory +
                    ": holds a BRDF, which has values at pairs of directions and no maps; `patina "
                    "eval` gives them, and its preview.png shows it");
  }
  PATINA_TRY(VerifyPayloads(opened));
  Decoder decoder;
  std::string problem;
  PATINA_TRY(DecoderStatus(Decoder::Load(opened.directory, &decoder, &problem), problem));
  const std::array<int, 2> mips =
      opened.manifest.lod_range.value_or(std::array<int, 2>{0, decoder.levels() - 1});
  const int mip = options.mip.value_or(mips[0]);
  if (mip < mips[0] || mip > mips[1]) {
    return Fail(ErrorCode::kOutOfRange,
                opened.directory + ": there is no mip " + std::to_string(mip) + "; its mips are " +
                    std::to_string(mips[0]) + " to " + std::to_string(mips[1]));
  }
  const WorkingSpace working =
      ParseWorkingSpace(decoder.working_space()).value_or(WorkingSpace::kLinearRec709);
  ColorTarget target = DefaultTarget(options.format, working);
  if (!options.space.empty()) {
    PATINA_ASSIGN(target, TargetOf(options, working));
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
    const bool color = members.size() == 3;
    const Picture picture = Assemble(members, decoded, color ? &target : nullptr, pool);
    const bool beyond = GoesBeyondCodes(picture);
    bool png = options.format != UnpackFormat::kExr;
    if (options.format == UnpackFormat::kAuto && color && !options.space.empty())
      png = !target.linear_light && !beyond;
    const std::string path = folder + "/" + role + (png ? ".png" : ".exr");
    if (png && beyond) {
      unpacked.warnings.push_back(
          path + ": values outside 0 to 1 are clipped; unpack with --format exr to keep them");
    }
    PATINA_TRY(WriteImage(path, FormatFor(png, type, picture), decoded.width, decoded.height,
                          picture.channels, picture.values.data(),
                          color ? target.primaries : nullptr));
    unpacked.paths.push_back(path);
  }
  return unpacked;
}

}  // namespace patina
