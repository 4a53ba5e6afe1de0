// `--as svbrdf`, and which jobs are told how to read maps.
#pragma once

#include "pipeline/jobs/job.h"

namespace patina {

// Of a texture set or a material of a scene the reflectance that follows from its maps: kind
// "svbrdf". What is reflectance already stays as it is.
void BakeAsReflectance(Job* job);

// Whether a job reads maps whose colour space can be given: those of a material, of reflectance
// that follows from maps, of layers.
bool ReadsColorMaps(const Job& job);

}  // namespace patina
