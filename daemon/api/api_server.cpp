#include "daemon/api/api_server.h"

#include <optional>

#include "daemon/api/access.h"
#include "daemon/api/api.h"
#include "daemon/api/http_server.h"
#include "daemon/api/listeners.h"

namespace patina::daemon {
namespace {

// Connections that are left for others when every event client's place is taken.
constexpr int kPlacesForRequests = 64;

class RunningApi : public ApiServer {
 public:
  RunningApi(const ApiOptions& options, Service* service, AssetSource* source, Logger* log)
      : api_(options, service, source, log) {}

  Status Begin(const ApiConfig& config) {
    std::vector<HttpServer::Listening> listening;
    PATINA_ASSIGN(auto on_socket, UnixListener::Open(config.socket));
    unix_.emplace(std::move(on_socket));
    listening.push_back({unix_->fd(), false});
    if (!config.listen_host.empty()) {
      PATINA_ASSIGN(tcp_, OpenTcpListener(config.listen_host, config.listen_port));
      listening.push_back({tcp_.fd.get(), true});
    }
    HttpLimits limits;
    limits.max_connections = config.max_event_clients + kPlacesForRequests;
    limits.max_body_bytes = config.max_body_bytes;
    limits.request = std::chrono::milliseconds(config.request_timeout_ms);
    limits.answer = limits.request;
    PATINA_ASSIGN(http_, HttpServer::Start(limits, listening, &api_));
    return {};
  }

  int tcp_port() const override { return tcp_.port; }

 private:
  Api api_;
  std::optional<UnixListener> unix_;
  TcpListener tcp_;
  std::unique_ptr<HttpServer> http_;  // ends first
};

}  // namespace

Result<std::unique_ptr<ApiServer>> ApiServer::Start(const ApiConfig& config,
                                                    const std::string& default_out,
                                                    Service* service, AssetSource* source,
                                                    Logger* log, const UploadOptions& uploads) {
  ApiOptions options;
  options.default_out = default_out;
  options.uploads = uploads;
  options.max_body_bytes = config.max_body_bytes;
  options.max_event_clients = config.max_event_clients;
  if (!config.listen_host.empty()) {
    if (config.token_file.empty()) {
      return Fail(ErrorCode::kInvalidArgument,
                  "TCP is asked for, and there is no token file: every user of this machine could "
                  "use the API; name one with --token-file, or leave TCP out");
    }
    PATINA_ASSIGN(options.token, config.makes_token ? ReadOrMakeTokenFile(config.token_file)
                                                    : ReadTokenFile(config.token_file));
  }
  auto server = std::make_unique<RunningApi>(options, service, source, log);
  PATINA_TRY(server->Begin(config));
  return std::unique_ptr<ApiServer>(std::move(server));
}

}  // namespace patina::daemon
