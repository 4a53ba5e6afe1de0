#include "pipeline/material/source_maps.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <optional>
#include <utility>

#include "pipeline/image/image_io.h"
#include "pipeline/image/resize.h"
#include "pipeline/material/normal_convention.h"

namespace patina {
namespace {

// Below these the pixels say nothing about the convention of a normal map. Measured: |correlation|
// with the height 0.79 to 0.98 on four sets, curl 0.06 to 0.93 on 22 OpenGL maps and -0.75 and less
// on DirectX maps.
constexpr double kHeightEvidence = 0.3;
constexpr double kCurlEvidence = -0.5;

class Loader {
 public:
  Loader(const MapSet& set, const ReferenceOptions& options, ThreadPool& pool,
         ProgressSink& progress)
      : set_(set), options_(options), pool_(pool), progress_(progress), started_(Clock::now()) {
    maps_.notes = set.notes;
  }

  Result<SourceMaps> Run() {
    PATINA_TRY(LoadFiles());
    PATINA_TRY(PlanMaps());
    PATINA_TRY(UnifySizes());
    SettleConventions();
    return std::move(maps_);
  }

 private:
  using Clock = std::chrono::steady_clock;

  void Report(double fraction, const std::string& message = "") {
    ProgressEvent event;
    event.stage = "ingest";
    event.fraction = fraction;
    event.elapsed_s = std::chrono::duration<double>(Clock::now() - started_).count();
    event.message = message;
    progress_.OnProgress(event);
  }

  void Warn(const std::string& warning) {
    maps_.warnings.push_back(warning);
    progress_.OnWarning(warning);
  }

  bool cancelled() const { return options_.cancel != nullptr && options_.cancel->cancelled(); }
  tl::unexpected<Error> Cancelled() const {
    return Fail(ErrorCode::kCancelled, "stopped while reading " + set_.name);
  }

  Status LoadFiles() {
    if (set_.maps.empty() && options_.constants.empty()) {
      return Fail(ErrorCode::kInvalidArgument,
                  set_.name + ": the set has no maps; name at least one");
    }
    Report(0, "reading " + std::to_string(set_.maps.size()) + " maps");
    std::vector<std::string> paths;
    for (const MapSource& source : set_.maps) {
      if (file_of_path_.emplace(source.path, static_cast<int>(paths.size())).second) {
        paths.push_back(source.path);
        ReferenceFile file;
        file.path = source.path;
        file.file = source.file;
        maps_.descriptions.push_back(std::move(file));
      }
    }
    const int count = static_cast<int>(paths.size());
    SetImageIoThreads(std::max(1, pool_.threads() / std::max(1, count)));
    std::vector<std::optional<Result<Image>>> loaded(count);
    pool_.ParallelFor(count, [&](int i, int) {
      if (cancelled()) return;
      loaded[i].emplace(options_.read_image ? options_.read_image(paths[i]) : ReadImage(paths[i]));
    });
    SetImageIoThreads(pool_.threads());
    if (cancelled()) return Cancelled();
    for (int i = 0; i < count; ++i) {
      if (!*loaded[i]) return Fail(std::move(*loaded[i]).error());
      LoadedFile file;
      file.image = std::move(**loaded[i]);
      loaded[i].reset();
      PATINA_TRY(CheckFinite(i, &file.image));
      file.stats = ScanImage(file.image, pool_);
      ReferenceFile& described = maps_.descriptions[i];
      const ImageInfo& info = file.image.info;
      described.width = info.width;
      described.height = info.height;
      described.channels = info.channels;
      described.type = info.type;
      described.format = info.format;
      for (const std::string& warning : info.warnings) Warn(described.file + ": " + warning);
      maps_.files.push_back(std::move(file));
      Report(static_cast<double>(i + 1) / count);
    }
    return {};
  }

  Status CheckFinite(int index, Image* image) {
    const NonFinite found = FindNonFinite(*image);
    if (found.count == 0) return {};
    const std::string where =
        std::to_string(found.count) + " samples are NaN or infinite, the first at x " +
        std::to_string(found.first_x) + ", y " + std::to_string(found.first_y) + ", channel " +
        std::to_string(found.first_channel);
    if (!options_.repair_nonfinite) {
      return Fail(ErrorCode::kCorruptData,
                  image->path + ": " + where +
                      "; mend the file, or replace such samples by the mean of their neighbours "
                      "with --repair-nonfinite");
    }
    RepairNonFinite(image);
    Warn(maps_.descriptions[index].file + ": " + where +
         "; each is replaced by the mean of its finite neighbours.");
    return {};
  }

  Status PlanMaps() {
    for (const MapSource& source : set_.maps) {
      const int file = file_of_path_.at(source.path);
      std::vector<std::string> warnings;
      PATINA_ASSIGN(MapPlan plan,
                    PlanMap(source, file, maps_.files[file], options_.color, &warnings, &maps_.notes));
      for (const std::string& warning : warnings) Warn(warning);
      if (plan.channels.empty()) continue;
      if (plan.role->kind == MapKind::kNormal) {
        if (options_.normal_convention != NormalConvention::kAuto && source.convention_from_name) {
          plan.convention = options_.normal_convention;
        }
      }
      maps_.descriptions[file].roles.push_back(plan.role->name);
      maps_.plans.push_back(std::move(plan));
    }
    if (maps_.plans.empty() && options_.constants.empty()) {
      return Fail(ErrorCode::kInvalidArgument,
                  set_.name + ": none of the maps says anything; name other maps");
    }
    std::stable_sort(maps_.plans.begin(), maps_.plans.end(),
                     [](const MapPlan& a, const MapPlan& b) { return a.role < b.role; });
    return {};
  }

