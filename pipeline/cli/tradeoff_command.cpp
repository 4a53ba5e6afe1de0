#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "formats/base/file_io.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/terminal_progress.h"
#include "pipeline/jobs/job_plan.h"
#include "pipeline/tradeoff/sweep_files.h"

namespace patina {
namespace {

template <class T, class Parse>
std::vector<T> Parsed(const std::vector<std::string>& names, Parse parse) {
  std::vector<T> values;
  for (const std::string& name : names) {
    // The command line has let no other names through.
    if (auto value = parse(name)) values.push_back(*value);
  }
  return values;
}

SweepAxes AxesOf(const TradeoffOptions& options) {
  SweepAxes axes;
  axes.profiles = Parsed<Profile>(options.profiles, ParseProfile);
  axes.qualities = Parsed<Quality>(options.qualities, ParseQuality);
  axes.recipes = Parsed<Recipe>(options.recipes, ParseRecipe);
  axes.nsides = options.nsides;
  axes.index_bits = options.index_bits;
  axes.hidden = options.hidden;
  axes.hidden_layers = options.hidden_layers;
  axes.interpolations = options.interpolations;
  axes.shares = options.shares;
  return axes;
}

bool AnyOfMaterials(const TradeoffOptions& o) { return !o.profiles.empty(); }
bool AnyOfBoth(const TradeoffOptions& o) { return !o.qualities.empty() || !o.recipes.empty(); }
bool AnyOfBrdfs(const TradeoffOptions& o) {
  return !(o.nsides.empty() && o.index_bits.empty() && o.hidden.empty() &&
           o.hidden_layers.empty() && o.interpolations.empty() && o.shares.empty());
}

std::vector<Variant> VariantsOf(const TradeoffOptions& options, JobKind kind) {
  const bool asked = AnyOfBoth(options) ||
                     (kind == JobKind::kMaterial ? AnyOfMaterials(options) : AnyOfBrdfs(options));
  if (asked) return ProductOf(AxesOf(options), kind);
  return kind == JobKind::kMaterial ? ProductOf(DefaultMaterialAxes(), kind)
                                    : DefaultBrdfVariants();
}

// Progress of each bake under its own name, and how far the sweep is.
class Observers {
 public:
  Observers(Verbosity verbosity, size_t bakes) : verbosity_(verbosity), bakes_(bakes) {}

  JobObserver& For(const std::string& label) {
    auto& terminal = terminals_[label];
    if (!terminal) {
      const std::string place =
          "[" + std::to_string(terminals_.size()) + "/" + std::to_string(bakes_) + "] ";
      terminal = std::make_unique<TerminalProgress>(stderr, verbosity_, place + label);
    }
    return *terminal;
  }

 private:
  Verbosity verbosity_;
  size_t bakes_;
  std::map<std::string, std::unique_ptr<TerminalProgress>> terminals_;
};

void PrintMeans(const std::vector<SweepRow>& means) {
  for (const SweepRow& row : means) {
    std::string fronts;
    if (row.front_encode) fronts += " time";
    if (row.front_bytes) fronts += " bytes";
    if (row.front_decode) fronts += " decode";
    std::printf("  %-44s %6.2f dB %8s %10s %7.1f ns%s\n", row.variant.c_str(), row.quality_db,
                DurationText(row.encode_s).c_str(),
                BytesText(static_cast<double>(row.bytes)).c_str(), row.decode_ns,
                fronts.empty() ? "" : ("   best for:" + fronts).c_str());
  }
}

}  // namespace

int TradeoffCommand(const CommandLine& line, const CancelToken& cancel) {
  const TradeoffOptions& options = line.tradeoff;
  std::vector<Job> materials, brdfs;
  std::set<std::string> taken;
  int worst = kExitDone;
  for (const std::string& input : options.inputs) {
    for (PlannedJob& planned : PlanJobs(input, options.out).jobs) {
      if (!planned.job) {
        PrintError(planned.asset + ": " + planned.job.error().message);
        worst = kExitBadInput;
        continue;
      }
      if (!taken.insert(planned.asset).second) {
        PrintError(planned.asset +
                   ": another input is also named so; rename one, or sweep it into "
                   "another --out");
        worst = kExitBadInput;
        continue;
      }
      if (planned.job->kind == JobKind::kSvbrdf) {
        PrintError(planned.asset +
                   ": is a spatially varying BRDF, of which no variants are baked; give " +
                   "texture sets or BRDF files");
        continue;
      }
      planned.job->threads = line.threads;
      (planned.job->kind == JobKind::kBrdf ? brdfs : materials).push_back(std::move(*planned.job));
    }
  }
  if (materials.empty() && brdfs.empty()) return kExitBadInput;
  const Status made = MakeDirectories(options.out);
  if (!made) return FailCommand(made.error());

  const std::pair<const std::vector<Job>*, std::vector<Variant>> kinds[] = {
      {&materials, VariantsOf(options, JobKind::kMaterial)},
      {&brdfs, VariantsOf(options, JobKind::kBrdf)}};
  size_t bakes = 0;
  for (const auto& [jobs, variants] : kinds) bakes += jobs->size() * variants.size();
  Observers observers(line.verbosity, bakes);
  std::vector<SweepRow> rows;
  for (const auto& [jobs, variants] : kinds) {
    if (jobs->empty()) continue;
    std::vector<SweepRow> more = Sweep(
        *jobs, variants, options.out,
        [&](const std::string& label) -> JobObserver& { return observers.For(label); }, cancel);
    rows.insert(rows.end(), std::make_move_iterator(more.begin()),
                std::make_move_iterator(more.end()));
  }
  Status timed;
  if (!cancel.cancelled()) timed = MeasureDecoding(&rows, cancel);
  if (cancel.cancelled()) {
    PrintError("interrupted; what is done is kept in " + options.out +
               ", and the same command goes on from there");
    return kExitInterrupted;
  }
  if (!timed) return FailCommand(timed.error());
  for (const SweepRow& row : rows) {
    if (row.problem.empty()) continue;
    PrintError(row.asset + " (" + row.variant + "): " + row.problem);
    worst = kExitFailed;
  }
  const std::vector<SweepRow> means = MeansOf(rows);
  const std::pair<const char*, std::string> files[] = {{"tradeoff.csv", SweepCsv(rows, means)},
                                                       {"tradeoff.json", SweepJson(rows, means)},
                                                       {"tradeoff.html", SweepPage(rows, means)}};
  for (const auto& [name, text] : files) {
    const Status written = WriteFileDurably(options.out + "/" + name, std::string_view(text));
    if (!written) return FailCommand(written.error());
  }
  if (line.verbosity != Verbosity::kQuiet) {
    PrintMeans(means);
    std::printf("%s/tradeoff.html\n", options.out.c_str());
  }
  return worst;
}

}  // namespace patina
