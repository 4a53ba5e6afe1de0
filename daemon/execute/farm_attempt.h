// What a farm executor knows of one attempt, and the attempt's files beside those of executor.h:
//   <attempt>/submit.sh   the script; written last of all that describes the attempt
//   <attempt>/farm_id     ids that the farm gave it, one a line
//   <attempt>/started/    made by the script
//   <job>/failed_nodes    nodes on which attempts of the job were lost, one a line
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/base/file_calls.h"
#include "daemon/execute/event_tail.h"
#include "daemon/execute/executor.h"
#include "daemon/execute/farm_commands.h"

namespace patina::daemon {

enum class FarmPhase { kLookUp, kSubmit, kSubmitting, kOnFarm, kEnding };

struct FarmAttempt {
  explicit FarmAttempt(const AttemptSpec& s) : spec(s), tail(s.folder + "/events.ndjson") {}

  AttemptSpec spec;
  FarmPhase phase = FarmPhase::kLookUp;
  std::vector<std::string> ids;
  bool asked_farm = false;    // it may have been submitted at some time
  bool confirmed = false;     // this daemon has heard its ids from the farm
  bool use_excluded = true;   // leave out nodes that failed
  int refusals = 0;           // by the farm, in a row
  uint64_t after_round = 0;   // rounds begun before this one say nothing about it
  int64_t not_before_ms = 0;  // of the next submission; steady
  FarmJob last;               // what the farm said last
  bool stop = false;          // somebody wants it to end
  int64_t next_cancel_ms = 0;
  int64_t next_look_ms = 0;  // at its files
  int64_t give_up_ms = 0;    // when its result is waited for no longer
  EndCause cause = EndCause::kNone;
  std::string detail;
  std::string told;  // the last state that was told as an event
  EventTail tail;
  std::vector<std::string> events;  // not reported yet
};

std::string FarmNameOf(const AttemptSpec& spec);  // patina-<job>-a<attempt>

// Ids that an earlier daemon noted; of another's hand it takes what looks like ids.
std::vector<std::string> ReadFarmIds(const AttemptSpec& spec);
Status WriteFarmIds(const AttemptSpec& spec, const std::vector<std::string>& ids, FileCalls& files);

std::vector<std::string> ReadFailedNodes(const AttemptSpec& spec);
Status AddFailedNode(const AttemptSpec& spec, const std::string& node, FileCalls& files);

bool FileIsThere(const std::string& path, FileCalls& files);

// Content of result.json; empty: it is not there.
std::string ReadResultFile(const AttemptSpec& spec);
// Whether a result says that all was done. Such a one needs no word of the farm.
bool SaysDone(const std::string& result_json);

// A line as of events.ndjson that tells how it is on the farm.
std::string FarmEventLine(const std::string& message);

// What the farm's last word on a job that is over means, if it left no result.
EndCause CauseOf(const FarmJob& job, bool started);

}  // namespace patina::daemon
