#include "pipeline/image/map_finder.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <system_error>
#include <tuple>
#include <utility>

#include "pipeline/image/image_io.h"
#include "pipeline/image/map_groups.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

// One claim of a file on a role.
struct Claim {
  const MapCandidate* candidate = nullptr;
  TokenPart part;
  int rank = 0;
  bool borrowed = false;  // from a group of another stem
};

// Lossless and deep formats first: of two files with the same size and depth the first is used.
int FormatOrder(const std::string& file) {
  static const std::vector<std::string> order = {".exr", ".tif", ".tiff", ".png", ".tga",
                                                 ".hdr", ".dds", ".jpg",  ".jpeg"};
  return static_cast<int>(std::find(order.begin(), order.end(), LowerExtension(file)) -
                          order.begin());
}

int DepthOf(const ImageInfo& info) {
  switch (info.type) {
    case SampleType::kUint8:
      return 1;
    case SampleType::kUint16:
      return 2;
    case SampleType::kHalf:
      return 3;
    case SampleType::kFloat:
      return 4;
  }
  return 0;
}

class Headers {
 public:
  const Result<ImageInfo>& Get(const std::string& path) {
    auto found = headers_.find(path);
    if (found == headers_.end()) found = headers_.emplace(path, ReadImageInfo(path)).first;
    return found->second;
  }

 private:
  std::map<std::string, Result<ImageInfo>> headers_;
};

class FolderFinder {
 public:
  explicit FolderFinder(std::string folder) : folder_(std::move(folder)) {}

  Result<std::vector<MapSet>> Run() {
    PATINA_ASSIGN(const GroupedMaps grouped, GroupMaps(folder_));
    std::vector<MapSet> sets;
    for (const MapGroup& group : grouped.groups) {
      notes_.clear();
      MapSet set;
      set.folder = folder_;
      set.name = group.set_name;
      PATINA_TRY(FillSet(group, &set));
      set.notes = std::move(notes_);
      set.notes.insert(set.notes.end(), grouped.notes.begin(), grouped.notes.end());
      std::stable_sort(set.notes.begin(), set.notes.end(),
                       [](const MapNote& a, const MapNote& b) { return a.file < b.file; });
      sets.push_back(std::move(set));
    }
    return sets;
  }

 private:
  void Note(MapNote::Kind kind, const std::string& file, const std::string& text) {
    notes_.push_back({kind, file, text});
  }
  void Ignore(const std::string& file, const std::string& why) {
    Note(MapNote::Kind::kIgnored, file, why);
  }

  Status FillSet(const MapGroup& group, MapSet* set) {
    std::map<int, std::vector<Claim>> claims;
    PATINA_TRY(AddClaims(group.own, false, &claims));
    PATINA_TRY(AddClaims(group.borrowed, true, &claims));
    for (auto& [role, of_role] : claims) {
      PATINA_ASSIGN(const Claim best, Decide(MapRoles()[role].name, of_role));
      const MapCandidate& candidate = *best.candidate;
      MapSource source;
      source.role = best.part.role;
      source.path = candidate.path;
      source.file = candidate.file;
      source.channels = best.part.channels;
      source.color_space = candidate.name.color_space;
      source.convention = candidate.name.convention;
      source.invert = best.part.invert;
      source.optional = best.part.optional;
      set->maps.push_back(std::move(source));
      std::string text = best.part.role;
      if (best.part.invert) text += " (inverted)";
      if (best.part.channels[0] != '\0') text += std::string(" from ") + best.part.channels;
      if (best.part.optional) text += ", unless it is 1 everywhere";
      if (candidate.guessed) text += ": " + candidate.because;
      Note(candidate.guessed ? MapNote::Kind::kGuessed : MapNote::Kind::kFound, candidate.file,
           text);
    }
    return {};
  }

