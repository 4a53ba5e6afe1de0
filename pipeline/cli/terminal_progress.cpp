#include "pipeline/cli/terminal_progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

namespace patina {
namespace {

template <class... Args>
std::string Format(const char* format, Args... args) {
  char text[160];
  const int n = std::snprintf(text, sizeof text, format, args...);
  return n > 0 ? std::string(text, std::min(static_cast<size_t>(n), sizeof text - 1))
               : std::string();
}

int TerminalColumns(int fd) {
  winsize size{};
  return ioctl(fd, TIOCGWINSZ, &size) == 0 && size.ws_col > 10 ? size.ws_col : 80;
}

}  // namespace

std::string DurationText(double seconds) {
  const double whole = std::max(0.0, std::round(seconds));
  if (seconds < 9.95) return Format("%.1f s", std::max(0.0, seconds));
  if (whole < 60) return Format("%.0f s", whole);
  const auto total = static_cast<long long>(std::min(whole, 1e15));
  if (total < 3600) return Format("%lld min %02lld s", total / 60, total % 60);
  return Format("%lld h %02lld min", total / 3600, total / 60 % 60);
}

std::string BytesText(double bytes) {
  if (bytes < 1e3) return Format("%.0f bytes", bytes);
  if (bytes < 1e6) return Format("%.1f kB", bytes / 1e3);
  if (bytes < 1e9) return Format("%.2f MB", bytes / 1e6);
  return Format("%.2f GB", bytes / 1e9);
}

std::string ProgressLine(const std::string& asset, const ProgressEvent& event) {
  std::string line = asset + ": " + event.stage;
  if (event.fraction >= 0) line += Format(" %.0f %%", 100 * std::min(1.0, event.fraction));
  if (event.samples_per_s > 0) line += Format(", %.1f M samples/s", event.samples_per_s / 1e6);
  if (event.psnr_db > 0) {
    line += Format(", %.1f dB", event.psnr_db);
    if (event.gain_10s_db >= 0.01) line += Format(" (+%.2f in 10 s)", event.gain_10s_db);
  }
  if (event.eta_s >= 0) line += ", " + DurationText(event.eta_s) + " left";
  if (!event.message.empty()) line += ", " + event.message;
  return line;
}

TerminalProgress::TerminalProgress(std::FILE* out, Verbosity verbosity, std::string asset)
    : out_(out), verbosity_(verbosity), asset_(std::move(asset)) {
  const char* term = std::getenv("TERM");
  live_ = isatty(fileno(out)) == 1 && term != nullptr && std::strcmp(term, "dumb") != 0;
}

void TerminalProgress::Draw(const std::string& line) {
  const auto columns = static_cast<size_t>(TerminalColumns(fileno(out_)) - 1);
  std::fprintf(out_, "\r\x1b[K%s", line.substr(0, columns).c_str());
  std::fflush(out_);
  drawn_ = true;
}

void TerminalProgress::ClearLine() {
  if (!drawn_) return;
  std::fprintf(out_, "\r\x1b[K");
  drawn_ = false;
}

void TerminalProgress::Print(const std::string& line) {
  ClearLine();
  std::fprintf(out_, "%s\n", line.c_str());
  std::fflush(out_);
}

void TerminalProgress::OnProgress(const ProgressEvent& event) {
  if (verbosity_ == Verbosity::kQuiet) return;
  const Clock::time_point now = Clock::now();
  if (now - last_ < std::chrono::milliseconds(live_ ? 100 : 2000)) return;
  last_ = now;
  const std::string line = ProgressLine(asset_, event);
  live_ ? Draw(line) : Print(line);
}

void TerminalProgress::OnWarning(const std::string& message) {
  Print("patina: warning: " + asset_ + ": " + message);
}

void TerminalProgress::OnStageStarted(const std::string& stage) {
  if (verbosity_ == Verbosity::kQuiet || !live_) return;
  Draw(asset_ + ": " + stage);
}

void TerminalProgress::OnNote(const std::string& status, const std::string& message) {
  if (verbosity_ == Verbosity::kVerbose ||
      (verbosity_ == Verbosity::kNormal && status == "guessed")) {
    Print(asset_ + ": " + status + " " + message);
  }
}

void TerminalProgress::OnStageFinished(const std::string& stage, double seconds) {
  if (verbosity_ == Verbosity::kVerbose)
    Print(asset_ + ": " + stage + " took " + DurationText(seconds));
}

void TerminalProgress::OnResult(const JobResult&) {
  ClearLine();
  std::fflush(out_);
}

}  // namespace patina
