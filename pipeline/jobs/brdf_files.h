// Which files hold BRDFs: measured ones, layered materials to simulate, and lists of images.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/jobs/job.h"

namespace patina {

// Whether a .json file is a list of measurements rather than a job: an object with an array
// "samples" and neither "kind" nor "version". Also true of a damaged list that looks like one as
// far as it goes; false for a file that cannot be read.
bool IsMeasurementList(const std::string& path);

// Whether a file is a BRDF, by its name and, where other programs use the extension too (.bin,
// .csv, .json), by a look into it.
bool LooksLikeBrdfFile(const std::string& path);

// The name of a BRDF's asset: the file's name without extension.
std::string BrdfAssetName(const std::string& path);

// The lists of images (svbrdf::kImageSetSuffix) directly in a folder, sorted; none of one that
// cannot be listed.
std::vector<std::string> FindImageSets(const std::string& folder);

// The images that a list names, links resolved; none of one that cannot be read.
std::vector<std::string> ImagesOfSet(const std::string& list);

// The layered materials with maps directly in a folder, sorted; none of one that cannot be listed.
std::vector<std::string> FindMappedStacks(const std::string& folder);

// The maps that a layered material names, links resolved; none of one that cannot be read.
std::vector<std::string> MapsOfStack(const std::string& file);

// The job that bakes a BRDF file or a list of images, spatially varying if it is one or has maps;
// without `out`.
Job JobOfBrdfFile(const std::string& asset, const std::string& file);

// The BRDF files directly in a folder, lists of images left out, sorted; hidden ones are passed
// over. Errors: kIo.
Result<std::vector<std::string>> FindBrdfFiles(const std::string& folder);

}  // namespace patina
