#include "daemon/api/api_json.h"

#include <nlohmann/json.hpp>

#include "daemon/base/clock.h"

namespace patina::daemon {
namespace {

using Json = nlohmann::ordered_json;

std::string Text(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void SetText(Json* json, const char* key, const std::string& text) {
  if (!text.empty()) (*json)[key] = text;
}

void SetTime(Json* json, const char* key, int64_t wall_ms) {
  if (wall_ms > 0) (*json)[key] = Rfc3339(wall_ms);
}

// Text that was written as JSON by this program or by `patina run`; null if it is not.
Json Stored(const std::string& text) { return Json::parse(text, nullptr, false); }

Json ProgressToJson(const JobProgress& progress) {
  Json json;
  json["stage"] = progress.stage;
  if (progress.fraction >= 0) json["fraction"] = progress.fraction;
  if (progress.eta_s >= 0) json["eta_s"] = progress.eta_s;
  if (progress.psnr_db > 0) json["psnr_db"] = progress.psnr_db;
  if (progress.gain_10s_db > 0) json["gain_10s_db"] = progress.gain_10s_db;
  SetText(&json, "message", progress.message);
  return json;
}

Json JobToJson(const JobView& view, bool whole) {
  const JobRecord& record = view.record;
  Json json;
  json["id"] = record.id;
  json["asset"] = record.asset;
  json["kind"] = record.kind;
  json["state"] = JobStateName(record.state);
  json["origin"] = JobOriginName(record.origin);
  json["priority"] = record.priority;
  json["out"] = record.out;
  json["force"] = record.force;
  json["held"] = record.held;
  json["cancel_requested"] = record.cancel_requested;
  json["attempt"] = record.attempt;
  json["failures"] = record.failures;
  json["limits"] = {{"threads", record.limits.threads},
                    {"memory_mb", record.limits.memory_mb},
                    {"cpu_s", record.limits.cpu_s},
                    {"wall_s", record.limits.wall_s}};
  SetTime(&json, "created", record.created_ms);
  SetTime(&json, "updated", record.updated_ms);
  SetTime(&json, "started", record.started_ms);
  SetTime(&json, "finished", record.finished_ms);
  SetTime(&json, "due", record.due_ms);
  SetText(&json, "waiting_reason", view.waiting_reason);
  if (view.progress) json["progress"] = ProgressToJson(*view.progress);
  if (!record.error_code.empty())
    json["error"] = {{"code", record.error_code}, {"message", record.error_message}};
  SetText(&json, "revision", record.revision);
  SetText(&json, "container", record.container);
  if (whole) {
    if (Json job = Stored(record.job_json); job.is_object()) json["job"] = std::move(job);
    if (Json result = Stored(record.result_json); result.is_object())
      json["result"] = std::move(result);
  }
  return json;
}

Json AssetToJson(const AssetView& asset) {
  Json json;
  json["name"] = asset.name;
  json["state"] = asset.state;
  SetText(&json, "out", asset.out);
  SetText(&json, "source", asset.source);
  SetText(&json, "reason", asset.reason);
  if (asset.job > 0) json["job"] = asset.job;
  SetText(&json, "revision", asset.revision);
  SetText(&json, "container", asset.container);
  SetTime(&json, "updated", asset.updated_ms);
  return json;
}

Json CountsToJson(const JobCounts& counts) {
  Json json = Json::object();
  for (const auto& [state, count] : counts.by_state) json[JobStateName(state)] = count;
  return json;
}

Json WatchToJson(const WatchHealth& health) {
  Json json;
  json["healthy"] = health.healthy;
  SetText(&json, "reason", health.reason);
  SetText(&json, "cure", health.cure);
  json["roots"] = Json::array();
  for (const WatchedRoot& root : health.roots) {
    json["roots"].push_back({{"path", root.path},
                             {"mode", root.mode},
                             {"mode_reason", root.mode_reason},
                             {"folders", root.folders},
                             {"assets", root.assets},
                             {"as", root.as_svbrdf ? "svbrdf" : "material"}});
  }
  json["events"] = health.events;
  json["overflows"] = health.overflows;
  json["rescans"] = health.rescans;
  return json;
}

}  // namespace

std::string JobJson(const JobView& job) { return Text(JobToJson(job, true)); }

std::string JobListJson(const JobViewPage& page) {
  Json json;
  json["jobs"] = Json::array();
  for (const JobView& job : page.jobs) json["jobs"].push_back(JobToJson(job, false));
  if (page.next > 0) json["next_cursor"] = std::to_string(page.next);
  return Text(json);
}

std::string SubmittedJson(const Submitted& submitted) {
  return Text({{"id", submitted.id},
               {"created", submitted.created},
               {"url", "/v1/jobs/" + std::to_string(submitted.id)}});
}

std::string StateJson(int64_t id, JobState state) {
  return Text({{"id", id}, {"state", JobStateName(state)}});
}

std::string AssetJson(const AssetView& asset) { return Text(AssetToJson(asset)); }

std::string AssetListJson(const std::vector<AssetView>& assets, const std::string& next) {
  Json json;
  json["assets"] = Json::array();
  for (const AssetView& asset : assets) json["assets"].push_back(AssetToJson(asset));
  SetText(&json, "next_cursor", next);
  return Text(json);
}

std::string FileListJson(const AssetView& asset, const std::vector<ContainerFile>& files) {
  Json json;
  json["asset"] = asset.name;
  json["revision"] = asset.revision;
  json["files"] = Json::array();
  for (const ContainerFile& file : files)
    json["files"].push_back({{"name", file.name}, {"bytes", file.bytes}});
  return Text(json);
}

std::string RevisionListJson(const AssetView& asset, const std::vector<ListedRevision>& revisions) {
  Json json;
  json["asset"] = asset.name;
  json["revisions"] = Json::array();
  for (const ListedRevision& revision : revisions) {
    Json entry = {
        {"revision", revision.name}, {"current", revision.current}, {"bytes", revision.bytes}};
    SetTime(&entry, "published", revision.published_ms);
    json["revisions"].push_back(std::move(entry));
  }
  return Text(json);
}

std::string CurveJson(const std::vector<CurvePoint>& curve) {
  Json json;
  json["points"] = Json::array();
  for (const CurvePoint& point : curve)
    json["points"].push_back({{"time_s", point.time_s}, {"psnr_db", point.psnr_db}});
  return Text(json);
}

std::string UploadedJson(const std::vector<UploadedJob>& jobs) {
  Json json;
  json["jobs"] = Json::array();
  json["refused"] = Json::array();
  for (const UploadedJob& job : jobs) {
    if (job.job > 0) {
      json["jobs"].push_back({{"asset", job.asset}, {"id", job.job}});
    } else {
      json["refused"].push_back({{"asset", job.asset}, {"detail", job.problem}});
    }
  }
  return Text(json);
}

std::string UploadJson(const std::string& id, uint64_t piece_bytes) {
  return Text({{"upload", id}, {"url", "/v1/uploads/" + id}, {"piece_bytes", piece_bytes}});
}

std::string PieceJson(uint64_t bytes) { return Text({{"bytes", bytes}}); }

std::string TicketJson(const std::string& url, int64_t seconds) {
  return Text({{"url", url}, {"seconds", seconds}});
}

std::string StatusJson(const ServiceStatus& status) {
  Json json;
  json["version"] = status.version;
  json["pid"] = status.pid;
  SetTime(&json, "started", status.started_ms);
  json["state"] = status.state;
  json["state_dir"] = status.state_dir;
  json["out"] = status.out;
  json["queue_paused"] = status.queue_paused;
  json["executor"] = status.executor;
  json["cores"] = status.cores;
  json["cores_used"] = status.cores_used;
  json["jobs"] = CountsToJson(status.counts);
  json["watch"] = WatchToJson(status.watch);
  json["pending"] = Json::array();
  for (const PendingAsset& pending : status.pending) {
    Json entry = {{"name", pending.name}, {"path", pending.path}, {"reason", pending.reason}};
    SetTime(&entry, "since", pending.since_ms);
    json["pending"].push_back(std::move(entry));
  }
  json["problems"] = status.problems;
  return Text(json);
}

std::string HealthJson(const WatchHealth& health) {
  Json json;
  json["status"] = health.healthy ? "ok" : "degraded";
  SetText(&json, "reason", health.reason);
  SetText(&json, "cure", health.cure);
  return Text(json);
}

std::string EventJson(const Event& event) {
  Json json;
  if (event.id > 0) json["id"] = event.id;
  SetTime(&json, "time", event.time_ms);
  json["type"] = event.type;
  if (event.job > 0) json["job"] = event.job;
  Json data = Stored(event.data);
  json["data"] = data.is_object() ? std::move(data) : Json::object();
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace patina::daemon
