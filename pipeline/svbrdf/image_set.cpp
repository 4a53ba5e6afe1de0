#include "pipeline/svbrdf/image_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/base/strict_json.h"
#include "formats/json_view.h"
#include "pipeline/brdf/brdf_kernels.h"
#include "pipeline/image/image_io.h"

namespace patina::svbrdf {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kFileVersion = 1;
constexpr int kDeepestJson = 8;
constexpr double kUnitTolerance = 1e-3;
constexpr double kSameDirection = 1e-5;
constexpr double kLeastHeight = 1e-3;  // z of a direction above the horizon

std::string Vector(const brdf::Direction& d) {
  char text[96];
  std::snprintf(text, sizeof text, "(%.6g, %.6g, %.6g)", static_cast<double>(d.x),
                static_cast<double>(d.y), static_cast<double>(d.z));
  return text;
}

class Reader {
 public:
  Reader(const Json& json, ImageSet* set) : json_(json), view_(&json, &problem_), set_(*set) {}

  // The first problem, or nothing.
  std::string Run() {
    Complain(UnknownMember(json_, "",
                           {"version", "width", "height", "address", "values", "scale", "images"}));
    const int version = view_.Field("version").Int(1, 1 << 20);
    if (problem_.text.empty() && version != kFileVersion) {
      Complain("/version: " + std::to_string(version) +
               " is a version that this program does not know; it reads 1");
    }
    set_.width = view_.Field("width").Int(1, kMaxSetSide);
    set_.height = view_.Field("height").Int(1, kMaxSetSide);
    ReadChoices();
    if (const JsonView scale = view_.Optional("scale")) {
      set_.scale = scale.Float();
      if (problem_.text.empty() && !(set_.scale > 0))
        Complain("/scale: " + json_["scale"].dump() + " is not above 0; leave it out for 1");
    }
    const JsonView images = view_.Field("images");
    size_t i = 0;
    images.ForEach(kMaxSetImages, [&](const JsonView& image) { ReadImageEntry(image, i++); });
    if (problem_.text.empty() && set_.images.empty())
      Complain("/images: is empty; list at least one image");
    if (problem_.text.empty()) CheckDirections();
    if (problem_.text.empty()) CheckTwice();
    if (problem_.text.empty()) CheckFiles();
    return problem_.text;
  }

 private:
  void Complain(const std::string& text) {
    if (problem_.text.empty()) problem_.text = text;
  }

  static std::string At(size_t image, const char* member) {
    return "/images/" + std::to_string(image) + "/" + member;
  }

  void ReadChoices() {
    if (const JsonView address = view_.Optional("address")) {
      const std::string word = address.String();
      set_.address = word == "wrap" ? AddressMode::kWrap : AddressMode::kClamp;
      if (problem_.text.empty() && word != "wrap" && word != "clamp")
        Complain("/address: " + QuoteForMessage(word) + " is neither \"wrap\" nor \"clamp\"");
    }
    if (const JsonView values = view_.Optional("values")) {
      const std::string word = values.String();
      set_.cosine_weighted = word == "brdf_cosine";
      if (problem_.text.empty() && word != "brdf" && word != "brdf_cosine")
        Complain("/values: " + QuoteForMessage(word) +
                 " is neither \"brdf\" (f) nor \"brdf_cosine\" (f times the light's cosine)");
    }
  }

  void ReadImageEntry(const JsonView& view, size_t index) {
    const Json& entry = json_["images"][index];
    Complain(UnknownMember(entry, "/images/" + std::to_string(index), {"file", "light", "view"}));
    SetImage image;
    image.file = view.Field("file").String();
    image.light = ReadDirection(view.Field("light"), At(index, "light"));
    image.view = ReadDirection(view.Field("view"), At(index, "view"));
    set_.images.push_back(std::move(image));
  }

  brdf::Direction ReadDirection(const JsonView& view, const std::string& pointer) {
    std::array<float, 3> xyz{};
    size_t n = 0;
    view.ForEach(3, [&](const JsonView& number) { xyz[n++] = number.Float(); });
    if (view && n != 3)
      Complain(pointer + ": " + std::to_string(n) + " numbers; give x, y and z of a unit vector");
    return {xyz[0], xyz[1], xyz[2]};
  }

  void CheckDirections() {
    for (size_t i = 0; i < set_.images.size(); ++i) {
      CheckDirection(At(i, "light"), &set_.images[i].light);
      CheckDirection(At(i, "view"), &set_.images[i].view);
    }
  }

  void CheckDirection(const std::string& pointer, brdf::Direction* direction) {
    const double x = static_cast<double>(direction->x), y = static_cast<double>(direction->y),
                 z = static_cast<double>(direction->z);
    const double length = std::sqrt(x * x + y * y + z * z);
    if (!(std::abs(length - 1) <= kUnitTolerance)) {
      return Complain(pointer + ": " + Vector(*direction) + " has length " +
                      std::to_string(length) +
                      "; give a unit vector from the sample towards the light or the camera");
    }
    if (!(z >= kLeastHeight)) {
      return Complain(pointer + ": " + Vector(*direction) +
                      " is not above the horizon (z of 0.001 or more); the third number is along "
                      "the sample's normal; leave images from below out");
    }
    *direction = {static_cast<float>(x / length), static_cast<float>(y / length),
                  static_cast<float>(z / length)};
  }

