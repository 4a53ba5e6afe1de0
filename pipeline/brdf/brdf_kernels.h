// The kernels of the BRDF trainer: lookups in the index grid, the network on rows of samples, the
// gradient of the corners.
//
// A batch is cut into chunks of kChunkRows samples. In a chunk, rows are samples and columns are
// features, so that every product of the network, forward and backward, is one small matrix product
// with the columns in lanes and needs no transposition:
//   forward       C[s][n]  = sum_k A[s][k] W[k][n]      bias: a column of ones in A, a last row of
//   W to inputs     dA[s][k] = sum_n dC[s][n] W[k][n] to weights    dW[k][n] = sum_s A[s][k]
//   dC[s][n]
// Sums run in the order of k, n and s on every target, so AVX2 and AVX-512 give the same bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "formats/brdf/brdf_source.h"
#include "pipeline/base/aligned_buffer.h"
#include "pipeline/kernels/dispatch.h"

namespace patina::brdf {

inline constexpr int kChunkRows = 128;
inline constexpr int kMaxExtraInputs = 5;
inline constexpr int kOutputs = 3;  // y of red, green, blue; f = exp(y) - 1
inline constexpr float kMaxLogValue = 12.0f;
inline constexpr float kMaxValue = 162753.79f;  // f at that y

constexpr int PadTo16(int n) { return (n + 15) / 16 * 16; }

// One dense layer in the flat parameter arrays.
struct DenseLayer {
  int inputs = 0;        // columns of A that are used, without the ones
  int outputs = 0;       // columns of C, a multiple of 16
  int input_stride = 0;  // floats between rows of A: PadTo16(inputs + 1)
  size_t weights = 0;    // offset of W [inputs + 1][outputs]
  size_t transposed =
      0;  // offset of its transpose [outputs][PadTo16(inputs)], in an array of its own
};

// Where everything lies. Input columns: features of wi [feature_stride], of wo [feature_stride], of
// the neural texture [texture_stride], then the extra inputs.
struct NetworkLayout {
  NetworkLayout(int primitive_size, int extra_inputs, int hidden, int hidden_layers,
                int texture_inputs = 0);

  int primitive_size;  // k
  int feature_stride;  // k rounded up to 16: floats between rows of features
  int extra_inputs;    // 0, 3 or 5
  int texture_inputs;  // of a spatially varying BRDF, else 0
  int texture_stride;  // texture_inputs rounded up to 16: floats between rows of texels
  int hidden;
  std::vector<DenseLayer> layers;
  size_t parameter_count = 0;
  size_t transposed_count = 0;

