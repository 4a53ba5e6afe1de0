#include "daemon/view/source_textures.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "daemon/api/problem.h"
#include "formats/base/names.h"
#include "formats/half.h"
#include "pipeline/jobs/compare.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kLanes = 4;

const TargetChannel* FindChannel(const MaterialReference& reference,
                                 const ManifestChannel& wanted) {
  for (const TargetChannel& channel : reference.channels) {
    if (channel.map == wanted.map && channel.component == wanted.component) return &channel;
  }
  return nullptr;
}

}  // namespace

Result<std::unique_ptr<const SourceTextures>> SourceTextures::Load(const Container& container,
                                                                   const std::string& path,
                                                                   ThreadPool& pool,
                                                                   const CancelToken& cancel,
                                                                   ProgressSink& progress) {
  Job job;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(path, ignored)) {
    PATINA_ASSIGN(job, ReadJobFile(path));
  } else {
    job.folder = path;
    job.asset = container.manifest.asset;
  }
  PATINA_ASSIGN(JobSource read, ReadSourceOf(container, job, pool, cancel, progress));
  const ManifestSource& baked = container.manifest.source;
  if (read.reference.width != baked.width || read.reference.height != baked.height) {
    return Fail(ErrorCode::kConflict,
                QuoteForMessage(path) + " has maps of " + std::to_string(read.reference.width) +
                    " x " + std::to_string(read.reference.height) +
                    " texels, the container was baked from " + std::to_string(baked.width) + " x " +
                    std::to_string(baked.height) + "; give the folder of its own maps");
  }
  std::unique_ptr<SourceTextures> textures(new SourceTextures);
  const bool same_source = IsSameSource(container, read);
  textures->reference_ = std::move(read.reference.material);
  textures->Describe(container, same_source);
  return std::unique_ptr<const SourceTextures>(std::move(textures));
}

void SourceTextures::Describe(const Container& container, bool same_source) {
  Json channels = Json::array();
  for (const ManifestChannel& wanted : container.manifest.channels) {
    const TargetChannel* channel = FindChannel(reference_, wanted);
    if (channel == nullptr) {
      channels.push_back(nullptr);
      continue;
    }
    Json listed = {{"encoding", EncodingName(channel->encoding)}, {"scale", channel->scale}};
    if (channel->learned_index < 0) {
      listed["constant"] = channel->constant_value;
    } else {
      auto at = std::find(stored_.begin(), stored_.end(), channel->learned_index);
      if (at == stored_.end()) at = stored_.insert(stored_.end(), channel->learned_index);
      const auto place = static_cast<size_t>(at - stored_.begin());
      listed["texture"] = place / kLanes;
      listed["lane"] = place % kLanes;
    }
    channels.push_back(std::move(listed));
  }
  Json levels = Json::array();
  for (const TargetLevel& level : reference_.pyramid.levels)
    levels.push_back({{"width", level.width}, {"height", level.height}});
  const Json json = {{"same_source", same_source},
                     {"first_mip", reference_.pyramid.first_mip},
                     {"textures", (stored_.size() + kLanes - 1) / kLanes},
                     {"levels", std::move(levels)},
                     {"channels", std::move(channels)}};
  description_ = json.dump() + "\n";
}

std::string SourceTextures::TexelsOf(size_t texture, const TargetLevel& level) const {
  std::string bytes(static_cast<size_t>(level.width) * level.height * kLanes * 2, '\0');
  size_t at = 0;
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) {
      for (size_t lane = 0; lane < kLanes; ++lane, at += 2) {
        const size_t place = texture * kLanes + lane;
        if (place >= stored_.size()) continue;
        const uint16_t half = FloatToHalf(level.At(x, y, stored_[place]));
        bytes[at] = static_cast<char>(half & 0xFF);
        bytes[at + 1] = static_cast<char>(half >> 8);
      }
    }
  }
  return bytes;
}

HttpResponse SourceTextures::Answer(const std::string& name) const {
  HttpResponse response;
  if (name == "source.json") {
    response.body = description_;
    return response;
  }
  response.content_type = "application/octet-stream";
  const auto& levels = reference_.pyramid.levels;
  for (size_t texture = 0; texture * kLanes < stored_.size(); ++texture) {
    for (size_t level = 0; level < levels.size(); ++level) {
      if (name != std::to_string(texture) + "_" + std::to_string(level) + ".bin") continue;
      response.body = TexelsOf(texture, levels[level]);
      return response;
    }
  }
  return ProblemResponse(404, "not_found",
                         "the source has no file " + QuoteForMessage(name) +
                             "; source.json says how many textures and levels there are");
}

}  // namespace patina::daemon
