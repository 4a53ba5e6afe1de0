#include "pipeline/jobs/job_runner.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <new>
#include <optional>

#include "formats/container.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/ingest.h"
#include "pipeline/jobs/job_sets.h"
#include "pipeline/jobs/machine.h"
#include "pipeline/jobs/measure.h"
#include "pipeline/jobs/package.h"
#include "pipeline/jobs/preview.h"
#include "pipeline/jobs/report.h"
#include "pipeline/jobs/run_record.h"
#include "pipeline/kernels/dispatch.h"

namespace patina {
namespace {

using Clock = std::chrono::steady_clock;

double Since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Names the stage in every report, and remembers the warnings.
class StageSink : public ProgressSink {
 public:
  StageSink(JobObserver& observer, std::vector<std::string>* warnings)
      : observer_(observer), warnings_(warnings) {}

  void SetStage(const std::string& stage) { stage_ = stage; }
  void OnProgress(const ProgressEvent& event) override {
    ProgressEvent named = event;
    // A module may name a step of its own within the stage, as the trainer does when it compresses.
    if (event.message.empty() && event.stage != stage_) named.message = event.stage;
    named.stage = stage_;
    observer_.OnProgress(named);
  }
  void OnWarning(const std::string& message) override {
    warnings_->push_back(message);
    observer_.OnWarning(message);
  }

 private:
  JobObserver& observer_;
  std::vector<std::string>* warnings_;
  std::string stage_;
};

// One run of a job. Each stage returns an error or leaves its result in a member.
class JobRun {
 public:
  JobRun(const Job& job, JobObserver& observer, const CancelToken& cancel)
      : job_(job), observer_(observer), cancel_(cancel), sink_(observer, &result_.warnings) {}

  JobResult Run() {
    ResetPeakMemory();
    result_.asset = job_.asset;
    result_.profile = ProfileName(job_.profile);
    result_.quality = QualityName(job_.quality);
    result_.recipe = RecipeName(job_.recipe);
    result_.seed = job_.seed;
    Status status;
    try {
      status = RunStages();
    } catch (const std::bad_alloc&) {
      status = Fail(ErrorCode::kResourceExhausted,
                    "not enough memory; use a smaller source, close other programs, or bake on a "
                    "machine with more");
    }
    staging_.reset();
    if (!status) {
      result_.error = status.error();
      result_.error_stage = stage_;
      if (result_.exit_code == kExitDone)
        result_.exit_code = ExitCodeFor(status.error(), reading_input_);
    }
    result_.seconds = Since(start_);
    result_.cpu_seconds = ProcessCpuSeconds() - start_cpu_;
    return std::move(result_);
  }

 private:
  Status RunStages() {
    PATINA_TRY(Stage("ingest", [this] { return Ingest(); }));
    reading_input_ = true;
    PATINA_TRY(Stage("reference", [this] { return BuildSource(); }));
    reading_input_ = false;
    PATINA_TRY(Stage("train", [this] { return Train(); }));
    PATINA_TRY(Stage("package", [this] { return Package(); }));
    PATINA_TRY(Stage("verify", [this] { return Verify(); }));
    PATINA_TRY(Stage("report", [this] { return Report(); }));
    return Stage("publish", [this] { return Publish(); });
  }

  template <class Body>
  Status Stage(const char* name, Body body) {
    if (cancel_.cancelled())
      return Fail(ErrorCode::kCancelled, "interrupted before it was done; nothing was published");
    stage_ = name;
    sink_.SetStage(name);
    observer_.OnStageStarted(name);
    const Clock::time_point start = Clock::now();
    const double start_cpu = ProcessCpuSeconds();
    Status status = body();
    if (!status) {
      if (status.error().code == ErrorCode::kCancelled) {
        status.error().message = "interrupted before it was done; nothing was published";
      }
      return status;
    }
    stages_.push_back({name, Since(start), ProcessCpuSeconds() - start_cpu});
    observer_.OnStageFinished(name, stages_.back().seconds);
    return status;
  }

  // What can fail for reasons of the machine comes first, before minutes of work.
  Status Ingest() {
    PATINA_ASSIGN(simd_, ActiveSimdTarget());
    reading_input_ = true;
    PATINA_ASSIGN(set_, MapsOfJob(job_));
    reading_input_ = false;
    PATINA_ASSIGN(StagingArea staging, StagingArea::Create(job_.out, job_.asset));
    staging_.emplace(std::move(staging));
    pool_.emplace(job_.threads);
    SetImageIoThreads(pool_->threads());
    return {};
  }

