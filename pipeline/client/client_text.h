// Answers of the daemon as a person reads them. What is missing in an answer is left out: a newer
// or older daemon may say more or less.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace patina {

// A table of /v1/jobs.
std::string JobsText(const nlohmann::json& answer);

// "12 wall: running, train 63 %, 31.2 dB, 11 s left".
std::string JobLine(const nlohmann::json& job);

// A line for an event; empty if there is nothing to say of it.
std::string EventLine(const nlohmann::json& event);

// /v1/status on a few lines.
std::string StatusText(const nlohmann::json& status);

// Whether nothing more happens to a job in this state unless somebody asks.
bool IsFinalState(const std::string& state);

// What `patina bake` would exit with for a job that has ended.
int ExitCodeOfJob(const nlohmann::json& job);

}  // namespace patina
