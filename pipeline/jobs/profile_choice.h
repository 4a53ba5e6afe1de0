// Chooses the size of the feature textures for what a job asks of quality and size.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/manifest.h"
#include "pipeline/jobs/job.h"

namespace patina {

// What a job asks for, and may miss.
struct Aims {
  double target_psnr_db = 0;  // of mip 0, measured on the written files; 0: none
  uint64_t most_bytes = 0;    // of what an engine loads; 0: no limit
};

// Of Job::target_psnr_db, and of Job::size_budget_bytes and Job::target_bpp the stricter one.
// width, height: texels of mip 0.
Aims AimsOfJob(const Job& job, int width, int height);

// Bytes of the feature textures and the network, as an engine loads them. mips: those that are
// stored, from first_mip of the source on.
uint64_t MaterialBytes(const ModelShape& shape, int outputs);
// The shape of a profile; levels that only mips beyond `mips` would read are left out.
ModelShape ShapeOfMips(Profile profile, int width, int height, int mips);

struct ProfileSizes {
  Profile profile;
  uint64_t bytes;
};

// What the profile is to be, of candidates from the smallest to the largest (not empty).
// smallest_first: of those that fit the smallest, which a target then confirms or not; else the
// largest. The reason is a sentence for people.
ManifestChoice ChooseProfile(const Aims& aims, const std::vector<ProfileSizes>& candidates,
                             bool smallest_first);

// After the chosen profile has missed the target with `reached_db` (in a whole training, or given
// up before its end): moves on to the next that fits. False if there is none.
bool ChooseNextProfile(double reached_db, bool given_up, ManifestChoice* choice);

}  // namespace patina
