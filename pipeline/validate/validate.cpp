#include "pipeline/validate/validate.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <new>

#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/container.h"
#include "pipeline/validate/archive_files.h"
#include "pipeline/validate/check_container.h"

namespace patina::validate {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kSilence{1};

// Of a revision that lies in an asset's folder.
void CheckAssetName(const Target& target, const Manifest& manifest, FindingList* findings) {
  std::error_code error;
  const fs::path folder = fs::canonical(target.path, error).parent_path();
  if (error || !fs::is_symlink(folder / kCurrentName, error)) return;
  const std::string name = folder.filename().string();
  if (name == manifest.asset) return;
  findings->Add(1205, JoinLabel(target.label, kManifestName), {"/asset", {}},
                QuoteForMessage(manifest.asset) + " in the folder " + QuoteForMessage(name));
}

void CheckTarget(const Target& target, const ValidateOptions& options, FindingList* findings) {
  switch (target.kind) {
    case TargetKind::kContainer: {
      const auto manifest = CheckContainer(DirectoryFiles(target.path), target.label, findings);
      if (!manifest) return;
      CheckAssetName(target, *manifest, findings);
      if (!options.inputs.empty())
        CheckInputs(*manifest, options.inputs, JoinLabel(target.label, kManifestName), findings);
      return;
    }
    case TargetKind::kAsset:
      return CheckAssetFolder(target.path, target.label, findings);
    case TargetKind::kArchive: {
      const auto manifest = CheckArchive(target.path, target.label, findings);
      if (manifest && !options.inputs.empty())
        CheckInputs(*manifest, options.inputs, JoinLabel(target.label, kManifestName), findings);
      return;
    }
    case TargetKind::kDocument:
      return CheckDocument(target.document, target.path, target.label, findings);
    case TargetKind::kUnknown:
      break;
  }
  std::error_code error;
  if (fs::is_regular_file(target.path, error))
    return CheckDocument(DocumentKind::kNone, target.path, target.label, findings);
  const bool there = fs::exists(target.path, error);
  findings->Add(9001, target.label, {},
                there ? "nothing in it can be validated" : "no such file or folder");
}

}  // namespace

size_t ValidationReport::Count(Severity severity) const {
  return static_cast<size_t>(
      std::count_if(findings.begin(), findings.end(), [&](const PlacedFinding& placed) {
        return !placed.finding.accepted && placed.finding.severity == severity;
      }));
}

size_t ValidationReport::accepted() const {
  return static_cast<size_t>(
      std::count_if(findings.begin(), findings.end(),
                    [](const PlacedFinding& placed) { return placed.finding.accepted; }));
}

bool ValidationReport::unreadable() const {
  return std::any_of(findings.begin(), findings.end(), [&](const PlacedFinding& placed) {
    return !placed.finding.accepted && placed.finding.number >= 9000 &&
           placed.finding.severity >= fail_on;
  });
}

bool ValidationReport::valid() const {
  return std::none_of(findings.begin(), findings.end(), [&](const PlacedFinding& placed) {
    return !placed.finding.accepted && placed.finding.severity >= fail_on;
  });
}

ValidationReport Validate(const ValidateOptions& options, ThreadPool& pool,
                          const CancelToken& cancel, ProgressSink& progress) {
  ValidationReport report;
  report.version = PATINA_VERSION;
  report.fail_on = options.fail_on;
  for (const std::string& path : options.paths) {
    for (Target& target : FindTargets(path, options.targets)) {
      report.targets.push_back(std::move(target));
    }
  }
  std::vector<FindingList> lists(report.targets.size(), FindingList(&options.severities));
  std::atomic<size_t> done{0};
  const auto start = std::chrono::steady_clock::now();
  pool.ParallelFor(static_cast<int>(report.targets.size()), [&](int index, int worker) {
    if (cancel.cancelled()) return;
    const auto at = static_cast<size_t>(index);
    try {
      CheckTarget(report.targets[at], options, &lists[at]);
    } catch (const std::bad_alloc&) {
      lists[at].Add(9002, report.targets[at].label, {}, "there is not enough memory to read it");
    }
    const size_t finished = done.fetch_add(1) + 1;
    // One thread speaks, and only of what takes long enough to wonder.
    if (worker != 0 || std::chrono::steady_clock::now() - start < kSilence) return;
    ProgressEvent event;
    event.stage = "validate";
    event.fraction = static_cast<double>(finished) / static_cast<double>(lists.size());
    progress.OnProgress(event);
  });
  if (options.against) {
    for (size_t i = 0; i < report.targets.size() && !cancel.cancelled(); ++i)
      options.against->remeasure(report.targets[i], options.against->source, pool, cancel, progress,
                                 &lists[i]);
  }
  Baseline left = options.baseline;
  for (size_t i = 0; i < lists.size(); ++i) {
    for (Finding& finding : lists[i].Take()) {
      const AcceptedFinding key{finding.number, finding.file, finding.pointer};
      finding.accepted = options.baseline.count(key) != 0;
      left.erase(key);
      report.findings.push_back({i, std::move(finding)});
    }
  }
  report.stale = left.size();
  return report;
}

void CheckInputs(const Manifest& manifest, const std::string& inputs, const std::string& file,
                 FindingList* findings) {
  std::vector<std::pair<std::string, std::string>> files;  // path, SHA-256
  if (manifest.brdf) {
    for (const ManifestBrdfFile& input : manifest.brdf->files)
      files.emplace_back(input.path, input.sha256);
  } else {
    for (const ManifestSourceFile& input : manifest.source.files)
      files.emplace_back(input.path, input.sha256);
  }
  for (size_t i = 0; i < files.size(); ++i) {
    const auto& [path, sha256] = files[i];
    const Place place{"/source/files/" + std::to_string(i), {}};
    std::error_code ignored;
    std::string found = inputs + "/" + manifest.asset + "/" + path;
    if (!fs::is_regular_file(found, ignored)) found = inputs + "/" + path;
    if (!fs::is_regular_file(found, ignored)) {
      findings->Add(1402, file, place, QuoteForMessage(path) + " is not there");
      continue;
    }
    const auto digest = Sha256OfFile(found);
    if (!digest) {
      findings->Add(9002, file, place, QuoteForMessage(path) + " cannot be read");
    } else if (digest->sha256 != sha256) {
      findings->Add(1401, file, place,
                    QuoteForMessage(path) + " has the SHA-256 " + digest->sha256 +
                        ", the container was baked from " + sha256);
    }
  }
}

}  // namespace patina::validate
