#include "pipeline/svbrdf/stack_model.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <mutex>
#include <numbers>
#include <set>

#include "formats/base/names.h"
#include "formats/layered/layered_file.h"
#include "pipeline/image/image_io.h"
#include "pipeline/material/map_plan.h"
#include "pipeline/svbrdf/tilted_frame.h"

namespace patina::svbrdf {
namespace {

using layered::StackMap;
using layered::StackNumber;

int ChannelsOf(StackNumber number) { return layered::IsColour(number) ? 3 : 1; }

// Sets a number of the stack; values: ChannelsOf(map.number) of them.
void SetNumber(const StackMap& map, const float* values, layered::Stack* stack) {
  const auto value = static_cast<double>(values[0]);
  const layered::Rgb rgb =
      layered::IsColour(map.number)
          ? layered::Rgb{value, static_cast<double>(values[1]), static_cast<double>(values[2])}
          : layered::Rgb{value, value, value};
  layered::Layer* layer = map.layer >= 0 ? &stack->layers[static_cast<size_t>(map.layer)] : nullptr;
  layered::BasePart* part = map.part >= 0 ? &stack->parts[static_cast<size_t>(map.part)] : nullptr;
  layered::Roughness* roughness = layer != nullptr ? &layer->roughness : &part->roughness;
  switch (map.number) {
    case StackNumber::kIor:
      layer->ior = value;
      break;
    case StackNumber::kRoughness:
      if (map.axis != 1) roughness->x = value;
      if (map.axis != 0) roughness->y = value;
      break;
    case StackNumber::kRotation:
      roughness->rotation_rad = value * std::numbers::pi / 180;
      break;
    case StackNumber::kThickness:
      layer->thickness = value;
      break;
    case StackNumber::kAbsorption:
      layer->absorption = rgb;
      break;
    case StackNumber::kScattering:
      layer->scattering = rgb;
      break;
    case StackNumber::kAsymmetry:
      layer->asymmetry = value;
      break;
    case StackNumber::kWeight:
      part->weight = value;
      break;
    case StackNumber::kAlbedo:
      part->albedo = rgb;
      break;
  }
}

std::string Short(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

void Join(const layered::Effects& one, layered::Effects* all) {
  all->deep = all->deep || one.deep;
  all->rough = all->rough || one.rough;
  all->anisotropic = all->anisotropic || one.anisotropic;
  all->absorption = all->absorption || one.absorption;
  all->scattering = all->scattering || one.scattering;
  all->colour = all->colour || one.colour;
}

}  // namespace

class StackLoader {
 public:
  StackLoader(const layered::VaryingStack& stack, const std::string& path,
              const ColorOptions& color, ThreadPool& pool)
      : path_(path), color_(color), pool_(pool), model_(new StackModel) {
    model_->varying_ = stack;
    const size_t slash = path.rfind('/');
    if (slash != std::string::npos) folder_ = path.substr(0, slash + 1);
  }

  Result<std::shared_ptr<const StackModel>> Run() {
    const layered::VaryingStack& stack = model_->varying_;
    for (const StackMap& map : stack.maps) {
      model_->first_.push_back(model_->stride_);
      model_->stride_ += ChannelsOf(map.number);
      PATINA_TRY(Open(map.pointer, map.file));
    }
    if (stack.normal) {
      model_->normal_ = model_->stride_;
      model_->stride_ += 3;
      PATINA_TRY(Open("/normal", stack.normal->file));
    }
    model_->texels_.resize(Texels() * static_cast<size_t>(model_->stride_));
    for (size_t m = 0; m < stack.maps.size(); ++m) PATINA_TRY(ReadNumbers(stack.maps[m], m));
    if (stack.normal) PATINA_TRY(ReadNormals(*stack.normal));
    PATINA_TRY(CheckWeights());
    FindMean();
    FindEffects();
    return std::shared_ptr<const StackModel>(std::move(model_));
  }

 private:
  size_t Texels() const {
    return static_cast<size_t>(model_->width_) * static_cast<size_t>(model_->height_);
  }

  tl::unexpected<Error> Refuse(const std::string& pointer, ErrorCode code,
                               const std::string& what) const {
    return Fail(code, path_ + ": " + pointer + ": " + what);
  }

