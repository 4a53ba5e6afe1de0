#include "pipeline/jobs/brdf_run.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "formats/base/file_io.h"
#include "pipeline/brdf/grouping.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/measure_brdf.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/staged_run.h"

namespace patina {
namespace {

template <class... Args>
std::string Format(const char* format, Args... args) {
  char text[192];
  const int n = std::snprintf(text, sizeof text, format, args...);
  return n > 0 ? std::string(text, std::min(static_cast<size_t>(n), sizeof text - 1))
               : std::string();
}

// What a group of jobs was trained to.
struct GroupTraining {
  brdf::TrainedBrdf model;
  SharedCodebook codebook;
  std::string sha256;              // of the file that was trained
  std::vector<std::string> group;  // and of all of them
};

class BrdfRun : public StagedRun {
 public:
  // trained: null to train alone; must outlive the run.
  BrdfRun(const Job& job, JobObserver& observer, const CancelToken& cancel,
          const RunGuards& guards, const GroupTraining* trained)
      : StagedRun(job, observer, cancel, guards), trained_(trained) {}

 private:
  Status RunStages() override {
    PATINA_TRY(Stage("ingest", [this] { return Ingest(); }));
    if (FoundUnchanged()) return {};
    PATINA_TRY(Stage("train", [this] { return Train(); }));
    PATINA_TRY(Stage("package", [this] { return Package(); }));
    PATINA_TRY(Stage("verify", [this] { return Verify(); }));
    PATINA_TRY(Stage("report", [this] { return Report(); }));
    return Stage("publish", [this] { return StagedRun::Publish(Curve()); });
  }

  Status Ingest() {
    PATINA_TRY(ChooseSimdTarget());
    reading_input_ = true;
    PATINA_ASSIGN(source_, ReadBrdfSource(job_));
    reading_input_ = false;
    if (trained_ != nullptr) {
      if (source_.sha256 != trained_->sha256) {
        return Fail(ErrorCode::kConflict, job_.file +
                                              ": it changed while its group was trained; "
                                              "bake again when it is complete");
      }
      source_.fingerprint = BrdfFingerprint(job_, source_.sha256, trained_->group);
    }
    result_.fingerprint = source_.fingerprint;
    const brdf::Source& data = source_.data;
    for (const std::string& warning : data.warnings) sink_.OnWarning(warning);
    observer_.OnNote("found",
                     std::filesystem::path(job_.file).filename().string() + ": " + data.format +
                         (data.isotropic ? ", isotropic, " : ", anisotropic, ") +
                         Format("%llu of %llu colours valid",
                                static_cast<unsigned long long>(data.cells - data.invalid_cells),
                                static_cast<unsigned long long>(data.cells)));
    return OpenStaging();
  }

  Status Train() {
    if (trained_ != nullptr) {
      model_ = trained_->model;
      return Trained();
    }
    const brdf::SourceKind kind = brdf::KindOf(source_.data);
    const brdf::ModelShape shape = ModelOfJob(job_, kind);
    brdf::TrainOptions options = TrainingOfJob(job_, kind);
    options.cancel = &cancel_;
    auto trained = brdf::TrainBrdf(source_.data, shape, options, *pool_, sink_);
    if (!trained) {
      // The trainer finds out whether there is enough to learn from.
      reading_input_ = trained.error().code == ErrorCode::kCorruptData;
      return Fail(trained.error(), job_.file);
    }
    model_ = std::move(*trained);
    return Trained();
  }

  Status Trained() {
    result_.samples = model_.samples;
    result_.stopped_by = "budget";
    if (model_.rollbacks > 0) {
      sink_.OnWarning("the training ran into values that are not finite and left out " +
                      std::to_string(model_.rollbacks) + " steps; look at the preview");
    }
    return {};
  }

  Status Package() {
    const SharedCodebook shared = trained_ != nullptr ? trained_->codebook : SharedCodebook();
    PATINA_TRY(AddBrdfModel(model_, shared, &*staging_));
    manifest_ = DescribeBrdf(job_, source_, model_.shape, shared);
    // So that the decoder can open what was written.
    PATINA_TRY(staging_->WriteManifest(manifest_));
    PATINA_TRY(AddBrdfSampler(&*staging_, &*manifest_.brdf));
    result_.bytes = ModelBytes(staging_->payloads());
    return staging_->WriteManifest(manifest_);
  }

  Status Verify() {
    PATINA_TRY(VerifyPayloads({staging_->directory(), WithPayloads()}));
    PATINA_ASSIGN(measurement_, MeasureBrdf(staging_->directory(), *manifest_.brdf, source_.data,
                                            *pool_, cancel_, sink_));
    DescribeBrdfQuality(measurement_, &*manifest_.brdf);
    result_.brdf = SummarizeBrdf(measurement_);
    WarnOfGain();
    return {};
  }

  // A gain of energy, which measurements do show, is reported and not changed.
  void WarnOfGain() {
    constexpr double kTolerance = 1.005;  // of the quadrature
    for (size_t i = 0; i < kAlbedoDegrees.size(); ++i) {
      const double albedo =
          *std::max_element(measurement_.albedo[i].begin(), measurement_.albedo[i].end());
      if (albedo <= kTolerance) continue;
      const std::string warning =
          Format("more light is reflected than comes in: %.3f times as much at %.0f degrees",
                 albedo, kAlbedoDegrees[i]);
      manifest_.warnings.push_back(warning);
      sink_.OnWarning(warning);
      return;
    }
  }

