#include "pipeline/jobs/sample_scene.h"

#include "formats/base/file_io.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/sample_material.h"
#include "pipeline/jobs/sample_set.h"

namespace patina {
namespace {

constexpr const char* kGltf = R"({
  "asset": {"version": "2.0", "generator": "patina sample"},
  "extensionsUsed": ["KHR_materials_clearcoat", "KHR_materials_emissive_strength", "KHR_materials_ior",
                     "KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_volume", "KHR_texture_transform"],
  "materials": [
    {
      "name": "floor",
      "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}},
      "normalTexture": {"index": 2},
      "occlusionTexture": {"index": 1},
      "emissiveTexture": {"index": 3},
      "emissiveFactor": [1, 1, 1],
      "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}
    },
    {
      "name": "wet floor",
      "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1},
                               "baseColorFactor": [0.5, 0.5, 0.55, 1], "metallicFactor": 0},
      "normalTexture": {"index": 2, "scale": 0.5},
      "emissiveTexture": {"index": 3},
      "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.05}}
    },
    {
      "name": "sign",
      "alphaMode": "MASK",
      "pbrMetallicRoughness": {"baseColorTexture": {"index": 3, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}},
      "normalTexture": {"index": 2},
      "extensions": {"KHR_materials_unlit": {}}
    },
    {"name": "brass", "pbrMetallicRoughness": {"baseColorFactor": [0.91, 0.78, 0.42, 1], "roughnessFactor": 0.25}},
    {
      "name": "glass",
      "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0},
      "extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"thicknessFactor": 0.02, "attenuationDistance": 0.5, "attenuationColor": [0.9, 1, 0.95]},
        "KHR_materials_ior": {"ior": 1.52}
      }
    }
  ],
  "textures": [{"sampler": 0, "source": 0}, {"sampler": 0, "source": 1}, {"sampler": 0, "source": 2}, {"sampler": 0, "source": 3}],
  "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}],
  "images": [{"uri": "mosaic_basecolor.png"}, {"uri": "mosaic_orm.png"}, {"uri": "mosaic_normal.png"}, {"uri": "mosaic_emissive.png"}]
}
)";

constexpr const char* kSceneFile = R"({
  "version": 1,
  "materials": [
    {
      "name": "far floor",
      "maps": [
        {"role": "albedo", "file": "mosaic_basecolor.png"},
        {"role": "roughness", "file": "mosaic_orm.png", "channels": "g"},
        {"role": "metalness", "file": "mosaic_orm.png", "channels": "b"},
        {"role": "normal", "file": "mosaic_normal.png", "convention": "opengl"}
      ],
      "constants": {"ao": 1},
      "uses": ["albedo", "roughness", "normal", "ao"],
      "texel_density": {"uv_size_m": 2, "pixels_per_m": [2, 16]}
    }
  ]
}
)";

}  // namespace

Result<std::vector<std::string>> WriteSampleScene(const std::string& folder, int size,
                                                  uint64_t seed, ThreadPool& pool) {
  PATINA_ASSIGN(const SampleMaterial material, StartSample(folder, size, seed, pool));
  struct File {
    const char* name;
    const std::vector<float>& values;
  };
  std::vector<std::string> written;
  for (const File& file : {File{"mosaic_basecolor.png", material.albedo},
                           {"mosaic_orm.png", material.arm},
                           {"mosaic_normal.png", material.normal},
                           {"mosaic_emissive.png", material.emissive}}) {
    written.push_back(folder + "/" + file.name);
    PATINA_TRY(WriteImage(written.back(), WriteFormat::kPng8, size, size, 3, file.values.data()));
  }
  for (const auto& [name, text] :
       {std::pair{"/mosaic.gltf", kGltf}, {"/afar.patina.json", kSceneFile}}) {
    written.push_back(folder + name);
    PATINA_TRY(WriteFileDurably(written.back(), std::string_view(text)));
  }
  return written;
}

}  // namespace patina
