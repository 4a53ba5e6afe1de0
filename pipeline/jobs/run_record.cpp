#include "pipeline/jobs/run_record.h"

#include <nlohmann/json.hpp>

namespace patina {

std::string RunRecordToJson(const RunRecord& record) {
  using Json = nlohmann::ordered_json;
  Json json;
  json["version"] = 1;
  json["asset"] = record.asset;
  json["fingerprint"] = record.fingerprint;
  json["patina"] = record.version;
  json["cpu"] = record.cpu;
  json["cpus"] = record.cpus;
  json["threads"] = record.threads;
  json["simd"] = record.simd;
  json["seconds"] = record.seconds;
  json["cpu_seconds"] = record.cpu_seconds;
  json["peak_memory_bytes"] = record.peak_memory_bytes;
  json["samples"] = record.samples;
  json["samples_per_s"] = record.samples_per_s;
  json["stages"] = Json::array();
  for (const StageCost& stage : record.stages) {
    json["stages"].push_back(
        {{"stage", stage.stage}, {"seconds", stage.seconds}, {"cpu_seconds", stage.cpu_seconds}});
  }
  json["recording_seconds"] = record.recording_seconds;
  json["curve"] = Json::array();
  for (const RunCurvePoint& point : record.curve) {
    Json entry{{"samples", point.samples}, {"seconds", point.seconds}};
    for (const auto& [name, value] : point.measures) entry[name] = value;
    json["curve"].push_back(std::move(entry));
  }
  for (const SimulationPoint& point : record.simulation) {
    json["simulation"].push_back({{"paths", point.paths},
                                  {"standard_error", point.standard_error},
                                  {"seconds", point.seconds}});
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace patina
