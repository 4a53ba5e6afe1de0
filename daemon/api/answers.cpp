#include "daemon/api/answers.h"

#include "daemon/api/api_parts.h"
#include "daemon/api/container_files.h"
#include "daemon/api/problem.h"
#include "formats/base/names.h"
#include "formats/container.h"

namespace patina::daemon {

void AddProtection(HttpResponse* response) {
  response->headers.emplace_back("X-Content-Type-Options", "nosniff");
  response->headers.emplace_back("Cache-Control", "no-store");
  response->headers.emplace_back("Referrer-Policy", "no-referrer");
}

HttpResponse ContainerFileAnswer(const HttpRequest& request, const std::string& container,
                                 const std::string& name) {
  auto file = OpenBelow(container, name);
  if (!file) return ProblemResponse(file.error());
  HttpResponse response;
  const std::string tag = Revised(container + "/" + name + " " + std::to_string(file->mtime_ns) +
                                  " " + std::to_string(file->bytes));
  response.headers.emplace_back("ETag", tag);
  if (NamesTag(request.Header("If-None-Match"), tag)) {
    response.status = 304;
    return response;
  }
  response.content_type = ContentTypeOf(name);
  // A report is a page of its own and runs nothing.
  response.headers.emplace_back("Content-Security-Policy",
                                "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
                                "frame-ancestors 'none'; sandbox");
  if (file->bytes == 0) return response;
  response.file = std::move(file->fd);
  response.file_bytes = file->bytes;
  return response;
}

Result<std::shared_ptr<const ShaderPackage>> ShaderPackages::Of(const std::string& container) {
  PATINA_ASSIGN(const OpenedFile manifest, OpenBelow(container, kManifestName));
  const std::string key = container + " " + std::to_string(manifest.mtime_ns);
  const std::lock_guard lock(mutex_);
  for (const Kept& kept : kept_) {
    if (kept.key == key) return kept.package;
  }
  PATINA_ASSIGN(const Container opened, OpenContainer(container));
  ShaderOptions options;
  options.language = ShaderLanguage::kEssl;
  PATINA_ASSIGN(ShaderPackage package, BuildShaderPackage(opened, options));
  if (kept_.size() >= kMost) kept_.erase(kept_.begin());
  kept_.push_back({key, std::make_shared<const ShaderPackage>(std::move(package))});
  return kept_.back().package;
}

HttpResponse ShaderFileAnswer(ShaderPackages* packages, const HttpRequest& request,
                              const std::string& container, const std::string& name) {
  const auto package = packages->Of(container);
  if (!package) return ProblemResponse(package.error());
  for (const ShaderFile& file : (*package)->files) {
    if (file.name != name) continue;
    HttpResponse response = WithTag(request, std::string(file.bytes.begin(), file.bytes.end()));
    response.content_type = ContentTypeOf(name);
    return response;
  }
  return ProblemResponse(404, "not_found",
                         "the shader package has no file " + QuoteForMessage(name) +
                             "; bindings.json names those that there are");
}

}  // namespace patina::daemon