  // Reads a file that no map before has named.
  Status Open(const std::string& pointer, const std::string& file) {
    if (files_.count(file) != 0) return {};
    const std::string path = folder_ + file;
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(path, ignored)) {
      return Refuse(pointer + "/map", ErrorCode::kNotFound,
                    "there is no file " + QuoteForMessage(file) +
                        " beside the JSON file; add it, or give a number in its place");
    }
    auto image = ReadImage(path);
    if (!image) return Fail(image.error(), path_ + ": " + pointer + "/map");
    if (image->width() > kMaxMapSide || image->height() > kMaxMapSide) {
      return Refuse(pointer + "/map", ErrorCode::kOutOfRange,
                    file + ": more than " + std::to_string(kMaxMapSide) +
                        " texels a side; scale the maps down");
    }
    if (files_.empty()) {
      model_->width_ = image->width();
      model_->height_ = image->height();
      first_file_ = file;
    } else if (image->width() != model_->width_ || image->height() != model_->height_) {
      return Refuse(pointer + "/map", ErrorCode::kInvalidArgument,
                    file + " has " + std::to_string(image->width()) + " x " +
                        std::to_string(image->height()) + " texels, but " + first_file_ + " " +
                        std::to_string(model_->width_) + " x " + std::to_string(model_->height_) +
                        "; scale all maps to one size");
    }
    if (const NonFinite bad = FindNonFinite(*image); bad.count > 0) {
      return Refuse(pointer + "/map", ErrorCode::kCorruptData,
                    file + ": " + std::to_string(bad.count) +
                        " samples are NaN or infinite, the first at x " +
                        std::to_string(bad.first_x) + ", y " + std::to_string(bad.first_y) +
                        "; mend the file");
    }
    for (const std::string& warning : image->info.warnings)
      model_->warnings_.push_back(file + ": " + warning);
    LoadedFile& loaded = files_[file];
    loaded.stats = ScanImage(*image, pool_);
    loaded.image = std::move(*image);
    return {};
  }

  // What is read from a file for a role of texture sets.
  Result<MapPlan> Plan(const std::string& pointer, const MapSource& source) {
    std::vector<std::string> warnings;
    std::vector<MapNote> notes;
    auto plan = PlanMap(source, 0, files_.at(source.file), color_, &warnings, &notes);
    if (!plan) return Fail(plan.error(), path_ + ": " + pointer);
    for (const std::string& warning : warnings) model_->warnings_.push_back(warning);
    return plan;
  }

  Status ReadNumbers(const StackMap& map, size_t index) {
    const LoadedFile& file = files_.at(map.file);
    const int available = file.image.channels();
    const int wanted = ChannelsOf(map.number);
    std::vector<int> channels;
    if (!map.channel.empty()) {
      const auto channel = static_cast<int>(std::string_view("rgba").find(map.channel));
      if (channel >= available) {
        return Refuse(map.pointer + "/channel", ErrorCode::kInvalidArgument,
                      map.file + " has " + std::to_string(available) + " channels and no " +
                          map.channel + "; name one that it has");
      }
      channels.assign(static_cast<size_t>(wanted), channel);
    } else {
      for (int c = 0; c < wanted; ++c) channels.push_back(available >= 3 ? c : 0);
    }
    std::optional<MapPlan> plan;
    if (map.number == StackNumber::kAlbedo) {
      MapSource source;
      source.role = "albedo";
      source.path = folder_ + map.file;
      source.file = map.file;
      if (!map.channel.empty()) source.channels = map.channel + map.channel + map.channel;
      source.color_space = map.color_space;
      PATINA_ASSIGN(plan, Plan(map.pointer, source));
      model_->used_color_config_ = model_->used_color_config_ || plan->color.transform != nullptr;
      // Pixels are there even of a file of one value.
      plan->constant_file = false;
    }
    const auto width = static_cast<size_t>(model_->width_);
    const auto stride = static_cast<size_t>(model_->stride_);
    pool_.ParallelFor(model_->height_, [&](int y, int) {
      std::vector<float> row(3 * width);
      float* planes[3] = {row.data(), row.data() + width, row.data() + 2 * width};
      if (plan) {
        LoadMapRow(*plan, file, model_->width_, y, planes, nullptr);
        for (float* plane : planes) LinearizeMapRow(*plan, plane, model_->width_);
      } else {
        for (int c = 0; c < wanted; ++c)
          LoadRow(file.image, y, channels[static_cast<size_t>(c)], planes[c]);
      }
      float* out = model_->texels_.data() + static_cast<size_t>(y) * width * stride +
                   static_cast<size_t>(model_->first_[index]);
      for (size_t x = 0; x < width; ++x) {
        for (int c = 0; c < wanted; ++c) {
          double value = map.offset + map.scale * static_cast<double>(planes[c][x]);
          // What a conversion of colours leaves beside 0 and 1.
          constexpr double kRounding = 1e-4;
          if (plan && std::abs(value - std::clamp(value, 0.0, 1.0)) < kRounding)
            value = std::clamp(value, 0.0, 1.0);
          out[x * stride + static_cast<size_t>(c)] = static_cast<float>(value);
        }
      }
    });
    return CheckRange(map, index);
  }

