// Which files and folders jobs may name.
#pragma once

#include <string>
#include <vector>

#include "formats/base/result.h"
#include "pipeline/jobs/job.h"

namespace patina::daemon {

struct Roots {
  std::vector<std::string> input;   // jobs may read what lies in these
  std::vector<std::string> output;  // jobs may publish in these
};

// Whether a path, links resolved, is one of the folders or lies in one. What is not there yet is
// judged by where it would be.
bool LiesWithin(const std::string& path, const std::vector<std::string>& folders);

// Checks every path of a job, and replaces each by the one it resolves to. Errors:
// kInvalidArgument: not absolute, not UTF-8 (a job is JSON), or outside the roots; the message
// begins with the JSON pointer.
Status ConfineJob(const Roots& roots, Job* job);

// What a job reads: its folder or files, the folder of its colour configuration, and the targets,
// within the roots, of links in its folder.
std::vector<std::string> InputsOf(const Job& job, const Roots& roots);

}  // namespace patina::daemon
