#include "pipeline/kernels/dispatch.h"

#include <cstdlib>
#include <optional>

namespace patina {
namespace {

std::optional<SimdTarget>& Forced() {
  static std::optional<SimdTarget> forced;
  return forced;
}

Result<std::optional<SimdTarget>> Parse(const std::string& name) {
  if (name.empty() || name == "auto") return std::optional<SimdTarget>();
  if (name == "avx2") return std::optional(SimdTarget::kAvx2);
  if (name == "avx512") return std::optional(SimdTarget::kAvx512);
  return Fail(ErrorCode::kInvalidArgument, "unknown SIMD target '" + name + "': use avx2, avx512 or auto");
}

Result<SimdTarget> Supported(SimdTarget target) {
  if (SimdTargetSupported(target)) return target;
  return Fail(ErrorCode::kUnsupported, std::string("this CPU cannot run ") + SimdTargetName(target) +
                                           " code; Patina needs at least AVX2, FMA and F16C");
}

}  // namespace

const char* SimdTargetName(SimdTarget target) { return target == SimdTarget::kAvx512 ? "avx512" : "avx2"; }

bool SimdTargetSupported(SimdTarget target) {
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (target == SimdTarget::kAvx2) return avx2;
  return avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}

Result<SimdTarget> ActiveSimdTarget() {
  if (Forced()) return Supported(*Forced());
  if (const char* name = std::getenv("PATINA_SIMD")) {
    PATINA_ASSIGN(auto wanted, Parse(name));
    if (wanted) return Supported(*wanted);
  }
  return Supported(SimdTargetSupported(SimdTarget::kAvx512) ? SimdTarget::kAvx512 : SimdTarget::kAvx2);
}

Status ForceSimdTarget(const std::string& name) {
  PATINA_ASSIGN(auto wanted, Parse(name));
  if (wanted) PATINA_TRY(Supported(*wanted));
  Forced() = wanted;
  return {};
}

}  // namespace patina
