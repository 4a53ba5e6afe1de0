// A flat array aligned for SIMD loads, on huge pages where it is large. Moves only.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>
#include <type_traits>

namespace patina {

template <class T>
class AlignedBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  AlignedBuffer() = default;
  explicit AlignedBuffer(size_t count) { Reset(count); }

  // Replaces the content by `count` elements, all bytes zero. Throws std::bad_alloc as `new` does.
  void Reset(size_t count) {
    memory_.reset();
    count_ = count;
    if (count == 0) return;
    constexpr size_t kHuge = size_t{1} << 21;
    const size_t bytes = count * sizeof(T);
    const size_t alignment = bytes >= kHuge ? kHuge : 64;
    const size_t rounded = (bytes + alignment - 1) / alignment * alignment;
    void* raw = std::aligned_alloc(alignment, rounded);
    if (raw == nullptr) throw std::bad_alloc();
    // A hint: random windows over a 200 MB target miss the TLB on 4 KiB pages.
    if (bytes >= kHuge) (void)madvise(raw, rounded, MADV_HUGEPAGE);
    __builtin_memset(raw, 0, rounded);
    memory_.reset(static_cast<T*>(raw));
  }

  T* data() { return memory_.get(); }
  const T* data() const { return memory_.get(); }
  size_t size() const { return count_; }
  T& operator[](size_t i) { return memory_.get()[i]; }
  const T& operator[](size_t i) const { return memory_.get()[i]; }

 private:
  struct Free {
    void operator()(T* p) const { std::free(p); }
  };
  std::unique_ptr<T, Free> memory_;
  size_t count_ = 0;
};

}  // namespace patina