  void CheckTwice() {
    std::map<std::string, size_t> files;
    std::map<std::array<int64_t, 6>, size_t> pairs;
    for (size_t i = 0; i < set_.images.size(); ++i) {
      const SetImage& image = set_.images[i];
      const auto [file, is_new] = files.emplace(image.file, i);
      if (!is_new) {
        return Complain(At(i, "file") + ": " + QuoteForMessage(image.file) +
                        " is that of /images/" + std::to_string(file->second) +
                        ", too; list each image once");
      }
      std::array<int64_t, 6> key{};
      const float numbers[6] = {image.light.x, image.light.y, image.light.z,
                                image.view.x,  image.view.y,  image.view.z};
      for (size_t k = 0; k < 6; ++k)
        key[k] = std::llround(static_cast<double>(numbers[k]) / kSameDirection);
      const auto [pair, is_other] = pairs.emplace(key, i);
      if (!is_other) {
        return Complain("/images/" + std::to_string(i) + ": light and view are those of /images/" +
                        std::to_string(pair->second) + ", too; keep one of the two");
      }
    }
  }

  void CheckFiles() {
    std::error_code error;
    const fs::path folder =
        fs::weakly_canonical(set_.folder.empty() ? fs::path(".") : fs::path(set_.folder), error);
    for (size_t i = 0; i < set_.images.size(); ++i) {
      const std::string& file = set_.images[i].file;
      if (const Status plain = CheckRelativePath(file, At(i, "file") + ":"); !plain) {
        return Complain(plain.error().message +
                        "; give a path below the folder of the JSON file, with '/' between "
                        "folders");
      }
      const fs::path target = fs::weakly_canonical(set_.PathOf(i), error);
      const fs::path inside = target.lexically_relative(folder);
      if (inside.empty() || *inside.begin() == "..") {
        return Complain(At(i, "file") + ": " + QuoteForMessage(file) +
                        " leads out of the folder of the JSON file; copy the image into it");
      }
      if (!fs::is_regular_file(target, error)) {
        return Complain(At(i, "file") + ": there is no file " + QuoteForMessage(file) +
                        " beside the JSON file; add it, or take its entry out of the list");
      }
    }
  }

  const Json& json_;
  JsonProblem problem_;
  JsonView view_;
  ImageSet& set_;
};

Error BadImage(const ImageSet& set, size_t image, ErrorCode code, const std::string& what) {
  return {code, set.path + ": /images/" + std::to_string(image) +
                    "/file: " + set.images[image].file + ": " + what};
}

}  // namespace

Result<ImageSet> ReadImageSet(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxImageSetBytes));
  auto json = ParseStrictJson(text, kDeepestJson);
  if (!json) return Fail(json.error(), path);
  ImageSet set;
  set.path = path;
  const size_t slash = path.rfind('/');
  if (slash != std::string::npos) set.folder = path.substr(0, slash + 1);
  const std::string problem = Reader(*json, &set).Run();
  if (!problem.empty())
    return Fail(ErrorCode::kInvalidArgument,
                path + ": " + problem + " (see schemas/image-set.schema.json)");
  return set;
}

Result<PlaneLevel> ReadSetImage(const ImageSet& set, size_t index) {
  auto image = ReadImage(set.PathOf(index));
  if (!image) {
    return Fail(image.error(), set.path + ": /images/" + std::to_string(index) + "/file");
  }
  const auto refuse = [&](ErrorCode code, const std::string& what) {
    return Fail(BadImage(set, index, code, what));
  };
  if (image->width() != set.width || image->height() != set.height) {
    return refuse(ErrorCode::kInvalidArgument,
                  std::to_string(image->width()) + " x " + std::to_string(image->height()) +
                      " pixels, but /width and /height say " + std::to_string(set.width) + " x " +
                      std::to_string(set.height) +
                      "; bring all images to one size, rectified to the sample's plane");
  }
  if (image->channels() < 3) {
    return refuse(ErrorCode::kInvalidArgument,
                  std::to_string(image->channels()) +
                      " channels; red, green and blue are needed (grey three times for grey)");
  }
  if (image->info.type == SampleType::kUint8) {
    return refuse(ErrorCode::kInvalidArgument,
                  "8-bit samples, which hold no linear reflectance; write OpenEXR with half or "
                  "float samples, or 16-bit PNG or TIFF with linear values");
  }
  if (const NonFinite bad = FindNonFinite(*image); bad.count > 0) {
    return refuse(ErrorCode::kCorruptData,
                  std::to_string(bad.count) + " samples are NaN or infinite, the first at x " +
                      std::to_string(bad.first_x) + ", y " + std::to_string(bad.first_y) +
                      ", channel " + std::to_string(bad.first_channel) +
                      "; mend the pixels, or take the image out of the list");
  }
  // Pixels at the horizon hold next to nothing of f; dividing by less would be noise.
  constexpr float kLeastCosine = 0.02f;
  const float factor = set.cosine_weighted
                           ? set.scale / std::max(set.images[index].light.z, kLeastCosine)
                           : set.scale;
  PlaneLevel planes;
  planes.Allocate(set.width, set.height, 3);
  for (int y = 0; y < set.height; ++y) {
    for (int c = 0; c < 3; ++c) {
      float* row = planes.Row(c, y);
      LoadRow(*image, y, c, row);
      for (int x = 0; x < set.width; ++x)
        row[x] = std::clamp(row[x] * factor, -brdf::kMaxValue, brdf::kMaxValue);
    }
  }
  return planes;
}

}  // namespace patina::svbrdf
