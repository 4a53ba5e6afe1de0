#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

#include "tests/bench/brdf_eval_measures.h"
#include "tests/bench/brdf_eval_systems.h"
#include "tests/bench/ggx_fit.h"

namespace patina::bench {
namespace {

FittedSystem SystemOf(NbrdfNetwork network, const PeerKernels& kernels) {
  FittedSystem fitted;
  fitted.bytes = kNbrdfBytes;
  const auto kept = std::make_shared<NbrdfNetwork>(std::move(network));
  fitted.evaluate = [kept, &kernels](int, size_t count, const brdf::Direction* wi,
                                     const brdf::Direction* wo, float* rgb) {
    kernels.nbrdf_evaluate(kept->parameters.data(), kept->isotropic, wi, wo, count, rgb);
  };
  return fitted;
}

FittedSystem SystemOf(const GgxMaterial& material, const PeerKernels& kernels) {
  FittedSystem fitted;
  fitted.bytes = kGgxBytes;
  fitted.evaluate = [material, &kernels](int, size_t count, const brdf::Direction* wi,
                                         const brdf::Direction* wo, float* rgb) {
    kernels.ggx_evaluate(material, wi, wo, count, rgb);
  };
  return fitted;
}

}  // namespace

std::vector<std::string> PeerNames() {
  return {"table", "ggx", "ggx-l2", "nbrdf", "nbrdf-retrained"};
}

Result<std::optional<FittedSystem>> FitPeer(const std::string& name, const Material& material,
                                            uint64_t seed, ThreadPool& pool) {
  PATINA_ASSIGN(const SimdTarget target, ActiveSimdTarget());
  const PeerKernels& kernels = PeerKernelsFor(target);
  if (name == "table") {
    if (material.source.table == nullptr) return std::optional<FittedSystem>();
    FittedSystem fitted;
    fitted.bytes = static_cast<double>(material.source.cells) * 3 * sizeof(double);
    fitted.evaluate = FunctionOf(material.source.table);
    return std::optional<FittedSystem>(std::move(fitted));
  }
  if (name == "nbrdf") {
    if (material.networks == nullptr) return std::optional<FittedSystem>();
    const auto found = material.networks->find(material.name);
    if (found == material.networks->end()) return std::optional<FittedSystem>();
    NbrdfNetwork network;
    std::copy_n(found->second.parameters.data(), kNbrdfPadded, network.parameters.data());
    return std::optional<FittedSystem>(SystemOf(std::move(network), kernels));
  }
  const auto start = std::chrono::steady_clock::now();
  FittedSystem fitted;
  if (name == "nbrdf-retrained") {
    NbrdfTrainOptions options;
    options.seed = seed;
    PATINA_ASSIGN(TrainedNbrdf trained, TrainNbrdf(material.source, options, pool));
    fitted = SystemOf(std::move(trained.network), kernels);
  } else {
    GgxFitOptions options;
    options.norm = name == "ggx" ? FitNorm::kL1 : FitNorm::kL2;
    options.seed = seed;
    PATINA_ASSIGN(const GgxFit fit, FitGgx(material.source, options, pool));
    fitted = SystemOf(fit.material, kernels);
  }
  fitted.train_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return std::optional<FittedSystem>(std::move(fitted));
}

}  // namespace patina::bench
