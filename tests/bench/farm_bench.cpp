// What a farm of 10,000 jobs on 1,000 nodes asks of the daemon: its queue, its executor for Slurm
// and its files are the real ones, the farm is simulated. Called as sbatch, squeue or scancel (the
// links that it makes for itself) this program is that farm's; a thread stands in for the workers.
//
// usage: patina_farm_bench [FOLDER [JOBS [NODES [SECONDS]]]]
//   FOLDER decides which disk; SECONDS is how long a job takes (default: . 10000 1000 10)
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/file.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "daemon/execute/command_runner.h"
#include "daemon/execute/slurm_commands.h"
#include "daemon/make_executor.h"
#include "daemon/service/daemon_service.h"

namespace {

using namespace patina::daemon;
namespace fs = std::filesystem;

// ---- The farm

struct SimulatedJob {
  int64_t taken_ms = 0, end_ms = 0;
  std::string name, folder;
  bool runs = false;
};

// In the order of submission each job takes the node that is free first, once the farm is open.
std::vector<SimulatedJob> ReadJobs(const std::string& farm) {
  int64_t nodes = 1, lasts_ms = 0, open_ms = 0;
  std::ifstream(farm + "/size") >> nodes >> lasts_ms;
  if (!(std::ifstream(farm + "/open") >> open_ms))
    open_ms = std::numeric_limits<int64_t>::max() / 2;
  std::vector<SimulatedJob> jobs;
  std::ifstream file(farm + "/jobs");
  for (SimulatedJob job; file >> job.taken_ms >> job.name >> job.folder;) {
    const size_t before = jobs.size() - std::min(jobs.size(), static_cast<size_t>(nodes));
    const int64_t free_ms = jobs.size() < static_cast<size_t>(nodes) ? 0 : jobs[before].end_ms;
    const int64_t start_ms = std::max({job.taken_ms, free_ms, open_ms});
    job.runs = start_ms <= SystemClock().WallMs();
    job.end_ms = start_ms + lasts_ms;
    jobs.push_back(job);
  }
  return jobs;
}

std::string ValueOf(const std::string& option, int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.rfind(option + "=", 0) == 0) return word.substr(option.size() + 1);
  }
  return "";
}

int Submit(const std::string& farm, int argc, char** argv) {
  std::ostringstream line;
  line << SystemClock().WallMs() << " " << ValueOf("--job-name", argc, argv) << " "
       << ValueOf("--chdir", argc, argv) << "\n";
  const std::string text = line.str();
  // The size of the file, in lines of the same length, would be the id; the name is one, too.
  const int fd = ::open((farm + "/jobs").c_str(), O_WRONLY | O_APPEND | O_CREAT, 0600);
  if (fd < 0 || ::write(fd, text.data(), text.size()) != static_cast<ssize_t>(text.size()))
    return 1;
  const std::string name = ValueOf("--job-name", argc, argv);
  std::printf("%lld\n", std::atoll(name.c_str() + std::string("patina-").size()));
  return 0;
}

int Tell(const std::string& farm) {
  const int64_t now = SystemClock().WallMs();
  for (const SimulatedJob& job : ReadJobs(farm)) {
    std::printf("%lld|%s|0|%s|None|%s|%s|\n",
                std::atoll(job.name.c_str() + std::string("patina-").size()),
                now >= job.end_ms ? "COMPLETED"
                : job.runs        ? "RUNNING"
                                  : "PENDING",
                job.runs ? "node" : "", job.name.c_str(), job.folder.c_str());
  }
  return 0;
}

// ---- The workers

// What `patina run` leaves when it is done.
void LeaveResult(const SimulatedJob& job, const std::string& out) {
  const std::string number = job.name.substr(7, job.name.rfind("-a") - 7);
  const std::string revision = out + "/asset" + number + "/r0001";
  fs::create_directories(revision);
  std::ofstream(revision + "/manifest.json") << "{}";
  std::ofstream(job.folder + "/result.tmp") << R"({"exit_code": 0, "revision": "r0001"})";
  fs::rename(job.folder + "/result.tmp", job.folder + "/result.json");
}

void Work(const std::string& farm, const std::string& out, const std::atomic<bool>* stop) {
  std::vector<bool> begun, done;
  while (!*stop) {
    const int64_t now = SystemClock().WallMs();
    const std::vector<SimulatedJob> jobs = ReadJobs(farm);
    begun.resize(jobs.size());
    done.resize(jobs.size());
    for (size_t i = 0; i < jobs.size(); ++i) {
      if (jobs[i].runs && !begun[i]) {
        begun[i] = true;
        std::ofstream(jobs[i].folder + "/events.ndjson")
            << R"({"type":"progress","stage":"train","fraction":0.5})"
            << "\n";
      }
      if (now >= jobs[i].end_ms && !done[i]) {
        done[i] = true;
        LeaveResult(jobs[i], out);
      }
    }
    ::poll(nullptr, 0, 200);
  }
}

// ---- The daemon

double CpuSeconds() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Phase {
  const char* name;
  int64_t begin_ms = SystemClock().SteadyMs();
  double begin_cpu = CpuSeconds();

  void Print(int64_t things, double longest_step_ms) const {
    const double seconds = static_cast<double>(SystemClock().SteadyMs() - begin_ms) / 1000;
    std::printf("%-34s %8.1f s %9.0f a second, CPU share %5.1f %%, longest step %6.0f ms\n", name,
                seconds, static_cast<double>(things) / seconds,
                100 * (CpuSeconds() - begin_cpu) / seconds, longest_step_ms);
  }
};

