#include "formats/model_bytes.h"

#include <algorithm>

namespace patina {

uint64_t ModelBytes(const std::vector<ManifestPayload>& payloads) {
  uint64_t bytes = 0;
  for (const ManifestPayload& payload : payloads) {
    for (const char* role : {"features", "grid", "codebook", "weights", "sampler"}) {
      if (payload.role == role) bytes += payload.bytes;
    }
  }
  return bytes;
}

double CompressionRatio(const ManifestBrdf& brdf, uint64_t bytes) {
  constexpr double kBytesOfAColor = 6;
  return kBytesOfAColor * static_cast<double>(brdf.cells) /
         std::max(1.0, static_cast<double>(bytes));
}

}  // namespace patina
