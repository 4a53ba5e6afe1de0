#include <algorithm>

#include "pipeline/material/train.h"

namespace patina {

const char* ProfileName(Profile profile) {
  switch (profile) {
    case Profile::kBcf05k: return "bcf-0.5k";
    case Profile::kBcf1k: return "bcf-1k";
    case Profile::kBcf2k: return "bcf-2k";
    case Profile::kBcf2kPlus: return "bcf-2k++";
  }
  return "bcf-1k";
}

const char* QualityName(Quality quality) {
  switch (quality) {
    case Quality::kPreview: return "preview";
    case Quality::kStandard: return "standard";
    case Quality::kReference: return "reference";
  }
  return "standard";
}

const char* RecipeName(Recipe recipe) { return recipe == Recipe::kPaper ? "paper" : "patina"; }

Result<Profile> ParseProfile(const std::string& name) {
  for (const Profile p : {Profile::kBcf05k, Profile::kBcf1k, Profile::kBcf2k, Profile::kBcf2kPlus}) {
    if (name == ProfileName(p)) return p;
  }
  return Fail(ErrorCode::kInvalidArgument,
              "unknown profile '" + name + "': use bcf-0.5k, bcf-1k, bcf-2k or bcf-2k++");
}

Result<Quality> ParseQuality(const std::string& name) {
  for (const Quality q : {Quality::kPreview, Quality::kStandard, Quality::kReference}) {
    if (name == QualityName(q)) return q;
  }
  return Fail(ErrorCode::kInvalidArgument, "unknown quality '" + name + "': use preview, standard or reference");
}

Result<Recipe> ParseRecipe(const std::string& name) {
  for (const Recipe r : {Recipe::kPatina, Recipe::kPaper}) {
    if (name == RecipeName(r)) return r;
  }
  return Fail(ErrorCode::kInvalidArgument, "unknown recipe '" + name + "': use patina or paper");
}

ModelShape ShapeForProfile(Profile profile, int width, int height) {
  static constexpr int kShifts[4][kFeatureTextures] = {{2, 3, 4, 5}, {1, 2, 3, 4}, {0, 1, 2, 3}, {0, 0, 2, 3}};
  ModelShape shape;
  for (int t = 0; t < kFeatureTextures; ++t) {
    FeatureShape& feature = shape[t];
    feature.lod_shift = kShifts[static_cast<int>(profile)][t];
    feature.width = std::max(1, width >> feature.lod_shift);
    feature.height = std::max(1, height >> feature.lod_shift);
    feature.levels = 1;
    for (int side = std::max(feature.width, feature.height); side > 1; side >>= 1) ++feature.levels;
  }
  return shape;
}

}  // namespace patina
