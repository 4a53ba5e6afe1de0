#include "pipeline/image/map_groups.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

namespace patina {
namespace {

namespace fs = std::filesystem;

bool StartsWith(const std::vector<std::string>& words, const std::vector<std::string>& prefix) {
  return words.size() >= prefix.size() && std::equal(prefix.begin(), prefix.end(), words.begin());
}

// "shared", "common": words that mark a map as belonging to several materials.
std::vector<std::string> WithoutSharedWords(std::vector<std::string> words) {
  std::erase_if(words, [](const std::string& word) {
    return word == "shared" || word == "common" || word == "all";
  });
  return words;
}

bool IsAlbedo(const MapCandidate* candidate) {
  return std::string_view(candidate->name.token->parts[0].role) == "albedo";
}

bool HasAlbedo(const MapGroup& group) {
  return std::any_of(group.own.begin(), group.own.end(), IsAlbedo);
}

class FolderGrouper {
 public:
  explicit FolderGrouper(std::string folder) : folder_(std::move(folder)) {}

  Result<GroupedMaps> Run() {
    PATINA_TRY(List());
    RecogniseNames();
    AdoptUnsuffixedColors();
    DropWeakNames();
    if (candidates_.empty()) return NothingFound();
    MakeGroups();
    NameSets();
    GroupedMaps grouped;
    grouped.candidates = std::move(candidates_);
    grouped.groups = std::move(colored_);
    grouped.notes = std::move(notes_);
    return grouped;
  }

 private:
  Status List() {
    std::error_code error;
    const fs::file_status status = fs::status(folder_, error);
    if (!fs::exists(status)) {
      return Fail(ErrorCode::kNotFound,
                  folder_ + ": no such folder; name a folder of texture maps");
    }
    if (!fs::is_directory(status)) {
      return Fail(ErrorCode::kInvalidArgument,
                  folder_ + ": not a folder; name a folder of texture maps");
    }
    fs::directory_iterator entry(folder_, error), end;
    for (; !error && entry != end; entry.increment(error)) {
      std::error_code ignored;
      const std::string file = entry->path().filename().string();
      if (file[0] != '.' && entry->is_regular_file(ignored)) files_.push_back(file);
    }
    if (error)
      return Fail(ErrorCode::kIo, folder_ + ": cannot list the folder: " + error.message());
    std::sort(files_.begin(), files_.end());
    return {};
  }

  void Ignore(const std::string& file, const std::string& why) {
    notes_.push_back({MapNote::Kind::kIgnored, file, why});
  }

  void RecogniseNames() {
    for (const std::string& file : files_) {
      if (!HasImageExtension(file)) {
        Ignore(file, "not an image of a format that is read");
        continue;
      }
      MapCandidate candidate;
      candidate.file = file;
      candidate.path = (fs::path(folder_) / file).string();
      candidate.name = ParseMapName(fs::path(file).stem().string());
      if (candidate.name.token == nullptr) {
        unknown_.push_back(std::move(candidate));
        continue;
      }
      if (candidate.name.bare_number) {
        candidate.guessed = true;
        candidate.because = "a number follows the map's name";
      }
      candidates_.push_back(std::move(candidate));
    }
  }

  // "rock.png" beside "rock_normal.png" is the base colour, as is "rusty_metal.png" beside
  // "rusty_metal_n.png".
  void AdoptUnsuffixedColors() {
    const auto has_albedo = [&](const std::vector<std::string>& words) {
      return std::any_of(candidates_.begin(), candidates_.end(), [&](const MapCandidate& other) {
        return std::string_view(other.name.token->parts[0].role) == "albedo" &&
               other.name.stem_words == words;
      });
    };
    const auto is_stem = [&](const MapCandidate& candidate) {
      const auto& words = candidate.name.all_words;
      return !words.empty() &&
             std::any_of(candidates_.begin(), candidates_.end(), [&](const MapCandidate& other) {
               return &other != &candidate && other.name.stem_words == words;
             });
    };
    const auto adopt = [&](MapCandidate* candidate) {
      candidate->guessed = true;
      candidate->because = "the name is the material's own, and no other file is its base colour";
      candidate->name.stem_words = candidate->name.all_words;
      candidate->name.stem = fs::path(candidate->file).stem().string();
      candidate->name.token = FindMapToken("albedo");
    };
    for (MapCandidate& candidate : candidates_) {
      if (candidate.name.token->weak && is_stem(candidate) && !has_albedo(candidate.name.all_words))
        adopt(&candidate);
    }
    std::vector<MapCandidate> adopted;
    for (MapCandidate& candidate : unknown_) {
      if (is_stem(candidate) && !has_albedo(candidate.name.all_words)) {
        adopt(&candidate);
        adopted.push_back(candidate);
      } else {
        Ignore(candidate.file, "no word at the end of its name says what map it is");
      }
    }
    for (MapCandidate& candidate : adopted) candidates_.push_back(std::move(candidate));
    std::sort(candidates_.begin(), candidates_.end(),
              [](const MapCandidate& a, const MapCandidate& b) { return a.file < b.file; });
  }

