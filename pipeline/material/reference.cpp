#include "pipeline/material/reference.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <new>
#include <utility>

#include "pipeline/color/color.h"
#include "pipeline/image/resize.h"
#include "pipeline/material/color_encoding.h"
#include "pipeline/material/map_plan.h"
#include "pipeline/material/mip_filter.h"
#include "pipeline/material/source_maps.h"

namespace patina {
namespace {

struct Range {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
  void Add(const float* values, int count) {
    float l = low, h = high;
    for (int i = 0; i < count; ++i) {
      l = values[i] < l ? values[i] : l;
      h = values[i] > h ? values[i] : h;
    }
    low = l;
    high = h;
  }
  void Add(const Range& other) {
    low = std::min(low, other.low);
    high = std::max(high, other.high);
  }
};

std::string Percent(uint64_t part, uint64_t whole) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f %%",
                100.0 * static_cast<double>(part) / static_cast<double>(whole));
  return text;
}

// Turns loaded maps into the pyramid, mip by mip.
class Builder {
 public:
  Builder(SourceMaps maps, const ReferenceOptions& options, ThreadPool& pool,
          ProgressSink& progress)
      : options_(options),
        pool_(pool),
        progress_(progress),
        started_(Clock::now()),
        files_(std::move(maps.files)),
        plans_(std::move(maps.plans)) {
    result_.width = maps.width;
    result_.height = maps.height;
    result_.files = std::move(maps.descriptions);
    result_.notes = std::move(maps.notes);
    result_.warnings = std::move(maps.warnings);
  }

  Result<SourceReference> Run() {
    Report(0);
    PATINA_TRY(
        ChooseEncodings(files_, result_.files, result_.width, result_.height,
                        options_.color.logarithms, pool_, &plans_));
    MeasureMip0();
    JudgeAll();
    DescribeChannels();
    DescribeMaps();
    PATINA_TRY(BuildMips());
    KeepWantedMips();
    DropLeftOut();
    AddConstantMaps();
    Report(1);
    return std::move(result_);
  }

 private:
  using Clock = std::chrono::steady_clock;

  void Report(double fraction) {
    ProgressEvent event;
    event.stage = "reference";
    event.fraction = fraction;
    event.elapsed_s = std::chrono::duration<double>(Clock::now() - started_).count();
    progress_.OnProgress(event);
  }

  void Warn(const std::string& warning) {
    result_.warnings.push_back(warning);
    progress_.OnWarning(warning);
  }

  // Scratch of each worker: the rows of one map and one coded row.
  struct Scratch {
    std::array<std::vector<float>, 3> rows;
    std::vector<float> coded;
    std::array<float*, 3> planes{};
  };
  std::vector<Scratch> MakeScratch(int width) const {
    std::vector<Scratch> all(pool_.threads());
    for (Scratch& scratch : all) {
      for (int i = 0; i < 3; ++i) {
        scratch.rows[i].resize(width);
        scratch.planes[i] = scratch.rows[i].data();
      }
      scratch.coded.resize(static_cast<size_t>((width + 15) / 16 + TargetLevel::kPadBlocks) * 16);
    }
    return all;
  }

