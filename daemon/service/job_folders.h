// Where the files of jobs lie, and what the daemon itself writes there.
//   <work>/jobs/<id>/log           output of all attempts
//   <work>/jobs/<id>/fence         number of the current attempt
//   <work>/jobs/<id>/a<attempt>/   job.json, events.ndjson, result.json, and what the executor adds
// <work> is WorkFolderOf(config): the state folder, or on a farm the folder that the nodes share.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/base/file_calls.h"
#include "daemon/queue/job_store.h"
#include "daemon/service/service.h"
#include "formats/base/result.h"

namespace patina::daemon {

class JobFolders {
 public:
  // Both must outlive it.
  JobFolders(std::string work_dir, FileCalls& files)
      : work_dir_(std::move(work_dir)), files_(files) {}

  std::string FolderOf(int64_t id) const;
  std::string LogOf(int64_t id) const { return FolderOf(id) + "/log"; }
  std::string FenceOf(int64_t id) const { return FolderOf(id) + "/fence"; }
  std::string AttemptFolder(int64_t id, int64_t attempt) const;

  // Makes the attempt's folder with its job file, makes the attempt the current one of the fence,
  // begins a part of the log, and makes <out>/<asset>. Errors: those of FailErrno and MoveFence.
  Status Prepare(const JobRecord& job, const std::string& job_json, int64_t now_ms);
  // Says in the log how an attempt ended; what cannot be written is left out.
  void NoteInLog(int64_t id, const std::string& text);

  // Part of a log; see Service::ReadLog. A log that is not there is empty.
  Result<std::string> ReadLog(int64_t id, int64_t* offset, size_t max_bytes, bool* at_end);

  // What the events of an attempt say of accuracy against time; see Service::Curve.
  std::vector<CurvePoint> ReadCurve(int64_t id, int64_t attempt);

  // Errors of removing are not reported: what is left is removed at the next start.
  void Remove(int64_t id);
  // The ids that have a folder.
  std::vector<int64_t> Existing();

 private:
  std::string work_dir_;
  FileCalls& files_;
};

// Content of <asset>.failed.json: what went wrong, for the person who put the asset there.
std::string FailedFileText(const JobRecord& job, const std::string& source, const std::string& log);

// The revision that `current` of an asset points at; empty if there is none or it is not whole.
std::string CurrentRevision(FileCalls& files, const std::string& out, const std::string& asset);

}  // namespace patina::daemon