// Steps as the service's own thread does; returns the longest, in ms.
double RunUntil(DaemonService& service, Executor& executor, const std::function<bool()>& done) {
  double longest_ms = 0;
  for (int64_t next_look_ms = 0;;) {
    const int64_t before = SystemClock().SteadyMs();
    const int wait = service.Step();
    const int64_t now = SystemClock().SteadyMs();
    longest_ms = std::max(longest_ms, static_cast<double>(now - before));
    if (now >= next_look_ms) {
      next_look_ms = now + 1000;
      if (done()) return longest_ms;
    }
    pollfd ready{executor.poll_fd(), POLLIN, 0};
    ::poll(&ready, 1, wait < 0 || wait > 1000 ? 1000 : wait);
  }
}

// The median of seven rounds, from the call to what it means.
double PollSeconds(const FarmCommands& commands, size_t* jobs) {
  std::vector<double> seconds;
  for (int run = 0; run < 7; ++run) {
    auto runner = CommandRunner::Create(SystemClock());
    if (!runner) return -1;
    const auto start = std::chrono::steady_clock::now();
    const std::vector<StatusCall> calls = commands.Status({}, {});
    runner->Start(calls[0].words, 60000);
    std::vector<CommandOutcome> ended;
    while ((ended = runner->Poll()).empty()) {
      pollfd ready{runner->poll_fd(), POLLIN, 0};
      ::poll(&ready, 1, 1000);
    }
    const auto parsed = commands.ParseStatus(calls[0], ended[0].out);
    *jobs = parsed ? parsed->size() : 0;
    seconds.push_back(
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(seconds.begin(), seconds.end());
  return seconds[seconds.size() / 2];
}

int Run(const std::string& folder, int64_t jobs, int64_t nodes, int64_t lasts_s) {
  const std::string farm = folder + "/farm";
  for (const char* made : {"bin", "farm", "in", "out", "state/jobs"})
    fs::create_directories(folder + "/" + made);
  std::ofstream(farm + "/size") << nodes << " " << 1000 * lasts_s;
  const fs::path self = fs::read_symlink("/proc/self/exe");
  for (const char* name : {"sbatch", "squeue", "scancel"})
    fs::create_symlink(self, folder + "/bin/" + name);
  ::setenv("PATH", (folder + "/bin:" + ::getenv("PATH")).c_str(), 1);
  ::setenv("PATINA_FARM_BENCH", farm.c_str(), 1);

  Config config;
  config.state_dir = folder + "/state";
  config.out = folder + "/out";
  config.input_roots = {folder + "/in"};
  config.worker = "/usr/bin/true";
  config.cores = 1;
  config.executor.kind = ExecutorKind::kSlurm;
  config.executor.jobs = static_cast<int>(jobs);
  auto store = JobStore::Open(folder + "/state/queue.db");
  auto executor = MakeExecutor(config, {}, RealFileCalls(), SystemClock(), NoLog());
  if (!store || !executor) return 1;
  auto service = DaemonService::Create(
      {**store, **executor, RealFileCalls(), SystemClock(), NoLog()}, config, 1);
  if (!service) return 1;

  Phase accepting{"accepted (one commit each)"};
  for (int64_t i = 1; i <= jobs; ++i) {
    SubmitRequest request;
    request.job.asset = "asset" + std::to_string(i);
    request.job.folder = folder + "/in";
    if (!(*service)->Submit(request)) return 1;
  }
  accepting.Print(jobs, 0);

  std::atomic<bool> stop{false};
  std::thread workers(Work, farm, config.out, &stop);
  Phase starting{"submitted (one commit each)"};
  double longest = RunUntil(**service, **executor, [&] {
    return fs::exists(farm + "/jobs") && static_cast<int64_t>(ReadJobs(farm).size()) >= jobs;
  });
  starting.Print(jobs, longest);

  const auto commands = MakeSlurmCommands({});
  size_t told = 0;
  const double poll = PollSeconds(*commands, &told);
  std::printf("%-34s %8.3f s (median of 7; %zu jobs told)\n", "one poll", poll, told);

  Phase waiting{"all wait on the farm"};
  const int64_t until_ms = SystemClock().SteadyMs() + 20000;
  longest = RunUntil(**service, **executor, [&] { return SystemClock().SteadyMs() >= until_ms; });
  waiting.Print(0, longest);
  std::ofstream(farm + "/open") << SystemClock().WallMs();
  Phase ending{"run and ended (one commit each)"};
  longest = RunUntil(**service, **executor, [&] {
    const auto counts = (*store)->Counts();
    return counts && counts->of(JobState::kSucceeded) >= jobs;
  });
  ending.Print(jobs, longest);
  stop = true;
  workers.join();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  ::setvbuf(stdout, nullptr, _IOLBF, 0);
  if (const char* farm = ::getenv("PATINA_FARM_BENCH")) {
    const std::string name = fs::path(argv[0]).filename();
    return name == "sbatch" ? Submit(farm, argc, argv) : name == "squeue" ? Tell(farm) : 0;
  }
  const auto number = [&](int i, int64_t otherwise) {
    return argc > i ? std::max<int64_t>(1, std::atoll(argv[i])) : otherwise;
  };
  std::string folder =
      fs::absolute(std::string(argc > 1 ? argv[1] : ".") + "/patina_farm_bench_XXXXXX");
  if (::mkdtemp(folder.data()) == nullptr) {
    std::perror("farm_bench");
    return 1;
  }
  const int result = Run(folder, number(2, 10000), number(3, 1000), number(4, 10));
  fs::remove_all(folder);
  return result;
}
