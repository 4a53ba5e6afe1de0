// The decoder network: 12 inputs -> 16 hidden (ReLU) -> C outputs, for batches of samples in lanes.
//
//   h = max(0, W1 x + b1)      y = W2 h + b2      (Weinreich 2024, section 5.1)
//
// Parameters are one flat array: W1 [16][12], b1 [16], W2 [C][16], b2 [C], all row-major; modules hold offsets.
// The unit of work is a chunk of 8 vectors of 16 samples: x [12][8][16], h [16][8][16], y [C][8][16].
#pragma once

#include <cstddef>

namespace patina::mlp {

inline constexpr int kInputs = 12;
inline constexpr int kHidden = 16;
inline constexpr int kMaxOutputs = 64;
inline constexpr int kChunkVectors = 8;
inline constexpr int kChunkSamples = 16 * kChunkVectors;

inline constexpr int kW1 = 0;
inline constexpr int kB1 = kHidden * kInputs;
inline constexpr int kW2 = kB1 + kHidden;
constexpr int OffsetB2(int outputs) { return kW2 + outputs * kHidden; }
constexpr int ParameterCount(int outputs) { return OffsetB2(outputs) + outputs; }
inline constexpr int kMaxParameters = ParameterCount(kMaxOutputs);

// Multiply-adds of one sample: forward, and forward + backward to inputs and weights.
constexpr int ForwardMacs(int outputs) { return kHidden * kInputs + outputs * kHidden; }
constexpr int TrainMacs(int outputs) { return 3 * ForwardMacs(outputs); }

// The scalar reference, written like the definition; S is float, double or std::complex<double> (complex step).
// hidden may be null; real parts decide the ReLU.
template <class S>
inline double RealPart(const S& x) {
  if constexpr (requires { x.real(); }) return x.real(); else return static_cast<double>(x);
}

template <class S>
void ForwardReference(const S* params, int outputs, const S x[kInputs], S* y, S* hidden = nullptr) {
  S h[kHidden];
  for (int j = 0; j < kHidden; ++j) {
    h[j] = params[kB1 + j];
    for (int i = 0; i < kInputs; ++i) h[j] += params[kW1 + j * kInputs + i] * x[i];
    if (!(RealPart(h[j]) > 0)) h[j] = S(0);
    if (hidden) hidden[j] = h[j];
  }
  for (int o = 0; o < outputs; ++o) {
    y[o] = params[OffsetB2(outputs) + o];
    for (int j = 0; j < kHidden; ++j) y[o] += params[kW2 + o * kHidden + j] * h[j];
  }
}

// Scratch of one chunk. 64-byte aligned; owned by one worker.
struct alignas(64) Chunk {
  float x[kInputs * kChunkSamples];
  float h[kHidden * kChunkSamples];
  float d[kHidden * kChunkSamples];   // gradient by the hidden pre-activations
  float dx[kInputs * kChunkSamples];  // gradient by the inputs
  float y[kMaxOutputs * kChunkSamples];  // outputs, then their gradients
};

// Sixteen partial sums (one a lane) for each parameter: [parameter][16], in the order of the parameters.
struct alignas(64) GradientLanes {
  float sum[kMaxParameters * 16];
};

}  // namespace patina::mlp
