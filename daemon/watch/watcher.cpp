#include "daemon/watch/watcher.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <mutex>
#include <optional>
#include <thread>

#include "daemon/base/unique_fd.h"
#include "daemon/watch/watch_core.h"

namespace patina::daemon {
namespace {

constexpr int64_t kNsPerSecond = 1000000000;
constexpr int kStatusTries = 200;  // a millisecond each

int64_t NowNs() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kNsPerSecond + now.tv_nsec;
}

class WatcherThread : public Watcher {
 public:
  WatcherThread(const WatchOptions& options, WatchHandlers handlers)
      : options_(options), handlers_(std::move(handlers)) {}

  ~WatcherThread() override {
    stopping_ = true;
    Wake();
    if (thread_.joinable()) thread_.join();
  }

  Status Begin() {
    timer_ = UniqueFd(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
    wake_ = UniqueFd(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC));
    epoll_ = UniqueFd(epoll_create1(EPOLL_CLOEXEC));
    if (!timer_ || !wake_ || !epoll_) {
      return Fail(ErrorCode::kResourceExhausted,
                  std::string("cannot begin to watch: ") + std::strerror(errno));
    }
    if (options_.mode != WatchMode::kPolling) {
      // Without it everything is polled, and the status says so.
      if (auto events = OpenInotify()) events_ = std::move(*events);
    }
    for (const int fd : {timer_.get(), wake_.get(), events_ ? events_->fd() : -1}) {
      epoll_event event{};
      event.events = EPOLLIN;
      if (fd >= 0 && epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0)
        return Fail(ErrorCode::kIo, std::string("cannot begin to watch: ") + std::strerror(errno));
    }
    core_.emplace(options_, events_.get(), FileSystemKindAt);
    PATINA_TRY(core_->Open(NowNs()));
    status_ = core_->status();
    thread_ = std::thread([this] { Run(); });
    return {};
  }

  WatchStatus status() const override {
    // A look at a disk that does not answer must not keep whoever asks how we are.
    // (Tries, as the thread sanitizer of g++ 12 does not know timed locks.)
    std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
    for (int i = 0; i < kStatusTries && !lock; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      lock.try_lock();
    }
    const std::lock_guard<std::mutex> status_lock(status_mutex_);
    if (lock) status_ = core_->status();
    return status_;
  }

  std::vector<WatchedAsset> assets() const override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return core_->assets(NowNs());
  }

  void RequestRescan() override {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      core_->RequestRescan(NowNs());
    }
    Wake();
  }

 private:
  void Wake() {
    const uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = write(wake_.get(), &one, sizeof one);
  }

  void Run() {
    std::vector<FolderEvent> events;
    while (!stopping_) {
      int64_t deadline_ns = 0;
      bool scanned = false;
      WatchCore::Outcome outcome;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        events.clear();
        const bool lost = events_ && events_->Read(&events);
        const int64_t now_ns = NowNs();
        if (lost || !events.empty()) core_->OnEvents(events, lost, now_ns);
        outcome = core_->OnTime(now_ns);
        scanned = core_->HasScanned();
        deadline_ns = core_->NextDeadline();
      }
      Tell(outcome, scanned);
      // What was handed over may be due again.
      if (!outcome.ready.empty()) continue;
      Sleep(deadline_ns);
    }
  }

  void Tell(const WatchCore::Outcome& outcome, bool scanned) {
    for (const ReadyAsset& asset : outcome.gone) {
      if (handlers_.on_gone) handlers_.on_gone(asset);
    }
    for (const ReadyAsset& asset : outcome.ready) {
      if (stopping_) return;
      const Status status = handlers_.on_ready(asset);
      const std::lock_guard<std::mutex> lock(mutex_);
      core_->HandedOver(asset, status, NowNs());
    }
    if (scanned && !told_scanned_) {
      told_scanned_ = true;
      if (handlers_.on_scanned) handlers_.on_scanned();
    }
  }

  void Sleep(int64_t deadline_ns) {
    const bool at_once = deadline_ns <= NowNs();
    if (!at_once) {
      itimerspec timer{};
      timer.it_value.tv_sec = static_cast<time_t>(deadline_ns / kNsPerSecond);
      timer.it_value.tv_nsec = static_cast<long>(deadline_ns % kNsPerSecond);
      timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &timer, nullptr);
    }
    epoll_event ready[4];
    const int count = epoll_wait(epoll_.get(), ready, 4, at_once ? 0 : -1);
    if (count <= 0) return;
    uint64_t ignored = 0;
    [[maybe_unused]] ssize_t got = read(timer_.get(), &ignored, sizeof ignored);
    got = read(wake_.get(), &ignored, sizeof ignored);
  }

  WatchOptions options_;
  WatchHandlers handlers_;
  UniqueFd timer_, wake_, epoll_;
  std::unique_ptr<FolderEvents> events_;
  mutable std::mutex mutex_;         // over core_ and events_
  mutable std::mutex status_mutex_;  // over status_, taken after mutex_
  mutable WatchStatus status_;       // as it was when nobody was at work last
  std::optional<WatchCore> core_;
  std::atomic<bool> stopping_{false};
  bool told_scanned_ = false;
  std::thread thread_;
};

}  // namespace

Result<std::unique_ptr<Watcher>> Watcher::Start(const WatchOptions& options,
                                                WatchHandlers handlers) {
  auto watcher = std::make_unique<WatcherThread>(options, std::move(handlers));
  PATINA_TRY(watcher->Begin());
  return std::unique_ptr<Watcher>(std::move(watcher));
}

}  // namespace patina::daemon
