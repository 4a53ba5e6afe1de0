#include "pipeline/tradeoff/sweep_files.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "pipeline/jobs/machine.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

std::string Number(double value, const char* format) {
  char text[48];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// RFC 4180; a leading '=' and the like would be run by spreadsheets.
std::string Field(std::string text) {
  if (!text.empty() && std::string("=+-@\t").find(text[0]) != std::string::npos) text.insert(0, "'");
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

void AddCsvLine(const SweepRow& row, std::string* csv) {
  *csv += Field(row.asset) + "," + JobKindName(row.kind) + "," + Field(row.variant) + ",";
  if (row.problem.empty()) {
    *csv += Number(row.quality_db, "%.4f") + "," + Number(row.encode_s, "%.3f") + "," +
            Number(row.encode_cpu_s, "%.3f") + "," + std::to_string(row.bytes) + "," +
            Number(row.decode_ns, "%.2f") + ",";
    for (const bool front : {row.front_encode, row.front_bytes, row.front_decode})
      *csv += front ? "1," : "0,";
  } else {
    *csv += ",,,,,,,,";
  }
  *csv += Field(row.problem) + "\r\n";
}

Json RowJson(const SweepRow& row) {
  Json json;
  if (!row.asset.empty()) json["asset"] = row.asset;
  json["kind"] = JobKindName(row.kind);
  json["variant"] = row.variant;
  json["settings"] = Json::object();
  for (const auto& [name, value] : row.settings) json["settings"][name] = value;
  if (row.asset.empty()) json["inputs"] = row.inputs;
  if (!row.problem.empty()) {
    json["problem"] = row.problem;
    return json;
  }
  json["quality_db"] = row.quality_db;
  json["encode_s"] = row.encode_s;
  json["encode_cpu_s"] = row.encode_cpu_s;
  json["bytes"] = row.bytes;
  json["decode_ns"] = row.decode_ns;
  json["fronts"] = Json::array();
  const std::pair<const char*, bool> fronts[] = {{"encode", row.front_encode},
                                                 {"bytes", row.front_bytes},
                                                 {"decode", row.front_decode}};
  for (const auto& [name, on] : fronts) {
    if (on) json["fronts"].push_back(name);
  }
  return json;
}

}  // namespace

std::string SweepCsv(const std::vector<SweepRow>& rows, const std::vector<SweepRow>& means) {
  std::string csv =
      "asset,kind,variant,quality_db,encode_s,encode_cpu_s,bytes,decode_ns,front_encode,"
      "front_bytes,front_decode,problem\r\n";
  for (const SweepRow& row : means) AddCsvLine(row, &csv);
  for (const SweepRow& row : rows) AddCsvLine(row, &csv);
  return csv;
}

std::string SweepJson(const std::vector<SweepRow>& rows, const std::vector<SweepRow>& means) {
  Json json{{"version", 1}, {"patina", PATINA_VERSION}, {"cpu", CpuName()}, {"cpus", UsableCpus()}};
  for (const auto& [name, list] : {std::pair{"means", &means}, std::pair{"rows", &rows}}) {
    json[name] = Json::array();
    for (const SweepRow& row : *list) json[name].push_back(RowJson(row));
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace patina
