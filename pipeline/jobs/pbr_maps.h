// From a job of kind "svbrdf" without a file to the maps that reflectance is computed from.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_sets.h"
#include "pipeline/svbrdf/pbr_model.h"

namespace patina {

struct PbrMaps {
  MapSet set;
  AddressMode address = AddressMode::kWrap;
  // Of a material of a scene:
  svbrdf::PbrSettings settings;
  std::optional<SceneLook> scene;  // without factors and parameters, which f holds already
  std::string scene_text;          // what of the scene decides bytes, for the fingerprint
  std::vector<std::string> warnings;
};

// A texture set as it is; of a material of a scene what the metallic-roughness model takes, with
// its numbers. Images inside the scene's file are written to `scratch_folder`. Errors: those of
// MapsOfJob, SceneOfJob and MapsOfScene; kUnsupported where the material reflects otherwise than
// the model (a coat, sheen, a tint of highlights, ...; no light at all), or has textures of f at
// different coordinates; kInvalidArgument where no texture is of f.
Result<PbrMaps> ReadPbrMaps(const Job& job, const std::string& scratch_folder);

}  // namespace patina
