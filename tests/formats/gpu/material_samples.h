// Materials with random content and of every shape, for the tests on GPUs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "formats/container.h"
#include "formats/decoder/patina_decoder.h"
#include "tests/formats/gpu/gpu_program.h"

namespace patina::gpu_test {

struct MaterialShape {
  int width = 64;
  int height = 48;
  std::vector<int> shifts = {1, 2, 3, 4};  // of the side of each texture against the source
  bool is_signed = false;
  int hidden = 16;
  int outputs = 5;
  int constants = 0;  // channels with a number, between the others
  std::string address = "wrap";
};

// Publishes a material in the folder: channels with the encodings srgb, normal_xy, linear and
// scaled in turns, ranges that clamp about every tenth value. Fails the current test on an error.
Container MakeMaterial(const std::string& folder, const MaterialShape& shape, uint64_t seed);

// The same container with only a part of each texture's levels, as of a material that is seen from
// some distances only: so many fine and coarse ones are cut off (one level stays).
Container CutLevels(const Container& container, int fine, int coarse);

// Random (u, v, s): eight floats each, of which the first three count. Positions beyond the edges,
// levels beyond both ends of the chain; a share of them on texel centres and whole levels.
std::vector<float> RandomLookups(uint64_t seed, size_t count, int width, int height);

// Physical values of all channels at each lookup by the C++ decoder.
std::vector<float> Decoded(const Decoder& decoder, const std::vector<float>& lookups);

// The C++ decoder; fails the current test if there is none.
Decoder LoadDecoder(const Container& container);

// Compares values of all channels at each lookup; the bound is a share of each channel's range.
void ExpectMaterialClose(const Decoder& decoder, const std::vector<float>& lookups,
                         const std::vector<float>& from_gpu, const std::vector<float>& expected);

// Runs the material's shader at random lookups and compares with the C++ decoder.
void CheckMaterial(const Container& container, uint64_t seed, size_t count,
                   const ShaderOptions& options, const RunProgram& run);

// The width of a channel's range in physical values.
double PhysicalRange(const Decoder::Channel& channel);

}  // namespace patina::gpu_test
