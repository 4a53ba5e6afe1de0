// Measured image sets (BTFs): images of one flat sample, each under one light from one view, and a
// JSON file that lists them. Described by schemas/image-set.schema.json.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "pipeline/material/mip_filter.h"
#include "pipeline/material/target_pyramid.h"

namespace patina::svbrdf {

// Files of this end are lists of images. Inline: who only asks must not load the image library.
inline constexpr std::string_view kImageSetSuffix = ".btf.json";
inline bool IsImageSetFileName(std::string_view path) {
  return path.size() > kImageSetSuffix.size() && path.ends_with(kImageSetSuffix);
}

inline constexpr size_t kMaxImageSetBytes = size_t{64} << 20;
inline constexpr size_t kMaxSetImages = 65536;
inline constexpr int kMaxSetSide = 4096;

struct SetImage {
  std::string file;       // relative to the JSON file's folder
  brdf::Direction light;  // unit vectors from the sample, z along its normal, x along u, y along v
  brdf::Direction view;   // (v runs down in the image)
};

struct ImageSet {
  std::string path;    // of the JSON file
  std::string folder;  // that files are relative to, with a '/' at its end; "" for none
  int width = 0;
  int height = 0;
  AddressMode address = AddressMode::kClamp;
  bool cosine_weighted = false;  // pixels are f cos(theta of the light), else f
  float scale = 1;               // of the pixels
  std::vector<SetImage> images;  // at least one

  std::string PathOf(size_t image) const { return folder + images[image].file; }
};

// Reads the list; looks at no image. Errors, with file, JSON pointer and remedy: those of
// ReadTextFile; kInvalidArgument for what the schema refuses, and for directions that are not unit
// vectors or not above the horizon, two images of one file or of one pair of directions, and files
// outside of the folder.
Result<ImageSet> ReadImageSet(const std::string& path);

// The image as f, planes red, green and blue: numbers beyond what an output can reach are cut off,
// noise below zero stays. Errors, with the file and the pointer of its entry: those of ReadImage;
// kInvalidArgument for another size, fewer than three channels, 8-bit samples; kCorruptData for
// pixels that are not finite.
Result<PlaneLevel> ReadSetImage(const ImageSet& set, size_t image);

}  // namespace patina::svbrdf
