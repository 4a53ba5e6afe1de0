// BRDFs for the tests on GPUs.
#pragma once

#include <vector>

#include "tests/formats/gpu/gpu_program.h"
#include "tests/formats/sample_brdf.h"

namespace patina::gpu_test {

// Pairs of directions, eight floats each (wi, -, wo, -): random ones, poles, both ends of the
// azimuth, edges of the lattice's quadrants, grazing ones, identical ones, mirror ones, and some
// below the horizon.
std::vector<float> RandomPairs(uint64_t seed, size_t count);

// Makes a random BRDF, runs its shader at random pairs, and compares with the C++ decoder. Fails
// the current test where they differ.
void CheckBrdf(const test::BrdfSampleOptions& options, uint64_t seed, size_t count,
               ShaderLanguage language, const RunProgram& run);

}  // namespace patina::gpu_test
