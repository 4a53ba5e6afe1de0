#include "pipeline/client/client_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "pipeline/jobs/job_result.h"

namespace patina {
namespace {

using Json = nlohmann::json;

// A file name may hold anything, and a terminal obeys some of it.
std::string Printable(std::string text) {
  for (char& c : text) c = (c >= 0 && c < ' ') || c == 0x7F ? '?' : c;
  return text;
}

std::string Text(const Json& object, const char* key) {
  if (!object.is_object()) return "";
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? Printable(found->get<std::string>()) : "";
}

double Number(const Json& object, const char* key, double absent) {
  if (!object.is_object()) return absent;
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : absent;
}

int64_t Integer(const Json& object, const char* key) {
  if (!object.is_object()) return 0;
  const auto found = object.find(key);
  return found != object.end() && found->is_number_integer() ? found->get<int64_t>() : 0;
}

bool Flag(const Json& object, const char* key) {
  if (!object.is_object()) return false;
  const auto found = object.find(key);
  return found != object.end() && found->is_boolean() && found->get<bool>();
}

const Json& Member(const Json& object, const char* key) {
  static const Json kNothing;
  if (!object.is_object()) return kNothing;
  const auto found = object.find(key);
  return found != object.end() ? *found : kNothing;
}

template <class... Args>
std::string Format(const char* format, Args... args) {
  char text[200];
  const int n = std::snprintf(text, sizeof text, format, args...);
  return n > 0 ? std::string(text, std::min(static_cast<size_t>(n), sizeof text - 1))
               : std::string();
}

std::string Duration(double seconds) {
  if (seconds < 9.95) return Format("%.1f s", std::max(0.0, seconds));
  const auto whole = static_cast<long long>(std::min(std::round(seconds), 1e15));
  if (whole < 60) return Format("%lld s", whole);
  if (whole < 3600) return Format("%lld min %02lld s", whole / 60, whole % 60);
  return Format("%lld h %02lld min", whole / 3600, whole / 60 % 60);
}

std::string ProgressText(const Json& progress) {
  std::string text = Text(progress, "stage");
  const double fraction = Number(progress, "fraction", -1);
  if (fraction >= 0) text += Format(" %.0f %%", 100 * std::min(1.0, fraction));
  const double psnr = Number(progress, "psnr_db", 0);
  const double gain = Number(progress, "gain_10s_db", 0);
  if (psnr > 0) text += Format(", %.1f dB", psnr);
  if (psnr > 0 && gain >= 0.01) text += Format(" (+%.2f in 10 s)", gain);
  const double eta = Number(progress, "eta_s", -1);
  if (eta >= 0) text += ", " + Duration(eta) + " left";
  return text;
}

// What there is to say of a job besides its state, on one line.
std::string Remark(const Json& job) {
  if (Flag(job, "cancel_requested") && Text(job, "state") == "running") return "being cancelled";
  if (const Json& progress = Member(job, "progress"); progress.is_object())
    return ProgressText(progress);
  if (const std::string reason = Text(job, "waiting_reason"); !reason.empty()) return reason;
  if (const Json& error = Member(job, "error"); error.is_object() && Text(job, "state") != "queued")
    return Text(error, "message");
  return Text(job, "container");
}

std::string Pad(std::string text, size_t width) {
  if (text.size() < width) text.append(width - text.size(), ' ');
  return text;
}

}  // namespace

bool IsFinalState(const std::string& state) {
  return state == "succeeded" || state == "failed" || state == "cancelled" || state == "buried";
}

int ExitCodeOfJob(const Json& job) {
  const std::string state = Text(job, "state");
  if (state == "succeeded") return kExitDone;
  if (state == "cancelled") return kExitInterrupted;
  const int64_t code = Integer(Member(job, "result"), "exit_code");
  return code == kExitBadInput || code == kExitQualityGate ? static_cast<int>(code) : kExitFailed;
}

std::string JobsText(const Json& answer) {
  const Json& jobs = Member(answer, "jobs");
  if (!jobs.is_array() || jobs.empty()) return "no jobs\n";
  size_t asset_width = 5, id_width = 2;
  for (const Json& job : jobs) {
    asset_width = std::max(asset_width, std::min<size_t>(Text(job, "asset").size(), 40));
    id_width = std::max(id_width, std::to_string(Integer(job, "id")).size());
  }
  std::string text =
      Pad("ID", id_width) + "  STATE          PRIO  " + Pad("ASSET", asset_width) + "  REMARK\n";
  for (const Json& job : jobs) {
    std::string line = Pad(std::to_string(Integer(job, "id")), id_width) + "  " +
                       Pad(Text(job, "state"), 13) + "  " +
                       Pad(std::to_string(Integer(job, "priority")), 4) + "  " +
                       Pad(Text(job, "asset"), asset_width) + "  " + Remark(job);
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  if (!Text(answer, "next_cursor").empty()) text += "there are more; see --limit\n";
  return text;
}

std::string JobLine(const Json& job) {
  std::string line =
      std::to_string(Integer(job, "id")) + " " + Text(job, "asset") + ": " + Text(job, "state");
  const std::string remark = Remark(job);
  return remark.empty() ? line : line + ", " + remark;
}

std::string EventLine(const Json& event) {
  const std::string type = Text(event, "type");
  const Json& data = Member(event, "data");
  const int64_t id = Integer(event, "job");
  if (id == 0) return type;
  std::string line = std::to_string(id);
  if (const std::string asset = Text(data, "asset"); !asset.empty()) line += " " + asset;
  line += ": ";
  if (type == "progress") return line + ProgressText(data);
  line += type;
  if (const int64_t attempt = Integer(data, "attempt"); attempt > 1)
    line += " (attempt " + std::to_string(attempt) + ")";
  for (const char* key : {"error_message", "error", "container", "revision"}) {
    const std::string detail = Text(data, key);
    if (!detail.empty()) return line + ", " + detail;
  }
  return line;
}

std::string StatusText(const Json& status) {
  std::string text = "patinad " + Text(status, "version") + ", " + Text(status, "state") +
                     ", process " + std::to_string(Integer(status, "pid")) + ", since " +
                     Text(status, "started") + "\n";
  text += "  state " + Text(status, "state_dir") + ", output " + Text(status, "out") + "\n";
  const std::string executor = Text(status, "executor");
  const bool on_farm = !executor.empty() && executor != "local";
  text += (on_farm ? "  farm (" + executor + "): places " : std::string("  cores ")) +
          std::to_string(Integer(status, "cores_used")) + " of " +
          std::to_string(Integer(status, "cores")) + " in use" +
          (Flag(status, "queue_paused") ? "; the queue is paused" : "") + "\n";
  std::string counts;
  const Json& jobs = Member(status, "jobs");
  if (jobs.is_object()) {
    for (const auto& [state, count] : jobs.items()) {
      if (!count.is_number_integer() || count.get<int64_t>() == 0) continue;
      counts += (counts.empty() ? "" : ", ") + std::to_string(count.get<int64_t>()) + " " +
                Printable(state);
    }
  }
  text += "  jobs " + (counts.empty() ? std::string("none") : counts) + "\n";
  const Json& watch = Member(status, "watch");
  const Json& roots = Member(watch, "roots");
  if (roots.is_array()) {
    for (const Json& root : roots) {
      text += "  watches " + Text(root, "path") + " by " + Text(root, "mode") + " (" +
              Text(root, "mode_reason") + "): " + std::to_string(Integer(root, "folders")) +
              " folders, " + std::to_string(Integer(root, "assets")) + " assets" +
              (Text(root, "as") == "svbrdf" ? ", texture sets as reflectance" : "") + "\n";
    }
  }
  const Json& pending = Member(status, "pending");
  if (pending.is_array() && !pending.empty()) {
    text += "not baked yet:\n";
    for (const Json& asset : pending)
      text += "  " + Text(asset, "name") + ": " + Text(asset, "reason") + "\n";
  }
  const Json& problems = Member(status, "problems");
  if (problems.is_array() && !problems.empty()) {
    text += "problems:\n";
    for (const Json& problem : problems)
      text += "  " + (problem.is_string() ? Printable(problem.get<std::string>()) : "?") + "\n";
  }
  return text;
}

}  // namespace patina
