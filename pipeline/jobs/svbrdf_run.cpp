#include "pipeline/jobs/svbrdf_run.h"

#include <cstdio>
#include <filesystem>
#include <optional>

#include "formats/base/file_io.h"
#include "formats/model_bytes.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/page_pictures.h"
#include "pipeline/jobs/report_page.h"
#include "pipeline/jobs/staged_run.h"
#include "pipeline/jobs/svbrdf_job.h"
#include "pipeline/jobs/svbrdf_package.h"

namespace patina {
namespace {

class SvbrdfRun : public StagedRun {
 public:
  using StagedRun::StagedRun;

 private:
  Status RunStages() override {
    PATINA_TRY(Stage("ingest", [this] { return Ingest(); }));
    if (unchanged_) return {};
    PATINA_TRY(Stage("train", [this] { return Train(); }));
    PATINA_TRY(Stage("package", [this] { return Package(); }));
    PATINA_TRY(Stage("verify", [this] { return Verify(); }));
    PATINA_TRY(Stage("report", [this] { return Report(); }));
    return Stage("publish", [this] { return StagedRun::Publish(CurveOf(model_.curve)); });
  }

  Status Ingest() {
    PATINA_TRY(ChooseSimdTarget());
    reading_input_ = true;
    {
      ThreadPool pool(job_.threads);
      PATINA_ASSIGN(source_, ReadSvbrdfSource(job_, pool, cancel_));
    }
    result_.fingerprint = source_.fingerprint;
    const svbrdf::ImageSet& set = source_.set;
    observer_.OnNote("found", std::filesystem::path(job_.file).filename().string() + ": " +
                                  std::to_string(set.images.size()) + " images of " +
                                  std::to_string(set.width) + " x " + std::to_string(set.height));
    reading_input_ = false;
    unchanged_ = FoundUnchanged();
    if (unchanged_) return {};
    PATINA_TRY(OpenStaging());
    shape_ = SvbrdfModelOfJob(job_, set.width, set.height, set.address);
    options_ =
        SvbrdfTrainingOfJob(job_, uint64_t{set.images.size()} * static_cast<uint64_t>(set.width) *
                                      static_cast<uint64_t>(set.height));
    options_.cancel = &cancel_;
    svbrdf::TexelPoolOptions drawing;
    drawing.count = WantedSamples(options_, shape_.texture, set.images.size());
    drawing.levels = shape_.texture.levels;
    drawing.grid = shape_.model.grid;
    drawing.seed = job_.seed;
    drawing.cancel = &cancel_;
    drawing.on_progress = [this](double fraction) {
      ProgressEvent event;
      event.stage = "ingest";
      event.fraction = fraction;
      event.elapsed_s = SecondsSoFar();
      sink_.OnProgress(event);
    };
    // Images are decoded several at a time, each by one thread.
    SetImageIoThreads(1);
    reading_input_ = true;
    PATINA_ASSIGN(texels_, svbrdf::DrawTexels(set, drawing, *pool_));
    // Who copies a set while it is read must not get a container under a wrong name.
    PATINA_ASSIGN(const SvbrdfSource after, ReadSvbrdfSource(job_, *pool_, cancel_));
    if (after.fingerprint != source_.fingerprint) {
      return Fail(ErrorCode::kConflict,
                  job_.file +
                      ": it or its images changed while they were read; bake again when "
                      "the set is complete");
    }
    reading_input_ = false;
    return {};
  }

  Status Train() {
    auto trained = svbrdf::TrainSvbrdf(texels_, shape_, options_, *pool_, sink_);
    if (!trained) return Fail(trained.error(), job_.file);
    model_ = std::move(*trained);
    texels_ = svbrdf::TexelPool();
    result_.samples = model_.samples;
    recording_seconds_ = model_.recording_s;
    result_.stopped_by = "budget";
    WarnOfRollbacks(model_.rollbacks);
    return {};
  }

  Status Package() {
    PATINA_TRY(AddSvbrdfModel(model_, &*staging_));
    manifest_ = DescribeSvbrdf(job_, source_, shape_);
    manifest_.brdf->rollbacks = model_.rollbacks;
    result_.bytes = ModelBytes(staging_->payloads());
    // So that the decoder can open what was written.
    return staging_->WriteManifest(manifest_);
  }

  Status Verify() {
    PATINA_TRY(VerifyPayloads({staging_->directory(), WithPayloads()}));
    PATINA_ASSIGN(measurement_,
                  MeasureSvbrdf(staging_->directory(), source_.set, *pool_, cancel_, sink_));
    DescribeSvbrdfQuality(measurement_, &*manifest_.brdf);
    result_.svbrdf = SummarizeSvbrdf(measurement_, *manifest_.brdf, result_.bytes);
    return {};
  }

  Status Report() {
    const std::string report =
        SvbrdfReportToJson(manifest_, staging_->payloads(), source_, measurement_, model_);
    PATINA_TRY(AddPreview(Sheet()));
    PATINA_TRY(staging_->AddPayload("report.json", "report", AsBytes(report)));
    PATINA_TRY(staging_->WriteManifest(manifest_));
    return AddReportPage(
        CurveOf(model_.curve), [this](const PageFacts& facts) -> Result<std::string> {
          std::vector<PageTrio> planes;
          for (const SvbrdfPlane& plane : measurement_.planes) {
            PageTrio trio;
            trio.map = "plane";
            PATINA_TRY(
                EncodeTrio({plane.source_picture, plane.decoded_picture, plane.difference_picture},
                           false, staging_->directory() + "/page.tmp", &trio));
            planes.push_back(std::move(trio));
          }
          return SvbrdfReportPage(facts, measurement_, model_, planes);
        });
  }

  RgbImage Sheet() const {
    std::vector<SheetRow> rows;
    for (const SvbrdfPlane& plane : measurement_.planes) {
      char label[128];
      std::snprintf(label, sizeof label, "light %.0f view %.0f deg  MSE %.6f  SSIM %.4f",
                    plane.light_deg, plane.view_deg, plane.mse, plane.error.ssim);
      rows.push_back(
          {label, {&plane.source_picture, &plane.decoded_picture, &plane.difference_picture}});
    }
    const std::string heads[] = {"source", "decoded", "difference x8"};
    return ComposeSheet(job_.asset, heads, rows);
  }

  bool unchanged_ = false;
  SvbrdfSource source_;
  svbrdf::SvbrdfShape shape_;
  svbrdf::SvbrdfOptions options_;
  svbrdf::TexelPool texels_;
  svbrdf::TrainedSvbrdf model_;
  SvbrdfMeasurement measurement_;
};

}  // namespace

JobResult RunSvbrdfJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                       const RunGuards& guards) {
  return SvbrdfRun(job, observer, cancel, guards).Run();
}

}  // namespace patina
