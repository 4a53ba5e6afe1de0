// A job: everything that decides what one bake makes. Described by schemas/job.schema.json.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/color/primaries.h"
#include "pipeline/effects/effects.h"
#include "pipeline/material/target_pyramid.h"
#include "pipeline/material/train.h"

namespace patina {

inline constexpr int kJobVersion = 1;
inline constexpr size_t kMaxJobBytes = size_t{4} << 20;  // larger job files are refused
inline constexpr size_t kMaxJobMaps = 64;
inline constexpr size_t kMaxColorSpaceName = 255;       // characters
inline constexpr uint64_t kMaxSeed = 9007199254740991;  // 2^53 - 1, exact in every JSON reader
inline constexpr int kMaxThreads = 256;
inline constexpr uint64_t kMaxSizeBudget = uint64_t{1} << 40;

// One entry of an explicit list of maps. Empty text means the default.
struct JobMap {
  std::string role;
  std::string file;      // absolute, or relative to Job::maps_folder
  std::string channels;  // letters of "rgba" in the order of the map's components; "" = the file's
                         // first ones
  std::string color_space = "auto";  // "auto", "srgb", "linear", "raw", or of the configuration
  std::string convention = "auto";   // "auto", "opengl", "directx"; of normal maps
  bool invert = false;               // the file holds 1 - value
};

// The shape of a BRDF's model. What is absent is the recipe's choice (see ModelOfJob in
// brdf_job.h).
struct JobModel {
  std::optional<int> nside;                  // 1..256
  std::optional<int> primitive_size;         // 1..64
  std::optional<int> index_bits;             // 1..12
  std::optional<int> hidden;                 // 4..256
  std::optional<int> hidden_layers;          // 1..4
  std::optional<int> textures;               // 1..4, of a spatially varying BRDF
  std::optional<std::string> texture_format;  // "bc6h", "fp16", likewise
  std::optional<std::string> interpolation;  // "bilinear", "inverse_distance", "uniform"
  std::optional<bool> angle_inputs;
  std::optional<bool> canonical_order;
  std::optional<std::string> index_training;  // "clusters", "softmax", "clusters_then_softmax"
};

enum class JobKind { kMaterial, kBrdf, kSvbrdf };  // "material", "brdf", "svbrdf"

// Fields marked [material] or [brdf] belong to jobs of that kind only; those of BRDFs to spatially
// varying ones, too, which may have folder, set, maps or scene and how to read them, not a file.
struct Job {
  JobKind kind = JobKind::kMaterial;
  std::string asset;
  std::string file;    // [brdf] measurements, list of images, layers; or, if it varies, `folder`
  JobModel model;      // [brdf]
  std::string folder;  // [material] of the maps; may be empty when `maps` is not
  std::string set;    // [material] name of the one meant when `folder` holds several materials; may
                      // be empty when it does not
  std::string scene;  // [material] a scene's file, in place of folder and maps
  std::string
      scene_material;        // [material] with `scene`: name of the one meant, or "#" and its index
  std::vector<JobMap> maps;  // [material] empty: found by file name in `folder`
  std::string maps_folder;  // [material] what files of `maps` are relative to: `folder`, or the job
                            // file's folder
  std::string out;
  Profile profile = Profile::kBcf1k;  // [material]
  bool choose_profile = false;        // [material] in place of `profile`: see profile_choice.h
  Quality quality = Quality::kStandard;
  Recipe recipe = Recipe::kPatina;
  uint64_t seed = 1;
  int threads = 0;  // 0: one for each CPU this process may use
  bool report = true;  // write report.html beside the manifest; no part of the fingerprint
  // [material], all that follow.
  double target_psnr_db = 0;  // of mip 0, on the written files; 0: none
  double target_bpp = 0;      // most bits a texel of mip 0 for an engine to load; 0: no limit
  uint64_t size_budget_bytes = 0;  // most bytes for an engine to load; 0: no limit
  double time_budget_s = 0;        // 0: none
  double samples = 0;         // 0: by quality and size
  double min_psnr_db = 0;     // 0: no gate
  AddressMode address = AddressMode::kWrap;
  bool address_given = false;  // not given: of a scene the material's samplers decide
  EffectSwitches effects;
  std::optional<std::array<int, 2>> lod_range;  // the mips that are looked at; absent: all
  std::string normal_convention = "auto";       // "auto", "opengl", "directx"
  bool repair_nonfinite = false;
  bool toksvig = true;
  WorkingSpace working_space = WorkingSpace::kLinearRec709;
  std::string color_space =
      "auto";        // of colour maps that `maps` gives none; as JobMap::color_space
  std::string ocio;  // OpenColorIO configuration; "": $OCIO, else the built-in one
};

// Parses a job. Relative folders are made relative to `base_folder` ("" leaves them as they are).
// `source` names the text in messages. Errors: kInvalidArgument with the complete list of what is
// wrong, one line each with its JSON pointer, or the line and column where the text is not JSON;
// kUnsupported for a newer version.
Result<Job> ParseJob(std::string_view text, const std::string& base_folder,
                     const std::string& source);

// ParseJob of a file. Also kNotFound, kIo, kOutOfRange (larger than kMaxJobBytes).
Result<Job> ReadJobFile(const std::string& path);

// Reads a list of maps: a JSON array of what a job has in "maps". Errors as ReadJobFile.
Result<std::vector<JobMap>> ReadMapListFile(const std::string& path);

// The folder of a file: what is before the last '/', "" if there is none.
std::string FolderOfFile(const std::string& path);

// The job as a job file: every field that is not its default, paths as they stand.
std::string JobToJson(const Job& job);

// What of a job decides the bytes of its result, as text for the fingerprint: every field with its
// value in a fixed order, without the folder and set it reads and the folder it writes to, the
// thread count, the quality gate and the configuration of colours, which enters by hash. Fields
// that came after version 0.1 stand there when they are not their default. Files of `maps` stand as
// their last path component; their content, and that of `file`, enters the fingerprint by hash. The
// model of a BRDF stands with what the recipe chose.
std::string CanonicalJob(const Job& job);

// Whether a name can be an asset's: 1 to 100 of A-Z a-z 0-9 _ - . and not starting with - or '.'.
bool IsAssetName(std::string_view name);

// An asset name from the last component of a path: everything else becomes '_'. "asset" if nothing
// is left.
std::string AssetNameFromPath(const std::string& path);

const char* AddressModeName(AddressMode mode);  // "wrap", "clamp"
const char* JobKindName(JobKind kind);          // "material", "brdf", "svbrdf"

}  // namespace patina
