#include "pipeline/validate/targets.h"

#include <algorithm>
#include <filesystem>

#include "formats/base/names.h"
#include "formats/container.h"
#include "pipeline/validate/check_container.h"

namespace patina::validate {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepestFolder = 32;

// "r0001" and beyond.
bool IsRevisionName(const std::string& name) {
  return name.size() >= 5 && name[0] == 'r' &&
         std::all_of(name.begin() + 1, name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool IsArchiveName(const std::string& name) {
  constexpr std::string_view kEnd = ".patina";
  return name.size() > kEnd.size() &&
         name.compare(name.size() - kEnd.size(), kEnd.size(), kEnd) == 0;
}

std::vector<fs::directory_entry> SortedEntries(const fs::path& folder) {
  std::vector<fs::directory_entry> entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error))
    entries.push_back(*entry);
  std::sort(entries.begin(), entries.end(),
            [](const auto& a, const auto& b) { return a.path().filename() < b.path().filename(); });
  return entries;
}

class Finder {
 public:
  explicit Finder(const TargetOptions& options) : options_(options) {}

  void Walk(const fs::path& folder, const std::string& label, int depth) {
    std::error_code ignored;
    if (fs::exists(folder / kManifestName, ignored)) {
      Add(TargetKind::kContainer, folder, label);
      return;
    }
    const std::vector<fs::directory_entry> entries = SortedEntries(folder);
    const bool is_asset =
        fs::symlink_status(folder / kCurrentName, ignored).type() != fs::file_type::not_found;
    if (is_asset) Add(TargetKind::kAsset, folder, label);
    const std::string current = fs::read_symlink(folder / kCurrentName, ignored).string();
    for (const fs::directory_entry& entry : entries) {
      const std::string name = entry.path().filename().string();
      if (name[0] == '.' || entry.is_symlink(ignored)) continue;
      if (entry.is_directory(ignored)) {
        if (is_asset && (!IsRevisionName(name) || (options_.current_only && name != current)))
          continue;
        if (is_asset) {
          Add(TargetKind::kContainer, entry.path(), JoinLabel(label, name));
        } else if (depth < kDeepestFolder) {
          Walk(entry.path(), JoinLabel(label, name), depth + 1);
        }
      } else if (entry.is_regular_file(ignored)) {
        AddFile(entry.path(), JoinLabel(label, name), false);
      }
    }
  }

  // A file that was named is validated whatever it is; one that was found may be anything.
  void AddFile(const fs::path& path, const std::string& label, bool named) {
    const std::string name = path.filename().string();
    if (IsArchiveName(name)) {
      Add(TargetKind::kArchive, path, label);
      return;
    }
    const DocumentKind kind = KindOfDocument(path.string());
    if (kind == DocumentKind::kNone && !named) return;
    // Of a glTF scene's folder nothing was said.
    if (kind == DocumentKind::kScene && !named && path.extension() != ".json") return;
    Add(kind == DocumentKind::kNone ? TargetKind::kUnknown : TargetKind::kDocument, path, label);
    targets_.back().document = kind;
  }

  void Add(TargetKind kind, const fs::path& path, const std::string& label) {
    targets_.push_back({kind, DocumentKind::kNone, path.string(), label});
  }

  std::vector<Target> Take() { return std::move(targets_); }

 private:
  TargetOptions options_;
  std::vector<Target> targets_;
};

std::string LabelOf(const std::string& argument) {
  fs::path path = fs::path(argument).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();  // a '/' at the end
  const std::string text = path.string();
  if (text == "." || text.empty()) return "";
  if (path.is_relative() && text.rfind("..", 0) != 0) return text;
  const std::string name = path.filename().string();
  return name == ".." ? "" : name;
}

}  // namespace

const char* KindName(const Target& target) {
  switch (target.kind) {
    case TargetKind::kContainer:
      return "container";
    case TargetKind::kAsset:
      return "asset";
    case TargetKind::kArchive:
      return "archive";
    case TargetKind::kUnknown:
      return "unknown";
    case TargetKind::kDocument:
      break;
  }
  switch (target.document) {
    case DocumentKind::kJob:
      return "job";
    case DocumentKind::kConfig:
      return "config";
    case DocumentKind::kScene:
      return "scene";
    case DocumentKind::kSceneManifest:
      return "scene-manifest";
    case DocumentKind::kBindings:
      return "bindings";
    case DocumentKind::kNone:
      break;
  }
  return "unknown";
}

std::vector<Target> FindTargets(const std::string& argument, const TargetOptions& options) {
  Finder finder(options);
  std::error_code error;
  fs::path path = argument;
  std::string label = LabelOf(argument);
  if (fs::is_regular_file(path, error) && path.filename() == kManifestName) {
    path = path.parent_path().empty() ? fs::path(".") : path.parent_path();
    label = fs::path(label).parent_path().string();
  }
  if (fs::is_directory(path, error)) {
    finder.Walk(path, label, 0);
  } else if (fs::exists(path, error)) {
    finder.AddFile(path, label, true);
  }
  std::vector<Target> targets = finder.Take();
  if (targets.empty())
    targets.push_back({TargetKind::kUnknown, DocumentKind::kNone, argument, label});
  for (Target& target : targets) {
    if (target.label.empty()) target.label = ".";
  }
  return targets;
}

void CheckAssetFolder(const std::string& path, const std::string& label, FindingList* findings) {
  std::error_code error;
  const fs::path folder = path;
  const fs::path link = folder / kCurrentName;
  const std::string file = JoinLabel(label, kCurrentName);
  std::string newest;
  for (const fs::directory_entry& entry : SortedEntries(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(".staging-", 0) == 0)
      findings->Add(1204, JoinLabel(label, name), {}, "what a bake has staged so far");
    if (name == "rejected" && entry.is_directory(error)) {
      findings->Add(1206, JoinLabel(label, name), {},
                    "the last container that missed its quality gate");
    }
    const bool longer = name.size() > newest.size();
    if (IsRevisionName(name) && (longer || (name.size() == newest.size() && name > newest)))
      newest = name;
  }
  if (!fs::is_symlink(link, error)) {
    findings->Add(1203, file, {}, "it is a file or folder of its own");
    return;
  }
  const std::string target = fs::read_symlink(link, error).string();
  if (!IsRevisionName(target) || !fs::is_directory(folder / target, error)) {
    findings->Add(1201, file, {}, "it points at " + QuoteForMessage(target));
  } else if (target != newest) {
    findings->Add(1202, file, {}, "it points at " + target + ", the newest is " + newest);
  }
}

}  // namespace patina::validate
