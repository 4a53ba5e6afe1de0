// A fixed set of workers for data-parallel loops whose results do not depend on the number of workers.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>
#include <type_traits>
#include <vector>

namespace patina {

// Runs loops on `threads` workers, the caller being worker 0. Workers spin briefly between loops, then sleep: a barrier
// between short loops costs about a microsecond. One loop at a time; not reentrant; owned and called by one thread.
class ThreadPool {
 public:
  // threads >= 1; 0 means one for each CPU that this process may use.
  explicit ThreadPool(int threads);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int threads() const { return static_cast<int>(workers_.size()) + 1; }

  // Calls body(index, worker) once for each index in [0, count), in any order, on any worker; returns when all are done.
  // For results independent of the thread count, write by index and reduce in index order afterwards. The body must not
  // throw.
  template <class Body>
  void ParallelFor(int count, Body&& body) {
    using Plain = std::remove_reference_t<Body>;
    Run(count, [](void* context, int index, int worker) { (*static_cast<Plain*>(context))(index, worker); },
        const_cast<void*>(static_cast<const void*>(&body)));
  }

 private:
  using Call = void (*)(void* context, int index, int worker);
  void Run(int count, Call call, void* context);
  void Work(int worker);
  void Drain(int worker);

  std::vector<std::thread> workers_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::atomic<uint64_t> generation_{0};
  std::atomic<int> next_{0};
  std::atomic<int> busy_{0};
  std::atomic<bool> stop_{false};
  int count_ = 0;
  Call call_ = nullptr;
  void* context_ = nullptr;
};

}  // namespace patina
