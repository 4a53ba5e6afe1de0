// The body of POST /v1/jobs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "daemon/api/problem.h"
#include "daemon/api/uploads.h"
#include "daemon/service/service.h"

namespace patina::daemon {

struct ParsedSubmit {
  SubmitRequest request;
  std::vector<FieldProblem> problems;  // the complete list; empty: the request can be used
};

// {"job": {...}, "priority": 0, "force": false, "limits": {"memory_mb", "cpu_s", "wall_s"}}; all
// but `job` may be absent. The job is as a job file (schemas/job.schema.json) with absolute paths;
// its `version` may be absent, and its `out` is default_out if it is.
ParsedSubmit ParseSubmit(std::string_view body, const std::string& default_out);

// What is wrong with a body that may be empty or an empty object and nothing else.
std::vector<FieldProblem> CheckEmptyBody(std::string_view body);

// The body of POST /v1/jobs/{id}/priority: {"priority": N}.
struct ParsedPriority {
  int priority = 0;
  std::vector<FieldProblem> problems;
};
ParsedPriority ParsePriority(std::string_view body);

// The body of POST /v1/uploads: {"name": "wall", "files": [{"name": "wall_ao.png", "bytes": 1}]}.
struct ParsedUpload {
  std::string name;
  std::vector<UploadFile> files;
  std::vector<FieldProblem> problems;
};
ParsedUpload ParseUpload(std::string_view body);

// The body of POST /v1/uploads/{upload}/submit: {"quality": "standard", "priority": 0, "force":
// false}; all may be absent.
struct ParsedUploadSubmit {
  Quality quality = Quality::kStandard;
  int priority = 0;
  bool force = false;
  std::vector<FieldProblem> problems;
};
ParsedUploadSubmit ParseUploadSubmit(std::string_view body);

// The body of POST /v1/tickets: {"path": "/v1/assets/wall/files/report.html"}.
struct ParsedTicket {
  std::string path;
  std::vector<FieldProblem> problems;
};
ParsedTicket ParseTicket(std::string_view body);

}  // namespace patina::daemon
