// Results of jobs as a person and a script read them.
#pragma once

#include <span>
#include <string>

#include "pipeline/jobs/job_result.h"

namespace patina {

// A few lines on a job that is done: quality, size, time and place.
std::string ResultText(const JobResult& result);

// What became of several assets: a count, and a line for each that is not done. planned: how many
// there were to be.
std::string SummaryText(std::span<const JobResult> results, size_t planned);

// One line of JSON: {"version":1,"exit_code":...,"assets":[...]}.
std::string ResultsToJson(std::span<const JobResult> results, int exit_code);

}  // namespace patina
