// Any farm that has programs to submit a job, to tell how jobs are, and to cancel one. Words may
// hold placeholders:
//   submit   {script} {name} {folder} {log} {cpus} {memory_mb} {seconds} {exclude}
//            The last word that it writes is the job's id. Exit code 0: the farm has taken the job;
//            any other: it has not.
//   status   a word {ids} becomes one word for each id, at most 500 a call
//   find     {name}; may be left out. Tells of jobs of that name, like status.
//   cancel   {id}
// A word with {memory_mb}, {seconds} or {exclude} (nodes with commas between them) is left out
// where there is no limit, or no node.
//
// status and find write a line for each job that the farm knows, "ID STATE [NODE [EXIT]]", and end
// with 0; a job without a line is not on the farm any more. STATE is one of
//   waiting running completed failed cancelled time_limit out_of_memory node_failed preempted
// EXIT is the exit code of the job's program. Any other state: it is on the farm, alive or not.
#pragma once

#include <memory>

#include "daemon/execute/farm_commands.h"

namespace patina::daemon {

struct TemplateOptions {
  Words submit, status, find, cancel;  // find may be empty
};

std::unique_ptr<FarmCommands> MakeTemplateCommands(const TemplateOptions& options);

// What of {…} in these words stands in none of the names; nothing if all is well.
std::optional<std::string> UnknownPlaceholder(const Words& words,
                                              const std::vector<std::string>& names);

// The placeholders of each.
const std::vector<std::string>& SubmitPlaceholders();

}  // namespace patina::daemon
