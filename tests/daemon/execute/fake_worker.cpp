// Stands in for `patina run` where a bake would take too long, or would not misbehave enough: the
// same command line, fence, container and result file, but the container holds the bytes of the
// input. The file `behaviour` in the job's folder says what each attempt does, one line each:
//   ATTEMPT VERB [ARGUMENT]      attempt 0: every one that has no line of its own
//   die STEP    killed at that step: begin, staged, verified, fenced, published, reported
//   fail CODE TEXT   result with exit code 1 and this error code
//   bad         result with exit code 3
//   exit N      ends without a result
//   signal N    kills itself
//   hang        until it is told to end; then says so
//   stubborn    until it is killed
//   wait        until somebody opens the pipe `go` in the job's folder; then all is well
//   child       leaves a process behind that does not end by itself
//   memory N    takes N MB, and says whether it got them
//   cpu         uses CPU time for ever
//   reach PATH  tries to read PATH, to write beside its output, and to open a socket in two ways
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "formats/base/sha256.h"
#include "formats/container.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/jobs/run_guards.h"
#include "tests/formats/sample_container.h"

namespace patina {
namespace {

namespace fs = std::filesystem;

volatile sig_atomic_t told_to_end = 0;

struct Arguments {
  std::string job, events, result;
  RunGuards guards;
};

Arguments Parse(int argc, char** argv) {
  Arguments parsed;
  for (int i = 2; i < argc; ++i) {
    const std::string name = argv[i];
    const auto value = [&] { return i + 1 < argc ? std::string(argv[++i]) : std::string(); };
    if (name == "--events") {
      parsed.events = value();
    } else if (name == "--result") {
      parsed.result = value();
    } else if (name == "--fence") {
      parsed.guards.fence_file = value();
    } else if (name == "--attempt") {
      parsed.guards.attempt = std::atoll(value().c_str());
    } else if (name == "--skip-unchanged") {
      parsed.guards.skip_unchanged = true;
    } else if (name == "--not-revision") {
      parsed.guards.not_revision = value();
    } else {
      parsed.job = name;
    }
  }
  return parsed;
}

struct Behaviour {
  std::string verb, argument, rest;
};

Behaviour BehaviourOf(const std::string& folder, int64_t attempt) {
  std::ifstream file(folder + "/behaviour");
  Behaviour any, own;
  bool has_own = false;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    int64_t number = 0;
    Behaviour behaviour;
    words >> number >> behaviour.verb >> behaviour.argument;
    std::getline(words, behaviour.rest);
    if (number == attempt) {
      own = behaviour;
      has_own = true;
    } else if (number == 0) {
      any = behaviour;
    }
  }
  return has_own ? own : any;
}

class Worker {
 public:
  explicit Worker(Arguments arguments) : arguments_(std::move(arguments)) {}

  int Run() {
    auto job = ReadJobFile(arguments_.job);
    if (!job) return Report(kExitBadInput, job.error());
    job_ = std::move(*job);
    result_.asset = job_.asset;
    behaviour_ = BehaviourOf(job_.folder, arguments_.guards.attempt);
    std::printf("worker of %s, attempt %lld\n", job_.asset.c_str(),
                static_cast<long long>(arguments_.guards.attempt));
    std::fflush(stdout);
    Event("{\"seq\":0,\"time_s\":0,\"type\":\"stage_started\",\"stage\":\"ingest\"}");
    Step("begin");
    const std::optional<int> misbehaved = Misbehave();
    if (misbehaved) return *misbehaved;
    Event("{\"seq\":1,\"time_s\":0,\"type\":\"progress\",\"stage\":\"train\",\"fraction\":0.5}");
    const Status baked = Bake();
    if (!baked) return Report(kExitFailed, baked.error());
    return Report(kExitDone, std::nullopt);
  }

 private:
  void Event(const char* line) {
    std::ofstream file(arguments_.events, std::ios::app);
    file << line << "\n";
  }

  void Step(const char* step) {
    if (behaviour_.verb == "die" && behaviour_.argument == step) ::raise(SIGKILL);
  }

  int Report(int exit_code, std::optional<Error> error) {
    result_.exit_code = exit_code;
    result_.error = std::move(error);
    (void)WriteFileDurably(arguments_.result, JobResultToJson(result_, 2));
    Step("reported");
    return exit_code;
  }

  static ErrorCode CodeOf(const std::string& name) {
    for (int code = 0; code <= static_cast<int>(ErrorCode::kInternal); ++code) {
      if (name == ErrorCodeName(static_cast<ErrorCode>(code))) return static_cast<ErrorCode>(code);
    }
    return ErrorCode::kInternal;
  }

  void WaitForEnd() {
    sigset_t blocked, old;
    sigemptyset(&blocked);
    sigaddset(&blocked, SIGTERM);
    ::sigprocmask(SIG_BLOCK, &blocked, &old);
    while (told_to_end == 0) ::sigsuspend(&old);
  }