  // Ranges of the coded channels of mip 0, and the coverage of opacity.
  void MeasureMip0() {
    int components = 0;
    for (const MapPlan& plan : plans_) components += plan.components();
    const int height = result_.height, width = result_.width;
    constexpr int kRowsPerTask = 16;
    const int tasks = (height + kRowsPerTask - 1) / kRowsPerTask;
    std::vector<Range> ranges(static_cast<size_t>(tasks) * components);
    std::vector<NormalDefects> defects(static_cast<size_t>(tasks) * plans_.size());
    std::vector<uint64_t> visible(tasks, 0);
    std::vector<Scratch> scratch = MakeScratch(width);
    pool_.ParallelFor(tasks, [&](int task, int worker) {
      Scratch& s = scratch[worker];
      const int end = std::min(height, (task + 1) * kRowsPerTask);
      Range* range = &ranges[static_cast<size_t>(task) * components];
      for (size_t p = 0; p < plans_.size(); ++p) {
        const MapPlan& plan = plans_[p];
        for (int y = task * kRowsPerTask; y < end; ++y) {
          LoadMapRow(plan, files_[plan.file], width, y, s.planes.data(),
                     &defects[task * plans_.size() + p]);
          for (int c = 0; c < plan.components(); ++c) {
            EncodeMapRow(plan, s.planes[c], width, s.coded.data());
            range[c].Add(s.coded.data(), width);
          }
          if (IsOpacity(plan)) {
            const float cutoff = options_.opacity_cutoff.value_or(kOpacityCutoff);
            for (int x = 0; x < width; ++x) visible[task] += s.planes[0][x] >= cutoff;
          }
        }
        range += plan.components();
      }
    });
    ranges_.assign(components, Range());
    for (size_t i = 0; i < ranges.size(); ++i) ranges_[i % components].Add(ranges[i]);
    const uint64_t texels = static_cast<uint64_t>(width) * height;
    uint64_t total_visible = 0;
    for (const uint64_t count : visible) total_visible += count;
    coverage_ = static_cast<double>(total_visible) / static_cast<double>(texels);
    for (size_t p = 0; p < plans_.size(); ++p) {
      NormalDefects total;
      for (int task = 0; task < tasks; ++task) {
        total.undefined += defects[task * plans_.size() + p].undefined;
        total.below += defects[task * plans_.size() + p].below;
      }
      const std::string& name = result_.files[plans_[p].file].file;
      if (total.undefined > 0) {
        Warn(name + ": " + std::to_string(total.undefined) + " normals (" +
             Percent(total.undefined, texels) + ") have no direction and count as (0, 0, 1).");
      }
      if (total.below > 0) {
        Warn(name + ": " + std::to_string(total.below) + " normals (" +
             Percent(total.below, texels) + ") point below the surface and are raised to it.");
      }
    }
  }

  static bool IsOpacity(const MapPlan& plan) {
    return std::strcmp(plan.role->name, "opacity") == 0;
  }

  // What the samples say of each channel, and of the maps without a file behind them.
  void JudgeAll() {
    std::vector<ChannelFacts> facts;
    for (const MapPlan& plan : plans_) {
      for (int c = 0; c < plan.components(); ++c) {
        const Range& range = ranges_[facts.size()];
        const float unit =
            plan.encoding == Encoding::kLinear ? ScaleOfRange(range.low, range.high) : 1.0f;
        facts.push_back(
            {plan.role->name, ComponentName(plan.role->kind, c), range.low, range.high, unit});
      }
    }
    const size_t of_files = facts.size();
    for (const ConstantMap& map : options_.constants) {
      for (const float value : map.value) facts.push_back({map.role, "", value, value, 1});
    }
    verdicts_ = JudgeChannels(facts, options_.effects);
    constant_verdicts_.assign(verdicts_.begin() + static_cast<std::ptrdiff_t>(of_files),
                              verdicts_.end());
    verdicts_.resize(of_files);
  }

  // The plan and component of a channel.
  struct Component {
    size_t plan = 0;
    int component = 0;
  };

