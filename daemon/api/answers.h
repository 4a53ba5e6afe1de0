// Answers that the daemon's API and the server of one container (daemon/view) share.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/api/http_types.h"
#include "formats/base/result.h"
#include "formats/shader_package.h"

namespace patina::daemon {

// What every answer says to browsers: keep nothing, guess no types, tell nobody.
void AddProtection(HttpResponse* response);

// A file below a container's folder, with a tag, under a policy that lets it run nothing. Problems:
// those of OpenBelow.
HttpResponse ContainerFileAnswer(const HttpRequest& request, const std::string& container,
                                 const std::string& name);

// What a browser needs to decode containers: their shader packages in GLSL ES 3.00. Keeps the last
// few. Thread-safe.
class ShaderPackages {
 public:
  // Of the container in a folder. Errors: those of OpenContainer and BuildShaderPackage.
  Result<std::shared_ptr<const ShaderPackage>> Of(const std::string& container);

 private:
  struct Kept {
    std::string key;  // the folder and when its manifest was written
    std::shared_ptr<const ShaderPackage> package;
  };
  static constexpr size_t kMost = 4;
  std::mutex mutex_;
  std::vector<Kept> kept_;  // the newest last
};

// A file of a container's shader package: bindings.json and what it names. Problems: those of
// ShaderPackages::Of; 404 for other names.
HttpResponse ShaderFileAnswer(ShaderPackages* packages, const HttpRequest& request,
                              const std::string& container, const std::string& name);

}  // namespace patina::daemon
