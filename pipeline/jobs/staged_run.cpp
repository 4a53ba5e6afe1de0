#include "pipeline/jobs/staged_run.h"

#include <filesystem>
#include <new>

#include "formats/base/file_io.h"
#include "pipeline/base/cpu_time.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/machine.h"
#include "pipeline/jobs/report_page.h"
#include "pipeline/layered/accuracy_curve.h"
#include "pipeline/report/picture.h"

namespace patina {
namespace {

double Since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

constexpr const char* kInterrupted = "interrupted before it was done; nothing was published";

}  // namespace

void StageSink::OnProgress(const ProgressEvent& event) {
  ProgressEvent named = event;
  // A module may name a step of its own within the stage, as the trainer does when it compresses.
  if (event.message.empty() && event.stage != stage_) named.message = event.stage;
  named.stage = stage_;
  observer_.OnProgress(named);
}

void StageSink::OnWarning(const std::string& message) {
  warnings_->push_back(message);
  observer_.OnWarning(message);
}

StagedRun::StagedRun(const Job& job, JobObserver& observer, const CancelToken& cancel,
                     const RunGuards& guards)
    : job_(job),
      observer_(observer),
      cancel_(cancel),
      sink_(observer, &result_.warnings),
      guards_(guards),
      start_(Clock::now()),
      start_cpu_(ProcessCpuSeconds()) {}

JobResult StagedRun::Run() {
  ResetPeakMemory();
  result_.asset = job_.asset;
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
  result_.seconds = SecondsSoFar();
  result_.cpu_seconds = ProcessCpuSeconds() - start_cpu_;
  return std::move(result_);
}

Status StagedRun::Stage(const char* name, const std::function<Status()>& body) {
  if (cancel_.cancelled()) return Fail(ErrorCode::kCancelled, kInterrupted);
  stage_ = name;
  sink_.SetStage(name);
  observer_.OnStageStarted(name);
  const Clock::time_point start = Clock::now();
  const double start_cpu = ProcessCpuSeconds();
  Status status = body();
  if (!status) {
    if (status.error().code == ErrorCode::kCancelled) status.error().message = kInterrupted;
    return status;
  }
  stages_.push_back({name, Since(start), ProcessCpuSeconds() - start_cpu});
  observer_.OnStageFinished(name, stages_.back().seconds);
  return status;
}

Status StagedRun::ChooseSimdTarget() {
  PATINA_ASSIGN(simd_, ActiveSimdTarget());
  return {};
}

Status StagedRun::OpenStaging() {
  PATINA_ASSIGN(StagingArea staging, StagingArea::Create(job_.out, job_.asset));
  staging_.emplace(std::move(staging));
  pool_.emplace(job_.threads);
  SetImageIoThreads(pool_->threads());
  return {};
}

bool StagedRun::FoundUnchanged() {
  if (!guards_.skip_unchanged) return false;
  auto current = OpenContainer(job_.out + "/" + job_.asset + "/" + kCurrentName);
  if (!current || current->manifest.fingerprint != result_.fingerprint) return false;
  const std::string revision = std::filesystem::path(current->directory).filename().string();
  if (revision == guards_.not_revision || !VerifyPayloads(*current)) return false;
  // The gate is no part of the fingerprint: a new one is measured.
  if (job_.min_psnr_db > current->manifest.quality.gate_min_psnr_db.value_or(0)) return false;
  result_.container = job_.out + "/" + job_.asset + "/" + revision;
  result_.revision = revision;
  result_.stopped_by = "unchanged";
  return true;
}

Status StagedRun::PassFence() {
  if (guards_.fence_file.empty() || fence_) return {};
  PATINA_ASSIGN(FenceHold hold, FenceHold::Acquire(guards_.fence_file, guards_.attempt));
  fence_.emplace(std::move(hold));
  return {};
}

Status StagedRun::AddPreview(const RgbImage& sheet) {
  PATINA_ASSIGN(const std::vector<uint8_t> png,
                EncodePng(staging_->directory() + "/preview.tmp.png", sheet.width, sheet.height, 3,
                          sheet.rgb.data()));
  return staging_->AddPayload("preview.png", "preview", png);
}

Status StagedRun::AddReportPage(std::vector<RunCurvePoint> curve,
                                const std::function<Result<std::string>(const PageFacts&)>& text) {
  if (!job_.report) return {};
  const Manifest manifest = WithPayloads();
  const RunRecord run = RecordSoFar(std::move(curve));
  PATINA_ASSIGN(std::vector<uint64_t> zstd_bytes,
                ZstdSizes(staging_->directory(), manifest.payloads));
  PATINA_ASSIGN(const std::string page, text({job_, manifest, run, result_.stopped_by,
                                              result_.warnings, std::move(zstd_bytes)}));
  return staging_->AddUnlisted(kReportPageName, AsBytes(page));
}

RunRecord StagedRun::RecordSoFar(std::vector<RunCurvePoint> curve) const {
  RunRecord record;
  record.asset = job_.asset;
  record.fingerprint = result_.fingerprint;
  record.version = PATINA_VERSION;
  record.cpu = CpuName();
  record.cpus = UsableCpus();
  record.threads = pool_->threads();
  record.simd = SimdTargetName(simd_);
  record.seconds = SecondsSoFar();
  record.cpu_seconds = ProcessCpuSeconds() - start_cpu_;
  record.peak_memory_bytes = PeakMemoryBytes();
  record.samples = result_.samples;
  for (const StageCost& stage : stages_) {
    if (stage.stage == "train" && stage.seconds > 0)
      record.samples_per_s = result_.samples / stage.seconds;
  }
  record.stages = stages_;
  record.recording_seconds = recording_seconds_;
  record.curve = std::move(curve);
  record.simulation = simulation_;
  return record;
}

void StagedRun::RecordSimulation(const layered::Stack& stack) {
  for (const layered::AccuracyPoint& point :
       layered::MeasureAccuracy(layered::Simulator(stack), job_.seed))
    simulation_.push_back({point.paths, point.standard_error, point.seconds});
}

Status StagedRun::AddRunRecord(std::vector<RunCurvePoint> curve) {
  const std::string text = RunRecordToJson(RecordSoFar(std::move(curve)));
  return staging_->AddUnlisted(kRunRecordName, AsBytes(text));
}

Status StagedRun::Publish(std::vector<RunCurvePoint> curve) {
  PATINA_TRY(AddRunRecord(std::move(curve)));
  PATINA_TRY(PassFence());
  PATINA_ASSIGN(PublishedContainer published, staging_->Publish());
  result_.container = published.directory;
  result_.revision = published.revision;
  if (!published.warning.empty()) sink_.OnWarning(published.warning);
  return {};
}

Manifest StagedRun::WithPayloads() const {
  Manifest manifest = manifest_;
  manifest.payloads = staging_->payloads();
  return manifest;
}

void StagedRun::WarnOfRollbacks(int rollbacks) {
  if (rollbacks == 0) return;
  sink_.OnWarning("the training ran into values that are not finite and was set back " +
                  std::to_string(rollbacks) + " times, with lower rates; look at the preview");
}

double StagedRun::SecondsSoFar() const { return Since(start_); }

}  // namespace patina
