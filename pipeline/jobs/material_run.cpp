#include "pipeline/jobs/material_run.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "formats/base/file_io.h"
#include "pipeline/jobs/ingest.h"
#include "pipeline/jobs/job_sets.h"
#include "pipeline/jobs/measure.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/preview.h"
#include "pipeline/jobs/report.h"
#include "pipeline/jobs/scene_maps.h"
#include "pipeline/jobs/staged_run.h"

namespace patina {
namespace {

std::string Decimals(int digits, double value) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

class MaterialRun : public StagedRun {
 public:
  MaterialRun(const Job& job, JobObserver& observer, const CancelToken& cancel,
              const RunGuards& guards)
      : StagedRun(job, observer, cancel, guards) {
    result_.profile = ProfileName(job.profile);
  }

 private:
  Status RunStages() override {
    PATINA_TRY(Stage("ingest", [this] { return Ingest(); }));
    reading_input_ = true;
    PATINA_TRY(Stage("reference", [this] { return BuildSource(); }));
    reading_input_ = false;
    if (FoundUnchanged()) return {};
    PATINA_TRY(Stage("train", [this] { return Train(); }));
    PATINA_TRY(Stage("package", [this] { return Package(); }));
    PATINA_TRY(Stage("verify", [this] { return Verify(); }));
    PATINA_TRY(Stage("report", [this] { return Report(); }));
    return Stage("publish",
                 [this] { return manifest_.quality.gate_met ? Publish(Curve()) : Reject(); });
  }

  Status Ingest() {
    PATINA_TRY(ChooseSimdTarget());
    reading_input_ = true;
    if (job_.scene.empty()) {
      PATINA_ASSIGN(maps_, MapsOfJob(job_));
      reading_input_ = false;
      return OpenStaging();
    }
    PATINA_ASSIGN(const SceneChoice choice, SceneOfJob(job_));
    reading_input_ = false;
    PATINA_TRY(OpenStaging());
    reading_input_ = true;
    PATINA_ASSIGN(maps_, MapsOfScene(job_, choice, ScratchFolder()));
    reading_input_ = false;
    return {};
  }

  // For images that lie inside other files; gone before anything is published.
  std::string ScratchFolder() const { return staging_->directory() + "/source"; }

  Status BuildSource() {
    PATINA_ASSIGN(source_, ReadSource(job_, maps_, *pool_, cancel_, sink_, guards_.images));
    std::error_code error;
    std::filesystem::remove_all(ScratchFolder(), error);
    if (error) return FailErrno(error.value(), "cannot remove", ScratchFolder());
    result_.fingerprint = source_.fingerprint;
    for (const MapNote& note : source_.reference.notes) {
      observer_.OnNote(MapNoteKindName(note.kind), note.file + ": " + note.text);
    }
    return {};
  }

  Status Train() {
    const MaterialReference& material = source_.reference.material;
    result_.stopped_by = "none";
    if (material.pyramid.channels == 0) return {};
    TrainOptions options;
    options.recipe = job_.recipe;
    options.quality = job_.quality;
    options.seed = job_.seed;
    options.target_psnr_db = job_.target_psnr_db;
    options.samples = job_.samples;
    options.cancel = &cancel_;
    if (job_.time_budget_s > 0) {
      // The budget is for the whole job: leave time for what follows the training.
      constexpr double kCpuSecondsPerTexelChannel = 1e-7;
      const double later = kCpuSecondsPerTexelChannel * source_.reference.width *
                           source_.reference.height *
                           static_cast<double>(material.channels.size()) / pool_->threads();
      options.time_budget_s = std::max(0.1, job_.time_budget_s - SecondsSoFar() - later);
    }
    const std::vector<TargetLevel>& mips = material.pyramid.levels;
    ModelShape shape = ShapeForProfile(job_.profile, mips[0].width, mips[0].height);
    // Levels that only coarser mips would read are not stored.
    for (FeatureShape& feature : shape) {
      const int read = static_cast<int>(mips.size()) - feature.lod_shift;
      feature.levels = std::clamp(read, 1, feature.levels);
    }
    PATINA_ASSIGN(TrainedMaterial model, TrainMaterial(material, shape, options, *pool_, sink_));
    result_.samples = model.samples;
    result_.stopped_by = model.stopped_by;
    if (model.rollbacks > 0) {
      sink_.OnWarning("the training ran into values that are not finite and was set back " +
                      std::to_string(model.rollbacks) +
                      " times, with lower rates; look at the preview");
    }
    model_.emplace(std::move(model));
    return {};
  }

