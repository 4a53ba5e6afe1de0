#include "formats/shader_constants.h"

#include <algorithm>
#include <bit>

#include "formats/base/check.h"
#include "formats/base/little_endian.h"
#include "formats/half.h"

namespace patina {
namespace {

int Fours(int count) { return (count + 3) / 4; }

std::vector<float> Floats(const WeightTensor& tensor) {
  std::vector<float> values;
  values.reserve(tensor.elements.size());
  for (const uint16_t half : tensor.elements) values.push_back(HalfToFloat(half));
  return values;
}

}  // namespace

Result<std::vector<DenseLayer>> DenseLayersOf(const WeightBuffer& buffer, int inputs, int outputs) {
  const auto find = [&](const std::string& name, size_t rank) -> const WeightTensor* {
    for (const WeightTensor& tensor : buffer.tensors) {
      if (tensor.name == name && tensor.shape.size() == rank) return &tensor;
    }
    return nullptr;
  };
  std::vector<DenseLayer> layers;
  int width = inputs;
  for (size_t n = 0; 2 * n < buffer.tensors.size(); ++n) {
    const std::string name = "layer" + std::to_string(n);
    const WeightTensor* weight = find(name + ".weight", 2);
    const WeightTensor* bias = find(name + ".bias", 1);
    if (weight == nullptr || bias == nullptr) {
      return Fail(
          ErrorCode::kCorruptData,
          "there is no " + name + ".weight of two dimensions or no " + name + ".bias of one");
    }
    if (weight->shape[1] != static_cast<uint32_t>(width) || bias->shape[0] != weight->shape[0]) {
      return Fail(ErrorCode::kCorruptData,
                  "the shapes of " + name + " do not fit: " + std::to_string(weight->shape[0]) +
                      " x " + std::to_string(weight->shape[1]) + " and " +
                      std::to_string(bias->shape[0]) + " for " + std::to_string(width) + " inputs");
    }
    DenseLayer layer{width, static_cast<int>(weight->shape[0]), Floats(*weight), Floats(*bias)};
    width = layer.outputs;
    layers.push_back(std::move(layer));
  }
  if (width != outputs) {
    return Fail(ErrorCode::kCorruptData, "the network has " + std::to_string(width) +
                                             " outputs instead of " + std::to_string(outputs));
  }
  return layers;
}

void ShaderConstants::AddLayers(std::span<const DenseLayer> layers,
                                std::span<const int> slot_of_input, int input4) {
  std::vector<int> slots(slot_of_input.begin(), slot_of_input.end());
  for (const DenseLayer& layer : layers) {
    PATINA_CHECK(slots.size() == static_cast<size_t>(layer.inputs));
    const int output4 = Fours(layer.outputs);
    const int first = matrices();
    matrices_.resize(matrices_.size() + static_cast<size_t>(input4) * output4 * 16, 0.0f);
    for (int o = 0; o < layer.outputs; ++o) {
      for (int i = 0; i < layer.inputs; ++i) {
        const int slot = slots[static_cast<size_t>(i)];
        const int matrix = first + o / 4 * input4 + slot / 4;
        matrices_[static_cast<size_t>(matrix) * 16 + static_cast<size_t>(slot % 4 * 4 + o % 4)] =
            layer.weight[static_cast<size_t>(o) * layer.inputs + static_cast<size_t>(i)];
      }
    }
    layers_.push_back({input4, output4, first, AddVectors(layer.bias)});
    width4_ = std::max({width4_, input4, output4});
    input4 = output4;
    slots.resize(static_cast<size_t>(layer.outputs));
    for (size_t i = 0; i < slots.size(); ++i) slots[i] = static_cast<int>(i);
  }
}

int ShaderConstants::AddVectors(std::span<const float> values) {
  const int first = vectors();
  vectors_.insert(vectors_.end(), values.begin(), values.end());
  vectors_.resize((vectors_.size() + 3) / 4 * 4, 0.0f);
  return first;
}

std::vector<uint8_t> ShaderConstants::Bytes() const {
  std::vector<uint8_t> bytes;
  bytes.reserve((matrices_.size() + vectors_.size()) * 4);
  for (const std::vector<float>* values : {&matrices_, &vectors_}) {
    for (const float value : *values) {
      uint8_t word[4];
      StoreLittle32(word, std::bit_cast<uint32_t>(value));
      bytes.insert(bytes.end(), word, word + 4);
    }
  }
  return bytes;
}

}  // namespace patina
