// ReadScene takes any bytes as a .gltf, a .glb and a scene file; images of what it accepts can be
// asked for.
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "formats/scene/scene.h"
#include "tests/formats/scene/gltf_samples.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

namespace {

const std::string& Folder() {
  static const test::TemporaryDirectory folder;
  static const bool filled = [] {
    test::WriteBytes(folder / "a.png", test::PngBytes());
    return true;
  }();
  (void)filled;
  return folder.path();
}

// Whether it is accepted.
bool Try(const std::string& name, const uint8_t* data, size_t size) {
  const std::string path = Folder() + "/" + name;
  std::ofstream(path, std::ios::binary | std::ios::trunc)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  const auto scene = ReadScene(path);
  if (!scene) {
    FUZZ_CHECK(!scene.error().message.empty() && scene.error().code != ErrorCode::kInternal);
    return false;
  }
  for (const SceneImage& image : scene->images) {
    const auto bytes = ReadSceneImage(image);
    FUZZ_CHECK(bytes.has_value() || !bytes.error().message.empty());
  }
  return true;
}

bool TryAll(const uint8_t* data, size_t size) {
  const bool gltf = Try("s.gltf", data, size), glb = Try("s.glb", data, size),
             own = Try("s.patina.json", data, size);
  return gltf || glb || own;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  TryAll(data, size);
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  test::Json packed = test::OneMaterial();
  packed["images"][0] = {{"bufferView", 0}, {"mimeType", "image/png"}};
  packed["bufferViews"] =
      test::Json::parse(R"([{"buffer": 0, "byteOffset": 0, "byteLength": 20}])");
  packed["buffers"] = test::Json::parse(R"([{"byteLength": 28}])");
  test::Json rich = test::OneMaterial();
  rich["materials"][0]["extensions"] = test::Json::parse(
      R"({"KHR_materials_clearcoat": {"clearcoatFactor": 0.5}, "KHR_materials_sheen": {"sheenColorFactor": [1, 0, 0]},
          "KHR_texture_transform": {"scale": [2, 2]}})");
  rich["materials"][0]["alphaMode"] = "MASK";
  const std::string texts[] = {
      test::OneMaterial().dump(), rich.dump(), test::Glb(packed, test::PngBytes()),
      test::Glb(test::OneMaterial()),
      R"({"version": 1, "materials": [{"name": "wall", "maps": [{"role": "albedo", "file": "a.png"}]}]})"};
  return SeedsOf(texts, [](std::string_view text) {
    return TryAll(reinterpret_cast<const uint8_t*>(text.data()), text.size());
  });
}
