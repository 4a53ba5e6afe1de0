#include "pipeline/jobs/brdf_group.h"

#include <new>
#include <optional>
#include <string>
#include <utility>

#include "formats/base/file_io.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/grouping.h"
#include "pipeline/jobs/brdf_job.h"
#include "pipeline/jobs/brdf_run.h"
#include "pipeline/jobs/staged_run.h"

namespace patina {
namespace {

constexpr const char* kAlone = "; each material gets a codebook of its own";

// Reads and trains; what comes of it stands at the place of its job. Sources that no group takes
// are read again by their own run.
class GroupTrainer {
 public:
  GroupTrainer(std::span<const Job> jobs, size_t share,
               const std::function<JobObserver&(size_t)>& observer, const CancelToken& cancel)
      : jobs_(jobs), share_(share), observer_(observer), cancel_(cancel) {}

  std::vector<std::optional<TrainedInGroup>> Run() {
    Read();
    std::vector<const brdf::Source*> data;
    std::vector<size_t> job_of;
    for (size_t i = 0; i < jobs_.size(); ++i) {
      if (!sources_[i]) continue;
      data.push_back(&sources_[i]->data);
      job_of.push_back(i);
    }
    for (std::vector<size_t> group : brdf::GroupAlike(data, share_)) {
      if (group.size() < 2 || cancel_.cancelled()) continue;
      for (size_t& member : group) member = job_of[member];
      Train(group);
    }
    return std::move(trained_);
  }

 private:
  void Read() {
    std::vector<std::string> warnings;
    for (size_t i = 0; i < jobs_.size() && !cancel_.cancelled(); ++i) {
      StageSink sink(observer_(0), &warnings);
      sink.SetStage("ingest");
      ProgressEvent event;
      event.stage = "ingest";
      event.fraction = static_cast<double>(i) / static_cast<double>(jobs_.size());
      sink.OnProgress(event);
      // What is wrong with a file its own run says.
      if (auto source = ReadBrdfSource(jobs_[i])) sources_[i] = std::move(*source);
    }
  }

  void Train(const std::vector<size_t>& group) {
    JobObserver& observer = observer_(group[0]);
    const Job& first = jobs_[group[0]];
    std::vector<const brdf::Source*> data;
    std::vector<std::string> hashes;
    std::string names;
    for (const size_t member : group) {
      data.push_back(&sources_[member]->data);
      hashes.push_back(sources_[member]->sha256);
      names += (names.empty() ? "" : ", ") + jobs_[member].asset;
    }
    observer.OnNote("group", std::to_string(group.size()) + " materials on one codebook: " + names);
    const brdf::SourceKind kind = brdf::KindOf(*data[0]);
    brdf::TrainOptions options = TrainingOfJob(first, kind);
    options.cancel = &cancel_;
    std::vector<std::string> warnings;
    StageSink sink(observer, &warnings);
    sink.SetStage("train");
    ThreadPool pool(first.threads);
    auto models = brdf::TrainShared(data, ModelOfJob(first, kind), options, pool, sink);
    if (!models) {
      if (!cancel_.cancelled()) observer.OnWarning(names + ": " + models.error().message + kAlone);
      return;
    }
    auto codebook = Write((*models)[0], first.out);
    if (!codebook) {
      observer.OnWarning(codebook.error().message + kAlone);
      return;
    }
    for (size_t m = 0; m < group.size(); ++m) {
      trained_[group[m]] = TrainedInGroup{std::move(*sources_[group[m]]), std::move((*models)[m]),
                                          *codebook, hashes};
    }
  }

  static Result<SharedCodebook> Write(const brdf::TrainedBrdf& model, const std::string& out) {
    PATINA_TRY(MakeDirectories(out));
    return WriteSharedCodebook(model, out);
  }

  std::span<const Job> jobs_;
  size_t share_;
  const std::function<JobObserver&(size_t)>& observer_;
  const CancelToken& cancel_;
  std::vector<std::optional<BrdfSource>> sources_ =
      std::vector<std::optional<BrdfSource>>(jobs_.size());
  std::vector<std::optional<TrainedInGroup>> trained_ =
      std::vector<std::optional<TrainedInGroup>>(jobs_.size());
};

}  // namespace

std::vector<JobResult> RunSharedBrdfJobs(std::span<const Job> jobs, size_t share,
                                         const std::function<JobObserver&(size_t)>& observer,
                                         const CancelToken& cancel) {
  std::vector<std::optional<TrainedInGroup>> trained(jobs.size());
  try {
    trained = GroupTrainer(jobs, share, observer, cancel).Run();
  } catch (const std::bad_alloc&) {
    observer(0).OnWarning("not enough memory to train materials together" + std::string(kAlone));
  }
  std::vector<JobResult> results;
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (cancel.cancelled() && i > 0) break;
    results.push_back(
        RunBrdfJob(jobs[i], observer(i), cancel, {}, trained[i] ? &*trained[i] : nullptr));
    trained[i].reset();
    observer(i).OnResult(results.back());
  }
  return results;
}

}  // namespace patina