  Status Report() {
    const std::string report =
        BrdfReportToJson(manifest_, staging_->payloads(), source_, measurement_, model_);
    PATINA_TRY(AddPreview(Sheet()));
    PATINA_TRY(staging_->AddPayload("report.json", "report", AsBytes(report)));
    return staging_->WriteManifest(manifest_);
  }

  RgbImage Sheet() const {
    SheetRow row;
    if (measurement_.image) {
      row.label = Format("MAE %.5f  RMSE %.5f  SSIM %.5f", measurement_.image->mae_srgb,
                         measurement_.image->rmse_srgb, measurement_.image->ssim);
      row.pictures = {&measurement_.source_picture, &measurement_.decoded_picture,
                      &measurement_.difference_picture};
      const std::string heads[] = {"source", "decoded", "difference x8"};
      return ComposeSheet(job_.asset, heads, std::span(&row, 1));
    }
    row.label = Format("log1p MAE %.5f at %llu measurements", measurement_.all.mae,
                       static_cast<unsigned long long>(measurement_.all.pairs));
    row.pictures = {&measurement_.decoded_picture};
    const std::string heads[] = {"decoded", "", ""};  // columns that leave room for the text
    return ComposeSheet(job_.asset, heads, std::span(&row, 1));
  }

  std::vector<RunCurvePoint> Curve() const {
    std::vector<RunCurvePoint> curve;
    for (const brdf::CurvePoint& point : model_.curve)
      curve.push_back({point.samples, point.wall_s, {{"log1p_mae", point.log1p_mae}}});
    return curve;
  }

  const GroupTraining* trained_;
  BrdfSource source_;
  brdf::TrainedBrdf model_;
  BrdfMeasurement measurement_;
};

void TrainGroup(std::span<const Job> jobs, const std::vector<BrdfSource>& sources,
                const std::vector<size_t>& job_of_source, const std::vector<size_t>& group,
                JobObserver& observer, const CancelToken& cancel,
                std::vector<std::optional<GroupTraining>>* trained) {
  const Job& first = jobs[job_of_source[group[0]]];
  std::vector<const brdf::Source*> data;
  std::vector<std::string> hashes;
  std::string names;
  for (const size_t member : group) {
    data.push_back(&sources[member].data);
    hashes.push_back(sources[member].sha256);
    names += (names.empty() ? "" : ", ") + jobs[job_of_source[member]].asset;
  }
  observer.OnNote("group", std::to_string(group.size()) + " materials on one codebook: " + names);
  const brdf::SourceKind kind = brdf::KindOf(*data[0]);
  brdf::TrainOptions options = TrainingOfJob(first, kind);
  options.cancel = &cancel;
  std::vector<std::string> warnings;
  StageSink sink(observer, &warnings);
  sink.SetStage("train");
  ThreadPool pool(first.threads);
  auto models = brdf::TrainShared(data, ModelOfJob(first, kind), options, pool, sink);
  if (!models) return;
  const Status folder = MakeDirectories(first.out);
  auto shared = folder ? WriteSharedCodebook((*models)[0], first.out)
                       : Result<SharedCodebook>(Fail(folder.error()));
  if (!shared) {
    observer.OnWarning(shared.error().message + "; each material gets a codebook of its own");
    return;
  }
  for (size_t m = 0; m < group.size(); ++m) {
    const size_t member = group[m];
    (*trained)[job_of_source[member]] =
        GroupTraining{std::move((*models)[m]), *shared, sources[member].sha256, hashes};
  }
}

}  // namespace

JobResult RunBrdfJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                     const RunGuards& guards) {
  return BrdfRun(job, observer, cancel, guards, nullptr).Run();
}

std::vector<JobResult> RunSharedBrdfJobs(std::span<const Job> jobs, size_t share,
                                         const std::function<JobObserver&(size_t)>& observer,
                                         const CancelToken& cancel) {
  // Files that cannot be read, or groups that cannot be trained, come to the same error when their
  // job runs alone.
  std::vector<BrdfSource> sources;
  std::vector<size_t> job_of_source;
  for (size_t i = 0; i < jobs.size(); ++i) {
    auto source = ReadBrdfSource(jobs[i]);
    if (!source) continue;
    sources.push_back(std::move(*source));
    job_of_source.push_back(i);
  }
  std::vector<const brdf::Source*> data;
  for (const BrdfSource& source : sources) data.push_back(&source.data);
  std::vector<std::optional<GroupTraining>> trained(jobs.size());
  for (const std::vector<size_t>& group : brdf::GroupAlike(data, share)) {
    if (group.size() < 2 || cancel.cancelled()) continue;
    TrainGroup(jobs, sources, job_of_source, group, observer(job_of_source[group[0]]), cancel,
               &trained);
  }
  sources.clear();
  std::vector<JobResult> results;
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (cancel.cancelled() && i > 0) break;
    results.push_back(
        BrdfRun(jobs[i], observer(i), cancel, {}, trained[i] ? &*trained[i] : nullptr).Run());
    observer(i).OnResult(results.back());
  }
  return results;
}

}  // namespace patina
