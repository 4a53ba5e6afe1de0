// What a job aims at.
#pragma once

#include "pipeline/jobs/job.h"

namespace patina {

// Whether the job asks for a quality or a size that a profile can be chosen by.
inline bool HasAims(const Job& job) {
  return job.target_psnr_db > 0 || job.target_bpp > 0 || job.size_budget_bytes > 0;
}

}  // namespace patina
