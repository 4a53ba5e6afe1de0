// From a job, or a folder somebody points at, to the maps and BRDF files that are meant.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/image/map_finder.h"
#include "pipeline/jobs/job.h"
#include "pipeline/material/reference.h"

namespace patina {

// Everything that a bake reads, and what a scene says of it.
struct JobMaps {
  JobMaps() = default;
  JobMaps(MapSet maps) : set(std::move(maps)) {}  // NOLINT: a set without a scene

  MapSet set;
  std::vector<ConstantMap> constants;
  std::optional<AddressMode> address;  // absent: the job's
  std::optional<float> opacity_cutoff = kOpacityCutoff;
  std::optional<std::array<int, 2>> lod_range;
  std::optional<TexelDensity> density;
  std::optional<SceneLook> scene;
  std::vector<Effect> left_out;       // what is not in `set` for that
  std::vector<std::string> warnings;  // complete sentences
};

// The maps of a job without a scene: its list, or what is found by name in its folder.
// Errors: those of FindMaps and ResolveMaps; kNotFound and kInvalidArgument when the folder holds
// several sets and job.set names none of them or is empty, with the list of names.
Result<MapSet> MapsOfJob(const Job& job);

// One asset that an input of `bake` stands for.
struct FoundAsset {
  std::string asset;  // a legal asset name
  std::string folder;
  std::string set;    // name of the set if the folder holds several, else empty
  std::string file;   // of a BRDF, or the list of an image set; else empty
  std::string scene;  // file of the scene it is a material of; else empty
  std::string scene_material;
  std::string problem;  // why it cannot be baked; empty if it can
  ErrorCode problem_code = ErrorCode::kNotFound;
};

struct FoundAssets {
  std::vector<FoundAsset> assets;    // sorted by folder; in each the sets by name, then the files
  std::vector<std::string> skipped;  // subfolders without any image or BRDF file
};

// The assets of a folder: the materials of its scenes, its texture sets and its BRDF files (see
// FindBrdfFiles); and those of its direct subfolders when it holds no maps of its own. Files that a
// scene refers to belong to it, and a set that has one of them is not listed. A BRDF's asset is
// named by its file without extension, or with it where that would give two assets of the folder
// one name. Maps that a layered material names belong to it, likewise. A folder with lists of
// images (FindImageSets) stands for these alone. A folder that has images but no usable set is
// listed with its problem, so that it does not hide the others. Hidden subfolders and `except` (the output folder) are passed over. Errors:
// kNotFound (no such folder, or nothing in it or its subfolders), kInvalidArgument (not a folder),
// kIo, and those of FindMaps when the folder itself holds maps and no BRDF file.
Result<FoundAssets> FindAssets(const std::string& folder, const std::string& except);

}  // namespace patina
