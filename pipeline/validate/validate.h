// `patina validate`: finds what can be validated, checks it on several threads, and judges.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "formats/base/result.h"
#include "formats/manifest.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/jobs/job.h"
#include "pipeline/validate/findings.h"
#include "pipeline/validate/targets.h"

namespace patina::validate {

struct AcceptedFinding {
  int number = 0;
  std::string file;
  std::string pointer;
  auto Key() const { return std::tie(number, file, pointer); }
  bool operator<(const AcceptedFinding& other) const { return Key() < other.Key(); }
};
using Baseline = std::set<AcceptedFinding>;

// Measures a target against the source it was baked from: see remeasure.h, which is not called from
// here because it needs the image library.
using RemeasureFunction = void (*)(const Target& target, const Job& source, ThreadPool& pool,
                                   const CancelToken& cancel, ProgressSink& progress,
                                   FindingList* findings);

struct Against {
  Job source;
  RemeasureFunction remeasure;  // never nullptr
};

struct ValidateOptions {
  std::vector<std::string> paths;
  TargetOptions targets;
  std::map<int, Severity> severities;  // in place of the catalogue's
  Severity fail_on = Severity::kError;
  std::string inputs;  // folder of the source files, to compare their hashes; or empty
  std::optional<Against> against;
  Baseline baseline;
};

// A finding and the target it belongs to.
struct PlacedFinding {
  size_t target = 0;
  Finding finding;
};

struct ValidationReport {
  std::string version;  // of the program
  Severity fail_on = Severity::kError;
  std::vector<Target> targets;
  std::vector<PlacedFinding> findings;  // by target
  size_t stale = 0;                     // entries of the baseline that were not found

  // Of a severity, accepted ones not counted.
  size_t Count(Severity severity) const;
  size_t accepted() const;
  bool unreadable() const;  // a 9xxx that counts
  bool valid() const;       // nothing that counts is of fail_on or above
};

// Never fails: what cannot be read is a finding. The report does not depend on the number of
// threads. progress hears of the share that is done. A cancelled run leaves out targets.
ValidationReport Validate(const ValidateOptions& options, ThreadPool& pool,
                          const CancelToken& cancel, ProgressSink& progress);

// The manifest's input files against the files of a folder: <inputs>/<path> or
// <inputs>/<asset>/<path>.
void CheckInputs(const Manifest& manifest, const std::string& inputs, const std::string& file,
                 FindingList* findings);

}  // namespace patina::validate
