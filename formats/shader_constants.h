// The numbers of a network as shaders read them: 4 x 4 matrices and vectors of four, in the layout
// that std140 and HLSL's constant buffers share.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/weights.h"

namespace patina {

// y = bias + weight x.
struct DenseLayer {
  int inputs = 0;
  int outputs = 0;
  std::vector<float> weight;  // [output][input]
  std::vector<float> bias;    // [output]
};

// The tensors `layer<n>.weight` and `layer<n>.bias`, n = 0, 1, ... Errors: kCorruptData if there
// are other tensors, the shapes do not follow each other, or the first and last width are not
// these.
Result<std::vector<DenseLayer>> DenseLayersOf(const WeightBuffer& buffer, int inputs, int outputs);

class ShaderConstants {
 public:
  // Adds the layers. The network's input i stands in component slot_of_input[i] of the shader's
  // input, which has input4 vectors of four; components without an input have weights of zero.
  void AddLayers(std::span<const DenseLayer> layers, std::span<const int> slot_of_input,
                 int input4);
  // Adds values in vectors of four, filled with zeros; returns the index of the first vector.
  int AddVectors(std::span<const float> values);

  int matrices() const { return static_cast<int>(matrices_.size() / 16); }
  int vectors() const { return static_cast<int>(vectors_.size() / 4); }
  // Vectors of four that hold the widest layer.
  int width4() const { return width4_; }
  // (input4, output4, first matrix, first vector) of each layer.
  const std::vector<std::array<int, 4>>& layers() const { return layers_; }

  // All matrices, column by column, then all vectors: floats, little-endian. A matrix maps four
  // inputs (its columns) to four outputs; a layer's are [output4][input4].
  std::vector<uint8_t> Bytes() const;

 private:
  std::vector<float> matrices_;
  std::vector<float> vectors_;
  std::vector<std::array<int, 4>> layers_;
  int width4_ = 0;
};

}  // namespace patina
