#include "pipeline/jobs/brdf_run.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "formats/base/file_io.h"
#include "formats/model_bytes.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/measure_brdf.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/page_pictures.h"
#include "pipeline/jobs/report_page.h"
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

class BrdfRun : public StagedRun {
 public:
  // trained: null to train alone; must outlive the run.
  BrdfRun(const Job& job, JobObserver& observer, const CancelToken& cancel, const RunGuards& guards,
          TrainedInGroup* trained)
      : StagedRun(job, observer, cancel, guards), trained_(trained) {}

 private:
  Status RunStages() override {
    PATINA_TRY(Stage("ingest", [this] { return Ingest(); }));
    if (FoundUnchanged()) return {};
    PATINA_TRY(Stage("train", [this] { return Train(); }));
    PATINA_TRY(Stage("package", [this] { return Package(); }));
    PATINA_TRY(Stage("verify", [this] { return Verify(); }));
    PATINA_TRY(Stage("report", [this] { return Report(); }));
    return Stage("publish", [this] { return StagedRun::Publish(CurveOf(model_.curve)); });
  }

  Status Ingest() {
    PATINA_TRY(ChooseSimdTarget());
    reading_input_ = true;
    if (trained_ != nullptr) {
      source_ = std::move(trained_->source);
      source_.fingerprint = BrdfFingerprint(job_, source_, trained_->group);
    } else {
      PATINA_ASSIGN(source_, ReadBrdfSource(job_));
    }
    reading_input_ = false;
    result_.fingerprint = source_.fingerprint;
    const brdf::Source& data = source_.data;
    for (const std::string& warning : data.warnings) sink_.OnWarning(warning);
    if (data.simulated) {
      std::string effects;
      for (const std::string& effect : data.effects)
        effects += (effects.empty() ? "" : ", ") + effect;
      observer_.OnNote("found", std::filesystem::path(job_.file).filename().string() +
                                    ": layers to simulate" +
                                    (data.isotropic ? ", isotropic; " : ", anisotropic; ") +
                                    (effects.empty() ? "no more than a surface" : effects));
      return OpenStaging();
    }
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
      model_ = std::move(trained_->model);
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
    if (source_.data.simulated) {
      const brdf::SimulationCost cost = source_.data.simulated->Spent();
      observer_.OnNote("simulated",
                       Format("%.1f M paths for %.0f k pairs of directions, standard error %.4f",
                              1e-6 * static_cast<double>(cost.paths),
                              1e-3 * static_cast<double>(cost.pairs), cost.standard_error));
    }
    return Trained();
  }

  Status Trained() {
    result_.samples = model_.samples;
    recording_seconds_ = model_.recording_s;
    result_.stopped_by = "budget";
    WarnOfRollbacks(model_.rollbacks);
    if (source_.stack) RecordSimulation(*source_.stack);
    return {};
  }

  Status Package() {
    const SharedCodebook shared = trained_ != nullptr ? trained_->codebook : SharedCodebook();
    PATINA_TRY(AddBrdfModel(model_, shared, &*staging_));
    manifest_ = DescribeBrdf(job_, source_, model_.shape, shared);
    manifest_.brdf->rollbacks = model_.rollbacks;
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
    PATINA_TRY(staging_->WriteManifest(manifest_));
    return AddReportPage(
        CurveOf(model_.curve), [this](const PageFacts& facts) -> Result<std::string> {
          PageTrio sphere;
          sphere.map = "sphere";
          PATINA_TRY(EncodeTrio({measurement_.source_picture, measurement_.decoded_picture,
                                 measurement_.difference_picture},
                                false, staging_->directory() + "/page.tmp", &sphere));
          return BrdfReportPage(facts, source_, measurement_, model_, sphere);
        });
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

  TrainedInGroup* trained_;
  BrdfSource source_;
  brdf::TrainedBrdf model_;
  BrdfMeasurement measurement_;
};

}  // namespace

JobResult RunBrdfJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                     const RunGuards& guards, TrainedInGroup* trained) {
  return BrdfRun(job, observer, cancel, guards, trained).Run();
}

}  // namespace patina
