#include <sys/inotify.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "daemon/watch/folder_events.h"
#include "formats/base/names.h"

namespace patina::daemon {
namespace {

constexpr uint32_t kMask = IN_CREATE | IN_MODIFY | IN_CLOSE_WRITE | IN_ATTRIB | IN_MOVED_FROM |
                           IN_MOVED_TO | IN_DELETE | IN_DELETE_SELF | IN_MOVE_SELF | IN_ONLYDIR |
                           IN_DONT_FOLLOW | IN_EXCL_UNLINK;

class Inotify : public FolderEvents {
 public:
  explicit Inotify(int fd) : fd_(fd) {}
  ~Inotify() override { close(fd_); }

  Result<int> AddFolder(const std::string& path) override {
    const int watch = inotify_add_watch(fd_, path.c_str(), kMask);
    if (watch >= 0) return watch;
    const int error = errno;
    if (error == ENOSPC || error == ENOMEM) {
      return Fail(ErrorCode::kResourceExhausted,
                  "the kernel's limit on watched folders is reached at " + QuoteForMessage(path));
    }
    const bool gone = error == ENOENT || error == ENOTDIR || error == ELOOP;
    return Fail(gone ? ErrorCode::kNotFound : ErrorCode::kIo,
                "cannot watch " + QuoteForMessage(path) + ": " + std::strerror(error));
  }

  void RemoveFolder(int watch) override { inotify_rm_watch(fd_, watch); }

  int fd() const override { return fd_; }

  bool Read(std::vector<FolderEvent>* events) override {
    bool lost = false;
    // A read takes whole events only; 64 KiB are at least 240 of them.
    alignas(inotify_event) char buffer[65536];
    for (int reads = 0; reads < 16; ++reads) {
      const ssize_t got = read(fd_, buffer, sizeof buffer);
      if (got <= 0) break;
      for (ssize_t at = 0; at < got;) {
        inotify_event event;
        std::memcpy(&event, buffer + at, sizeof event);
        const char* name = buffer + at + sizeof event;
        at += static_cast<ssize_t>(sizeof event + event.len);
        lost = lost || (event.mask & IN_Q_OVERFLOW) != 0;
        if (event.wd >= 0) Append(event, event.len > 0 ? name : "", events);
      }
    }
    return lost;
  }

 private:
  static void Append(const inotify_event& event, std::string name,
                     std::vector<FolderEvent>* events) {
    FolderEvent out;
    out.watch = event.wd;
    out.is_folder = (event.mask & IN_ISDIR) != 0;
    out.name = std::move(name);
    if ((event.mask & (IN_DELETE_SELF | IN_MOVE_SELF | IN_UNMOUNT | IN_IGNORED)) != 0) {
      out.kind = FolderEvent::Kind::kFolderLost;
    } else if (out.name.empty()) {
      // Attributes of the watched folder itself: of interest only for what is in it.
      out.is_folder = true;
    } else if ((event.mask & (IN_CREATE | IN_MOVED_TO)) != 0) {
      out.kind = FolderEvent::Kind::kAppeared;
    } else if ((event.mask & (IN_DELETE | IN_MOVED_FROM)) != 0) {
      out.kind = FolderEvent::Kind::kVanished;
    }
    events->push_back(std::move(out));
  }

  int fd_;
};

}  // namespace

Result<std::unique_ptr<FolderEvents>> OpenInotify() {
  const int fd = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  if (fd >= 0) return std::make_unique<Inotify>(fd);
  const int error = errno;
  if (error == EMFILE) {
    return Fail(ErrorCode::kResourceExhausted,
                "no more inotify instances: the limit is fs.inotify.max_user_instances or the "
                "number of open files");
  }
  return Fail(ErrorCode::kIo, std::string("cannot open inotify: ") + std::strerror(error));
}

}  // namespace patina::daemon