  // What a sample looks up, and what gets a gradient.
  int feature_columns() const { return 2 * feature_stride + texture_stride; }
  int input_columns() const { return feature_columns() + extra_inputs; }
  // Multiply-adds of one sample that do work: padding is not counted.
  double ForwardMacs() const;
};

// One training sample, looked up once: corners are rows of the grid of both hemispheres.
struct alignas(32) PoolSample {
  int32_t corner[8];             // four of wi, four of wo
  float weight[8];               // of the corners
  float extra[kMaxExtraInputs];  // the scalar inputs l, t, q, X, Y
  float value[3];                // f, 1/sr
  float cosine;                  // of the direction that is nearer to the normal
  float importance;              // factor of the loss
};

// Where a sample looks up the neural texture: rows of texels of two levels, bilinear in each. Rows
// of weight 0 are rows of the texture, too.
struct alignas(32) TexelTaps {
  int32_t row[8];
  float weight[8];
};

// What a lookup needs to know of the grid; bilinear weights.
struct LookUpGrid {
  int nside = 1;
  int corners = 0;  // of one hemisphere: where those of wo begin
  bool isotropic = true, canonical_order = true, angle_inputs = true, half_vector_inputs = false;
};

// Lookups of a chunk of pairs to evaluate: what PoolSample holds, pairs in lanes. Pairs beyond
// those asked for repeat one of them.
struct PairLookups {
  alignas(64) int32_t corner[8][kChunkRows];
  alignas(64) float weight[8][kChunkRows];
  alignas(64) float extra[kMaxExtraInputs][kChunkRows];
};

// Columns of ones (the biases') are set here and stay.
struct ChunkScratch {
  explicit ChunkScratch(const NetworkLayout& layout);
  std::vector<AlignedBuffer<float>> activations;  // [layer] [kChunkRows][input_stride]
  AlignedBuffer<float> outputs;                   // [kChunkRows][16]
  AlignedBuffer<float> gradient[2];               // [kChunkRows][widest layer], in turn
};

// What a chunk leaves behind for the step that follows.
struct ChunkResult {
  explicit ChunkResult(const NetworkLayout& layout);
  AlignedBuffer<float> weight_gradient;   // like the parameters
  AlignedBuffer<float> feature_gradient;  // [kChunkRows][feature_columns]
  double loss = 0;                        // not finite if an output was not
  bool finite = true;                     // the squares of both gradients are
};

struct ChunkTask {
  const NetworkLayout* layout = nullptr;
  const float* parameters = nullptr;
  const float* transposed = nullptr;
  const float* features = nullptr;         // rows of feature_stride floats
  const int32_t* row_of_corner = nullptr;  // codebook: row of a corner; null: its own
  const PoolSample* samples = nullptr;
  int count = kChunkRows;  // 1..kChunkRows; the rest is computed for nothing
  // Both null where the layout has no texture inputs.
  const float* texture = nullptr;   // rows of texture_stride floats
  const TexelTaps* taps = nullptr;  // of each sample
};

struct AdamSettings {
  float rate = 0;
  float decay = 0;  // of the parameters themselves, per step and rate (AdamW)
  float beta1 = 0.9f, beta2 = 0.99f, epsilon = 1e-8f;
  float correction1 = 1, correction2 = 1;  // 1 / (1 - beta^t)
};

struct BrdfKernels {
  // Forward, loss and backward. Loss of a sample (sum over channels):
  //   |log1p(f c) - log1p(f* c)| + 0.05 |log1p(f) - log1p(f*)|,  f = exp(y) - 1
  void (*train_chunk)(const ChunkTask& task, ChunkScratch* scratch, ChunkResult* result);
  // Forward only: y [kChunkRows][16] into scratch->outputs.
  void (*forward_chunk)(const ChunkTask& task, ChunkScratch* scratch);
  // Corners, weights and scalars of 1..kChunkRows pairs, as LookUpPair (sample_pool.h) gives them
  // within a few roundings. Directions are finite.
  void (*look_up_pairs)(const LookUpGrid& grid, const Direction* wi, const Direction* wo, int count,
                        PairLookups* pairs);
  // forward_chunk without the product of the first layer: it is linear, so its weights may act on
  // the corners' features beforehand. folded: rows of layers[0].outputs floats, W F of each corner,
  // without the bias. Layouts without texture inputs.
  void (*evaluate_chunk)(const NetworkLayout& layout, const float* parameters, const float* folded,
                         const PairLookups& pairs, ChunkScratch* scratch);
  // rgb [count][3] = max(0, exp(min(y, 12)) - 1) of the outputs of forward_chunk, 1..kChunkRows of
  // them; 0 where a direction is not above the horizon.
  void (*output_values)(const float* outputs, const Direction* wi, const Direction* wo, int count,
                        float* rgb);
  // gradient[corner] += weight * feature gradient, for one hemisphere (0: wi, 1: wo), in sample
  // order.
  void (*scatter)(const NetworkLayout& layout, const PoolSample* samples, int count, int hemisphere,
                  const ChunkResult& result, float* gradient);
  // The same for the texels: gradient[row] += weight * texture gradient, rows of texture_stride.
  void (*scatter_texels)(const NetworkLayout& layout, const TexelTaps* taps, int count,
                         const ChunkResult& result, float* gradient);
  // gradient[j] = p_j (s_j - <p, s>) / temperature with p = softmax(logits / temperature) and s_j
  // = <code j, feature gradient>: design/neural-brdf. columns: a multiple of 16; a column of
  // padding has a logit below all others by 1e4 or more. transposed: codebook [stride][columns].
  void (*softmax_gradient)(const float* logits, int columns, float temperature,
                           const float* transposed, const float* feature_gradient, int stride,
                           float* gradient);
  // One Adam step of `count` floats, a multiple of 16; clears the gradient. Returns false if a
  // parameter or moment is not finite afterwards.
  bool (*adam)(float* parameters, float* gradient, float* moment1, float* moment2, size_t count,
               const AdamSettings& settings);
};

const BrdfKernels& KernelsFor(SimdTarget target);

// Fills `transposed` from the parameters.
void TransposeWeights(const NetworkLayout& layout, const float* parameters, float* transposed);

}  // namespace patina::brdf
