// RGL files taken apart and changed, for tests.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/brdf/tensor_file.h"

namespace patina::brdf {

// The tensors of a file of our own writer.
inline std::vector<TensorToWrite> TensorsOf(std::span<const uint8_t> bytes) {
  std::vector<TensorToWrite> tensors;
  const auto file = ParseTensorFile(bytes, "own");
  for (const Tensor& tensor : file->tensors)
    tensors.push_back(
        {tensor.name, tensor.type, tensor.shape, {tensor.bytes.begin(), tensor.bytes.end()}});
  return tensors;
}

// The tensor of a name; added if there is none.
inline TensorToWrite& Named(std::vector<TensorToWrite>& tensors, const std::string& name) {
  for (TensorToWrite& tensor : tensors) {
    if (tensor.name == name) return tensor;
  }
  tensors.push_back({name, TensorType::kU8, {}, {}});
  return tensors.back();
}

}  // namespace patina::brdf
