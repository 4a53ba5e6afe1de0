#include "formats/model_bytes.h"

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

}  // namespace patina
