#include "pipeline/jobs/profile_choice.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/base/check.h"
#include "formats/weights.h"
#include "pipeline/jobs/effect_costs.h"

namespace patina {
namespace {

template <class... Args>
std::string Format(const char* format, Args... args) {
  char text[256];
  const int n = std::snprintf(text, sizeof text, format, args...);
  return n > 0 ? std::string(text, std::min(static_cast<size_t>(n), sizeof text - 1))
               : std::string();
}

uint64_t WeightBytes(int outputs) {
  NetworkWeights network;
  network.inputs = kNetworkInputs;
  network.hidden = kNetworkHidden;
  network.outputs = outputs;
  network.w1.resize(static_cast<size_t>(kNetworkHidden * kNetworkInputs));
  network.b1.resize(kNetworkHidden);
  network.w2.resize(static_cast<size_t>(outputs * kNetworkHidden));
  network.b2.resize(static_cast<size_t>(outputs));
  const auto packed = PackNetwork(network);
  const auto bytes = packed ? EncodeWeights(*packed) : Fail(packed.error());
  PATINA_CHECK(bytes);
  return bytes->size();
}

}  // namespace

Aims AimsOfJob(const Job& job, int width, int height) {
  Aims aims;
  aims.target_psnr_db = job.target_psnr_db;
  aims.most_bytes = job.size_budget_bytes;
  if (job.target_bpp > 0) {
    const double bytes = job.target_bpp / 8 * width * height;
    const auto most = static_cast<uint64_t>(std::max(1.0, std::floor(bytes)));
    aims.most_bytes = aims.most_bytes == 0 ? most : std::min(aims.most_bytes, most);
  }
  return aims;
}

ModelShape ShapeOfMips(Profile profile, int width, int height, int mips) {
  ModelShape shape = ShapeForProfile(profile, width, height);
  for (FeatureShape& feature : shape) {
    feature.levels = std::clamp(mips - feature.lod_shift, 1, feature.levels);
  }
  return shape;
}

uint64_t MaterialBytes(const ModelShape& shape, int outputs) {
  return TextureBytes(shape) + WeightBytes(outputs);
}

ManifestChoice ChooseProfile(const Aims& aims, const std::vector<ProfileSizes>& candidates,
                             bool smallest_first) {
  ManifestChoice choice;
  choice.target_psnr_db = aims.target_psnr_db;
  choice.most_bytes = aims.most_bytes;
  size_t fitting = 0;  // the first so many fit
  for (const ProfileSizes& candidate : candidates) {
    choice.candidates.push_back({ProfileName(candidate.profile), candidate.bytes, {}, false});
    if (aims.most_bytes == 0 || candidate.bytes <= aims.most_bytes) ++fitting;
  }
  const size_t chosen = fitting == 0 || smallest_first ? 0 : fitting - 1;
  choice.chosen = choice.candidates[chosen].profile;
  const unsigned long long bytes = choice.candidates[chosen].bytes, most = aims.most_bytes;
  const char* name = choice.chosen.c_str();
  if (fitting == 0) {
    choice.in_reach = false;
    choice.reason = Format(
        "%s has %llu bytes, and at most %llu are asked for; needed: a smaller "
        "--profile (bcf-0.5k is the smallest), a smaller source, or --lod-range",
        name, bytes, most);
  } else if (candidates.size() == 1) {
    choice.reason = Format("%s is what was asked for", name);
  } else if (smallest_first) {
    choice.reason = Format("%s is the smallest, with %llu bytes", name, bytes);
  } else if (most > 0) {
    choice.reason = Format("%s is the largest that fits: %llu of %llu bytes", name, bytes, most);
  } else {
    choice.reason = Format(
        "%s is the largest, and the time budget leaves no room to try smaller "
        "ones",
        name);
  }
  return choice;
}

bool ChooseNextProfile(double reached_db, bool given_up, ManifestChoice* choice) {
  auto& candidates = choice->candidates;
  const auto tried = std::find_if(candidates.begin(), candidates.end(),
                                  [choice](const auto& c) { return c.profile == choice->chosen; });
  const auto next = tried == candidates.end() ? tried : tried + 1;
  if (next == candidates.end() || (choice->most_bytes > 0 && next->bytes > choice->most_bytes))
    return false;
  tried->reached_db = reached_db;
  tried->given_up = given_up;
  choice->chosen = next->profile;
  choice->reason = Format("%s is the smallest that is left: %s %s %.2f dB of the %.2f dB asked for",
                          next->profile.c_str(), tried->profile.c_str(),
                          given_up ? "was given up on the way at" : "reached", reached_db,
                          choice->target_psnr_db);
  return true;
}

}  // namespace patina
