// Reference decoder of Patina containers of kind "svbrdf", spatially varying BRDFs: (wi, wo) at a
// place of a texture -> rgb of f in 1/sr, linear Rec.709, without the cosine.
//
// Four headers: this, patina_decoder.h, patina_brdf_decoder.h and patina_brdf_sampler.h; C++17,
// needs only the standard library and nlohmann/json: copy them into a renderer. They read what
// FORMATS.md describes.
//
//   patina::SvbrdfDecoder cloth;
//   std::string problem;
//   using Status = patina::SvbrdfDecoder::LoadStatus;
//   if (patina::SvbrdfDecoder::Load("out/cloth", &cloth, &problem) != Status::kOk) return;
//   cloth.Evaluate(wi, wo, u, v, s, rgb);
//
// Directions are unit vectors in the frame of the surface, z along the normal, x along u, y along
// v, both pointing away from it. A loaded decoder is immutable: all its const members may be called
// from many threads at once. Load does not throw.
#pragma once

#include <exception>
#include <string>
#include <utility>

#include "patina_brdf_decoder.h"
#include "patina_decoder.h"

namespace patina {

class SvbrdfDecoder {
 public:
  enum class LoadStatus { kOk, kNotFound, kCorrupt, kUnsupported, kNoMemory };

  // `path` is a revision's directory or an asset's directory (its `current` is taken). Fills
  // *decoder only if it returns kOk, else *problem with what is wrong and where. Does not check
  // SHA-256 sums.
  static LoadStatus Load(const std::string& path, SvbrdfDecoder* decoder, std::string* problem) {
    SvbrdfDecoder loaded;
    LoadStatus status = LoadStatus::kOk;
    try {
      status = loaded.LoadAll(path, problem);
    } catch (const std::exception& error) {
      *problem = path + ": " + error.what();
      status = LoadStatus::kNoMemory;
    }
    if (status == LoadStatus::kOk) *decoder = std::move(loaded);
    return status;
  }

  // f(wi, wo) at texture coordinates u, v (any finite numbers; 0..1 spans the texture, v downwards)
  // and level of detail s in mips (0: full resolution); each channel finite and at least 0; zero
  // unless both directions are above the horizon.
  void Evaluate(const float wi[3], const float wo[3], double u, double v, double s,
                float rgb[3]) const {
    float features[3 * Decoder::kMaxTextures];
    for (size_t t = 0; t < texture_.textures_.size(); ++t)
      texture_.SampleTexture(texture_.textures_[t], u, v, s, features + 3 * t);
    brdf_.Run(wi, wo, features, rgb);
  }

  int width() const { return texture_.width_; }  // of the texture's level 0, texels
  int height() const { return texture_.height_; }
  int levels() const { return texture_.levels_; }

 private:
  LoadStatus LoadAll(const std::string& path, std::string* problem) {
    using namespace decoder_detail;
    std::string directory = path;
    if (!std::ifstream(directory + "/manifest.json")) directory += "/current";
    const std::string manifest_path = directory + "/manifest.json";
    Decoder::Failure failure;
    std::string text;
    if (!Decoder::ReadFile(manifest_path, uint64_t{8} << 20, &text, &failure))
      return Failed(failure, problem);
    const nlohmann::json manifest = nlohmann::json::parse(text, nullptr, false);
    const nlohmann::json& features = Member(manifest, "features");
    const size_t count = features.is_array() ? features.size() : 0;
    BrdfDecoder::Failure brdf_failure;
    if (!brdf_.LoadAll(path, "svbrdf", 3 * count, &brdf_failure)) {
      *problem = brdf_failure.text;
      return brdf_failure.status == BrdfDecoder::LoadStatus::kNotFound  ? LoadStatus::kNotFound
             : brdf_failure.status == BrdfDecoder::LoadStatus::kCorrupt ? LoadStatus::kCorrupt
                                                                        : LoadStatus::kUnsupported;
    }
    const std::string address =
        Text(Member(Member(Member(manifest, "source"), "images"), "address"));
    if (count < 1 || count > static_cast<size_t>(Decoder::kMaxTextures)) {
      failure.Set(Decoder::LoadStatus::kCorrupt,
                  manifest_path + ": /features is not an array of 1 to 16 textures");
    } else if (address != "wrap" && address != "clamp") {
      failure.Set(Decoder::LoadStatus::kUnsupported,
                  manifest_path + ": /source/images/address is neither wrap nor clamp");
    }
    texture_.wrap_ = address == "wrap";
    for (size_t t = 0; t < count && failure.status == Decoder::LoadStatus::kOk; ++t)
      texture_.ReadTexture(features[t], directory, manifest_path, true, &failure);
    if (failure.status != Decoder::LoadStatus::kOk) return Failed(failure, problem);
    const TextureLevel& first = texture_.textures_[0].levels[0];
    texture_.width_ = first.width;
    texture_.height_ = first.height;
    texture_.levels_ = static_cast<int>(texture_.textures_[0].levels.size());
    return LoadStatus::kOk;
  }

  static LoadStatus Failed(const Decoder::Failure& failure, std::string* problem) {
    *problem = failure.message;
    switch (failure.status) {
      case Decoder::LoadStatus::kNotFound:
        return LoadStatus::kNotFound;
      case Decoder::LoadStatus::kUnsupported:
        return LoadStatus::kUnsupported;
      case Decoder::LoadStatus::kNoMemory:
        return LoadStatus::kNoMemory;
      default:
        return LoadStatus::kCorrupt;
    }
  }

  BrdfDecoder brdf_;
  Decoder texture_;  // its textures and how they are addressed; nothing else of it is used
};

}  // namespace patina
