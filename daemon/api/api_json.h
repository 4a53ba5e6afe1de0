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
std::string StatusJson(const ServiceStatus& status);
// {"status": "ok"} or "degraded" with the reason and the cure.
std::string HealthJson(const WatchHealth& health);
// The data of a server-sent event, on one line.
std::string EventJson(const Event& event);

}  // namespace patina::daemon
