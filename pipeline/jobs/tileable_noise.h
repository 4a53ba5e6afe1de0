// Seeded noise that repeats over the unit square, for procedural sample input.
#pragma once

#include <cstdint>

namespace patina {

// A hash of a lattice point, uniform over 32 bits; the same on every machine.
uint32_t LatticeHash(int x, int y, uint32_t seed);

// The same as a number in [0, 1).
float LatticeRandom(int x, int y, uint32_t seed);

// Gradient noise (Perlin 2002) over a lattice of `period` x `period` cells on the unit square; u
// and v may be any finite numbers and wrap. About -1 to 1, mean 0.
float TileableNoise(float u, float v, int period, uint32_t seed);

// Sum of `octaves` of TileableNoise, doubling the period and halving the weight; scaled back to
// about -1 to 1.
float TileableFbm(float u, float v, int period, int octaves, uint32_t seed);

// Voronoi cells of one jittered point in each cell of a `period` x `period` lattice on the unit
// square.
struct VoronoiHit {
  float border = 0;   // distance to the nearest border between two cells, in lattice cells
  uint32_t cell = 0;  // hash of the cell that owns the place
};
VoronoiHit TileableVoronoi(float u, float v, int period, uint32_t seed);

}  // namespace patina
