// From a job, or a folder somebody points at, to the maps and BRDF files that are meant.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/image/map_finder.h"
#include "pipeline/jobs/job.h"

namespace patina {

// The maps of a job: its list, or what is found by name in its folder.
// Errors: those of FindMaps and ResolveMaps; kNotFound and kInvalidArgument when the folder holds
// several sets and job.set names none of them or is empty, with the list of names.
Result<MapSet> MapsOfJob(const Job& job);

// One asset that an input of `bake` stands for.
struct FoundAsset {
  std::string asset;  // a legal asset name
  std::string folder;
  std::string set;      // name of the set if the folder holds several, else empty
  std::string file;     // of a BRDF; else empty
  std::string problem;  // why it cannot be baked; empty if it can
  ErrorCode problem_code = ErrorCode::kNotFound;
};

struct FoundAssets {
  std::vector<FoundAsset> assets;    // sorted by folder; in each the sets by name, then the files
  std::vector<std::string> skipped;  // subfolders without any image or BRDF file
};

// The assets of a folder: its texture sets and its BRDF files (see FindBrdfFiles); and those of its
// direct subfolders when it holds no maps itself. A BRDF's asset is named by its file without
// extension, or with it where that would give two assets of the folder one name. A folder that has
// images but no usable set is listed with its problem, so that it does not hide the others. Hidden
// subfolders and `except` (the output folder) are passed over. Errors: kNotFound (no such folder,
// or nothing in it or its subfolders), kInvalidArgument (not a folder), kIo, and those of FindMaps
// when the folder itself holds maps and no BRDF file.
Result<FoundAssets> FindAssets(const std::string& folder, const std::string& except);

}  // namespace patina
