// How a long stage says where it is, and how it is told to stop.
#pragma once

#include <atomic>
#include <string>

namespace patina {

// One report of a running stage. Unknown numbers are negative (fraction, eta_s) or zero.
struct ProgressEvent {
  std::string stage;        // "ingest", "reference", "train", "compress", "package", "verify", "report", "publish"
  double fraction = -1;     // of the stage, 0..1
  double elapsed_s = 0;     // since the stage began
  double eta_s = -1;        // to the end of the stage
  double samples = 0;       // training samples so far
  double samples_per_s = 0;
  double psnr_db = 0;       // quality so far on held-out samples; 0 if not measured yet
  double gain_10s_db = 0;   // expected of the next 10 seconds, or of the rest of the stage; 0 if not known yet
  std::string message;      // free text for a person; may be empty
};

// Receives reports on the thread that runs the job. Must not block for long.
class ProgressSink {
 public:
  virtual ~ProgressSink() = default;
  virtual void OnProgress(const ProgressEvent& event) = 0;
  virtual void OnWarning(const std::string& message) = 0;
};

// Swallows everything.
ProgressSink& NoProgress();

// Set from a signal handler or another thread; long loops look at it at least ten times a second.
class CancelToken {
 public:
  void Cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }

 private:
  std::atomic<bool> cancelled_{false};
};

}  // namespace patina
