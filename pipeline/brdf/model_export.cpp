#include "pipeline/brdf/model_export.h"

#include "formats/half.h"

namespace patina::brdf {
namespace {

// Without the codebook.
IndexPack PackOf(const ModelShape& shape, int material, std::span<const float> usage,
                 const std::vector<int32_t>& index) {
  IndexPack pack;
  pack.nside = shape.grid.nside;
  pack.primitive_size = shape.primitive_size;
  pack.index_bits = shape.index_bits;
  pack.interpolation = shape.grid.interpolation;
  pack.isotropic = shape.grid.isotropic;
  pack.canonical_order = shape.grid.canonical_order;
  pack.angle_inputs = shape.grid.angle_inputs;
  pack.half_vector_inputs = shape.grid.half_vector_inputs;
  const int corners = shape.grid.corners();
  for (int side = 0; side < 2; ++side) {
    pack.stored[side].resize(corners);
    for (int c = 0; c < corners; ++c) {
      const int corner = (2 * material + side) * corners + c;
      pack.stored[side][c] = usage[corner] > 0 ? 1 : 0;
      if (usage[corner] > 0) pack.indices.push_back(static_cast<uint16_t>(index[corner]));
    }
  }
  return pack;
}

// Renumbers the indices; returns the codes that a material uses.
std::vector<int> DropUnusedCodes(int count, std::vector<IndexPack>* packs) {
  std::vector<int> place(static_cast<size_t>(count), -1), codes;
  for (const IndexPack& pack : *packs) {
    for (const uint16_t index : pack.indices) place[index] = 0;
  }
  for (int code = 0; code < count; ++code) {
    if (place[code] < 0) continue;
    place[code] = static_cast<int>(codes.size());
    codes.push_back(code);
  }
  for (IndexPack& pack : *packs) {
    for (uint16_t& index : pack.indices) index = static_cast<uint16_t>(place[index]);
  }
  return codes;
}

// The columns of the first layer's inputs, in the order of decoders.
std::vector<int> InputColumns(const NetworkLayout& layout) {
  std::vector<int> columns;
  for (int side = 0; side < 2; ++side) {
    for (int k = 0; k < layout.primitive_size; ++k)
      columns.push_back(side * layout.feature_stride + k);
  }
  for (int e = 0; e < layout.extra_inputs; ++e) columns.push_back(layout.feature_columns() + e);
  for (int k = 0; k < layout.texture_inputs; ++k) columns.push_back(2 * layout.feature_stride + k);
  return columns;
}

}  // namespace

int CodesOf(const ModelShape& shape) {
  const int indices = 1 << shape.index_bits;
  return indices - indices / 16;
}

Result<WeightBuffer> ExportNetwork(const NetworkLayout& layout, const float* parameters) {
  WeightBuffer network;
  for (size_t l = 0; l < layout.layers.size(); ++l) {
    const DenseLayer& layer = layout.layers[l];
    const bool last = l + 1 == layout.layers.size();
    const int outputs = last ? kOutputs : layout.hidden;
    std::vector<int> columns;
    if (l == 0) {
      columns = InputColumns(layout);
    } else {
      for (int i = 0; i < layout.hidden; ++i) columns.push_back(i);
    }
    WeightTensor weight, bias;
    weight.name = "layer" + std::to_string(l) + ".weight";
    weight.shape = {static_cast<uint32_t>(outputs), static_cast<uint32_t>(columns.size())};
    bias.name = "layer" + std::to_string(l) + ".bias";
    bias.shape = {static_cast<uint32_t>(outputs)};
    const float* w = parameters + layer.weights;
    for (int o = 0; o < outputs; ++o) {
      for (const int i : columns)
        weight.elements.push_back(FloatToHalf(w[static_cast<size_t>(i) * layer.outputs + o]));
      bias.elements.push_back(
          FloatToHalf(w[static_cast<size_t>(layer.inputs) * layer.outputs + o]));
    }
    for (const auto* elements : {&weight.elements, &bias.elements}) {
      for (const uint16_t half : *elements) {
        if (!HalfIsFinite(half))
          return Fail(ErrorCode::kOutOfRange,
                      "a weight of the network does not fit half precision");
      }
    }
    network.tensors.push_back(std::move(weight));
    network.tensors.push_back(std::move(bias));
  }
  return network;
}

std::vector<IndexPack> ExportPacks(const ModelShape& shape, int materials,
                                   std::span<const float> usage, GridTrainer* trainer) {
  std::vector<IndexPack> packs;
  for (int m = 0; m < materials; ++m) packs.push_back(PackOf(shape, m, usage, trainer->index()));
  const std::vector<int> codes = DropUnusedCodes(CodesOf(shape), &packs);
  const size_t stride = PadTo16(shape.primitive_size);
  for (IndexPack& pack : packs) {
    for (const int code : codes) {
      for (int k = 0; k < shape.primitive_size; ++k)
        pack.codebook.push_back(
            FloatToHalf(trainer->codebook()[static_cast<size_t>(code) * stride + k]));
    }
  }
  return packs;
}

}  // namespace patina::brdf
