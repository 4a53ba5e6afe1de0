// From what somebody names on a command line to what is validated.
#pragma once

#include <string>
#include <vector>

#include "pipeline/validate/check_documents.h"
#include "pipeline/validate/findings.h"

namespace patina::validate {

// The values of "kind" in reports: "container", "asset", "archive", "job", ...
enum class TargetKind {
  kContainer,  // a revision's folder
  kAsset,      // the folder around revisions: `current`, and what lies beside it
  kArchive,
  kDocument,
  kUnknown
};

struct Target {
  TargetKind kind = TargetKind::kUnknown;
  DocumentKind document = DocumentKind::kNone;
  std::string path;
  std::string label;  // as reports name it: relative to the argument's folder
};

const char* KindName(const Target& target);

struct TargetOptions {
  bool current_only = false;  // of an asset's revisions only the one that `current` points at
};

// Everything that lies in `argument`, sorted by label; one of kind kUnknown for what is not there
// or holds nothing. Links are not followed, but for the argument and `current`. Labels begin with
// the argument if that is a relative path without "..", else with its last component, so that
// reports name no folder of the machine.
std::vector<Target> FindTargets(const std::string& argument, const TargetOptions& options);

// The folder of an asset: what its `current` is, and what lies beside the revisions.
void CheckAssetFolder(const std::string& path, const std::string& label, FindingList* findings);

}  // namespace patina::validate
