// decoder.weights: the network of a container as named half-precision tensors. Byte table:
// FORMATS.md.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina {

inline constexpr uint32_t kWeightsVersion = 1;
inline constexpr int kWeightsAlignment = 64;  // of every tensor in the file, bytes
inline constexpr uint64_t kMaxWeightsBytes = uint64_t{1} << 24;

struct WeightTensor {
  std::string name;  // 1..31 bytes of printable ASCII without spaces, unique in the buffer
  std::vector<uint32_t> shape;     // 1..4 dimensions, each at least 1, outermost first
  std::vector<uint16_t> elements;  // bits of halves, row-major; all finite
};

struct WeightBuffer {
  std::vector<WeightTensor> tensors;  // 1..64, in file order
};

// The bytes of a weight buffer. Errors: kInvalidArgument (a broken rule of WeightTensor or
// WeightBuffer).
Result<std::vector<uint8_t>> EncodeWeights(const WeightBuffer& buffer);

// Errors: kCorruptData, with a message that starts with "bad magic", "bad header", "bad tensor",
// "truncated", "trailing bytes", "bad checksum" or "non-finite weight"; kUnsupported for a newer
// version or another element type.
Result<WeightBuffer> ParseWeights(std::span<const uint8_t> bytes);

Status WriteWeights(const std::string& path, const WeightBuffer& buffer);
Result<WeightBuffer> ReadWeights(const std::string& path);

// The network 12 -> 16 -> C (or other sizes) of a material: y = w2 relu(w1 x + b1) + b2.
struct NetworkWeights {
  int inputs = 0;
  int hidden = 0;
  int outputs = 0;
  std::vector<float> w1;  // [hidden][inputs], row-major
  std::vector<float> b1;  // [hidden]
  std::vector<float> w2;  // [outputs][hidden]
  std::vector<float> b2;  // [outputs]
};

// As tensors "layer0.weight" [hidden][inputs], "layer0.bias" [hidden], "layer1.weight"
// [outputs][hidden] and "layer1.bias" [outputs]; values are rounded to the nearest half. Errors:
// kInvalidArgument (wrong vector sizes, a value that is not finite as a half).
Result<WeightBuffer> PackNetwork(const NetworkWeights& network);

// Errors: kCorruptData (a tensor missing, unknown or of a shape that does not match the others).
Result<NetworkWeights> UnpackNetwork(const WeightBuffer& buffer);

// CRC-32 as in zlib and PNG: polynomial 0xEDB88320 reflected, start and final exclusive or
// 0xFFFFFFFF. `crc` continues an earlier call.
uint32_t Crc32(std::span<const uint8_t> bytes, uint32_t crc = 0);

}  // namespace patina
