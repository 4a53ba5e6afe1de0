#include "tests/system/child_process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace patina::testing_support {
namespace {

namespace fs = std::filesystem;

std::string MakeFolder() {
  std::string pattern = testing::TempDir() + "patina_XXXXXX";
  if (mkdtemp(pattern.data()) == nullptr) std::abort();
  return pattern;
}

void Redirect(const std::string& path, int fd) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (file < 0 || ::dup2(file, fd) < 0) ::_exit(126);
}

}  // namespace

Child::Child(const std::vector<std::string>& arguments, const ChildOptions& options)
    : folder_(MakeFolder()) {
  const std::string program = std::string(PATINA_BIN_DIR) + "/patina";
  const std::string out = folder_ + "/out";
  const std::string err = folder_ + "/err";
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = ::fork();
  if (pid_ == 0) {
    Redirect(out, STDOUT_FILENO);
    Redirect(err, STDERR_FILENO);
    if (options.max_file_bytes > 0) {
      const rlimit limit{options.max_file_bytes, options.max_file_bytes};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      ::signal(SIGXFSZ, SIG_IGN);
    }
    ::execv(program.c_str(), argv.data());
    ::_exit(127);
  }
}

Child::~Child() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

void Child::Signal(int signal) const { ::kill(pid_, signal); }

Outcome Child::Wait() {
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  Outcome outcome;
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  outcome.out = ReadAll(folder_ + "/out");
  outcome.err = ReadAll(folder_ + "/err");
  return outcome;
}

Outcome Patina(const std::vector<std::string>& arguments, const ChildOptions& options) {
  return Child(arguments, options).Wait();
}

TempFolder::TempFolder() : path_(MakeFolder()) {}

TempFolder::~TempFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::vector<std::pair<std::string, std::string>> Snapshot(const std::string& folder) {
  std::vector<std::pair<std::string, std::string>> files;
  std::error_code ignored;
  for (const auto& entry : fs::recursive_directory_iterator(folder, ignored)) {
    const std::string name = fs::relative(entry.path(), folder).string();
    if (entry.is_symlink()) {
      files.emplace_back(name, "-> " + fs::read_symlink(entry.path()).string());
    } else if (entry.is_regular_file() && entry.path().filename() != "run.json" &&
               entry.path().filename() != "report.html") {
      files.emplace_back(name, ReadAll(entry.path().string()));
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace patina::testing_support
