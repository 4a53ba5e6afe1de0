// What a drop folder makes of what lies in it: jobs, and their names. Reads no images, so that the
// daemon, which uses it, need not load the libraries for them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/jobs/job.h"

namespace patina {

// An asset name for what lies at `relative` below a root called `root_name`: the parts of the path
// joined by '_', of a file without its extension; the root's own if `relative` is empty. Where
// bytes had to be replaced that are neither '/' nor ' ', or the name was too long, a hash of the
// path is appended, so that different assets have different names. Two paths can still have one
// name: "a/b" and "a_b".
std::string AssetNameBelow(const std::string& root_name, const std::string& relative, bool is_file);

// The jobs of a BRDF file (is_file), or of a folder, without `out`, by names and by the text of
// scenes and layers alone. root, path: without links. name: AssetNameBelow. One for a file or a
// folder with one material; one for each material of a folder that holds several, named after
// folder and set, list, layers, or scene and material. What is wrong with a folder or a scene its
// job says, which is there.
std::vector<Job> DropJobs(const std::string& root, const std::string& path, const std::string& name,
                          bool is_file);

// The name that the drop folder `root` gives to what a job bakes; none if that does not lie in it,
// or is baked otherwise there.
std::optional<std::string> NameInDropFolder(const std::string& root, const Job& job);

}  // namespace patina
