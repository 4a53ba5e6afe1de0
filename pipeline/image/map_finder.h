// Finds the maps of a material: by the file names in a folder, or by an explicit list.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/image/map_roles.h"

namespace patina {

// One map of a set: what it is and where its samples are.
struct MapSource {
  std::string role;  // a name in MapRoles()
  std::string path;  // of the file, as it can be opened
  // Relative to the folder of the set, '/' between folders: for manifests and messages.
  std::string file;
  // Letters of r, g, b, a: the file's first to fourth channel; "" lets the content decide.
  std::string channels;
  // What the numbers of the file are: "auto" (nobody says), "srgb", "linear", "raw", or the name of
  // a space of a configuration. See ChooseColor in pipeline/material/color_choice.h.
  std::string color_space = "auto";
  int list_index = -1;  // in the list of maps it comes from; -1: found by name
  NormalConvention convention = NormalConvention::kAuto;
  bool convention_from_name = true;  // false: somebody gave it, and it is not to be overridden
  bool invert = false;               // the file holds 1 - value
  bool optional = false;  // no map if the channel is 1 everywhere (alpha channels that say nothing)
};

// One line of the report of what was found, guessed and ignored.
struct MapNote {
  enum class Kind { kFound, kGuessed, kIgnored };
  Kind kind = Kind::kFound;
  std::string file;
  // "roughness (inverted) from a", "two of this map: the larger one is used", ...
  std::string text;
};
const char* MapNoteKindName(MapNote::Kind kind);  // "found", "guessed", "ignored"

// The maps of one material. Maps are sorted by role, in the order of MapRoles(); no role twice.
struct MapSet {
  // Of the material: the folder's, followed by "_" and the stem if the folder holds several.
  std::string name;
  std::string folder;
  std::vector<MapSource> maps;
  std::vector<MapNote> notes;  // sorted by file name
};

// The material sets of one folder (subfolders are not searched), sorted by stem. Files belong to
// the set that shares the words before the map's name; if only one set has a base colour,
// everything belongs to it. Of the same map in several sizes or formats the largest, then the most
// precise is used. See map_name.h for the naming conventions and map_roles.cpp for the words. Reads
// headers, no pixels.
// Errors: kNotFound (no such folder; no recognised map in it: lists the files and the known words),
// kInvalidArgument (not a folder), kConflict (two files claim one role), and those of ReadImageInfo
// for a file that is needed.
Result<std::vector<MapSet>> FindMaps(const std::string& folder);

// An entry of an explicit list of maps, as a job gives it.
struct MapRequest {
  // A name in MapRoles(), or a packed name such as "orm", "arm", "rma" (then no channels).
  std::string role;
  std::string file;  // absolute, or relative to the base folder
  // "" or letters of "rgba": three for a colour, two or three for a normal, one for a scalar.
  std::string channels;
  std::string color_space = "auto";  // as MapSource::color_space
  NormalConvention convention = NormalConvention::kAuto;
  bool invert = false;
};

// The set that a list describes. Nothing is guessed or searched for.
// Errors, naming the entry ("maps[2]"): kInvalidArgument (unknown role, bad channels, no maps),
// kConflict (a role twice), and those of ReadImageInfo.
Result<MapSet> ResolveMaps(const std::vector<MapRequest>& requests, const std::string& base_folder,
                           const std::string& name);

}  // namespace patina
