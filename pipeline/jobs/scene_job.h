// Scenes as jobs: their materials, and how a job names one. Reads no images, so that the daemon,
// which uses it, need not load the libraries for them.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/scene/scene.h"
#include "pipeline/jobs/job.h"

namespace patina {

// How a job names a material: by its name if no other of the scene has it, else "#" and its index.
std::string SceneMaterialKey(const Scene& scene, const SceneMaterial& material);

// The scene and the material of job.scene_material. Errors: those of ReadScene, kNotFound (lists
// the names), and the problem of the material.
struct SceneChoice {
  Scene scene;
  size_t index = 0;
  const SceneMaterial& material() const { return scene.materials[index]; }
};
Result<SceneChoice> SceneOfJob(const Job& job);

// The scene files of a folder, sorted; empty if it cannot be listed.
std::vector<std::string> FindSceneFiles(const std::string& folder);

// The files that a scene refers to, without links.
std::vector<std::string> FilesOfScene(const Scene& scene);

// One job for each material of a scene, without `out`; with its error where it cannot be baked.
// Errors: those of ReadScene.
Result<std::vector<Job>> JobsOfScene(const std::string& path);

}  // namespace patina
