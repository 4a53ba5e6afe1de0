#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "formats/base/file_io.h"
#include "formats/scene/scene_name.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/result_text.h"
#include "pipeline/jobs/as_reflectance.h"
#include "pipeline/jobs/brdf_group.h"
#include "pipeline/jobs/event_log.h"
#include "pipeline/jobs/job_plan.h"
#include "pipeline/jobs/job_runner.h"
#include "pipeline/jobs/scene_manifest.h"

namespace patina {
namespace {

template <class Enum, class Parse>
void Override(const std::optional<std::string>& name, Parse parse, Enum* value) {
  if (!name) return;
  // The command line has let no other names through.
  if (auto parsed = parse(*name)) *value = *parsed;
}

template <class T>
void Override(const std::optional<T>& given, T* value) {
  if (given) *value = *given;
}

// Options that were given and that BRDFs do not have, for a message.
std::string MapOptions(const JobOverrides& given, const Job& job) {
  std::string names;
  const auto add = [&names](bool is_given, const char* name) {
    if (is_given) names += (names.empty() ? "" : ", ") + std::string(name);
  };
  add(given.profile.has_value(), "--profile");
  const bool set = job.kind == JobKind::kSvbrdf && job.file.empty();
  const bool maps = ReadsColorMaps(job);
  add(given.address.has_value() && !set, "--address");
  add(given.normal_convention.has_value() && !set, "--normal-convention");
  add(given.target_psnr_db.has_value(), "--target-psnr");
  add(given.target_bpp.has_value(), "--target-bpp");
  add(given.size_budget_bytes.has_value(), "--size-budget");
  add(given.time_budget_s.has_value(), "--time-budget");
  add(given.samples.has_value(), "--samples");
  add(given.min_psnr_db.has_value(), "--min-psnr");
  add(given.working_space.has_value(), "--working-space");
  add(given.color_space.has_value() && !maps, "--color-space");
  add(given.ocio.has_value() && !maps, "--ocio");
  add(given.repair_nonfinite, "--repair-nonfinite");
  add(given.no_toksvig, "--no-toksvig");
  add(given.learn_all, "--learn-all");
  add(!given.effects_off.empty(), "--effect-off");
  add(given.constant_tolerance.has_value(), "--constant-tolerance");
  add(given.lod_range.has_value(), "--lod-range");
  return names;
}

// How maps are read.
void ApplyToMaps(const JobOverrides& overrides, Job* job) {
  if (job->file.empty()) {
    if (overrides.address) job->address_given = true;
    if (overrides.address)
      job->address = *overrides.address == "clamp" ? AddressMode::kClamp : AddressMode::kWrap;
    Override(overrides.normal_convention, &job->normal_convention);
  }
  if (!ReadsColorMaps(*job)) return;
  Override(overrides.color_space, &job->color_space);
  Override(overrides.ocio, &job->ocio);
}

void Apply(const JobOverrides& overrides, Job* job) {
  Override(overrides.out, &job->out);
  Override(overrides.quality, ParseQuality, &job->quality);
  Override(overrides.recipe, ParseRecipe, &job->recipe);
  Override(overrides.seed, &job->seed);
  Override(overrides.threads, &job->threads);
  if (overrides.no_report) job->report = false;
  if (job->kind != JobKind::kMaterial) {
    const std::string names = MapOptions(overrides, *job);
    if (!names.empty()) {
      std::fprintf(stderr, "patina: warning: %s: a BRDF has no %s; passed over\n",
                   job->asset.c_str(), names.c_str());
    }
    if (job->kind == JobKind::kSvbrdf) {
      ApplyToMaps(overrides, job);
      if (overrides.texture_format) job->model.texture_format = overrides.texture_format;
    }
    return;
  }
  if (overrides.profile) job->choose_profile = *overrides.profile == "auto";
  Override(overrides.profile, ParseProfile, &job->profile);
  const bool aims = overrides.target_psnr_db || overrides.target_bpp || overrides.size_budget_bytes;
  if (aims && !overrides.profile && job->profile == Job().profile) job->choose_profile = true;
  ApplyToMaps(overrides, job);
  Override(overrides.target_psnr_db, &job->target_psnr_db);
  Override(overrides.target_bpp, &job->target_bpp);
  Override(overrides.size_budget_bytes, &job->size_budget_bytes);
  Override(overrides.time_budget_s, &job->time_budget_s);
  Override(overrides.samples, &job->samples);
  Override(overrides.min_psnr_db, &job->min_psnr_db);
  Override(overrides.working_space, ParseWorkingSpace, &job->working_space);
  if (overrides.repair_nonfinite) job->repair_nonfinite = true;
  if (overrides.no_toksvig) job->toksvig = false;
  for (const char* name : EffectNames()) {
    if (overrides.learn_all) *EffectSwitch(&job->effects, name) = false;
  }
  // The command line has let no other names through.
  for (const std::string& name : overrides.effects_off) *EffectSwitch(&job->effects, name) = false;
  Override(overrides.constant_tolerance, &job->effects.constant_tolerance);
  if (overrides.lod_range) job->lod_range = {(*overrides.lod_range)[0], (*overrides.lod_range)[1]};
}

// Of --material: what else scenes hold is not baked; what they do not hold is an error.
void KeepChosenMaterials(const std::vector<std::string>& wanted, std::vector<PlannedJob>* plan) {
  if (wanted.empty()) return;
  std::set<std::string> missing(wanted.begin(), wanted.end());
  std::string known;
  std::erase_if(*plan, [&](const PlannedJob& planned) {
    if (!planned.job || planned.job->scene.empty()) return false;
    const std::string& name = planned.job->scene_material;
    known += (known.empty() ? "" : ", ") + name;
    missing.erase(name);
    missing.erase(planned.asset);
    return std::find(wanted.begin(), wanted.end(), name) == wanted.end() &&
           std::find(wanted.begin(), wanted.end(), planned.asset) == wanted.end();
  });
  for (const std::string& name : missing) {
    plan->push_back(
        {AssetNameFromPath(name),
         Fail(ErrorCode::kNotFound, "no scene here has a material \"" + name +
                                        "\"; there are: " + (known.empty() ? "none" : known))});
  }
}

// Writes the manifest of each scene that something was baked of. False if one could not be written.
bool WriteSceneManifests(const std::vector<PlannedJob>& plan, const std::vector<JobResult>& results,
                         Verbosity verbosity) {
  std::map<std::pair<std::string, std::string>, std::map<std::string, std::string>> scenes;
  for (const PlannedJob& planned : plan) {
    if (!planned.job || planned.job->scene.empty()) continue;
    auto& problems = scenes[{planned.job->scene, planned.job->out}];
    for (const JobResult& result : results) {
      if (result.asset == planned.asset && result.error)
        problems[planned.asset] = result.error->message;
    }
  }
  bool written = true;
  for (const auto& [scene, problems] : scenes) {
    auto path = WriteSceneManifest(scene.first, scene.second, problems);
    if (!path) PrintError(path.error().message);
    written = written && path;
    if (path && verbosity != Verbosity::kQuiet)
      std::fprintf(stderr, "patina: the scene is described in %s\n", path->c_str());
  }
  return written;
}

// Of --texture-format: what has no neural texture is not baked as if nothing had been asked for.
void RefuseWithoutNeuralTexture(std::vector<PlannedJob>* plan) {
  for (PlannedJob& planned : *plan) {
    if (!planned.job || planned.job->kind == JobKind::kSvbrdf) continue;
    const bool material = planned.job->kind == JobKind::kMaterial;
    planned.job = Fail(
        ErrorCode::kInvalidArgument,
        std::string("--texture-format is of the neural texture of a spatially varying BRDF, and "
                    "this is a ") +
            (material ? "material; leave it out, or add --as svbrdf"
                      : "BRDF that does not vary; leave it out"));
  }
}

std::vector<PlannedJob> Plan(const BakeOptions& options, Verbosity verbosity) {
  std::vector<PlannedJob> plan;
  for (const std::string& input : options.inputs) {
    std::error_code ignored;
    if (!options.map_list.empty() && !std::filesystem::is_regular_file(input, ignored)) {
      // The list says which maps there are: none need be found.
      Job job;
      job.asset = AssetNameFromPath(input);
      job.folder = input;
      plan.push_back({job.asset, std::move(job)});
      continue;
    }
    JobPlan found = PlanJobs(input, options.job.out.value_or(""));
    std::move(found.jobs.begin(), found.jobs.end(), std::back_inserter(plan));
    if (verbosity != Verbosity::kVerbose) continue;
    for (const std::string& skipped : found.skipped) {
      std::fprintf(stderr, "patina: %s holds no images and no BRDFs and is passed over\n",
                   skipped.c_str());
    }
  }
  if (!options.map_list.empty()) {
    auto maps = ReadMapListFile(options.map_list);
    for (PlannedJob& planned : plan) {
      if (!maps) planned.job = Fail(maps.error());
      if (!planned.job) continue;
      const bool brdf = !planned.job->file.empty();
      if (brdf || !planned.job->scene.empty()) {
        planned.job = Fail(ErrorCode::kInvalidArgument,
                           std::string("--maps describes a texture set, and this is a ") +
                               (brdf ? "BRDF" : "scene") + "; leave it out");
        continue;
      }
      planned.job->maps = *maps;
      planned.job->maps_folder = FolderOfFile(options.map_list);
    }
  }
  KeepChosenMaterials(options.materials, &plan);
  for (PlannedJob& planned : plan) {
    if (planned.job && options.as == "svbrdf") BakeAsReflectance(&*planned.job);
  }
  if (options.job.texture_format) RefuseWithoutNeuralTexture(&plan);
  std::set<std::string> taken;
  std::map<std::string, std::string> described;  // where a scene's manifest comes, and whose it is
  for (PlannedJob& planned : plan) {
    if (!planned.job) continue;
    Apply(options.job, &*planned.job);
    if (const std::string scene = planned.job->scene; !scene.empty()) {
      const std::string manifest = planned.job->out + "/" + SceneNameOf(scene) + ".scene.json";
      const auto [first, is_new] = described.emplace(manifest, scene);
      if (!is_new && first->second != scene) {
        planned.job = Fail(ErrorCode::kConflict, scene + " and " + first->second +
                                                     " would both be described in " + manifest +
                                                     "; rename one, or bake it into another --out");
        continue;
      }
    }
    if (planned.job->out.empty()) {
      planned.job =
          Fail(ErrorCode::kInvalidArgument, "no folder for the container; give --out DIR");
    } else if (!taken.insert(planned.job->out + "\n" + planned.asset).second) {
      planned.job =
          Fail(ErrorCode::kConflict, "another input of this run is also named " + planned.asset +
                                         "; rename one, or bake it into another --out");
    }
  }
  return plan;
}

JobResult Unplanned(const std::string& asset, const Error& error) {
  JobResult result;
  result.asset = asset;
  result.error = error;
  result.error_stage = "ingest";
  result.exit_code = ExitCodeFor(error, true);
  return result;
}

// Later in the list is worse.
int Severity(int exit_code) {
  constexpr int kOrder[] = {kExitDone,  kExitQualityGate, kExitBadInput,
                            kExitUsage, kExitFailed,      kExitInterrupted};
  for (int i = 0; i < 6; ++i) {
    if (kOrder[i] == exit_code) return i;
  }
  return 4;
}

void Print(const JobResult& result, const CommandLine& line) {
  if (result.error) return PrintError(result.asset + ": " + result.error->message);
  if (line.verbosity == Verbosity::kQuiet) return;
  std::fputs(ResultText(result).c_str(), line.json ? stderr : stdout);
  std::fflush(stdout);
}

// Runs the BRDFs of a plan that may share codebooks.
void RunShared(const std::vector<PlannedJob>& plan, int share, Verbosity verbosity,
               const CancelToken& cancel, std::vector<std::optional<JobResult>>* results) {
  std::vector<Job> jobs;
  std::vector<size_t> place;
  for (size_t i = 0; i < plan.size(); ++i) {
    if (!plan[i].is_brdf_file || !plan[i].job) continue;
    jobs.push_back(*plan[i].job);
    place.push_back(i);
  }
  if (jobs.empty()) return;
  std::vector<std::unique_ptr<TerminalProgress>> terminals(jobs.size());
  const auto observer = [&](size_t job) -> JobObserver& {
    if (!terminals[job]) {
      terminals[job] = std::make_unique<TerminalProgress>(stderr, verbosity, jobs[job].asset);
    }
    return *terminals[job];
  };
  std::vector<JobResult> done =
      RunSharedBrdfJobs(jobs, static_cast<size_t>(share), observer, cancel);
  for (size_t job = 0; job < done.size(); ++job) (*results)[place[job]] = std::move(done[job]);
}

// Beside the events, unless they go to a pipe or a device; else beside the job.
std::string DefaultResultPath(const RunOptions& options) {
  std::error_code ignored;
  const bool beside_events =
      !options.events.empty() && std::filesystem::is_regular_file(options.events, ignored);
  const std::string folder = FolderOfFile(beside_events ? options.events : options.job_file);
  return folder.empty() ? "result.json" : folder + "/result.json";
}

}  // namespace

int BakeCommand(const CommandLine& line, const CancelToken& cancel) {
  const BakeOptions& options = line.bake;
  if (!options.map_list.empty() && options.inputs.size() != 1) {
    PrintError("--maps describes one material; give one INPUT folder with it");
    return kExitUsage;
  }
  const std::vector<PlannedJob> plan = Plan(options, line.verbosity);
  std::vector<std::optional<JobResult>> shared(plan.size());
  if (options.share > 1) RunShared(plan, options.share, line.verbosity, cancel, &shared);
  std::vector<JobResult> results;
  const auto of_scenes = std::count_if(plan.begin(), plan.end(), [](const PlannedJob& planned) {
    return planned.job && !planned.job->scene.empty();
  });
  SharedImages images;
  RunGuards guards;
  if (of_scenes > 1) guards.images = &images;
  int worst = kExitDone;
  for (size_t i = 0; i < plan.size(); ++i) {
    const PlannedJob& planned = plan[i];
    if (shared[i]) {
      results.push_back(std::move(*shared[i]));
    } else if (cancel.cancelled() && !results.empty()) {
      continue;  // what is shared and behind it may be done
    } else if (planned.job) {
      TerminalProgress progress(stderr, line.verbosity, planned.asset);
      results.push_back(RunJob(*planned.job, progress, cancel, guards));
    } else {
      results.push_back(Unplanned(planned.asset, planned.job.error()));
    }
    Print(results.back(), line);
    if (Severity(results.back().exit_code) > Severity(worst)) worst = results.back().exit_code;
  }
  if (!WriteSceneManifests(plan, results, line.verbosity) &&
      Severity(worst) < Severity(kExitFailed))
    worst = kExitFailed;
  if (plan.size() > 1 && line.verbosity != Verbosity::kQuiet) {
    std::fputs(SummaryText(results, plan.size()).c_str(), line.json ? stderr : stdout);
  }
  if (line.json) {
    std::printf("%s\n",
                (plan.size() == 1 ? JobResultToJson(results[0], -1) : ResultsToJson(results, worst))
                    .c_str());
  }
  return worst;
}

int RunCommand(const CommandLine& line, const CancelToken& cancel) {
  const RunOptions& options = line.run;
  ObserverList observers;
  std::optional<EventLog> events;
  if (!options.events.empty()) {
    auto opened = EventLog::Open(options.events);
    if (!opened) return FailCommand(opened.error());
    events.emplace(std::move(*opened));
    observers.Add(&*events);
  }
  auto job = ReadJobFile(options.job_file);
  TerminalProgress terminal(stderr, line.verbosity,
                            job ? job->asset : AssetNameFromPath(options.job_file));
  observers.Add(&terminal);
  JobResult result;
  if (job) {
    result = RunJob(*job, observers, cancel, options.guards);
  } else {
    result = Unplanned("", job.error());
    observers.OnResult(result);
  }
  if (result.asset.empty() && result.error) {
    PrintError(result.error->message);
  } else {
    Print(result, line);
  }
  const std::string result_path =
      options.result.empty() ? DefaultResultPath(options) : options.result;
  if (events && events->failed())
    PrintError("some events could not be written to " + options.events);
  const Status written =
      WriteFileDurably(result_path, std::string_view(JobResultToJson(result, 2) + "\n"));
  if (line.json) std::printf("%s\n", JobResultToJson(result, -1).c_str());
  if (!written) {
    PrintError(written.error().message);
    // The container, if any, is published; but who relies on the result file must not take it for
    // done.
    return result.exit_code == kExitDone ? static_cast<int>(kExitFailed) : result.exit_code;
  }
  return result.exit_code;
}

}  // namespace patina
