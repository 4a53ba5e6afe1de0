// NBRDF, a peer: a network of 675 numbers in half and difference vectors.
//
// Based on: Sztrajman et al. 2021, "Neural BRDF Representation and Importance Sampling", and the
// networks that its authors published. Inputs h with azimuth 0 and d, the light's direction in the
// frame of h, both Cartesian; 21 and 21 units with ReLU; f = max(exp(y) - 1, 0). Differs from the
// paper for anisotropic materials: h keeps its azimuth.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/base/aligned_buffer.h"
#include "pipeline/base/thread_pool.h"
#include "tests/bench/brdf_eval_kernels.h"
#include "tests/bench/brdf_eval_pairs.h"

namespace patina::bench {

inline constexpr int kNbrdfParameters = 6 * 21 + 21 + 21 * 21 + 21 + 21 * 3 + 3;
inline constexpr double kNbrdfBytes = 4.0 * kNbrdfParameters;

struct NbrdfNetwork {
  NbrdfNetwork() : parameters(kNbrdfPadded) {}
  // From numbers in order: for each layer the weights [inputs][outputs], then the biases.
  explicit NbrdfNetwork(const float numbers[kNbrdfParameters]);

  float& weight(int layer, int input, int output) {
    return parameters[kNbrdfOffset[layer] + input * kNbrdfColumns[layer] + output];
  }
  float& bias(int layer, int output) { return weight(layer, kNbrdfInputs[layer], output); }

  AlignedBuffer<float> parameters;  // as the kernels hold them
  bool isotropic = true;
};

// Networks by name, from the text that nbrdf_networks.py writes: a name and 675 numbers a line.
// Errors: kCorruptData (with the line), those of ReadTextFile.
Result<std::map<std::string, NbrdfNetwork>> ReadNbrdfNetworks(const std::string& path);

struct NbrdfTrainOptions {
  uint64_t seed = 1;
  size_t pool = size_t{1} << 20;
  double half_angle_share = 0.5;
  int steps = 240000;  // of 512 samples
  // A start at random each, one a thread; the best on held-out samples is kept.
  std::vector<float> rates = {0.005f, 0.005f};
};

struct TrainedNbrdf {
  NbrdfNetwork network;
  double held_out_loss = 0;  // mean over samples and channels, as the trainer weights it
};

// Trains with Adam and a cosine schedule on the pairs and the loss of our trainer. Of rates of
// 0.003 to 0.012, 0.005 gave the least image errors of NP-decoded alum-bronze, chrome and
// blue-fabric (0.012 has the lesser loss, but images a fifth worse); twice the default steps lower
// the held-out loss by 1 to 9 %. The same for any number of threads. Errors: kCorruptData (fewer
// than 64 pairs), kUnsupported (CPU).
Result<TrainedNbrdf> TrainNbrdf(const brdf::Source& source, const NbrdfTrainOptions& options,
                                ThreadPool& pool);

// Samples of a chunk or more as tiles; lanes beyond the last pair have importance 0, so that the
// count of tiles is a multiple of kNbrdfChunkTiles.
AlignedBuffer<NbrdfTile> MakeNbrdfTiles(const TrainingPair* pairs, size_t count, bool isotropic);

}  // namespace patina::bench