  Status Package() {
    if (model_) PATINA_TRY(AddModel(*model_, &*staging_));
    manifest_ = DescribeContainer(job_, source_, model_ ? &*model_ : nullptr);
    result_.bytes = ModelBytes(staging_->payloads());
    // Complete but for its quality, so that the decoder can open what was written.
    return staging_->WriteManifest(manifest_);
  }

  Status Verify() {
    PATINA_TRY(VerifyPayloads({staging_->directory(), WithPayloads()}));
    PATINA_ASSIGN(measurement_, MeasureContainer(staging_->directory(), source_.reference.material,
                                                 *pool_, cancel_, sink_, &preview_));
    result_.psnr = SummarizePsnr(measurement_.quality);
    result_.ssim = measurement_.quality.ssim;
    result_.flip = measurement_.quality.flip;
    result_.normal_angle_deg = measurement_.quality.normal_angle_deg;
    if (!std::isfinite(result_.psnr->overall_db)) {
      return Fail(ErrorCode::kInternal, "the measured quality is not a number");
    }
    DescribeQuality(job_, measurement_, &manifest_);
    return {};
  }

  Status Report() {
    const std::string report = ReportToJson(manifest_, staging_->payloads(), source_, measurement_,
                                            model_ ? &*model_ : nullptr);
    std::vector<std::string> labels;
    for (const auto& [role, db] : result_.psnr->maps)
      labels.push_back(role + "  " + Decimals(1, db) + " dB");
    PATINA_TRY(AddPreview(preview_.Compose(job_.asset + "  " + manifest_.profile + "  " +
                                               Decimals(1, result_.psnr->overall_db) + " dB",
                                           labels)));
    PATINA_TRY(staging_->AddPayload("report.json", "report", AsBytes(report)));
    return staging_->WriteManifest(manifest_);
  }

  // Keeps what missed the gate for a look, in place of what missed it before.
  Status Reject() {
    PATINA_TRY(AddRunRecord(Curve()));
    PATINA_TRY(PassFence());
    const std::filesystem::path rejected =
        std::filesystem::path(job_.out) / job_.asset / "rejected";
    std::error_code error;
    std::filesystem::remove_all(rejected, error);
    if (!error) std::filesystem::rename(staging_->directory(), rejected, error);
    if (error)
      return FailErrno(error.value(), "cannot keep the rejected container as", rejected.string());
    result_.container = rejected.string();
    result_.exit_code = kExitQualityGate;
    return Fail(ErrorCode::kOutOfRange,
                "the overall PSNR is " + Decimals(2, result_.psnr->overall_db) +
                    " dB, below the gate of " + Decimals(2, job_.min_psnr_db) +
                    " dB; nothing was published, the result is kept in " + result_.container +
                    "; try a higher --quality or a larger --profile");
  }

  std::vector<RunCurvePoint> Curve() const {
    std::vector<RunCurvePoint> curve;
    if (!model_) return curve;
    for (const CurvePoint& point : model_->curve) {
      curve.push_back({point.samples,
                       point.wall_s,
                       {{"cpu_seconds", point.cpu_s},
                        {"psnr_mip0_db", point.psnr_mip0_db},
                        {"psnr_mean_mips_db", point.psnr_mean_mips_db}}});
    }
    return curve;
  }

  JobMaps maps_;
  JobSource source_;
  std::optional<TrainedMaterial> model_;
  Measurement measurement_;
  Preview preview_;
};

}  // namespace

JobResult RunMaterialJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                         const RunGuards& guards) {
  return MaterialRun(job, observer, cancel, guards).Run();
}

}  // namespace patina
