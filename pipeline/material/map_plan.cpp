#include "pipeline/material/map_plan.h"

#include <algorithm>
#include <cmath>

#include "pipeline/color/color.h"

namespace patina {
namespace {

// Grey stored as RGB: what JPEG's rounding makes of it.
constexpr float kGreyTolerance = 2.5f / 255.0f;

// Shorter than this, a decoded normal is mid-grey (0.5 is no 8-bit code) and points nowhere.
constexpr float kShortestNormal = 0.02f;

// Floating-point samples below this are components, not codes.
constexpr float kSignedBelow = -0.05f;

std::string ChannelLetter(int channel) { return std::string(1, "rgba"[channel]); }

// The channel that holds the one value of a scalar map when nobody says which.
int GuessScalarChannel(const MapSource& source, const MapRole& role, const LoadedFile& file,
                       std::vector<std::string>* warnings) {
  const ImageInfo& info = file.image.info;
  if (info.loaded_channels < 3) return 0;
  const bool alpha_varies = info.has_alpha() && !file.stats.constant(info.alpha_channel);
  const auto warn = [&](int channel, const std::string& why) {
    warnings->push_back(source.file + ": " + why + "; " + source.role + " is read from " +
                        ChannelLetter(channel) +
                        ". If that is wrong, list the maps with their channels.");
    return channel;
  };
  std::vector<int> varying;
  for (int c = 0; c < 3; ++c) {
    if (!file.stats.constant(c)) varying.push_back(c);
  }
  if (varying.empty() && alpha_varies)
    return warn(info.alpha_channel, "its colour channels are constant");
  if (file.stats.grey_difference <= kGreyTolerance) return 0;
  if (varying.size() == 1)
    return warn(varying[0], "its colour channels differ and one of them varies");
  const int usual = static_cast<int>(std::string("rgba").find(role.usual_channel));
  return warn(usual < info.loaded_channels ? usual : 0, "its colour channels differ");
}

Result<std::vector<int>> GivenChannels(const MapSource& source, const ImageInfo& info) {
  std::vector<int> channels;
  for (const char letter : source.channels) {
    int channel = static_cast<int>(std::string("rgba").find(letter));
    if (letter == 'a' && info.has_alpha()) channel = info.alpha_channel;
    // Grey, with or without alpha.
    if (letter != 'a' && info.loaded_channels == (info.has_alpha() ? 2 : 1)) channel = 0;
    if (channel < 0 || channel >= info.loaded_channels) {
      return Fail(ErrorCode::kInvalidArgument,
                  source.path + ": " + source.role + " is wanted from channel " + letter +
                      ", but the file has " + std::to_string(info.loaded_channels) +
                      " channels; correct the list of maps");
    }
    channels.push_back(channel);
  }
  return channels;
}

Result<std::vector<int>> ChooseChannels(const MapSource& source, const MapRole& role,
                                        const LoadedFile& file,
                                        std::vector<std::string>* warnings) {
  const ImageInfo& info = file.image.info;
  if (!source.channels.empty()) {
    PATINA_ASSIGN(std::vector<int> channels, GivenChannels(source, info));
    if (role.kind == MapKind::kColor && channels.size() == 1) channels.resize(3, channels[0]);
    return channels;
  }
  const int colors = info.has_alpha() && info.loaded_channels % 2 == 0 ? info.loaded_channels - 1
                                                                       : info.loaded_channels;
  switch (role.kind) {
    case MapKind::kColor:
      return colors >= 3 ? std::vector<int>{0, 1, 2} : std::vector<int>{0, 0, 0};
    case MapKind::kScalar:
      return std::vector<int>{GuessScalarChannel(source, role, file, warnings)};
    case MapKind::kVector2:
    case MapKind::kNormal:
      if (colors < 2) {
        return Fail(ErrorCode::kInvalidArgument,
                    source.path + ": a " + source.role +
                        " map needs two or three channels, this file has one; is it a " +
                        "height map? Rename it (\"height\") or list the maps");
      }
      if (role.kind == MapKind::kVector2 || colors == 2) return std::vector<int>{0, 1};
      return std::vector<int>{0, 1, 2};
  }
  return std::vector<int>{0};
}

void FillNormalPlan(const LoadedFile& file, MapPlan* plan) {
  const auto lowest =
      std::min(file.stats.min[plan->channels[0]], file.stats.min[plan->channels[1]]);
  plan->signed_samples = !IsInteger(file.image.info.type) && lowest < kSignedBelow;
  // A constant third channel is no z that belongs to x and y.
  if (plan->channels.size() == 3 && file.stats.constant(plan->channels[2]))
    plan->channels.pop_back();
}

// Data have no colour: only the words of old job files are let through.
Status CheckDataSpace(const MapSource& source) {
  for (const char* word : {"auto", "srgb", "linear", "raw"}) {
    if (source.color_space == word) return {};
  }
  return Fail(ErrorCode::kInvalidArgument,
              ColorPointer(source) + ": " + source.role +
                  " is data, which is never converted, and cannot be in the colour space \"" +
                  source.color_space + "\"; leave it out");
}

void NormalRow(const MapPlan& plan, int width, float* const planes[3], NormalDefects* defects) {
  const bool has_z = plan.channels.size() == 3;
  const float scale = plan.signed_samples ? 1.0f : 2.0f,
              offset = plan.signed_samples ? 0.0f : -1.0f;
  const float sign_y = plan.flip_y ? -1.0f : 1.0f;
  float* const px = planes[0];
  float* const py = planes[1];
  float* const pz = planes[2];
  uint64_t undefined = 0, below = 0;
  for (int i = 0; i < width; ++i) {
    // Black is the background of an atlas, not a direction.
    const bool black = !plan.signed_samples && px[i] == 0 && py[i] == 0 && (!has_z || pz[i] == 0);
    const float x = px[i] * scale + offset;
    const float y = (py[i] * scale + offset) * sign_y;
    const float stored_z =
        has_z ? pz[i] * scale + offset : std::sqrt(std::max(0.0f, 1 - x * x - y * y));
    const float z = std::max(0.0f, stored_z);
    const float length = std::sqrt(x * x + y * y + z * z);
    const bool nowhere = black || length < kShortestNormal;
    undefined += nowhere;
    below += !nowhere && stored_z < 0;
    const float inverse = nowhere ? 0.0f : 1.0f / length;
    px[i] = x * inverse;
    py[i] = y * inverse;
    pz[i] = nowhere ? 1.0f : z * inverse;
  }
  defects->undefined += undefined;
  defects->below += below;
}

}  // namespace

const char* ComponentName(MapKind kind, int component) {
  constexpr const char* kColors[3] = {"r", "g", "b"};
  constexpr const char* kAxes[2] = {"x", "y"};
  if (kind == MapKind::kColor) return kColors[component];
  return kind == MapKind::kScalar ? "" : kAxes[component];
}

Result<MapPlan> PlanMap(const MapSource& source, int file_index, const LoadedFile& file,
                        const ColorOptions& color, std::vector<std::string>* warnings,
                        std::vector<MapNote>* notes) {
  MapPlan plan;
  plan.role = FindMapRole(source.role);
  if (plan.role == nullptr) {
    return Fail(ErrorCode::kInvalidArgument,
                source.path + ": \"" + source.role + "\" is not a role of a map");
  }
  plan.file = file_index;
  PATINA_ASSIGN(plan.channels, ChooseChannels(source, *plan.role, file, warnings));
  const ImageStats& stats = file.stats;
  if (source.optional && stats.min[plan.channels[0]] == 1.0f &&
      stats.max[plan.channels[0]] == 1.0f) {
    notes->push_back({MapNote::Kind::kIgnored, source.file,
                      "no " + source.role + ": its channel is 1 everywhere"});
    plan.channels.clear();
    return plan;
  }
  plan.invert = source.invert;
  plan.convention = source.convention;
  switch (plan.role->kind) {
    case MapKind::kNormal:
      plan.encoding = Encoding::kNormalXy;
      FillNormalPlan(file, &plan);
      break;
    case MapKind::kColor: {
      PATINA_ASSIGN(plan.color, ChooseColor(source, file.image.info, color, warnings));
      plan.srgb = plan.color.srgb;
      // Integers are as fine as they are in their own curve.
      const bool codes = IsInteger(file.image.info.type) && !plan.color.linear_light;
      plan.encoding = plan.srgb || codes ? Encoding::kSrgb : Encoding::kLinear;
    } break;
    case MapKind::kScalar:
    case MapKind::kVector2:
      plan.srgb = source.color_space == "srgb";
      break;
  }
  if (plan.role->kind != MapKind::kColor) PATINA_TRY(CheckDataSpace(source));
  plan.constant_file = std::all_of(plan.channels.begin(), plan.channels.end(),
                                   [&](int c) { return stats.constant(c); });
  return plan;
}

void LoadMapRow(const MapPlan& plan, const LoadedFile& file, int width, int y,
                float* const planes[3], NormalDefects* defects) {
  const auto used = static_cast<int>(plan.channels.size());
  for (int i = 0; i < used; ++i) {
    const int channel = plan.channels[i];
    const auto twin = std::find(plan.channels.begin(), plan.channels.begin() + i, channel);
    if (plan.constant_file) {
      std::fill(planes[i], planes[i] + width, file.stats.min[channel]);
    } else if (twin != plan.channels.begin() + i) {
      std::copy_n(planes[twin - plan.channels.begin()], width, planes[i]);
    } else {
      LoadRow(file.image, y, channel, planes[i]);
    }
  }
  if (plan.role->kind == MapKind::kNormal) {
    NormalRow(plan, width, planes, defects);
    return;
  }
  for (int i = 0; i < used; ++i) {
    // Colours stay as codes; data that is said to be sRGB-coded is wanted linear.
    if (plan.srgb && plan.role->kind != MapKind::kColor)
      SrgbToLinearRow(planes[i], width, planes[i]);
    if (plan.invert) {
      for (int x = 0; x < width; ++x) planes[i][x] = 1.0f - planes[i][x];
    }
  }
  if (plan.color.transform != nullptr)
    plan.color.transform->Apply(planes[0], planes[1], planes[2], static_cast<size_t>(width));
}

void EncodeMapRow(const MapPlan& plan, const float* loaded, int width, float* coded) {
  const auto count = static_cast<size_t>(width);
  if (plan.encoding == Encoding::kNormalXy) {
    for (int x = 0; x < width; ++x) coded[x] = 0.5f + 0.5f * loaded[x];
  } else if (plan.encoding == Encoding::kSignedLog) {
    SignedLogRow(loaded, count, plan.scale, coded);
  } else if (plan.encoding == Encoding::kSrgb && !plan.loads_coded()) {
    LinearToSrgbRow(loaded, count, coded);
  } else if (coded != loaded) {
    std::copy_n(loaded, width, coded);
  }
}

void LinearizeMapRow(const MapPlan& plan, float* loaded, int width) {
  if (plan.loads_coded()) SrgbToLinearRow(loaded, static_cast<size_t>(width), loaded);
}

}  // namespace patina