  void DescribeChannels() {
    std::vector<Component> components;
    for (size_t p = 0; p < plans_.size(); ++p) {
      for (int c = 0; c < plans_[p].components(); ++c) components.push_back({p, c});
    }
    int learned = 0;
    for (size_t index = 0; index < components.size(); ++index) {
      const MapPlan& plan = plans_[components[index].plan];
      const ChannelVerdict& verdict = verdicts_[index];
      TargetChannel channel;
      channel.map = plan.role->name;
      channel.component = ComponentName(plan.role->kind, components[index].component);
      channel.encoding = plan.encoding;
      channel.min_value = ranges_[index].low;
      channel.max_value = ranges_[index].high;
      channel.constant = verdict.state == EffectState::kConstant;
      if (channel.constant) {
        channel.constant_value = channel.min_value = channel.max_value = verdict.constant;
      } else if (channel.encoding == Encoding::kLinear) {
        channel.scale = ScaleOfRange(channel.min_value, channel.max_value);
        channel.min_value /= channel.scale;
        channel.max_value /= channel.scale;
      }
      Effect effect{ChannelName(channel.map, channel.component), verdict.state, verdict.reason, 0};
      if (verdict.state == EffectState::kLearned) {
        const int twin = EqualChannel(components, index);
        channel.learned_index =
            twin < 0 ? learned++
                     : result_.material.channels[static_cast<size_t>(twin)].learned_index;
        if (twin >= 0) {
          const TargetChannel& other = result_.material.channels[static_cast<size_t>(twin)];
          effect.state = EffectState::kDerived;
          effect.reason = "equal to " + ChannelName(other.map, other.component);
        }
      }
      if (channel.encoding == Encoding::kSignedLog) channel.scale = plan.scale;
      effect.outputs = effect.state == EffectState::kLearned ? 0 : 1;
      result_.material.channels.push_back(std::move(channel));
      result_.effects.push_back(std::move(effect));
      const bool last_of_normal =
          plan.role->kind == MapKind::kNormal && components[index].component == 1;
      if (last_of_normal && verdict.state != EffectState::kLeftOut) {
        result_.effects.push_back({ChannelName(plan.role->name, "z"), EffectState::kDerived,
                                   "the length of a normal is 1", 1});
      }
    }
    TargetPyramid& pyramid = result_.material.pyramid;
    pyramid.channels = learned;
    pyramid.address = options_.address;
    int width = result_.width, height = result_.height;
    for (;;) {
      TargetLevel level;
      level.Allocate(width, height, learned);
      pyramid.levels.push_back(std::move(level));
      if (width == 1 && height == 1) break;
      width = NextMipSide(width);
      height = NextMipSide(height);
    }
  }

  // Whether the mips of a channel follow from its samples alone.
  bool IsFilteredPlainly(const MapPlan& plan) const {
    if (plan.encoding == Encoding::kNormalXy || IsOpacity(plan)) return false;
    const std::string role = plan.role->name;
    return !options_.widen_roughness || (role != "roughness" && role != "clearcoat_roughness");
  }

  // The first channel before `index` that has the same coded values on every mip, or -1.
  int EqualChannel(const std::vector<Component>& components, size_t index) const {
    const MapPlan& plan = plans_[components[index].plan];
    if (!options_.effects.equal || !IsFilteredPlainly(plan)) return -1;
    for (size_t other = 0; other < index; ++other) {
      const MapPlan& twin = plans_[components[other].plan];
      const bool alike = verdicts_[other].state == EffectState::kLearned &&
                         twin.encoding == plan.encoding && twin.scale == plan.scale &&
                         IsFilteredPlainly(twin) &&
                         ranges_[other].low == ranges_[index].low &&
                         ranges_[other].high == ranges_[index].high;
      if (alike && HaveEqualSamples(components[other], components[index]))
        return static_cast<int>(other);
    }
    return -1;
  }

  bool HaveEqualSamples(const Component& a, const Component& b) const {
    const int width = result_.width;
    std::array<std::vector<Scratch>, 2> scratch = {MakeScratch(width), MakeScratch(width)};
    std::atomic<bool> equal{true};
    pool_.ParallelFor(result_.height, [&](int y, int worker) {
      if (!equal.load(std::memory_order_relaxed)) return;
      NormalDefects ignored;
      const auto load = [&](const Component& of, Scratch* s) {
        const MapPlan& plan = plans_[of.plan];
        LoadMapRow(plan, files_[plan.file], width, y, s->planes.data(), &ignored);
        return s->planes[static_cast<size_t>(of.component)];
      };
      const float* first = load(a, &scratch[0][worker]);
      const float* second = load(b, &scratch[1][worker]);
      if (!std::equal(first, first + width, second)) equal.store(false, std::memory_order_relaxed);
    });
    return equal.load();
  }

