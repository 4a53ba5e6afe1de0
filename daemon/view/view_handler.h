// What `patina view` serves: one container, and the pages that show it.
#pragma once

#include <string>

#include "daemon/api/answers.h"
#include "daemon/api/http_types.h"
#include "daemon/view/source_textures.h"
#include "formats/container.h"

namespace patina::daemon {

// Paths, all read only: "/" is the viewer, /web/<file> what it consists of; both are the same for
// everybody. The rest wants the token (Authorization: Bearer): /v1/container/files/<file>, the
// manifest and the payloads that it lists, and nothing else of the folder;
// /v1/container/shader/<file>, what decodes it; /v1/container/source/<file>, the maps to hold it
// against (source.json is null where there are none). Of requests that come under a name of another
// host, or for a page of another site, none is answered.
class ViewHandler : public HttpHandler {
 public:
  // source: may be null; must outlive the handler.
  ViewHandler(Container container, std::string token, const SourceTextures* source)
      : container_(std::move(container)), token_(std::move(token)), source_(source) {}

  HttpResponse Handle(const HttpRequest& request) override;
  HttpResponse Refuse(int status) override;

 private:
  HttpResponse Route(const HttpRequest& request);
  HttpResponse SendFile(const HttpRequest& request, const std::string& name) const;

  Container container_;
  std::string token_;
  const SourceTextures* source_;
  ShaderPackages shaders_;
};

}  // namespace patina::daemon
