// Runs the real program, as a shell would.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace patina::testing_support {

struct Outcome {
  int exit_code = -1;  // or 128 + signal
  std::string out;
  std::string err;
};

struct ChildOptions {
  uint64_t max_file_bytes =
      0;  // files may not grow beyond this (RLIMIT_FSIZE), as on a full disk; 0: no limit
};

// A running `patina`. Its output goes to files, so that it never waits for a reader.
class Child {
 public:
  explicit Child(const std::vector<std::string>& arguments, const ChildOptions& options = {});
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void Signal(int signal) const;
  Outcome Wait();

 private:
  pid_t pid_ = -1;
  std::string folder_;
};

// Runs `patina` to its end.
Outcome Patina(const std::vector<std::string>& arguments, const ChildOptions& options = {});

// A new folder below the test's temporary directory, removed with the object.
class TempFolder {
 public:
  TempFolder();
  ~TempFolder();
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::string ReadAll(const std::string& path);

// All files below a folder, with their content, but for run.json and report.html, in which times
// stand.
std::vector<std::pair<std::string, std::string>> Snapshot(const std::string& folder);

}  // namespace patina::testing_support
