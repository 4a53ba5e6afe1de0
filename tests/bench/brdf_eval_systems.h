// The systems that are compared: variants of our model, and peers. Each is fitted to a source and
// gives a function.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "pipeline/base/thread_pool.h"
#include "pipeline/brdf/sphere_render.h"
#include "tests/bench/nbrdf.h"

namespace patina::bench {

struct FittedSystem {
  double bytes = 0;              // of what a renderer needs for this material
  double train_seconds = 0;      // wall time
  brdf::EvaluatePairs evaluate;  // for workers below the pool's thread count; keeps what it needs
};

struct Material {
  std::string name;
  brdf::Source source;
  const std::map<std::string, NbrdfNetwork>* networks = nullptr;  // published ones, by material
};

// Variants of our model (brdf_eval_variants.cpp), trained with as many threads as the pool has.
std::vector<std::string> VariantNames();
Result<FittedSystem> FitVariant(const std::string& name, const Material& material, uint64_t seed,
                                ThreadPool& pool);

// Peers (brdf_eval_peers.cpp):
//   table            the source's own table, interpolated; doubles, as a MERL file has them
//   ggx, ggx-l2      Lambert and GGX, fitted in L1 and in L2 of log1p(f cos)
//   nbrdf            a published network; nothing for materials without one
//   nbrdf-retrained  the same architecture trained here on the source
std::vector<std::string> PeerNames();
Result<std::optional<FittedSystem>> FitPeer(const std::string& name, const Material& material,
                                            uint64_t seed, ThreadPool& pool);

// Whether the seed makes a difference, so that several are worth a run.
bool DependsOnSeed(const std::string& name);
// Variants first.
std::vector<std::string> SystemNames();
// Nothing where the system has nothing for the material. Errors: those of the trainers;
// kInvalidArgument for an unknown name.
Result<std::optional<FittedSystem>> FitSystem(const std::string& name, const Material& material,
                                              uint64_t seed, ThreadPool& pool);

}  // namespace patina::bench