  // A file that only constant maps come from takes any size.
  bool IsConstantFile(int file) const {
    return std::all_of(maps_.plans.begin(), maps_.plans.end(), [&](const MapPlan& plan) {
      return plan.file != file || plan.constant_file;
    });
  }

  Status UnifySizes() {
    if (maps_.plans.empty()) maps_.width = maps_.height = 1;
    const bool all_constant = std::all_of(maps_.plans.begin(), maps_.plans.end(),
                                          [](const MapPlan& plan) { return plan.constant_file; });
    for (const MapPlan& plan : maps_.plans) {
      if (plan.constant_file && !all_constant) continue;
      maps_.width = std::max(maps_.width, maps_.files[plan.file].image.width());
      maps_.height = std::max(maps_.height, maps_.files[plan.file].image.height());
    }
    const uint64_t texels = static_cast<uint64_t>(maps_.width) * maps_.height;
    if (texels > options_.max_texels) {
      return Fail(ErrorCode::kOutOfRange,
                  set_.name + ": the maps are " + std::to_string(maps_.width) + " x " +
                      std::to_string(maps_.height) + ", more than " +
                      std::to_string(options_.max_texels) + " texels; scale them down");
    }
    for (size_t i = 0; i < maps_.files.size(); ++i) {
      LoadedFile& file = maps_.files[i];
      const int width = file.image.width(), height = file.image.height();
      if (IsConstantFile(static_cast<int>(i))) {
        file.image.bytes.Reset(0);
        continue;
      }
      if (width == maps_.width && height == maps_.height) continue;
      std::string warning = maps_.descriptions[i].file + ": " + std::to_string(width) + " x " +
                            std::to_string(height) + " texels are enlarged to " +
                            std::to_string(maps_.width) + " x " + std::to_string(maps_.height) +
                            ", the size of the largest map.";
      if (static_cast<int64_t>(width) * maps_.height !=
          static_cast<int64_t>(height) * maps_.width) {
        warning += " The proportions differ.";
      }
      Warn(warning);
      file.image = ResizeBicubic(file.image, file.stats, maps_.width, maps_.height,
                                 options_.address == AddressMode::kWrap, pool_);
      file.resized = true;
      if (cancelled()) return Cancelled();
    }
    return {};
  }

  const MapPlan* PlanOf(const char* role) const {
    for (const MapPlan& plan : maps_.plans) {
      if (std::strcmp(plan.role->name, role) == 0) return &plan;
    }
    return nullptr;
  }

  void SettleConventions() {
    for (MapPlan& plan : maps_.plans) {
      if (plan.role->kind != MapKind::kNormal) continue;
      if (plan.convention == NormalConvention::kAuto) GuessConvention(&plan);
      plan.flip_y = plan.convention == NormalConvention::kDirectX;
    }
  }

  void GuessConvention(MapPlan* plan) {
    plan->convention = NormalConvention::kOpenGl;
    const std::string& name = maps_.descriptions[plan->file].file;
    const bool straight = plan->channels[0] == 0 && plan->channels[1] == 1 && !plan->signed_samples;
    if (plan->constant_file || !straight) return;
    const MapPlan* height =
        std::strcmp(plan->role->name, "normal") == 0 ? PlanOf("displacement") : nullptr;
    if (height != nullptr && height->constant_file) height = nullptr;
    const NormalEvidence evidence =
        MeasureNormals(maps_.files[plan->file].image,
                       height != nullptr ? &maps_.files[height->file].image : nullptr,
                       height != nullptr ? height->channels[0] : 0, pool_);
    char number[32];
    if (height != nullptr && evidence.height_x > kHeightEvidence &&
        std::fabs(evidence.height_y) > kHeightEvidence) {
      std::snprintf(number, sizeof number, "%.2f", evidence.height_y);
      const std::string& height_name = maps_.descriptions[height->file].file;
      if (evidence.height_y < 0) {
        plan->convention = NormalConvention::kDirectX;
        Warn(name +
             ": read as a DirectX normal map (Y down), because its Y runs against the slope of " +
             height_name + " (correlation " + number +
             "). If that is wrong, set the normal convention to opengl.");
      } else {
        maps_.notes.push_back({MapNote::Kind::kGuessed, name,
                               "OpenGL normals: Y follows the slope of " + height_name +
                                   " (correlation " + number + ")"});
      }
    } else if (evidence.curl < kCurlEvidence) {
      std::snprintf(number, sizeof number, "%.2f", evidence.curl);
      Warn(name +
           ": read as an OpenGL normal map (Y up), as nothing says otherwise, but its slopes fit "
           "together better as "
           "DirectX (curl correlation " +
           number + "). If it is, set the normal convention to directx.");
    } else {
      maps_.notes.push_back(
          {MapNote::Kind::kGuessed, name, "OpenGL normals, as nothing says otherwise"});
    }
  }

  const MapSet& set_;
  const ReferenceOptions& options_;
  ThreadPool& pool_;
  ProgressSink& progress_;
  Clock::time_point started_;
  std::map<std::string, int> file_of_path_;
  SourceMaps maps_;
};

}  // namespace

Result<SourceMaps> LoadSourceMaps(const MapSet& set, const ReferenceOptions& options,
                                  ThreadPool& pool, ProgressSink& progress) {
  return Loader(set, options, pool, progress).Run();
}

}  // namespace patina