  // Mips that nobody looks at are neither learned nor measured.
  void KeepWantedMips() {
    if (!options_.effects.mips || (!options_.lod_range && !options_.density)) return;
    std::vector<TargetLevel>& levels = result_.material.pyramid.levels;
    const int last = static_cast<int>(levels.size()) - 1;
    std::array<int, 2> range =
        options_.lod_range ? *options_.lod_range
                           : LodRangeOf(*options_.density, result_.width, result_.height, last + 1);
    range = {std::min(range[0], last), std::min(range[1], last)};
    if (range[0] == 0 && range[1] == last) return;
    const auto leave_out = [&](int first, int end) {
      if (first >= end) return;
      const std::string from = std::to_string(first), to = std::to_string(end - 1);
      result_.effects.push_back({first == end - 1 ? "mip " + from : "mips " + from + " to " + to,
                                 EffectState::kLeftOut, "outside of the mips that are looked at",
                                 0});
    };
    leave_out(0, range[0]);
    leave_out(range[1] + 1, last + 1);
    levels.erase(levels.begin() + range[1] + 1, levels.end());
    levels.erase(levels.begin(), levels.begin() + range[0]);
    result_.material.pyramid.first_mip = range[0];
    result_.lod_range = range;
  }

  void DropLeftOut() {
    std::vector<TargetChannel> kept;
    for (size_t i = 0; i < verdicts_.size(); ++i) {
      if (verdicts_[i].state != EffectState::kLeftOut)
        kept.push_back(std::move(result_.material.channels[i]));
    }
    result_.material.channels = std::move(kept);
    std::erase_if(result_.maps, [&](const ReferenceMap& map) {
      return std::none_of(result_.material.channels.begin(), result_.material.channels.end(),
                          [&](const TargetChannel& channel) { return channel.map == map.role; });
    });
  }

  void AddConstantMaps() {
    size_t verdict = 0;
    for (const ConstantMap& map : options_.constants) {
      const MapRole& role = *FindMapRole(map.role);
      const int place = MapRoleIndex(map.role);
      std::vector<TargetChannel> channels;
      for (size_t c = 0; c < map.value.size(); ++c, ++verdict) {
        const bool left_out = constant_verdicts_[verdict].state == EffectState::kLeftOut;
        TargetChannel channel;
        channel.map = map.role;
        channel.component = ComponentName(role.kind, static_cast<int>(c));
        channel.constant = true;
        channel.constant_value = channel.min_value = channel.max_value = map.value[c];
        std::string reason = constant_verdicts_[verdict].reason;
        if (!left_out) reason = "constant in the scene";
        result_.effects.push_back({ChannelName(map.role, channel.component),
                                   left_out ? EffectState::kLeftOut : EffectState::kConstant,
                                   reason, 1});
        if (!left_out) channels.push_back(std::move(channel));
      }
      if (channels.empty()) continue;
      auto& all = result_.material.channels;
      const auto at = std::find_if(all.begin(), all.end(), [&](const TargetChannel& channel) {
        return MapRoleIndex(channel.map) > place;
      });
      all.insert(at, channels.begin(), channels.end());
      ReferenceMap described;
      described.role = map.role;
      described.type = SampleType::kFloat;
      const auto before =
          std::find_if(result_.maps.begin(), result_.maps.end(),
                       [&](const ReferenceMap& other) { return MapRoleIndex(other.role) > place; });
      result_.maps.insert(before, std::move(described));
    }
  }

  void DescribeMaps() {
    for (const MapPlan& plan : plans_) {
      const LoadedFile& file = files_[plan.file];
      ReferenceMap map;
      map.role = plan.role->name;
      map.file = plan.file;
      map.file_channels.assign(plan.channels.begin(), plan.channels.begin() + plan.components());
      map.type = result_.files[plan.file].type;
      map.inverted = plan.invert;
      map.srgb = plan.srgb || plan.color.space == "sRGB";
      if (plan.role->kind == MapKind::kColor) {
        map.color_space = plan.color.space;
        map.color_rule = ColorRuleName(plan.color.rule);
        map.converted = plan.color.transform != nullptr;
      }
      map.convention = plan.convention;
      map.encoding = plan.encoding;
      map.resized = file.resized;
      result_.maps.push_back(std::move(map));
    }
  }

