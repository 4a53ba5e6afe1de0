// What jobs of every kind have in common: stages with a clock, a name in every report, cancelling,
// errors and their exit codes, the record of the run, publishing.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "formats/container.h"
#include "formats/layered/layered_stack.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/run_guards.h"
#include "pipeline/jobs/run_record.h"
#include "pipeline/jobs/sheet.h"
#include "pipeline/kernels/dispatch.h"

namespace patina {

struct PageFacts;  // report_page.h

// Names the stage in every report, and remembers the warnings.
class StageSink : public ProgressSink {
 public:
  // Both must outlive it.
  StageSink(JobObserver& observer, std::vector<std::string>* warnings)
      : observer_(observer), warnings_(warnings) {}

  void SetStage(const std::string& stage) { stage_ = stage; }
  void OnProgress(const ProgressEvent& event) override;
  void OnWarning(const std::string& message) override;

 private:
  JobObserver& observer_;
  std::vector<std::string>* warnings_;
  std::string stage_;
};

// One run of a job. A kind of job derives from it; each of its stages returns an error or leaves
// its result in a member.
class StagedRun {
 public:
  // The first three must outlive it.
  StagedRun(const Job& job, JobObserver& observer, const CancelToken& cancel,
            const RunGuards& guards);
  virtual ~StagedRun() = default;
  StagedRun(const StagedRun&) = delete;
  StagedRun& operator=(const StagedRun&) = delete;

  // Call once. Does not tell the observer of the result.
  JobResult Run();

 protected:
  // Calls Stage for each stage in order.
  virtual Status RunStages() = 0;
  Status Stage(const char* name, const std::function<Status()>& body);

  // What can fail for reasons of the machine, and comes before minutes of work. OpenStaging makes
  // the staging area and the threads.
  Status ChooseSimdTarget();
  Status OpenStaging();
  // Whether the guards ask to leave it at what is there: result_ then describes `current`. Call
  // once the fingerprint is known.
  bool FoundUnchanged();
  // Call right before anything becomes visible; until the run ends no other attempt takes over.
  Status PassFence();
  // Writes a picture as the payload preview.png.
  Status AddPreview(const RgbImage& sheet);
  // Writes report.html, unless the job asks for none. Call once the manifest is complete.
  Status AddReportPage(std::vector<RunCurvePoint> curve,
                       const std::function<Result<std::string>(const PageFacts&)>& text);
  Status AddRunRecord(std::vector<RunCurvePoint> curve);
  // AddRunRecord and the container's publication.
  Status Publish(std::vector<RunCurvePoint> curve);
  // What accuracy costs where the input is simulated, for the record and the report page.
  void RecordSimulation(const layered::Stack& stack);
  // If the trainer was set back because of values that are not finite.
  void WarnOfRollbacks(int rollbacks);
  // The manifest with what is staged so far.
  Manifest WithPayloads() const;
  double SecondsSoFar() const;

  const Job& job_;
  JobObserver& observer_;
  const CancelToken& cancel_;
  JobResult result_;
  StageSink sink_;
  bool reading_input_ = false;  // an error now is the input's fault
  std::optional<StagingArea> staging_;
  std::optional<ThreadPool> pool_;
  Manifest manifest_;
  RunGuards guards_;
  double recording_seconds_ = 0;             // of the training, to measure the curve
  std::vector<SimulationPoint> simulation_;  // as of the run's record

 private:
  using Clock = std::chrono::steady_clock;

  RunRecord RecordSoFar(std::vector<RunCurvePoint> curve) const;

  Clock::time_point start_;
  double start_cpu_;
  std::string stage_;
  std::vector<StageCost> stages_;
  SimdTarget simd_ = SimdTarget::kAvx2;
  std::optional<FenceHold> fence_;
};

}  // namespace patina
