// Shows a person how a job goes: one live line on a terminal, a line now and then elsewhere.
#pragma once

#include <chrono>
#include <cstdio>
#include <string>

#include "pipeline/jobs/event_log.h"

namespace patina {

enum class Verbosity { kQuiet, kNormal, kVerbose };

// "cobblestone: train 63 %, 29.4 M samples/s, 31.2 dB, 11 s left". Numbers that are not known are
// left out.
std::string ProgressLine(const std::string& asset, const ProgressEvent& event);

// "11 s", "2 min 05 s", "1 h 02 min".
std::string DurationText(double seconds);

// "1.77 MB"; powers of ten.
std::string BytesText(double bytes);

class TerminalProgress : public JobObserver {
 public:
  // out is not owned. On a terminal one line is redrawn at most ten times a second; elsewhere a
  // line is written at most every two seconds. kQuiet shows warnings only, kNormal also what was
  // guessed, kVerbose also what was found and ignored and the time of each stage.
  TerminalProgress(std::FILE* out, Verbosity verbosity, std::string asset);

  void OnProgress(const ProgressEvent& event) override;
  void OnWarning(const std::string& message) override;
  void OnStageStarted(const std::string& stage) override;
  void OnNote(const std::string& status, const std::string& message) override;
  void OnStageFinished(const std::string& stage, double seconds) override;
  void OnResult(const JobResult& result) override;

 private:
  using Clock = std::chrono::steady_clock;
  void Draw(const std::string& line);
  void ClearLine();
  void Print(const std::string& line);

  std::FILE* out_;
  Verbosity verbosity_;
  std::string asset_;
  bool live_ = false;
  bool drawn_ = false;
  Clock::time_point last_{};
};

}  // namespace patina