  // Coded values of ordinary maps are their own; those far above 1 or below it are brought near 1
  // by a power of two, which is exact both ways.
  static float ScaleOfRange(float low, float high) {
    const float largest = std::max(std::abs(low), std::abs(high));
    if (largest == 0 || (largest <= 1.0f && largest >= 0x1p-10f)) return 1.0f;
    return std::clamp(std::exp2(std::ceil(std::log2(largest))), 0x1p-100f, 0x1p100f);
  }

  // Writes a row of one channel; a linear one divided by its scale.
  void StoreScaledRow(TargetLevel* level, int y, int channel, float* coded) const {
    const TargetChannel& described = result_.material.channels[channel];
    const float scale = described.scale;
    if (scale != 1.0f && described.encoding == Encoding::kLinear) {
      for (int x = 0; x < level->width; ++x) coded[x] /= scale;
    }
    StoreRow(level, y, Learned(channel), coded);
  }

  // Where the planes and channels of a map are.
  struct Place {
    int channel = 0;  // in material.channels, of the first component
    int plane = -1;   // of the working levels, or -1 when no component is learned
  };

  std::vector<Place> MakePlaces(int* planes) const {
    std::vector<Place> places;
    int channel = 0;
    *planes = 0;
    for (const MapPlan& plan : plans_) {
      Place place;
      place.channel = channel;
      bool learned = false;
      for (int c = 0; c < plan.components(); ++c) learned |= Learned(channel + c) >= 0;
      if (learned) {
        place.plane = *planes;
        *planes += plan.work_planes();
      }
      places.push_back(place);
      channel += plan.components();
    }
    return places;
  }

  int Learned(int channel) const { return result_.material.channels[channel].learned_index; }

  // Writes a row of one channel, columns beyond the edge included. `coded` has room for all blocks
  // of the row.
  void StoreRow(TargetLevel* level, int y, int channel, float* coded) const {
    const int columns = level->row_blocks * 16;
    for (int x = level->width; x < columns; ++x) {
      coded[x] = options_.address == AddressMode::kWrap ? coded[x - level->width]
                                                        : coded[level->width - 1];
    }
    float* to = level->data.data() +
                (static_cast<size_t>(y) * level->row_blocks * level->channels + channel) * 16;
    for (int block = 0; block < level->row_blocks; ++block) {
      std::memcpy(to + static_cast<size_t>(block) * level->channels * 16, coded + block * 16,
                  16 * sizeof(float));
    }
  }

  Status BuildMips() {
    int planes = 0;
    const std::vector<Place> places = MakePlaces(&planes);
    TargetPyramid& pyramid = result_.material.pyramid;
    PlaneLevel level = BuildFirstLevels(places, planes);
    files_.clear();
    for (size_t mip = 1; mip < pyramid.levels.size(); ++mip) {
      if (options_.cancel != nullptr && options_.cancel->cancelled()) {
        return Fail(ErrorCode::kCancelled, "stopped while the reference was filtered");
      }
      if (mip > 1) level = NextLevel(level, pool_);
      EncodeLevel(places, level, &pyramid.levels[mip]);
      Report(static_cast<double>(mip) / static_cast<double>(pyramid.levels.size()));
    }
    return {};
  }

