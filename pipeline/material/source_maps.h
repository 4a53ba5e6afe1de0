// Reads the files of a set and settles what each map is: the first half of building a reference.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/progress.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/image/map_finder.h"
#include "pipeline/material/map_plan.h"
#include "pipeline/material/reference.h"

namespace patina {

// The maps of a set in memory, all of one size but for constant files, whose pixels are dropped.
struct SourceMaps {
  int width = 0;
  int height = 0;
  std::vector<LoadedFile> files;
  std::vector<MapPlan> plans;               // in the order of MapRoles(), conventions settled
  std::vector<ReferenceFile> descriptions;  // of `files`, by index
  std::vector<MapNote> notes;
  std::vector<std::string> warnings;  // also sent to the sink
};

// The part of BuildReference (reference.h) up to the pixels of mip 0; same errors. Reports stage
// "ingest".
Result<SourceMaps> LoadSourceMaps(const MapSet& set, const ReferenceOptions& options,
                                  ThreadPool& pool, ProgressSink& progress);

}  // namespace patina