  // The least and the largest value must be ones that a stack can have; then all are.
  Status CheckRange(const StackMap& map, size_t index) {
    const auto stride = static_cast<size_t>(model_->stride_);
    const auto first = static_cast<size_t>(model_->first_[index]);
    const size_t texels = Texels();
    for (size_t c = 0; c < static_cast<size_t>(ChannelsOf(map.number)); ++c) {
      size_t least = 0, largest = 0;
      const auto at = [&](size_t texel) { return model_->texels_[texel * stride + first + c]; };
      for (size_t t = 1; t < texels; ++t) {
        if (at(t) < at(least)) least = t;
        if (at(t) > at(largest)) largest = t;
      }
      for (const size_t texel : {least, largest}) PATINA_TRY(CheckValue(map, at(texel), texel));
    }
    const double floor = map.number == StackNumber::kRoughness ? kLeastMapRoughness
                         : map.number == StackNumber::kIor     ? kLeastMapIor
                                                               : -layered::kMaxMapFactor;
    for (size_t t = 0; t < texels; ++t) {
      float& value = model_->texels_[t * stride + first];
      value = std::max(value, static_cast<float>(floor));
    }
    return {};
  }

  Status CheckValue(const StackMap& map, float value, size_t texel) {
    layered::Stack stack = model_->varying_.stack;
    const float given[3] = {value, value, value};
    // A texel without a layer has nothing that could absorb; polished ones are raised.
    const bool none = map.number == StackNumber::kThickness && value == 0;
    const bool polished = map.number == StackNumber::kRoughness && value >= 0 &&
                          static_cast<double>(value) < kLeastMapRoughness;
    if (none || polished) return {};
    SetNumber(map, given, &stack);
    const Status status = layered::CheckStack(stack);
    if (status) return {};
    const auto width = static_cast<size_t>(model_->width_);
    return Fail(ErrorCode::kInvalidArgument,
                path_ + ": " + status.error().message + " (" + Short(map.offset) + " + " +
                    Short(map.scale) + " x the sample at x " + std::to_string(texel % width) +
                    ", y " + std::to_string(texel / width) + " of " + map.file +
                    "; change \"scale\" and \"offset\" of " + map.pointer + ", or the map)");
  }

  Status ReadNormals(const layered::StackNormal& normal) {
    const LoadedFile& file = files_.at(normal.file);
    MapSource source;
    source.role = "normal";
    source.path = folder_ + normal.file;
    source.file = normal.file;
    PATINA_ASSIGN(MapPlan plan, Plan("/normal", source));
    plan.constant_file = false;
    // Rows of the map run down, as y of the frame does.
    plan.flip_y = !normal.directx;
    const auto width = static_cast<size_t>(model_->width_);
    const auto stride = static_cast<size_t>(model_->stride_);
    std::mutex mutex;
    NormalDefects defects;
    pool_.ParallelFor(model_->height_, [&](int y, int) {
      std::vector<float> row(3 * width);
      float* planes[3] = {row.data(), row.data() + width, row.data() + 2 * width};
      NormalDefects of_row;
      LoadMapRow(plan, file, model_->width_, y, planes, &of_row);
      float* out = model_->texels_.data() + static_cast<size_t>(y) * width * stride +
                   static_cast<size_t>(model_->normal_);
      for (size_t x = 0; x < width; ++x) {
        for (size_t c = 0; c < 3; ++c) out[x * stride + c] = planes[c][x];
      }
      const std::lock_guard lock(mutex);
      defects.undefined += of_row.undefined;
      defects.below += of_row.below;
    });
    if (defects.undefined + defects.below > 0) {
      model_->warnings_.push_back(
          normal.file + ": " + std::to_string(defects.undefined + defects.below) +
          " texels have no direction or one below the surface, and are mended.");
    }
    return {};
  }

  // Shares of a mixture, which maps give, sum to at most 1 at every texel.
  Status CheckWeights() const {
    const auto& maps = model_->varying_.maps;
    const auto is_weight = [](const StackMap& map) { return map.number == StackNumber::kWeight; };
    const auto last = std::find_if(maps.rbegin(), maps.rend(), is_weight);
    if (last == maps.rend()) return {};
    const auto width = static_cast<size_t>(model_->width_);
    layered::Stack stack = model_->varying_.stack;
    for (size_t t = 0; t < Texels(); ++t) {
      model_->Apply(model_->texels_.data() + t * static_cast<size_t>(model_->stride_), &stack);
      double sum = 0;
      for (const layered::BasePart& part : stack.parts) sum += part.weight;
      if (sum <= 1 + 1e-6) continue;
      return Refuse("/base/parts", ErrorCode::kInvalidArgument,
                    "the weights sum to " + Short(sum) + " at x " + std::to_string(t % width) +
                        ", y " + std::to_string(t / width) +
                        ", so the base would make light; change \"scale\" and \"offset\" of " +
                        last->pointer);
    }
    return {};
  }