  // Writes mip 0 and returns the working values of mip 1, each row of which needs two or three rows
  // of mip 0. Of three, the last is read again for the next row.
  PlaneLevel BuildFirstLevels(const std::vector<Place>& places, int planes) {
    TargetLevel& mip0 = result_.material.pyramid.levels[0];
    const int width = result_.width, height = result_.height;
    PlaneLevel next;
    next.Allocate(NextMipSide(width), NextMipSide(height), planes);
    std::vector<Scratch> scratch = MakeScratch(width);
    pool_.ParallelFor(next.height, [&](int y, int worker) {
      Scratch& s = scratch[worker];
      NormalDefects ignored;
      const BoxTaps taps = BoxTapsFor(height, y);
      for (size_t p = 0; p < plans_.size(); ++p) {
        const MapPlan& plan = plans_[p];
        if (places[p].plane < 0) continue;
        for (int tap = 0; tap < taps.count; ++tap) {
          const int row = taps.first + tap;
          LoadMapRow(plan, files_[plan.file], width, row, s.planes.data(), &ignored);
          const bool mine = tap < 2 || y == next.height - 1;
          for (int c = 0; c < plan.components() && mine; ++c) {
            const int channel = Learned(places[p].channel + c);
            if (channel < 0) continue;
            EncodeMapRow(plan, s.planes[c], width, s.coded.data());
            StoreScaledRow(&mip0, row, places[p].channel + c, s.coded.data());
          }
          for (int i = 0; i < plan.work_planes(); ++i) {
            LinearizeMapRow(plan, s.planes[i], width);
            AddBoxRow(s.planes[i], width, taps.weight[tap], next.Row(places[p].plane + i, y));
          }
        }
      }
    });
    return next;
  }

  // Index of the plan whose normals widen the roughness of plan p, or -1.
  int WideningNormals(size_t p, const std::vector<Place>& places) const {
    if (!options_.widen_roughness) return -1;
    const std::string role = plans_[p].role->name;
    const char* wanted = role == "roughness"             ? "normal"
                         : role == "clearcoat_roughness" ? "clearcoat_normal"
                                                         : nullptr;
    for (size_t other = 0; other < plans_.size() && wanted != nullptr; ++other) {
      if (std::strcmp(plans_[other].role->name, wanted) == 0 && places[other].plane >= 0)
        return static_cast<int>(other);
    }
    return -1;
  }

  void EncodeLevel(const std::vector<Place>& places, const PlaneLevel& level, TargetLevel* target) {
    const int width = level.width;
    std::vector<float> scales(plans_.size(), 1.0f);
    std::vector<int> widening(plans_.size(), -1);
    for (size_t p = 0; p < plans_.size(); ++p) {
      if (places[p].plane < 0) continue;
      widening[p] = WideningNormals(p, places);
      if (IsOpacity(plans_[p]) && options_.opacity_cutoff) {
        const size_t texels = static_cast<size_t>(width) * level.height;
        scales[p] = CoverageScale({level.Row(places[p].plane, 0), texels}, coverage_,
                                  *options_.opacity_cutoff);
      }
    }
    const size_t channels = result_.material.channels.size();
    std::vector<Range> ranges(channels * level.height);
    std::vector<Scratch> scratch = MakeScratch(width);
    pool_.ParallelFor(level.height, [&](int y, int worker) {
      float* coded = scratch[worker].coded.data();
      for (size_t p = 0; p < plans_.size(); ++p) {
        const Place& place = places[p];
        if (place.plane < 0) continue;
        for (int c = 0; c < plans_[p].components(); ++c) {
          if (Learned(place.channel + c) < 0) continue;
          EncodeRow(p, c, level, y, place, scales[p],
                    widening[p] < 0 ? -1 : places[widening[p]].plane, coded);
          StoreScaledRow(target, y, place.channel + c, coded);
          ranges[y * channels + place.channel + c].Add(coded, width);
        }
      }
    });
    for (size_t i = 0; i < ranges.size(); ++i) {
      TargetChannel& channel = result_.material.channels[i % channels];
      if (channel.constant) continue;
      channel.min_value = std::min(channel.min_value, ranges[i].low);
      channel.max_value = std::max(channel.max_value, ranges[i].high);
    }
  }

