// The container of RGL .bsdf files: named tensors.
//
// "tensor_file\0", u8 major (1), u8 minor, u32 field count; per field u16 name length, name, u16
// ndim, u8 type, u64 offset from the start of the file, u64 shape[ndim]; then the data, row-major,
// little-endian. Each field is aligned to 8 bytes by the writers in use; readers do not need that.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"

namespace patina::brdf {

enum class TensorType : uint8_t {
  kU8 = 1,
  kI8 = 2,
  kU16 = 3,
  kI16 = 4,
  kU32 = 5,
  kI32 = 6,
  kU64 = 7,
  kI64 = 8,
  kF16 = 9,
  kF32 = 10,
  kF64 = 11
};

// Bytes of one element; 0 for a number that is no type.
int TensorTypeBytes(uint8_t type);

struct Tensor {
  std::string name;
  TensorType type = TensorType::kU8;
  std::vector<uint64_t> shape;     // sides of 1 and more
  uint64_t count = 0;              // elements
  uint64_t offset = 0;             // in the file, for messages
  std::span<const uint8_t> bytes;  // of the file's buffer

  // An element as a number; kU64 and kI64 rounded. index < count.
  double At(uint64_t index) const;
};

struct TensorFile {
  std::vector<Tensor> tensors;

  const Tensor* Find(const std::string& name) const;  // or null
};

inline constexpr uint32_t kMaxTensorFields = 64;
inline constexpr int kMaxTensorRank = 8;

// Tensors point into `bytes`. `name` begins the messages. Errors: kCorruptData, kUnsupported (a
// later major version).
Result<TensorFile> ParseTensorFile(std::span<const uint8_t> bytes, const std::string& name);

// A tensor to be written; `data` has the elements in the file's own form.
struct TensorToWrite {
  std::string name;
  TensorType type = TensorType::kU8;
  std::vector<uint64_t> shape;
  std::vector<uint8_t> data;
};

TensorToWrite FloatTensor(const std::string& name, std::vector<uint64_t> shape,
                          std::span<const float> values);
TensorToWrite ByteTensor(const std::string& name, std::span<const uint8_t> values);

// The bytes of a tensor file, version 1.0, data aligned to 8 bytes, nothing behind the last tensor.
std::vector<uint8_t> EncodeTensorFile(std::span<const TensorToWrite> tensors);

}  // namespace patina::brdf
