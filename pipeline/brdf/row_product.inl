// Small matrix products with columns in lanes. Included inside a target section, after simd16.h and
// unroll.h.

namespace patina::PATINA_SIMD {
namespace {

#if defined(PATINA_SIMD_IS_AVX512)
inline constexpr int kTileRows = 8, kTileVectors = 2;
#else
inline constexpr int kTileRows = 4, kTileVectors = 1;
#endif

// A(m, k) = a[m * row + k * step].
struct Strided {
  const float* a;
  ptrdiff_t row, step;
};

// C[m][0..16*kVectors) = sum over k of A(m, k) B[k][..] for kRows rows; kRectify: not below zero.
template <int kRows, int kVectors, bool kRectify>
PATINA_INLINE void ProductTile(const Strided& a, const float* b, ptrdiff_t b_stride, int depth,
                               float* c, ptrdiff_t c_stride) {
  F16 sum[kRows][kVectors];
  Unroll<kRows>([&](auto m) PATINA_LAMBDA {
    Unroll<kVectors>([&](auto n) PATINA_LAMBDA { sum[m][n] = Zero(); });
  });
  const float* left = a.a;
  for (int k = 0; k < depth; ++k, left += a.step, b += b_stride) {
    F16 right[kVectors];
    Unroll<kVectors>([&](auto n) PATINA_LAMBDA { right[n] = Load(b + 16 * n); });
    Unroll<kRows>([&](auto m) PATINA_LAMBDA {
      const F16 value = Set(left[m * a.row]);
      Unroll<kVectors>([&](auto n)
                           PATINA_LAMBDA { sum[m][n] = MulAdd(value, right[n], sum[m][n]); });
    });
  }
  Unroll<kRows>([&](auto m) PATINA_LAMBDA {
    Unroll<kVectors>([&](auto n) PATINA_LAMBDA {
      Store(c + m * c_stride + 16 * n, kRectify ? Max(sum[m][n], Zero()) : sum[m][n]);
    });
  });
}

template <int kVectors, bool kRectify>
PATINA_INLINE void ProductColumns(Strided a, int rows, const float* b, ptrdiff_t b_stride,
                                  int depth, float* c, ptrdiff_t c_stride) {
  for (; rows >= kTileRows; rows -= kTileRows) {
    ProductTile<kTileRows, kVectors, kRectify>(a, b, b_stride, depth, c, c_stride);
    a.a += kTileRows * a.row;
    c += kTileRows * c_stride;
  }
  for (; rows > 0; --rows) {
    ProductTile<1, kVectors, kRectify>(a, b, b_stride, depth, c, c_stride);
    a.a += a.row;
    c += c_stride;
  }
}

// C [rows][columns] = A B, columns a multiple of 16; B and C rows aligned to 64 bytes. kRectify:
// negative sums become zero.
template <bool kRectify>
PATINA_STAGE void RowProduct(const Strided& a, int rows, const float* b, ptrdiff_t b_stride,
                             int depth, int columns, float* c, ptrdiff_t c_stride) {
  int n = 0;
  for (; n + 16 * kTileVectors <= columns; n += 16 * kTileVectors) {
    ProductColumns<kTileVectors, kRectify>(a, rows, b + n, b_stride, depth, c + n, c_stride);
  }
  for (; n < columns; n += 16)
    ProductColumns<1, kRectify>(a, rows, b + n, b_stride, depth, c + n, c_stride);
}

}  // namespace
}  // namespace patina::PATINA_SIMD
