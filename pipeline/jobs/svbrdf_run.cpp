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
    // Images may lie inside a scene's file.
    if (!job_.scene.empty()) PATINA_TRY(OpenStaging());
    const std::string scratch = staging_ ? staging_->directory() + "/source" : "";
    reading_input_ = true;
    {
      ThreadPool pool(job_.threads);
      PATINA_ASSIGN(source_, ReadSvbrdfSource(job_, scratch, pool, cancel_, sink_));
    }
    result_.fingerprint = source_.fingerprint;
    observer_.OnNote("found", source_.found);
    for (const std::string& warning : source_.warnings) sink_.OnWarning(warning);
    reading_input_ = false;
    unchanged_ = FoundUnchanged();
    if (unchanged_) return {};
    if (!staging_) PATINA_TRY(OpenStaging());
    const svbrdf::VaryingSource& texels = *source_.texels;
    shape_ = SvbrdfModelOfJob(job_, texels.width(), texels.height(), texels.address(),
                              texels.isotropic());
    options_ =
        SvbrdfTrainingOfJob(job_, texels.pairs().size() * static_cast<uint64_t>(texels.width()) *
                                      static_cast<uint64_t>(texels.height()));
    options_.cancel = &cancel_;
    svbrdf::TexelPoolOptions drawing;
    drawing.count = WantedSamples(options_, shape_.texture, texels);
    drawing.levels = shape_.texture.levels;
    drawing.features = shape_.texture.features();
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
    PATINA_ASSIGN(texels_, texels.Draw(drawing, *pool_));
    PATINA_TRY(CheckUnchanged(source_, *pool_, cancel_));
    reading_input_ = false;
    std::error_code error;
    if (!scratch.empty()) std::filesystem::remove_all(scratch, error);
    if (error) return FailErrno(error.value(), "cannot remove", scratch);
    cost_ = texels_.cost;
    if (source_.simulated) {
      char text[128];
      std::snprintf(text, sizeof text,
                    "%.1f M paths for %.0f k places and pairs of directions, standard error %.4f",
                    1e-6 * static_cast<double>(cost_.paths),
                    1e-3 * static_cast<double>(cost_.pairs), cost_.standard_error);
      observer_.OnNote("simulated", text);
      RecordSimulation(*source_.simulated);
    }
    return {};
  }

  Status Train() {
    auto trained = svbrdf::TrainSvbrdf(texels_, shape_, options_, *pool_, sink_);
    if (!trained) return Fail(trained.error(), job_.asset);
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
    manifest_ = DescribeSvbrdf(job_, source_, shape_, cost_);
    manifest_.brdf->rollbacks = model_.rollbacks;
    result_.bytes = ModelBytes(staging_->payloads());
    // So that the decoder can open what was written.
    return staging_->WriteManifest(manifest_);
  }

  Status Verify() {
    PATINA_TRY(VerifyPayloads({staging_->directory(), WithPayloads()}));
    PATINA_ASSIGN(measurement_,
                  MeasureSvbrdf(staging_->directory(), *source_.texels, *pool_, cancel_, sink_));
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
  brdf::SimulationCost cost_;
  svbrdf::TrainedSvbrdf model_;
  SvbrdfMeasurement measurement_;
};

}  // namespace

JobResult RunSvbrdfJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                       const RunGuards& guards) {
  return SvbrdfRun(job, observer, cancel, guards).Run();
}

}  // namespace patina