  // Looks into headers where the number of channels decides what a file holds.
  Status AddClaims(const std::vector<const MapCandidate*>& candidates, bool borrowed,
                   std::map<int, std::vector<Claim>>* claims) {
    for (const MapCandidate* candidate : candidates) {
      const MapToken& token = *candidate->name.token;
      const Result<ImageInfo>& info = headers_.Get(candidate->path);
      if (!info) return Fail(info.error());
      const bool wide = info->loaded_channels >= 3 && !token.wide_parts.empty();
      const std::vector<TokenPart>& parts = wide ? token.wide_parts : token.parts;
      for (size_t i = 0; i < parts.size(); ++i) {
        TokenPart part = parts[i];
        if (!HasChannels(*info, part, i == 0)) {
          if (!part.optional) {
            Ignore(candidate->file, std::string("no channel for ") + part.role + " in a file of " +
                                        std::to_string(info->loaded_channels));
          }
          continue;
        }
        if (i == 0 && info->loaded_channels < 3)
          part.channels = "";  // grey: whatever it holds is the first map
        const int rank = part.optional ? kAlphaRank : token.rank;
        (*claims)[MapRoleIndex(part.role)].push_back({candidate, part, rank, borrowed});
      }
    }
    return {};
  }

  static bool HasChannels(const ImageInfo& info, const TokenPart& part, bool first) {
    if (first) return true;
    for (const char* letter = part.channels; *letter != '\0'; ++letter) {
      if (*letter == 'a' ? !info.has_alpha() : info.loaded_channels < 3) return false;
    }
    return true;
  }

  Result<Claim> Decide(const std::string& role, std::vector<Claim> claims) {
    // What is plainly preferred, by name alone.
    const auto preference = [](const Claim& claim) {
      const MapName& name = claim.candidate->name;
      const int convention = name.convention == NormalConvention::kOpenGl    ? 0
                             : name.convention == NormalConvention::kDirectX ? 1
                                                                             : 2;
      return std::make_tuple(claim.borrowed ? 1 : 0, claim.rank, convention, name.level_of_detail,
                             name.variant);
    };
    std::stable_sort(claims.begin(), claims.end(),
                     [&](const Claim& a, const Claim& b) { return preference(a) < preference(b); });
    std::vector<Claim> equal;
    for (const Claim& claim : claims) {
      if (preference(claim) == preference(claims[0])) {
        equal.push_back(claim);
      } else {
        ReportLoser(role, claim, claims[0]);
      }
    }
    if (equal.size() == 1) return equal[0];
    for (const Claim& claim : equal) {
      if (claim.candidate->name.token == equal[0].candidate->name.token &&
          (!claim.borrowed ||
           claim.candidate->name.stem_words == equal[0].candidate->name.stem_words)) {
        continue;
      }
      return Conflict(role, equal[0], claim);
    }
    // The same map several times: by what is in the files.
    const auto worth = [&](const Claim& claim) {
      const ImageInfo& info = *headers_.Get(claim.candidate->path);
      return std::make_tuple(-static_cast<int64_t>(info.width) * info.height, -DepthOf(info),
                             FormatOrder(claim.candidate->file));
    };
    std::stable_sort(equal.begin(), equal.end(),
                     [&](const Claim& a, const Claim& b) { return worth(a) < worth(b); });
    if (worth(equal[0]) == worth(equal[1])) return Conflict(role, equal[0], equal[1]);
    for (size_t i = 1; i < equal.size(); ++i) {
      Ignore(equal[i].candidate->file,
             "the same map as " + equal[0].candidate->file + ", which is larger or more precise");
    }
    return equal[0];
  }

  tl::unexpected<Error> Conflict(const std::string& role, const Claim& a, const Claim& b) const {
    return Fail(ErrorCode::kConflict,
                folder_ + ": both " + a.candidate->file + " and " + b.candidate->file +
                    " claim to be the " + role +
                    " map; remove or rename one, or list the maps with --maps");
  }

  void ReportLoser(const std::string& role, const Claim& loser, const Claim& winner) {
    if (loser.candidate == winner.candidate || loser.part.optional) return;
    Ignore(loser.candidate->file, role + " is taken from " + winner.candidate->file);
  }

  std::string folder_;
  std::vector<MapNote> notes_;
  Headers headers_;
};

