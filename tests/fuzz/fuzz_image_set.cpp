// ReadImageSet takes any bytes; of what it accepts all directions are usable and all files lie
// beside the list.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "pipeline/svbrdf/image_set.h"
#include "tests/formats/test_support.h"
#include "tests/fuzz/fuzz_target.h"

using namespace patina;

namespace {

const std::string& Folder() {
  static const test::TemporaryDirectory folder;
  static const bool filled = [] {
    for (const char* name : {"a.exr", "b.exr"}) std::ofstream(folder / name) << "image";
    return true;
  }();
  (void)filled;
  return folder.path();
}

bool Usable(const brdf::Direction& d) {
  return d.z > 0 && std::abs(std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z) - 1) < 1e-5f;
}

// Whether it is accepted.
bool Try(std::string_view text) {
  const std::string path = Folder() + "/s.btf.json";
  std::ofstream(path, std::ios::binary | std::ios::trunc)
      .write(text.data(), static_cast<std::streamsize>(text.size()));
  const auto set = svbrdf::ReadImageSet(path);
  if (!set) {
    FUZZ_CHECK(!set.error().message.empty() && set.error().code == ErrorCode::kInvalidArgument);
    return false;
  }
  FUZZ_CHECK(!set->images.empty() && set->width > 0 && set->height > 0 && set->scale > 0);
  for (size_t i = 0; i < set->images.size(); ++i) {
    FUZZ_CHECK(Usable(set->images[i].light) && Usable(set->images[i].view));
    FUZZ_CHECK(std::filesystem::path(set->PathOf(i)).parent_path() == Folder());
    const auto image = svbrdf::ReadSetImage(*set, i);
    FUZZ_CHECK(!image && !image.error().message.empty());
  }
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Try({reinterpret_cast<const char*>(data), size});
  return 0;
}

std::vector<std::vector<uint8_t>> FuzzSeeds() {
  const std::string texts[] = {
      R"({"version": 1, "width": 3, "height": 2,
          "images": [{"file": "a.exr", "light": [0, 0, 1], "view": [0.6, 0, 0.8]}]})",
      R"({"version": 1, "width": 3, "height": 2, "address": "wrap", "values": "brdf_cosine", "scale": 0.3183,
          "images": [{"file": "a.exr", "light": [0, 0.6, 0.8], "view": [0, 0, 1]},
                     {"file": "b.exr", "light": [0, -0.6, 0.8], "view": [0.48, 0.36, 0.8]}]})"};
  return SeedsOf(texts, Try);
}
