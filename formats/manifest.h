// manifest.json: what a container is, how to decode it, where it came from and how good it is.
//
// The fields are described one by one in FORMATS.md; schemas/manifest.schema.json is the formal
// description. Names that are a closed set in the file are strings here, because readers of a newer
// version may meet new ones.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"
#include "formats/scene/scene.h"

namespace patina {

// What readers read up to. Written is the lowest version whose readers decode the container
// rightly: 2 for channels of encoding "signed_log", working spaces other than "lin_rec709", channels
// that share an output and containers with a lod_range, else 1.
inline constexpr int kManifestVersion = 2;
inline constexpr size_t kMaxManifestBytes = size_t{8} << 20;  // readers refuse larger files
inline constexpr int kMaxManifestFeatures = 16;
inline constexpr int kMaxManifestHidden = 256;
inline constexpr int kMaxManifestOutputs = 256;
inline constexpr int kMaxManifestLayerWidth = 512;  // of a BRDF's network
inline constexpr int kMaxManifestLayers = 16;

struct ManifestTool {
  std::string name = "patina";
  std::string version;            // of the program, e.g. "0.1.0"
  std::string recipe = "patina";  // "patina" or "paper"
  int recipe_version = 1;         // raised when the same job would give other bytes
};

// One image file of the source set.
struct ManifestSourceFile {
  std::string path;                // relative to the input folder, '/' between folders, UTF-8
  std::vector<std::string> roles;  // what it was used for; empty if nothing
  std::string sha256;              // 64 lower-case hex digits
  int width = 0;
  int height = 0;
  int channels = 0;
  std::string type;         // "uint8", "uint16", "uint32", "half", "float", "double"
  std::string file_format;  // OpenImageIO's name of the format: "png", "jpeg", "openexr", ...
};

struct ManifestSource {
  int width = 0;  // of mip 0 of the material
  int height = 0;
  int levels = 0;  // of the full chain down to 1x1
  std::string address =
      "wrap";  // "wrap" or "clamp": beyond the edge, for features and source alike
  std::string normal_convention =
      "opengl";  // of the source's files: "opengl" (Y up) or "directx" (Y down)
  std::vector<ManifestSourceFile> files;
};

// A file of the container. manifest.json itself and files that differ from run to run (run.json,
// report.html) are not listed.
struct ManifestPayload {
  std::string name;  // a plain file name in the container's directory
  std::string role;  // "features", "grid", "codebook", "weights", "sampler", "preview", "report"
  uint64_t bytes = 0;
  std::string sha256;
};

// One feature texture; three consecutive inputs of the network, in the order of the array.
struct ManifestFeature {
  std::string payload;  // name of a payload of role "features"
  int width = 0;        // of its level 0
  int height = 0;
  int levels = 0;
  int lod_bias = 0;  // added to s to get the level; 0 or negative
  std::string format = "BC6H_UF16";  // or "BC6H_SF16"; of kind "svbrdf" also "RGBA16F"
};

// outputs = W2 relu(W1 inputs + b1) + b2
struct ManifestNetwork {
  std::string payload;  // name of the payload of role "weights"
  int inputs = 12;
  int hidden = 16;
  int outputs = 0;
  std::string activation = "relu";
};

// One channel of the material; channels of one map are contiguous.
struct ManifestChannel {
  std::string map;  // role: "albedo", "normal", "ao", "roughness", "metalness", "displacement", ...
  std::string component;  // "r", "g", "b", "x", "y", or "" for a map of one channel
  std::string encoding =
      "linear";  // "linear", "srgb", "normal_xy" or "signed_log": coded value -> physical value
  float range_min = 0;  // coded; decoders clamp to it
  float range_max = 1;
  int output = -1;     // output of the network, which equal channels share, or -1 for a constant
  float constant = 0;  // coded; used when output < 0
  // > 0. Of "linear": physical value = coded value * scale. Of "signed_log": physical value =
  // scale * sign(coded) * (exp2(|coded|) - 1).
  float scale = 1;
};

// How a map was stored in the source, so that it can be written back the same way.
struct ManifestMap {
  std::string role;
  int file = -1;  // index into source.files, or -1 if the map has no file of its own
  std::vector<int>
      file_channels;      // channels of that file, 0-based, in the order of the map's components
  std::string type;       // as ManifestSourceFile::type
  bool inverted = false;  // the file holds 1 - value (glossiness for roughness)
  std::string transfer = "linear";  // "linear" or "srgb": what the file's numbers are
  // Of colours baked since 0.2; empty for data.
  std::string color_space;  // that the file's numbers are in, by the name of the configuration
  std::string color_rule;  // "list", "option", "name", "tag", "file_rule" or "default": who said so
};

// The OpenColorIO configuration that a material was baked with.
struct ManifestColorConfig {
  std::string source;  // "builtin", "environment", "file"
  std::string file;    // its name without folders; empty if built in
  std::string sha256;  // of its text and all its tables
};

// Measures of a map, at one mip or over all. Absent if not measured; infinity (written as null) for
// a PSNR without error.
struct ManifestMeasures {
  std::optional<double> psnr_db;
  std::optional<double> ssim;
  std::optional<double> flip;
  std::optional<double> normal_deg;  // mean angle between normals
};

struct ManifestMapQuality {
  std::string map;
  ManifestMeasures overall;            // over all mips
  std::vector<ManifestMeasures> mips;  // mip 0 first
};

struct ManifestQuality {
  // Learned channels, coded values, decoded from the written payloads. Infinity (null) without
  // error.
  double psnr_overall_db = 0;  // of the mean squared error over all channels and mips
  double psnr_mip0_db = 0;
  double psnr_mean_mips_db = 0;  // mean over mips of the PSNR of each
  std::optional<double> ssim;
  std::optional<double> flip;
  std::vector<ManifestMapQuality> maps;
  std::optional<double> gate_min_psnr_db;  // the gate asked for, if any
  bool gate_met = true;
};

struct ManifestCurvePoint {
  uint64_t samples = 0;
  double psnr_mip0_db = 0;
  double psnr_mean_mips_db = 0;
  std::map<std::string, double> maps_db;  // of mip 0, learned channels only; empty before 0.2
};

// A profile that could have been chosen.
struct ManifestCandidate {
  std::string profile;
  uint64_t bytes = 0;                 // for an engine to load
  std::optional<double> reached_db;   // PSNR of mip 0 of one that was tried and was not enough
  bool given_up = false;              // before the end of its training
};

// How the profile followed from what the job asked for.
struct ManifestChoice {
  double target_psnr_db = 0;  // of mip 0; 0: none
  uint64_t most_bytes = 0;    // for an engine to load; 0: no limit
  std::vector<ManifestCandidate> candidates;  // from the smallest to the largest
  std::string chosen;
  bool in_reach = true;  // before the training: whether what is asked for was expected
  bool met = true;       // what the written files have of it
  std::string reason;    // a sentence for people
};

struct ManifestTraining {
  uint64_t samples = 0;
  std::string
      stopped_by;  // "budget", "slope", "target", "time", or "none" when nothing had to be learned
  double float_psnr_mip0_db = 0;  // of the trainer's own float model: what the export cost
  double float_psnr_mean_mips_db = 0;
  int rollbacks = 0;
  std::vector<ManifestCurvePoint> curve;
  std::optional<ManifestChoice> choice;  // when the job asked for a quality or a size
};

// What an effect saved against learning it, computed from the model.
struct ManifestSavings {
  uint64_t bytes = 0;                 // for an engine to load
  uint64_t decode_multiply_adds = 0;  // of one lookup
  uint64_t train_samples = 0;
  uint64_t train_multiply_adds = 0;
};

struct ManifestEffect {
  std::string what;    // "metalness", "albedo.r", "normal.z", "mips 0 to 1", ...
  std::string state;   // "learned", "constant", "derived", "left_out"
  std::string reason;  // "constant 0", "alphaMode is OPAQUE", ...; empty of what is learned
  std::optional<ManifestSavings> saved;
};

// One input file of a BRDF.
struct ManifestBrdfFile {
  std::string path;    // relative to the input folder, '/' between folders, UTF-8
  std::string sha256;  // 64 lower-case hex digits
};

// The directional albedo of the decoded BRDF: the integral of f cos(theta_o) over wo.
struct ManifestAlbedo {
  double theta_deg = 0;                   // colatitude of wi
  std::array<double, 3> rgb = {0, 0, 0};  // above 1 where the BRDF does not conserve energy
};

// Measured on the written payloads; what was not measured is absent. FORMATS.md says how.
struct ManifestBrdfQuality {
  std::optional<double> image_mae;          // of the lit sphere, sRGB
  std::optional<double> image_rmse;         // likewise
  std::optional<double> image_ssim;         // likewise
  std::optional<double> log1p_mse;          // of log(1 + f) over the raw samples
  std::optional<double> reciprocity_error;  // mean |f(wi, wo) - f(wo, wi)| over their mean
  std::vector<ManifestAlbedo> albedo;
};

// How a source was simulated rather than measured.
struct ManifestSimulation {
  uint64_t pairs = 0;         // of directions
  uint64_t paths = 0;         // of light
  double standard_error = 0;  // root mean square over the pairs, of log(1 + f c)
  std::vector<std::string> effects, left_out;  // in words
};

// The measured images that a spatially varying BRDF comes from.
struct ManifestImageSet {
  uint64_t images = 0;
  int width = 0;  // of each, texels
  int height = 0;
  std::string address = "clamp";  // "wrap" or "clamp": beyond the edge, of the neural texture
  std::string sha256;  // of the hex digests of the images' files, one a line, in the list's order
};

// What a container of kind "brdf" or "svbrdf" has instead of channels and maps.
struct ManifestBrdf {
  // The source.
  std::string source_format;   // "merl", "rgl", "utia", "sparse", "layered", ...
  uint64_t cells = 0;          // colours in the file
  uint64_t invalid_cells = 0;  // of those, the ones that were left out
  std::optional<ManifestSimulation> simulation;  // of a layered material
  std::optional<ManifestImageSet> images;        // of kind "svbrdf", and only there
  std::vector<ManifestBrdfFile> files;
  // The model; what repeats the index pack's header is the same as there.
  std::string grid;      // name of the payload of role "grid"
  std::string codebook;  // of the payload of role "codebook", if it is a file of this container
  // If several containers share it: a plain file name in the folder that holds the assets. With
  // neither of the two the codebook is in the grid's file.
  std::string shared_codebook_file;
  std::string shared_codebook_sha256;
  int nside = 64;
  int primitive_size = 16;
  int index_bits = 9;
  std::string interpolation = "bilinear";  // "bilinear", "inverse_distance", "uniform"
  bool isotropic = true;
  bool canonical_order = true;
  bool angle_inputs = true;
  bool half_vector_inputs = false;         // only with angle_inputs
  std::string network;                     // name of the payload of role "weights"
  std::vector<int> layers;                 // widths: inputs, hidden ..., 3 outputs
  std::string activation = "relu";         // between layers
  std::string output_transform = "expm1";  // f = max(0, exp(min(y, 12)) - 1)
  std::string sampler;                     // of the payload of role "sampler"; empty if none
  int rollbacks = 0;  // how often training went back because a value was not finite
  ManifestBrdfQuality quality;
};

// Fields marked [material] are absent from the file of another kind and then have their defaults.
struct Manifest {
  // format "patina-container" and format_version kManifestVersion are written by ToJson and checked
  // by ParseManifest.
  std::string kind = "material";  // or "brdf", or "svbrdf": a BRDF with a neural texture
  std::string asset;
  ManifestTool tool;
  std::string fingerprint;  // hex SHA-256 of recipe, job and input hashes
  uint64_t seed = 1;        // below 2^63, which is as far as JSON Schema validators count
  std::string profile;      // [material] "bcf-0.5k", "bcf-1k", "bcf-2k", "bcf-2k++"
  std::string quality_setting = "standard";  // "preview", "standard", "reference"
  ManifestSource source;                     // [material]
  std::vector<ManifestPayload> payloads;
  // [material] empty when every channel is constant. Of kind "svbrdf": the neural texture, all of
  // the images' size; its values are the last inputs of the network, three of each texture.
  std::vector<ManifestFeature> features;
  std::optional<ManifestNetwork> network;  // [material] likewise
  std::vector<ManifestChannel> channels;   // [material]
  std::vector<ManifestMap> maps;           // [material]
  // [material] The mips of the source that are stored; absent: all.
  std::optional<std::array<int, 2>> lod_range;
  std::optional<SceneLook> scene;            // [material], "svbrdf": if it comes from a scene
  std::optional<ManifestBrdf> brdf;          // of kinds "brdf" and "svbrdf", and only there
  std::string working_space = "lin_rec709";  // of physical colour values; or "acescg"
  std::optional<ManifestColorConfig> color_config;  // [material] absent before 0.2
  ManifestQuality quality;                          // [material]
  ManifestTraining training;                        // [material]
  std::vector<ManifestEffect> effects;
  std::vector<std::string> warnings;
};

// The version that is written for a manifest; see kManifestVersion.
int FormatVersionOf(const Manifest& manifest);

// The canonical text: fixed key order, 2-space indent, LF, a final newline, shortest decimals that
// read back exactly. The same manifest gives the same bytes. Text that is not UTF-8 has its bad
// bytes replaced by U+FFFD. Errors: kInvalidArgument with a JSON pointer for anything that
// ParseManifest would refuse.
Result<std::string> ToJson(const Manifest& manifest);

// Reads a manifest of any version written so far; ignores fields it does not know.
// Errors, with JSON pointers: kCorruptData (not JSON, wrong type, missing field, value outside its
// range, references to payloads, files or outputs that are not there), kUnsupported (a newer
// format_version, another format or kind).
Result<Manifest> ParseManifest(std::string_view text);

}  // namespace patina
