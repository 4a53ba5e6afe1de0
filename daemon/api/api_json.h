// What the service knows, as the JSON of the API (schemas/openapi.json). Text that is not UTF-8 is
// shown with replacement characters.
#pragma once

#include <string>
#include <vector>

#include "daemon/service/service.h"

namespace patina::daemon {

std::string JobJson(const JobView& job);           // with `job` and `result`
std::string JobListJson(const JobViewPage& page);  // without
std::string SubmittedJson(const Submitted& submitted);
std::string StateJson(int64_t id, JobState state);
std::string AssetJson(const AssetView& asset);
// next: the cursor for what follows; empty: nothing does.
std::string AssetListJson(const std::vector<AssetView>& assets, const std::string& next);
struct ContainerFile {
  std::string name;  // below the container, '/' between folders
  uint64_t bytes = 0;
};
std::string FileListJson(const AssetView& asset, const std::vector<ContainerFile>& files);
struct ListedRevision {
  std::string name;
  int64_t published_ms = 0;
  uint64_t bytes = 0;  // of all its files
  bool current = false;
};
std::string RevisionListJson(const AssetView& asset, const std::vector<ListedRevision>& revisions);
std::string CurveJson(const std::vector<CurvePoint>& curve);
// What was made of an upload: jobs, and what in it cannot be baked.
struct UploadedJob {
  std::string asset;
  int64_t job = 0;      // 0: none was made
  std::string problem;  // why not
};
std::string UploadedJson(const std::vector<UploadedJob>& jobs);
std::string UploadJson(const std::string& id, uint64_t piece_bytes);
std::string PieceJson(uint64_t bytes);
std::string TicketJson(const std::string& url, int64_t seconds);
std::string StatusJson(const ServiceStatus& status);
// {"status": "ok"} or "degraded" with the reason and the cure.
std::string HealthJson(const WatchHealth& health);
// The data of a server-sent event, on one line.
std::string EventJson(const Event& event);

}  // namespace patina::daemon
