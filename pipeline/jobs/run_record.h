// run.json: what a run cost on the machine it ran on. Lies in the container, but is not listed by
// its manifest, because it differs from run to run.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace patina {

struct StageCost {
  std::string stage;
  double seconds = 0;
  double cpu_seconds = 0;
};

// What a training had reached at some moment; the measures are those of the job's kind, by name.
struct RunCurvePoint {
  double samples = 0;
  double seconds = 0;  // from the start of the training
  std::vector<std::pair<std::string, double>> measures;
};

// What accuracy costs where the input is simulated: measured on some pairs of directions.
struct SimulationPoint {
  int paths = 0;              // for each pair
  double standard_error = 0;  // of log(1 + f c), root mean square over the pairs
  double seconds = 0;         // of one thread, for a pair
};

struct RunRecord {
  std::string asset;
  std::string fingerprint;
  std::string version;  // of the program
  std::string cpu;
  int cpus = 0;        // that the process may use
  int threads = 0;     // that it used
  std::string simd;    // "avx2" or "avx512"
  double seconds = 0;  // from the start of the job to the writing of this record
  double cpu_seconds = 0;
  uint64_t peak_memory_bytes = 0;
  double samples = 0;
  double samples_per_s = 0;  // of the train stage as a whole
  std::vector<StageCost> stages;
  double recording_seconds = 0;  // of the training, to measure the curve
  std::vector<RunCurvePoint> curve;
  std::vector<SimulationPoint> simulation;  // empty: nothing is simulated
};

std::string RunRecordToJson(const RunRecord& record);

}  // namespace patina
