#include "pipeline/jobs/material_run.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "formats/base/check.h"
#include "formats/base/file_io.h"
#include "formats/model_bytes.h"
#include "pipeline/jobs/ingest.h"
#include "pipeline/jobs/job_sets.h"
#include "pipeline/jobs/measure.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/page_pictures.h"
#include "pipeline/jobs/preview.h"
#include "pipeline/jobs/profile_choice.h"
#include "pipeline/jobs/report.h"
#include "pipeline/jobs/report_page.h"
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
      : StagedRun(job, observer, cancel, guards), chosen_(job) {}

 private:
  Status RunStages() override {
    PATINA_TRY(Stage("ingest", [this] { return Ingest(); }));
    reading_input_ = true;
    PATINA_TRY(Stage("reference", [this] { return BuildSource(); }));
    reading_input_ = false;
    if (FoundUnchanged()) return {};
    do {
      PATINA_TRY(Stage("train", [this] { return Train(); }));
      PATINA_TRY(Stage("package", [this] { return Package(); }));
      PATINA_TRY(Stage("verify", [this] { return Verify(); }));
    } while (TrainsLonger() || TriesNextProfile(result_.psnr->mip0_db, false));
    PATINA_TRY(Stage("report", [this] { return Report(); }));
    PATINA_TRY(
        Stage("publish", [this] { return WhatIsMissed().empty() ? Publish(Curve()) : Reject(); }));
    WarnOfTime();
    return {};
  }

  // What follows the training cannot be shortened.
  void WarnOfTime() {
    constexpr double kKept = 1.05;
    const double seconds = SecondsSoFar();
    if (job_.time_budget_s == 0 || seconds <= kKept * job_.time_budget_s) return;
    char text[200];
    std::snprintf(
        text, sizeof text,
        "took %.1f s, more than its time budget of %.3g s: encoding and checking the files alone "
        "need most of that; ask for a smaller profile, --quality preview or more time",
        seconds, job_.time_budget_s);
    sink_.OnWarning(text);
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
    if (!choice_) PATINA_TRY(Choose());
    TrainOptions options = OptionsOfJob();
    options.target_margin_db += more_margin_db_;
    if (job_.target_psnr_db > 0)
      options.target_psnr_db = std::max(1e-3, job_.target_psnr_db - ConstantsGainDb());
    if (job_.time_budget_s > 0)
      options.time_budget_s = std::max(0.1, job_.time_budget_s - SecondsSoFar());
    TrainedMaterial model;
    do {
      // The last one that fits is trained to the end: its container is kept for a look.
      ManifestChoice after = choice_.value_or(ManifestChoice{});
      options.give_up = MayTryMore() && ChooseNextProfile(0, true, &after);
      PATINA_ASSIGN(model,
                    TrainMaterial(material, ShapeOf(chosen_.profile), options, *pool_, sink_));
    } while (model.stopped_by == "hopeless" &&
             TriesNextProfile(model.curve.back().psnr_mip0_db + ConstantsGainDb(), true));
    result_.samples = model.samples;
    result_.stopped_by = model.stopped_by;
    recording_seconds_ = model.recording_s;
    WarnOfRollbacks(model.rollbacks);
    model_.emplace(std::move(model));
    return {};
  }

  TrainOptions OptionsOfJob() const {
    TrainOptions options;
    options.recipe = job_.recipe;
    options.quality = job_.quality;
    options.seed = job_.seed;
    options.samples = job_.samples;
    options.cancel = &cancel_;
    return options;
  }

  ModelShape ShapeOf(Profile profile) const {
    const std::vector<TargetLevel>& mips = source_.reference.material.pyramid.levels;
    return ShapeOfMips(profile, mips[0].width, mips[0].height, static_cast<int>(mips.size()));
  }

  // The trainer measures the channels that it learns; on files, those that cost nothing count too.
  double ConstantsGainDb() const {
    double all = 0, learned = 0;
    for (const TargetChannel& channel : source_.reference.material.channels) {
      all += channel.encoding == Encoding::kNormalXy ? 1.5 : 1;  // z stands for half of x and of y
      learned += channel.constant ? 0 : 1;
    }
    return 10 * std::log10(all / learned);
  }

  // The profile, if the job leaves it open, and whether what it asks for is in reach.
  Status Choose() {
    choice_.emplace();
    chosen_.choose_profile = false;
    const MaterialReference& material = source_.reference.material;
    const Aims aims = AimsOfJob(job_, source_.reference.width, source_.reference.height);
    if (aims.target_psnr_db == 0 && aims.most_bytes == 0) {
      choice_.reset();
      return {};
    }
    std::vector<ProfileSizes> candidates;
    for (const Profile profile :
         {Profile::kBcf05k, Profile::kBcf1k, Profile::kBcf2k, Profile::kBcf2kPlus}) {
      if (job_.choose_profile || profile == job_.profile)
        candidates.push_back({profile, MaterialBytes(ShapeOf(profile), material.pyramid.channels)});
    }
    // Trying one after the other takes time, which a budget does not leave.
    const bool smallest_first = aims.target_psnr_db > 0 && job_.time_budget_s == 0;
    *choice_ = ChooseProfile(aims, candidates, smallest_first);
    PATINA_ASSIGN(chosen_.profile, ParseProfile(choice_->chosen));
    const std::string said =
        std::string(choice_->in_reach ? "" : "not in reach: ") + choice_->reason;
    choice_->in_reach ? observer_.OnNote("chosen", said) : sink_.OnWarning(said);
    return {};
  }

  bool MayTryMore() const {
    return choice_ && job_.choose_profile && choice_->in_reach && job_.target_psnr_db > 0 &&
           job_.time_budget_s == 0;
  }

  // Whether the training ended at the target, and the export lost more than was in hand: the same
  // profile may have more to give. A target that is met at last is worth training twice.
  bool TrainsLonger() {
    constexpr double kSafetyDb = 0.05;
    const double missing = job_.target_psnr_db - result_.psnr->mip0_db;
    if (result_.stopped_by != "target" || missing <= 0 || job_.time_budget_s > 0) return false;
    more_margin_db_ += missing + kSafetyDb;
    observer_.OnNote("chosen",
                     "the files are " + Decimals(2, missing) + " dB below the target at " +
                         "which the training ended: it is done again, and goes on longer");
    return true;
  }

  // Whether another profile is to be tried in place of the one that missed.
  bool TriesNextProfile(double reached_db, bool given_up) {
    if (!MayTryMore() || reached_db >= job_.target_psnr_db ||
        !ChooseNextProfile(reached_db, given_up, &*choice_)) {
      return false;
    }
    observer_.OnNote("chosen", choice_->reason);
    const auto profile = ParseProfile(choice_->chosen);
    PATINA_CHECK(profile);
    chosen_.profile = *profile;
    return true;
  }

  // What the job asks for and the written files do not have, for a message; empty if nothing.
  std::string WhatIsMissed() const {
    std::string missed;
    const auto add = [&missed](const std::string& text) {
      missed += (missed.empty() ? "" : "; ") + text;
    };
    if (!manifest_.quality.gate_met) {
      add("the overall PSNR is " + Decimals(2, result_.psnr->overall_db) +
          " dB, below the gate of " + Decimals(2, job_.min_psnr_db) +
          " dB; try a higher --quality or a larger --profile");
    }
    if (!choice_) return missed;
    if (MissesTarget()) {
      add("mip 0 has " + Decimals(2, result_.psnr->mip0_db) + " dB of the " +
          Decimals(2, job_.target_psnr_db) + " dB asked for" + " with " + choice_->chosen +
          (&choice_->candidates.back() != &choice_->candidates.front() &&
                   choice_->candidates.back().profile == choice_->chosen
               ? ", the largest profile"
               : "") +
          "; try a higher --quality, a larger --profile, more time or a lower target");
    }
    if (MissesSize()) add(choice_->reason);
    return missed;
  }

  bool MissesTarget() const {
    return choice_ && job_.target_psnr_db > 0 && result_.psnr->mip0_db < job_.target_psnr_db;
  }
  bool MissesSize() const {
    return choice_ && choice_->most_bytes > 0 && result_.bytes > choice_->most_bytes;
  }

  Status Package() {
    // Of a profile that was tried before nothing stays.
    if (!staging_->payloads().empty()) {
      staging_.reset();
      PATINA_TRY(OpenStaging());
    }
    if (model_) PATINA_TRY(AddModel(*model_, &*staging_));
    manifest_ = DescribeContainer(chosen_, source_, model_ ? &*model_ : nullptr);
    result_.profile = manifest_.profile;
    result_.bytes = ModelBytes(staging_->payloads());
    // Complete but for its quality, so that the decoder can open what was written.
    return staging_->WriteManifest(manifest_);
  }

  Status Verify() {
    PATINA_TRY(VerifyPayloads({staging_->directory(), WithPayloads()}));
    // A model that missed may have been here before.
    preview_ = Preview();
    page_pictures_ = PagePictures();
    const LevelViewer viewer = [this](int mip, std::span<const metrics::QualityMap> maps, int width,
                                      int height, std::span<const metrics::PlanePair> planes) {
      if (mip == 0) preview_.Capture(maps, width, height, planes, *pool_);
      if (job_.report) page_pictures_.Capture(mip, maps, width, height, planes, *pool_);
    };
    PATINA_ASSIGN(measurement_, MeasureContainer(staging_->directory(), source_.reference.material,
                                                 *pool_, cancel_, sink_, viewer));
    result_.psnr = SummarizePsnr(measurement_.quality);
    result_.ssim = measurement_.quality.ssim;
    result_.flip = measurement_.quality.flip;
    result_.normal_angle_deg = measurement_.quality.normal_angle_deg;
    if (!std::isfinite(result_.psnr->overall_db)) {
      return Fail(ErrorCode::kInternal, "the measured quality is not a number");
    }
    DescribeQuality(job_, measurement_, &manifest_);
    if (choice_) {
      choice_->met = !MissesTarget() && !MissesSize();
      manifest_.training.choice = choice_;
      result_.choice = choice_->reason;
    }
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
    PATINA_TRY(staging_->WriteManifest(manifest_));
    return AddReportPage(Curve(), [this](const PageFacts& facts) -> Result<std::string> {
      PATINA_ASSIGN(const std::vector<PageTrio> pictures,
                    page_pictures_.Encode(staging_->directory() + "/page.tmp.", *pool_));
      return MaterialReportPage(facts, source_, measurement_, model_ ? &*model_ : nullptr,
                                pictures);
    });
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
    return Fail(
        ErrorCode::kOutOfRange,
        WhatIsMissed() + "; nothing was published, the result is kept in " + result_.container);
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
      for (const auto& [map, db] : MapsOfPoint(source_.reference.material, point))
        curve.back().measures.emplace_back("psnr_" + map + "_db", db);
    }
    return curve;
  }

  Job chosen_;                            // the job with the profile that was chosen
  double more_margin_db_ = 0;             // beyond what trainings keep of a target for the export
  std::optional<ManifestChoice> choice_;  // when the job asks for a quality or a size
  JobMaps maps_;
  JobSource source_;
  std::optional<TrainedMaterial> model_;
  Measurement measurement_;
  Preview preview_;
  PagePictures page_pictures_;
};

}  // namespace

JobResult RunMaterialJob(const Job& job, JobObserver& observer, const CancelToken& cancel,
                         const RunGuards& guards) {
  return MaterialRun(job, observer, cancel, guards).Run();
}

}  // namespace patina