  std::optional<int> Misbehave() {
    const std::string& verb = behaviour_.verb;
    const std::string& argument = behaviour_.argument;
    if (verb == "bad")
      return Report(kExitBadInput, Error{ErrorCode::kCorruptData, "the input is bad"});
    if (verb == "fail") return Report(kExitFailed, Error{CodeOf(argument), behaviour_.rest});
    if (verb == "exit") return std::atoi(argument.c_str());
    if (verb == "signal") {
      ::signal(std::atoi(argument.c_str()), SIG_DFL);
      ::raise(std::atoi(argument.c_str()));
    }
    if (verb == "hang") {
      ::signal(SIGTERM, [](int) { told_to_end = 1; });
      Event("{\"seq\":1,\"time_s\":0,\"type\":\"stage_started\",\"stage\":\"train\"}");
      WaitForEnd();
      return Report(kExitInterrupted, Error{ErrorCode::kCancelled, "interrupted"});
    }
    if (verb == "stubborn") {
      ::signal(SIGTERM, SIG_IGN);
      Event("{\"seq\":1,\"time_s\":0,\"type\":\"stage_started\",\"stage\":\"train\"}");
      for (;;) ::pause();
    }
    if (verb == "wait") {
      Event("{\"seq\":1,\"time_s\":0,\"type\":\"stage_started\",\"stage\":\"train\"}");
      std::ifstream(job_.folder + "/go").get();
    }
    if (verb == "child" && ::fork() == 0) {
      ::signal(SIGTERM, SIG_IGN);
      for (;;) ::pause();
    }
    if (verb == "memory") {
      const size_t bytes = static_cast<size_t>(std::atoll(argument.c_str())) << 20;
      void* memory = std::malloc(bytes);
      if (memory == nullptr)
        return Report(kExitFailed, Error{ErrorCode::kResourceExhausted, "not enough memory"});
      std::memset(memory, 1, bytes);
      result_.warnings.push_back("memory at " +
                                 std::to_string(reinterpret_cast<uintptr_t>(memory)));
      std::free(memory);
    }
    if (verb == "cpu") {
      volatile uint64_t count = 0;
      for (;;) count = count + 1;
    }
    if (verb == "reach") {
      const auto tell = [this](const char* what, bool reached) {
        result_.warnings.push_back(std::string(what) + (reached ? " reached" : " refused"));
      };
      tell("file", std::ifstream(argument).good());
      tell("out", std::ofstream(job_.out + "/stray").good());
      tell("socket", ::socket(AF_UNIX, SOCK_STREAM, 0) >= 0);
      ::syscall(0x40000000 | SYS_socket, AF_UNIX, SOCK_STREAM, 0);
      tell("x32", errno != EPERM);
      tell("privileges", ::prctl(PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0) != 1);
    }
    return std::nullopt;
  }

  bool Unchanged() {
    const RunGuards& guards = arguments_.guards;
    if (!guards.skip_unchanged) return false;
    const auto current = OpenContainer(job_.out + "/" + job_.asset + "/current");
    if (!current || current->manifest.fingerprint != result_.fingerprint) return false;
    const std::string revision = fs::path(current->directory).filename().string();
    if (revision == guards.not_revision || !VerifyPayloads(*current)) return false;
    result_.revision = revision;
    result_.container = job_.out + "/" + job_.asset + "/" + revision;
    result_.stopped_by = "unchanged";
    return true;
  }

  Status Bake() {
    PATINA_ASSIGN(const std::string input, ReadTextFile(job_.folder + "/input.png", 1 << 20));
    result_.fingerprint = Sha256Hex(AsBytes(CanonicalJob(job_) + input));
    if (Unchanged()) return {};
    PATINA_ASSIGN(StagingArea staging, StagingArea::Create(job_.out, job_.asset));
    PATINA_TRY(staging.AddPayload("preview.png", "preview", AsBytes(input)));
    Step("staged");
    PATINA_TRY(staging.AddPayload("report.json", "report", AsBytes(result_.fingerprint)));
    Manifest manifest = test::FullManifest();
    manifest.features.clear();
    manifest.network.reset();
    for (ManifestChannel& channel : manifest.channels)
      channel = {channel.map, channel.component, channel.encoding, 0.5f, 0.5f, -1, 0.5f};
    manifest.quality = {};
    manifest.fingerprint = result_.fingerprint;
    PATINA_TRY(staging.WriteManifest(manifest));
    Step("verified");
    std::optional<FenceHold> fence;
    if (!arguments_.guards.fence_file.empty()) {
      PATINA_ASSIGN(FenceHold hold,
                    FenceHold::Acquire(arguments_.guards.fence_file, arguments_.guards.attempt));
      fence.emplace(std::move(hold));
    }
    Step("fenced");
    PATINA_ASSIGN(const PublishedContainer published, staging.Publish());
    Step("published");
    result_.revision = published.revision;
    result_.container = published.directory;
    return {};
  }

  Arguments arguments_;
  Job job_;
  Behaviour behaviour_;
  JobResult result_;
};

}  // namespace
}  // namespace patina

int main(int argc, char** argv) { return patina::Worker(patina::Parse(argc, argv)).Run(); }