  void FindMean() {
    const auto stride = static_cast<size_t>(model_->stride_);
    std::vector<double> sums(stride);
    for (size_t t = 0; t < Texels(); ++t) {
      for (size_t n = 0; n < stride; ++n)
        sums[n] += static_cast<double>(model_->texels_[t * stride + n]);
    }
    std::vector<float> means;
    for (const double sum : sums)
      means.push_back(static_cast<float>(sum / static_cast<double>(Texels())));
    model_->mean_ = model_->varying_.stack;
    model_->Apply(means.data(), &model_->mean_);
  }

  void FindEffects() {
    std::mutex mutex;
    const auto width = static_cast<size_t>(model_->width_);
    const auto stride = static_cast<size_t>(model_->stride_);
    pool_.ParallelFor(model_->height_, [&](int y, int) {
      layered::Effects of_row;
      layered::Stack stack = model_->varying_.stack;
      for (size_t x = 0; x < width; ++x) {
        const float* numbers =
            model_->texels_.data() + (static_cast<size_t>(y) * width + x) * stride;
        model_->Apply(numbers, &stack);
        Join(layered::Prepare(stack).effects, &of_row);
      }
      const std::lock_guard lock(mutex);
      Join(of_row, &model_->effects_);
    });
    model_->kernel_ = layered::KernelFor(model_->effects_);
  }

  const std::string& path_;
  const ColorOptions& color_;
  ThreadPool& pool_;
  std::string folder_, first_file_;
  std::map<std::string, LoadedFile> files_;
  std::shared_ptr<StackModel> model_;
};

Result<std::shared_ptr<const StackModel>> StackModel::Load(const layered::VaryingStack& stack,
                                                           const std::string& path,
                                                           const ColorOptions& color,
                                                           ThreadPool& pool) {
  return StackLoader(stack, path, color, pool).Run();
}

void StackModel::Apply(const float* numbers, layered::Stack* stack) const {
  for (size_t m = 0; m < varying_.maps.size(); ++m)
    SetNumber(varying_.maps[m], numbers + first_[m], stack);
}

layered::Stack StackModel::StackAt(size_t texel) const {
  layered::Stack stack = varying_.stack;
  Apply(texels_.data() + texel * static_cast<size_t>(stride_), &stack);
  return stack;
}

void StackModel::Numbers(size_t texel, float* out) const {
  const float* numbers = texels_.data() + texel * static_cast<size_t>(stride_);
  std::copy(numbers, numbers + stride_, out);
}

void StackModel::AddDraws(size_t texel, const brdf::Direction& wi, const brdf::Direction& wo,
                          int draws, Rng* rng, double sum[3], double squares[3]) const {
  const float* numbers = texels_.data() + texel * static_cast<size_t>(stride_);
  TiltedFrame frame = {wi, wo, 1};
  if (normal_ >= 0)
    frame = TiltTo({numbers[normal_], numbers[normal_ + 1], numbers[normal_ + 2]}, wi, wo);
  if (frame.factor == 0) return;
  // Its vectors keep their memory from draw to draw.
  thread_local layered::Stack stack;
  stack = varying_.stack;
  Apply(numbers, &stack);
  const layered::PreparedStack prepared = layered::Prepare(stack);
  const auto exact = [](const brdf::Direction& w) {
    return layered::Normalized(
        {static_cast<double>(w.x), static_cast<double>(w.y), static_cast<double>(w.z)});
  };
  const layered::Vec i = exact(frame.wi), o = exact(frame.wo);
  const auto factor = static_cast<double>(frame.factor);
  double drawn[3] = {0, 0, 0}, drawn_squares[3] = {0, 0, 0};
  if (prepared.layers > 0) {
    kernel_(prepared, i, o, draws, rng, drawn, drawn_squares);
  } else {
    layered::EvaluateBareBase(prepared, i, o, drawn);
    for (size_t c = 0; c < 3; ++c) {
      drawn_squares[c] = draws * drawn[c] * drawn[c];
      drawn[c] *= draws;
    }
  }
  for (size_t c = 0; c < 3; ++c) {
    sum[c] += factor * drawn[c];
    squares[c] += factor * factor * drawn_squares[c];
  }
}

}  // namespace patina::svbrdf
