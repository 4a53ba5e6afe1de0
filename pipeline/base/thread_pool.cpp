#include "pipeline/base/thread_pool.h"

#include <immintrin.h>
#include <sched.h>

#include <algorithm>

namespace patina {
namespace {

// About 20 microseconds: longer than the serial part between two training steps, shorter than anybody's patience.
constexpr int kSpins = 2000;

// Denormals cost two orders of magnitude in speed and nothing in quality: every worker flushes them, so that a loop
// gives the same bits on whichever worker it runs.
void FlushDenormals() { _mm_setcsr(_mm_getcsr() | 0x8040); }

int UsableCpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof set, &set) == 0) return std::max(1, CPU_COUNT(&set));
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

}  // namespace

ThreadPool::ThreadPool(int threads) {
  if (threads <= 0) threads = UsableCpus();
  for (int worker = 1; worker < threads; ++worker) workers_.emplace_back([this, worker] { Work(worker); });
}

ThreadPool::~ThreadPool() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
    generation_.fetch_add(1);
  }
  wake_.notify_all();
  for (auto& worker : workers_) worker.join();
}

void ThreadPool::Run(int count, Call call, void* context) {
  if (count <= 0) return;
  const unsigned saved = _mm_getcsr();
  FlushDenormals();
  count_ = count;
  call_ = call;
  context_ = context;
  next_.store(0, std::memory_order_relaxed);
  if (count > 1 && !workers_.empty()) {
    busy_.store(static_cast<int>(workers_.size()), std::memory_order_relaxed);
    {
      std::lock_guard lock(mutex_);
      generation_.fetch_add(1, std::memory_order_release);
    }
    wake_.notify_all();
    Drain(0);
    for (int spins = 0; busy_.load(std::memory_order_acquire) != 0; ++spins) {
      // A worker that another program pushed off its core gets this one.
      if (spins < kSpins) _mm_pause(); else std::this_thread::yield();
    }
  } else {
    Drain(0);
  }
  _mm_setcsr(saved);
}

void ThreadPool::Drain(int worker) {
  for (int index; (index = next_.fetch_add(1, std::memory_order_relaxed)) < count_;) call_(context_, index, worker);
}

void ThreadPool::Work(int worker) {
  FlushDenormals();
  uint64_t seen = 0;
  for (;;) {
    uint64_t now = seen;
    for (int spins = 0; spins < kSpins; ++spins) {
      now = generation_.load(std::memory_order_acquire);
      if (now != seen) break;
      _mm_pause();
    }
    if (now == seen) {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [&] { return generation_.load(std::memory_order_acquire) != seen; });
      now = generation_.load(std::memory_order_acquire);
    }
    seen = now;
    if (stop_) return;
    Drain(worker);
    busy_.fetch_sub(1, std::memory_order_release);
  }
}

}  // namespace patina