Status CheckChannels(const std::string& where, const MapRole& role, const std::string& channels) {
  const auto fail = [&](const std::string& wanted) {
    return Fail(ErrorCode::kInvalidArgument, where + ": channels \"" + channels + "\" do not fit " +
                                                 role.name + "; give " + wanted +
                                                 " of the letters r, g, b, a, or leave them out");
  };
  if (channels.find_first_not_of("rgba") != std::string::npos) return fail("some");
  const size_t count = channels.size();
  switch (role.kind) {
    case MapKind::kColor:
      if (count != 0 && count != 1 && count != 3) return fail("three (or one for grey)");
      break;
    case MapKind::kNormal:
      if (count != 0 && count != 2 && count != 3) return fail("three (or two: z follows)");
      break;
    case MapKind::kScalar:
      if (count > 1) return fail("one");
      break;
    case MapKind::kVector2:
      if (count != 0 && count != 2) return fail("two");
      break;
  }
  return {};
}

}  // namespace

const char* MapNoteKindName(MapNote::Kind kind) {
  switch (kind) {
    case MapNote::Kind::kFound:
      return "found";
    case MapNote::Kind::kGuessed:
      return "guessed";
    case MapNote::Kind::kIgnored:
      return "ignored";
  }
  return "found";
}

Result<std::vector<MapSet>> FindMaps(const std::string& folder) {
  return FolderFinder(folder).Run();
}

Result<MapSet> ResolveMaps(const std::vector<MapRequest>& requests, const std::string& base_folder,
                           const std::string& name) {
  if (requests.empty()) {
    return Fail(ErrorCode::kInvalidArgument, "the list of maps is empty; name at least one map");
  }
  MapSet set;
  set.name = name;
  set.folder = base_folder;
  for (size_t i = 0; i < requests.size(); ++i) {
    const MapRequest& request = requests[i];
    const std::string where = "maps[" + std::to_string(i) + "]";
    MapSource source;
    source.file = request.file;
    source.path = (fs::path(base_folder) / request.file).string();
    source.color_space = request.color_space;
    source.list_index = static_cast<int>(i);
    source.convention = request.convention;
    source.convention_from_name = false;
    if (request.file.empty()) return Fail(ErrorCode::kInvalidArgument, where + ": no file named");
    auto info = ReadImageInfo(source.path);
    if (!info) return Fail(std::move(info).error(), where);

    std::vector<TokenPart> parts;
    const MapToken* token = FindMapToken(request.role);
    const MapRole* role = FindMapRole(request.role);
    if (role != nullptr) {
      PATINA_TRY(CheckChannels(where, *role, request.channels));
      parts.push_back({role->name, request.channels.c_str(), request.invert});
    } else if (token != nullptr && token->rank == kPackedRank && request.channels.empty() &&
               !request.invert) {
      parts = info->loaded_channels >= 3 && !token->wide_parts.empty() ? token->wide_parts
                                                                       : token->parts;
    } else {
      std::string roles;
      for (const MapRole& known : MapRoles()) {
        if (!roles.empty()) roles += ", ";
        roles += known.name;
      }
      return Fail(ErrorCode::kInvalidArgument,
                  where + ": unknown role \"" + request.role + "\"; roles are " + roles +
                      ", and orm, arm, rma, metallicsmoothness, ... without channels");
    }
    for (const TokenPart& part : parts) {
      source.role = part.role;
      source.channels = part.channels;
      source.invert = part.invert;
      source.optional = part.optional;
      for (const char letter : source.channels) {
        const int index = static_cast<int>(std::string_view("rgba").find(letter));
        if (index >= info->loaded_channels && info->loaded_channels != 2) {
          return Fail(ErrorCode::kInvalidArgument, where + ": " + request.file +
                                                       " has no channel " + letter + " (it has " +
                                                       std::to_string(info->loaded_channels) + ")");
        }
      }
      for (const MapSource& other : set.maps) {
        if (other.role == source.role) {
          return Fail(ErrorCode::kConflict, where + ": " + request.file + " and " + other.file +
                                                " are both given as the " + source.role +
                                                " map; keep one");
        }
      }
      set.maps.push_back(source);
      set.notes.push_back({MapNote::Kind::kFound, source.file, source.role + " (listed)"});
    }
  }
  std::stable_sort(set.maps.begin(), set.maps.end(), [](const MapSource& a, const MapSource& b) {
    return MapRoleIndex(a.role) < MapRoleIndex(b.role);
  });
  return set;
}

}  // namespace patina
