#include "tests/bench/brdf_eval_systems.h"

#include <algorithm>

#include "formats/base/names.h"

namespace patina::bench {
namespace {

bool Has(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

bool DependsOnSeed(const std::string& name) { return Has(VariantNames(), name); }

std::vector<std::string> SystemNames() {
  std::vector<std::string> names = VariantNames();
  for (const std::string& name : PeerNames()) names.push_back(name);
  return names;
}

Result<std::optional<FittedSystem>> FitSystem(const std::string& name, const Material& material,
                                              uint64_t seed, ThreadPool& pool) {
  if (Has(PeerNames(), name)) return FitPeer(name, material, seed, pool);
  if (!Has(VariantNames(), name))
    return Fail(ErrorCode::kInvalidArgument, "no system is called " + QuoteForMessage(name));
  PATINA_ASSIGN(FittedSystem fitted, FitVariant(name, material, seed, pool));
  return std::optional<FittedSystem>(std::move(fitted));
}

}  // namespace patina::bench