  // Words that also name materials count only beside a map that cannot be mistaken, or beside
  // another of the same stem.
  void DropWeakNames() {
    const bool any_strong =
        std::any_of(candidates_.begin(), candidates_.end(),
                    [](const MapCandidate& candidate) { return !candidate.name.token->weak; });
    std::erase_if(candidates_, [&, all = candidates_](const MapCandidate& candidate) {
      if (!candidate.name.token->weak || any_strong) return false;
      const auto same_stem = std::count_if(all.begin(), all.end(), [&](const MapCandidate& other) {
        return other.name.stem_words == candidate.name.stem_words;
      });
      if (same_stem > 1) return false;
      Ignore(candidate.file,
             "nothing but the word \"" + candidate.name.token->name + "\" says what map it is");
      return true;
    });
    for (MapCandidate& candidate : candidates_) {
      if (!candidate.name.token->weak || candidate.guessed) continue;
      const auto strong_sibling =
          std::any_of(candidates_.begin(), candidates_.end(), [&](const MapCandidate& other) {
            return !other.name.token->weak && other.name.stem_words == candidate.name.stem_words;
          });
      if (strong_sibling && candidate.name.token->name.size() > 1) continue;
      candidate.guessed = true;
      candidate.because = "the word \"" + candidate.name.token->name + "\" may mean something else";
    }
  }

  tl::unexpected<Error> NothingFound() const {
    constexpr size_t kListed = 20;
    std::string list;
    for (size_t i = 0; i < std::min(files_.size(), kListed); ++i)
      list += (i == 0 ? "" : ", ") + files_[i];
    if (files_.size() > kListed)
      list += ", and " + std::to_string(files_.size() - kListed) + " more";
    if (files_.empty()) list = "none";
    return Fail(ErrorCode::kNotFound,
                folder_ + ": no map is recognised by its name. Files: " + list +
                    ". A name must end in a word for the map, before any resolution: " +
                    KnownTokensText() + "; or list the maps with --maps");
  }

  void MakeGroups() {
    std::map<std::pair<std::vector<std::string>, std::string>, MapGroup> by_stem;
    for (const MapCandidate& candidate : candidates_) {
      MapGroup& group = by_stem[{candidate.name.stem_words, candidate.name.tile}];
      group.words = candidate.name.stem_words;
      group.tile = candidate.name.tile;
      if (group.stem.empty()) group.stem = candidate.name.stem;
      group.own.push_back(&candidate);
    }
    for (auto& [key, group] : by_stem)
      (HasAlbedo(group) ? colored_ : rest_).push_back(std::move(group));
    DropVariants();
    if (colored_.empty()) {
      // No base colour at all: one set of everything.
      colored_.push_back(std::move(rest_.front()));
      rest_.erase(rest_.begin());
    }
    for (const MapGroup& group : rest_) Lend(group);
  }

  // A group that is nothing but another base colour for a material that has its own maps.
  void DropVariants() {
    std::erase_if(colored_, [&](const MapGroup& group) {
      if (group.own.size() != 1) return false;
      for (const MapGroup& other : colored_) {
        if (&other == &group || other.own.size() < 2 || other.tile != group.tile) continue;
        if (!StartsWith(group.words, other.words) || other.words.empty()) continue;
        Ignore(group.own[0]->file,
               "another base colour for " + other.stem + ", which has " + AlbedoOf(other)->file);
        return true;
      }
      return false;
    });
  }

  static const MapCandidate* AlbedoOf(const MapGroup& group) {
    for (const MapCandidate* candidate : group.own) {
      if (std::string_view(candidate->name.token->parts[0].role) == "albedo") return candidate;
    }
    return group.own[0];
  }

  void Lend(const MapGroup& group) {
    const std::vector<std::string> words = WithoutSharedWords(group.words);
    bool lent = false;
    for (MapGroup& target : colored_) {
      if (colored_.size() > 1 && !StartsWith(target.words, words) &&
          !StartsWith(words, target.words))
        continue;
      if (colored_.size() > 1 && !group.tile.empty() && group.tile != target.tile) continue;
      target.borrowed.insert(target.borrowed.end(), group.own.begin(), group.own.end());
      lent = true;
    }
    if (lent) return;
    for (const MapCandidate* candidate : group.own) {
      Ignore(candidate->file, "the folder holds several materials and its name fits none of them");
    }
  }

  void NameSets() {
    std::string folder_name = fs::path(folder_).lexically_normal().filename().string();
    if (folder_name.empty() || folder_name == ".") {
      std::error_code error;
      const fs::path absolute = fs::canonical(folder_, error);
      folder_name = error ? "material" : absolute.filename().string();
    }
    for (MapGroup& group : colored_) {
      group.set_name = folder_name;
      if (colored_.size() == 1) continue;
      if (!group.stem.empty()) group.set_name += "_" + group.stem;
      if (!group.tile.empty()) group.set_name += "_" + group.tile;
    }
  }

  std::string folder_;
  std::vector<std::string> files_;
  std::vector<MapCandidate> candidates_;
  std::vector<MapCandidate> unknown_;
  std::vector<MapGroup> colored_;
  std::vector<MapGroup> rest_;
  std::vector<MapNote> notes_;
};

}  // namespace

Result<GroupedMaps> GroupMaps(const std::string& folder) { return FolderGrouper(folder).Run(); }

Result<std::vector<std::string>> FindSetNames(const std::string& folder) {
  return FindSetNames(folder, {});
}

Result<std::vector<std::string>> FindSetNames(const std::string& folder,
                                              const std::set<std::string>& claimed) {
  PATINA_ASSIGN(const GroupedMaps grouped, GroupMaps(folder));
  std::vector<std::string> names;
  std::error_code ignored;
  const auto is_claimed = [&](const MapCandidate* candidate) {
    return claimed.count(std::filesystem::weakly_canonical(candidate->path, ignored).string()) != 0;
  };
  for (const MapGroup& group : grouped.groups) {
    if (claimed.empty() || std::none_of(group.own.begin(), group.own.end(), is_claimed))
      names.push_back(group.set_name);
  }
  return names;
}

}  // namespace patina