  // Working values of component c of a map to coded ones.
  void EncodeRow(size_t p, int c, const PlaneLevel& level, int y, const Place& place, float scale,
                 int normal_plane, float* coded) const {
    const int width = level.width;
    const float* in = level.Row(place.plane + c, y);
    switch (plans_[p].encoding) {
      case Encoding::kSrgb:
        LinearToSrgbRow(in, width, coded);
        return;
      case Encoding::kNormalXy: {
        const float* nx = level.Row(place.plane, y);
        const float* ny = level.Row(place.plane + 1, y);
        const float* nz = level.Row(place.plane + 2, y);
        for (int x = 0; x < width; ++x) {
          const float length = std::sqrt(nx[x] * nx[x] + ny[x] * ny[x] + nz[x] * nz[x]);
          // Normals that cancel out leave a flat surface.
          coded[x] = length > 1e-6f ? 0.5f + 0.5f * (in[x] / length) : 0.5f;
        }
        return;
      }
      case Encoding::kSignedLog:
        SignedLogRow(in, width, plans_[p].scale, coded);
        return;
      case Encoding::kLinear:
        break;
    }
    if (normal_plane >= 0) {
      const float* nx = level.Row(normal_plane, y);
      const float* ny = level.Row(normal_plane + 1, y);
      const float* nz = level.Row(normal_plane + 2, y);
      for (int x = 0; x < width; ++x) {
        coded[x] = WidenRoughness(in[x], std::sqrt(nx[x] * nx[x] + ny[x] * ny[x] + nz[x] * nz[x]));
      }
    } else if (scale != 1.0f) {
      for (int x = 0; x < width; ++x) coded[x] = std::min(1.0f, in[x] * scale);
    } else {
      std::copy_n(in, width, coded);
    }
  }

  const ReferenceOptions& options_;
  ThreadPool& pool_;
  ProgressSink& progress_;
  Clock::time_point started_;
  std::vector<LoadedFile> files_;
  std::vector<MapPlan> plans_;
  std::vector<Range> ranges_;                      // of mip 0, one for each component of each plan
  std::vector<ChannelVerdict> verdicts_;           // likewise
  std::vector<ChannelVerdict> constant_verdicts_;  // of options_.constants
  double coverage_ = 0;                            // of opacity on mip 0
  SourceReference result_;
};

int Address(int i, int size, AddressMode mode) {
  if (mode == AddressMode::kClamp) return std::clamp(i, 0, size - 1);
  const int rest = i % size;
  return rest < 0 ? rest + size : rest;
}

// Adds weight times the bicubic value of one level at (u, v).
void AddLevel(const TargetLevel& level, AddressMode mode, double u, double v, double weight,
              double* out) {
  const double x = u * level.width - 0.5, y = v * level.height - 0.5;
  const double x0 = std::floor(x), y0 = std::floor(y);
  double wx[4], wy[4];
  CatmullRomWeights(x - x0, wx);
  CatmullRomWeights(y - y0, wy);
  for (int j = 0; j < 4; ++j) {
    const int row = Address(static_cast<int>(y0) - 1 + j, level.height, mode);
    for (int i = 0; i < 4; ++i) {
      const int column = Address(static_cast<int>(x0) - 1 + i, level.width, mode);
      for (int c = 0; c < level.channels; ++c) {
        out[c] += weight * wy[j] * wx[i] * static_cast<double>(level.At(column, row, c));
      }
    }
  }
}

}  // namespace

Result<SourceReference> BuildReference(const MapSet& set, const ReferenceOptions& options,
                                       ThreadPool& pool, ProgressSink& progress) {
  try {
    PATINA_ASSIGN(SourceMaps maps, LoadSourceMaps(set, options, pool, progress));
    return Builder(std::move(maps), options, pool, progress).Run();
  } catch (const std::bad_alloc&) {
    return Fail(
        ErrorCode::kResourceExhausted,
        set.name + ": not enough memory for the reference; use smaller maps or a larger machine");
  }
}

void SampleReference(const TargetPyramid& pyramid, double u, double v, double s, double* out) {
  std::fill(out, out + pyramid.channels, 0.0);
  const double last = static_cast<double>(pyramid.levels.size()) - 1;
  const double clamped = std::clamp(s, 0.0, last);
  const auto fine = static_cast<size_t>(clamped);
  const double share = clamped - static_cast<double>(fine);
  AddLevel(pyramid.levels[fine], pyramid.address, u, v, 1 - share, out);
  if (share > 0) AddLevel(pyramid.levels[fine + 1], pyramid.address, u, v, share, out);
}

}  // namespace patina
