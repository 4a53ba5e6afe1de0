// Between the watchers of the drop folders and the service: what is complete is offered for baking,
// what disappeared is withdrawn.
#pragma once

#include <memory>

#include "daemon/base/log.h"
#include "daemon/config/config.h"
#include "daemon/service/service.h"

namespace patina::daemon {

// Watches every folder of config.watch; it is the service's AssetSource until it is destroyed.
class DropFolders {
 public:
  // The references must outlive it. Errors: those of Watcher::Start.
  static Result<std::unique_ptr<DropFolders>> Start(const Config& config, Service& service,
                                                    Logger& log);
  virtual ~DropFolders() = default;
  virtual AssetSource* source() = 0;
};

}  // namespace patina::daemon