  Status BuildSource() {
    PATINA_ASSIGN(source_, ReadSource(job_, set_, *pool_, cancel_, sink_));
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
      options.time_budget_s = std::max(0.1, job_.time_budget_s - Since(start_) - later);
    }
    const ModelShape shape =
        ShapeForProfile(job_.profile, source_.reference.width, source_.reference.height);
    PATINA_ASSIGN(TrainedMaterial model, TrainMaterial(material, shape, options, *pool_, sink_));
    result_.samples = model.samples;
    result_.stopped_by = model.stopped_by;
    if (model.rollbacks > 0) {
      sink_.OnWarning("the training ran into values that are not finite and was set back " +
                      std::to_string(model.rollbacks) + " times; look at the preview");
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
    PATINA_TRY(AddPreview());
    PATINA_TRY(staging_->AddPayload("report.json", "report", AsBytes(report)));
    return staging_->WriteManifest(manifest_);
  }

  Status AddPreview() {
    std::vector<std::string> labels;
    for (const auto& [role, db] : result_.psnr->maps)
      labels.push_back(role + "  " + OneDecimal(db) + " dB");
    const RgbImage sheet = preview_.Compose(
        job_.asset + "  " + manifest_.profile + "  " + OneDecimal(result_.psnr->overall_db) + " dB",
        labels);
    // Images are written to files only; the payload is its bytes.
    const std::string path = staging_->directory() + "/preview.tmp.png";
    PATINA_TRY(
        WriteImage(path, WriteFormat::kPng8, sheet.width, sheet.height, 3, sheet.rgb.data()));
    auto bytes = ReadFile(path, uint64_t{1} << 30);
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
    if (!bytes) return Fail(bytes.error());
    return staging_->AddPayload("preview.png", "preview", *bytes);
  }

  Status Publish() {
    if (!manifest_.quality.gate_met) return Reject();
    PATINA_TRY(AddRunRecord());
    PATINA_ASSIGN(PublishedContainer published, staging_->Publish());
    result_.container = published.directory;
    result_.revision = published.revision;
    if (!published.warning.empty()) sink_.OnWarning(published.warning);
    return {};
  }

  // Keeps what missed the gate for a look, in place of what missed it before.
  Status Reject() {
    PATINA_TRY(AddRunRecord());
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
                "the overall PSNR is " + TwoDecimals(result_.psnr->overall_db) +
                    " dB, below the gate of " + TwoDecimals(job_.min_psnr_db) +
                    " dB; nothing was published, the result is kept in " + result_.container +
                    "; try a higher --quality or a larger --profile");
  }

  Status AddRunRecord() {
    RunRecord record;
    record.asset = job_.asset;
    record.fingerprint = source_.fingerprint;
    record.version = PATINA_VERSION;
    record.cpu = CpuName();
    record.cpus = UsableCpus();
    record.threads = pool_->threads();
    record.simd = SimdTargetName(simd_);
    record.seconds = Since(start_);
    record.cpu_seconds = ProcessCpuSeconds() - start_cpu_;
    record.peak_memory_bytes = PeakMemoryBytes();
    record.samples = result_.samples;
    for (const StageCost& stage : stages_) {
      if (stage.stage == "train" && stage.seconds > 0)
        record.samples_per_s = result_.samples / stage.seconds;
    }
    record.stages = stages_;
    if (model_) record.curve = model_->curve;
    const std::string text = RunRecordToJson(record);
    return staging_->AddUnlisted("run.json", AsBytes(text));
  }

  Manifest WithPayloads() const {
    Manifest manifest = manifest_;
    manifest.payloads = staging_->payloads();
    return manifest;
  }

  static std::string OneDecimal(double value) { return Decimals("%.1f", value); }
  static std::string TwoDecimals(double value) { return Decimals("%.2f", value); }
  static std::string Decimals(const char* format, double value) {
    char text[48];
    std::snprintf(text, sizeof text, format, value);
    return text;
  }

  const Job& job_;
  JobObserver& observer_;
  const CancelToken& cancel_;
  JobResult result_;
  StageSink sink_;
  Clock::time_point start_ = Clock::now();
  double start_cpu_ = ProcessCpuSeconds();
  std::string stage_;
  std::vector<StageCost> stages_;
  bool reading_input_ = false;

  SimdTarget simd_ = SimdTarget::kAvx2;
  std::optional<StagingArea> staging_;
  std::optional<ThreadPool> pool_;
  MapSet set_;
  JobSource source_;
  std::optional<TrainedMaterial> model_;
  Manifest manifest_;
  Measurement measurement_;
  Preview preview_;
};

}  // namespace

JobResult RunJob(const Job& job, JobObserver& observer, const CancelToken& cancel) {
  JobResult result = JobRun(job, observer, cancel).Run();
  observer.OnResult(result);
  return result;
}

}  // namespace patina
