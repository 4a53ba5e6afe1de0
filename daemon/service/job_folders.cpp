#include "daemon/service/job_folders.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "daemon/base/clock.h"
#include "daemon/execute/event_tail.h"
#include "formats/container.h"
#include "pipeline/jobs/run_guards.h"

namespace patina::daemon {
namespace {
constexpr size_t kMostFolders = 10'000'000;
constexpr size_t kMostCurvePoints = 500;
}  // namespace

std::string JobFolders::FolderOf(int64_t id) const {
  return work_dir_ + "/jobs/" + std::to_string(id);
}

std::string JobFolders::AttemptFolder(int64_t id, int64_t attempt) const {
  return FolderOf(id) + "/a" + std::to_string(attempt);
}

Status JobFolders::Prepare(const JobRecord& job, const std::string& job_json, int64_t now_ms) {
  const std::string folder = AttemptFolder(job.id, job.attempt);
  PATINA_TRY(MakeDirectories(folder, files_));
  const std::string job_file = folder + "/job.json";
  if (const int error = files_.WriteSynced(job_file, AsBytes(job_json)))
    return FailErrno(error, "cannot write", job_file);
  PATINA_TRY(MoveFence(FenceOf(job.id), job.attempt));
  PATINA_TRY(MakeDirectories(job.out + "/" + job.asset, files_));
  NoteInLog(job.id, "attempt " + std::to_string(job.attempt) + " at " + Rfc3339(now_ms));
  return {};
}

void JobFolders::NoteInLog(int64_t id, const std::string& text) {
  int fd = -1;
  if (files_.Open(LogOf(id), O_WRONLY | O_APPEND | O_CREAT, 0600, &fd) != 0) return;
  files_.Write(fd, AsBytes("== " + text + "\n"));
  files_.Close(fd);
}

Result<std::string> JobFolders::ReadLog(int64_t id, int64_t* offset, size_t max_bytes,
                                        bool* at_end) {
  *at_end = true;
  int fd = -1;
  const int error = files_.Open(LogOf(id), O_RDONLY | O_NONBLOCK, 0, &fd);
  if (error == ENOENT) {
    *offset = 0;
    return std::string();
  }
  if (error != 0) return FailErrno(error, "cannot open", LogOf(id));
  const int64_t size = std::max<int64_t>(0, ::lseek(fd, 0, SEEK_END));
  int64_t start = *offset < 0 ? size + *offset : *offset;
  start = std::clamp<int64_t>(start, 0, size);
  std::string text(std::min(max_bytes, static_cast<size_t>(size - start)), '\0');
  size_t done = 0;
  int failed = ::lseek(fd, start, SEEK_SET) < 0 ? EIO : 0;
  while (failed == 0 && done < text.size()) {
    size_t n = 0;
    auto* bytes = reinterpret_cast<uint8_t*>(text.data());
    failed = files_.Read(fd, std::span<uint8_t>(bytes + done, text.size() - done), &n);
    if (n == 0) break;
    done += n;
  }
  files_.Close(fd);
  if (failed != 0) return FailErrno(failed, "cannot read", LogOf(id));
  text.resize(done);
  *offset = start + static_cast<int64_t>(done);
  *at_end = *offset >= size;
  return text;
}

std::vector<CurvePoint> JobFolders::ReadCurve(int64_t id, int64_t attempt) {
  EventTail tail(AttemptFolder(id, attempt) + "/events.ndjson");
  std::vector<CurvePoint> curve;
  std::optional<CurvePoint> newest;  // if it is not in the curve
  size_t stride = 1, seen = 0;       // every stride-th point is taken
  for (std::vector<std::string> lines = tail.Read(files_); !lines.empty();
       lines = tail.Read(files_)) {
    for (const std::string& line : lines) {
      const auto event = nlohmann::json::parse(line, nullptr, false);
      const auto number = [&event](const char* key) {
        const auto found = event.find(key);
        return found != event.end() && found->is_number() ? found->get<double>() : NAN;
      };
      if (!event.is_object()) continue;
      const CurvePoint point{number("time_s"), number("psnr_db")};
      if (!std::isfinite(point.time_s) || !std::isfinite(point.psnr_db)) continue;
      newest = point;
      if (seen++ % stride != 0) continue;
      curve.push_back(point);
      newest.reset();
      if (curve.size() < kMostCurvePoints) continue;
      for (size_t kept = 1; 2 * kept < curve.size(); ++kept) curve[kept] = curve[2 * kept];
      curve.resize((curve.size() + 1) / 2);
      stride *= 2;
    }
  }
  if (newest) curve.push_back(*newest);
  return curve;
}

void JobFolders::Remove(int64_t id) { files_.RemoveTree(FolderOf(id)); }

std::vector<int64_t> JobFolders::Existing() {
  std::vector<DirectoryEntry> entries;
  std::vector<int64_t> ids;
  if (files_.List(work_dir_ + "/jobs", kMostFolders, &entries) != 0) return ids;
  for (const DirectoryEntry& entry : entries) {
    int64_t id = 0;
    const char* end = entry.name.data() + entry.name.size();
    const auto parsed = std::from_chars(entry.name.data(), end, id);
    if (parsed.ec == std::errc() && parsed.ptr == end && id > 0) ids.push_back(id);
  }
  return ids;
}

std::string FailedFileText(const JobRecord& job, const std::string& source,
                           const std::string& log) {
  const nlohmann::ordered_json json{
      {"asset", job.asset},
      {"source", source},
      {"job", std::to_string(job.id)},
      {"attempts", job.attempt},
      {"time", Rfc3339(job.finished_ms)},
      {"state", JobStateName(job.state)},
      {"error", {{"code", job.error_code}, {"message", job.error_message}}},
      {"log", log},
      {"what_now", job.state == JobState::kBuried
                       ? "The machine failed it too often. Once that is repaired: patina retry " +
                             std::to_string(job.id)
                       : "Correct the files; the asset is then baked by itself. Or: patina retry " +
                             std::to_string(job.id)}};
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string CurrentRevision(FileCalls& files, const std::string& out, const std::string& asset) {
  const std::string link = out + "/" + asset + "/" + kCurrentName;
  char target[256];
  const ssize_t size = ::readlink(link.c_str(), target, sizeof target);
  if (size <= 0 || size >= static_cast<ssize_t>(sizeof target)) return "";
  struct stat info;
  if (files.Stat(link + "/" + kManifestName, true, &info) != 0) return "";
  return {target, static_cast<size_t>(size)};
}

}  // namespace patina::daemon
