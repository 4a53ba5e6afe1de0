// File calls of which the N-th fails, and the calls after it, if wanted, too.
#pragma once

#include <atomic>
#include <cerrno>
#include <functional>
#include <string>
#include <vector>

#include "daemon/base/file_calls.h"

namespace patina::daemon::test {

// Passes calls on to the real ones, counting those that may fail for want of space or a broken
// disk: all but Close and Stat.
class FailingFileCalls : public FileCalls {
 public:
  // fail_at: 0 is the first counted call, -1 none. and_all_after: what follows fails as well.
  explicit FailingFileCalls(int fail_at, bool and_all_after = false, int error = ENOSPC)
      : fail_at_(fail_at), and_all_after_(and_all_after), error_(error) {}

  int calls() const { return calls_; }
  // From now on nothing fails.
  void Mend() { fail_at_ = -1; }

  int WriteSynced(const std::string& path, std::span<const uint8_t> bytes) override {
    // A full disk leaves a part of the file.
    if (const int error = Next()) {
      real_.WriteSynced(path, bytes.first(bytes.size() / 2));
      return error;
    }
    return real_.WriteSynced(path, bytes);
  }
  int Sync(const std::string& path) override {
    return Call([&] { return real_.Sync(path); });
  }
  int MakeDirectory(const std::string& path) override {
    return Call([&] { return real_.MakeDirectory(path); });
  }
  int Rename(const std::string& from, const std::string& to) override {
    return Call([&] { return real_.Rename(from, to); });
  }
  int RenameNew(const std::string& from, const std::string& to) override {
    return Call([&] { return real_.RenameNew(from, to); });
  }
  int MakeSymlink(const std::string& target, const std::string& path) override {
    return Call([&] { return real_.MakeSymlink(target, path); });
  }
  int RemoveFile(const std::string& path) override {
    return Call([&] { return real_.RemoveFile(path); });
  }
  int Open(const std::string& path, int flags, mode_t mode, int* fd) override {
    return Call([&] { return real_.Open(path, flags, mode, fd); });
  }
  int Close(int fd) override { return real_.Close(fd); }
  int Read(int fd, std::span<uint8_t> bytes, size_t* done) override {
    return Call([&] { return real_.Read(fd, bytes, done); });
  }
  int Write(int fd, std::span<const uint8_t> bytes) override {
    if (const int error = Next()) {
      real_.Write(fd, bytes.first(bytes.size() / 2));
      return error;
    }
    return real_.Write(fd, bytes);
  }
  int SyncFile(int fd) override {
    return Call([&] { return real_.SyncFile(fd); });
  }
  int Stat(const std::string& path, bool follow, struct stat* info) override {
    return real_.Stat(path, follow, info);
  }
  int List(const std::string& path, size_t max_entries,
           std::vector<DirectoryEntry>* entries) override {
    return Call([&] { return real_.List(path, max_entries, entries); });
  }
  int RemoveDirectory(const std::string& path) override {
    return Call([&] { return real_.RemoveDirectory(path); });
  }
  int RemoveTree(const std::string& path) override {
    return Call([&] { return real_.RemoveTree(path); });
  }

 protected:
  // Before each counted call.
  virtual void OnCall() {}

 private:
  int Next() {
    OnCall();
    const int call = calls_++;
    const int fail_at = fail_at_;
    if (fail_at < 0 || call < fail_at || (call > fail_at && !and_all_after_)) return 0;
    return error_;
  }
  template <class Body>
  int Call(Body body) {
    if (const int error = Next()) return error;
    return body();
  }

  FileCalls& real_ = RealFileCalls();
  std::atomic<int> calls_{0};
  std::atomic<int> fail_at_;
  const bool and_all_after_;
  const int error_;
};

}  // namespace patina::daemon::test
