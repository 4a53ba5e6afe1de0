// The API on its sockets, as the configuration asks for it.
#pragma once

#include <memory>

#include "daemon/api/uploads.h"
#include "daemon/base/log.h"
#include "daemon/config/config.h"
#include "daemon/service/service.h"
#include "formats/base/result.h"

namespace patina::daemon {

class ApiServer {
 public:
  // Listens on the Unix socket and, if the configuration names a host, on TCP; answers at once.
  // The service, the source (may be null) and the log must outlive it. Errors: those of
  // UnixListener, OpenTcpListener and ReadOrMakeTokenFile; kInvalidArgument: TCP without a token
  // file.
  static Result<std::unique_ptr<ApiServer>> Start(const ApiConfig& config,
                                                  const std::string& default_out, Service* service,
                                                  AssetSource* source, Logger* log,
                                                  const UploadOptions& uploads = {});
  // Ends all connections and removes the socket.
  virtual ~ApiServer() = default;

  virtual int tcp_port() const = 0;  // 0: no TCP
};

}  // namespace patina::daemon
