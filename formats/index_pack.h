// Index packs (.hpx): two HEALPix hemispheres of indices into a codebook of primitives, and
// codebooks (.hpc) that several packs share. Byte tables: FORMATS.md.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/healpix_corners.h"

namespace patina {

inline constexpr uint32_t kIndexPackVersion = 1;
inline constexpr uint32_t kCodebookVersion = 1;
inline constexpr uint64_t kMaxIndexPackBytes = uint64_t{1} << 26;  // without a zstd frame
inline constexpr int kMaxPrimitiveSize = 64;
inline constexpr int kMaxIndexBits = 16;
// Of ExpandCorners: 1 GiB.
inline constexpr uint64_t kMaxExpandedFloats = uint64_t{1} << 28;

using Interpolation = healpix::Interpolation;

// What the decoder does with it stands in FORMATS.md, "BRDF".
struct IndexPack {
  int nside = 64;           // 1..healpix::kMaxNside
  int primitive_size = 16;  // k: floats of a primitive, 1..kMaxPrimitiveSize
  int index_bits = 9;       // b: 1..16
  Interpolation interpolation = Interpolation::kBilinear;
  bool isotropic = true;            // pairs are folded before the lookup
  bool canonical_order = true;      // wi and wo change places where theta_i > theta_o
  bool angle_inputs = true;         // the network has the three inputs l, t, q after the features
  bool half_vector_inputs = false;  // and then X, Y; only with angle_inputs
  // One byte for each corner of a hemisphere, in corner order: 1 stored, 0 derived. Hemisphere 0 is
  // wi (S+), 1 is wo (S-). A derived corner is the mean of its parents (healpix::ParentsOf) in the
  // finest lattice of which it is a corner that is none of the lattice above; zero if there is no
  // lattice above, that is where Nside is odd.
  std::vector<uint8_t> stored[2];
  // Of the stored corners, hemisphere 0 then 1, corner order. Below 2^b and, with a codebook
  // inline, below its number of entries.
  std::vector<uint16_t> indices;
  // Bits of finite halves, [entry][k], 1..2^b entries. Empty if codebook_file is not.
  std::vector<uint16_t> codebook;
  // A plain file name beside the pack, and the SHA-256 of that file's bytes; both empty if the
  // codebook is inline.
  std::string codebook_file;
  std::string codebook_sha256;
};

// A codebook by itself.
struct Codebook {
  int primitive_size = 16;
  std::vector<uint16_t> halves;  // [entry][primitive_size], 1..65536 entries, all finite
};

// The bytes of a pack; inside a zstd frame of that level if zstd_level is 1..19, bare if 0. Errors:
// kInvalidArgument (a broken rule of IndexPack; the message names the field).
Result<std::vector<uint8_t>> EncodeIndexPack(const IndexPack& pack, int zstd_level = 0);

// Bare or in a zstd frame. Errors: kCorruptData, with a message that starts with "bad magic",
// "bad header", "bad map", "bad index", "bad codebook", "truncated", "trailing bytes", "bad
// checksum", "non-finite primitive" or "bad zstd frame"; kUnsupported for a newer version;
// kOutOfRange for a zstd frame above kMaxIndexPackBytes.
Result<IndexPack> ParseIndexPack(std::span<const uint8_t> bytes);

Status WriteIndexPack(const std::string& path, const IndexPack& pack, int zstd_level = 0);
Result<IndexPack> ReadIndexPack(const std::string& path);

// The same for codebooks, with the same errors.
Result<std::vector<uint8_t>> EncodeCodebook(const Codebook& codebook, int zstd_level = 0);
Result<Codebook> ParseCodebook(std::span<const uint8_t> bytes);
Status WriteCodebook(const std::string& path, const Codebook& codebook, int zstd_level = 0);
Result<Codebook> ReadCodebook(const std::string& path);

// The codebook of a pack that was read from a file in `directory`: its own, or the one it names,
// looked for in `directory` and then two folders above it (beside the assets of a container's
// revision). Its SHA-256 and primitive size are checked. Errors: those of ReadCodebook;
// kCorruptData if the file is not the one that the pack was written for.
Result<Codebook> CodebookOf(const IndexPack& pack, const std::string& directory);

// The same from the bytes of the file that the pack names; `name` stands in messages. Errors: those
// of ParseCodebook; kCorruptData if the file is not the one that the pack was written for.
Result<Codebook> SharedCodebookOf(const IndexPack& pack, std::span<const uint8_t> bytes,
                                  const std::string& name);

// Whether all indices are within the codebook, which a pack that shares one cannot tell by itself.
// Errors: kCorruptData ("bad index").
Status CheckIndices(const IndexPack& pack, const Codebook& codebook);

// Features of all corners, [2][healpix::CornerCount(nside)][k], derived ones filled from coarse to
// fine. Errors: kInvalidArgument (a broken rule of IndexPack, another primitive size), kCorruptData
// ("bad index": beyond the codebook), kOutOfRange (above kMaxExpandedFloats).
Result<std::vector<float>> ExpandCorners(const IndexPack& pack, const Codebook& codebook);

// Fills the derived corners of one hemisphere of [CornerCount(nside)][k] floats whose stored
// corners are set. `stored` as in IndexPack. For trainers; ExpandCorners does it too.
void FillDerivedCorners(int nside, int primitive_size, std::span<const uint8_t> stored,
                        float* features);

}  // namespace patina
