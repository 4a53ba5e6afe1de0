// What the files of a folder are, by their names alone: no file is opened, so that a program can
// ask that must not touch images.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/image/map_finder.h"
#include "pipeline/image/map_name.h"

namespace patina {

// A file whose name was understood.
struct MapCandidate {
  std::string file;
  std::string path;
  MapName name;
  bool guessed = false;  // reported as a guess
  std::string because;   // why it is a guess
};

// Files that share the words before the map's name.
struct MapGroup {
  std::string set_name;  // as MapSet::name
  std::vector<std::string> words;
  std::string tile;
  std::string stem;
  std::vector<const MapCandidate*> own;
  std::vector<const MapCandidate*> borrowed;
};

// The groups point at the candidates: moved together, never copied.
struct GroupedMaps {
  GroupedMaps() = default;
  GroupedMaps(GroupedMaps&&) = default;
  GroupedMaps& operator=(GroupedMaps&&) = default;
  std::vector<MapCandidate> candidates;
  std::vector<MapGroup> groups;  // one for each material, at least one
  std::vector<MapNote> notes;    // of files that no group has
};

// Errors: kNotFound, kInvalidArgument and kIo as FindMaps.
Result<GroupedMaps> GroupMaps(const std::string& folder);

// The names of the materials of a folder, as FindMaps gives them and Job::set takes them. What the
// files hold can still make each of them an error. Errors: those of GroupMaps.
Result<std::vector<std::string>> FindSetNames(const std::string& folder);
// The same without materials of which a file is in `claimed`: canonical paths, such as those of the
// textures of scenes.
Result<std::vector<std::string>> FindSetNames(const std::string& folder,
                                              const std::set<std::string>& claimed);

}  // namespace patina
