// Metrics in the text format of Prometheus.
#pragma once

#include <string>

#include "daemon/service/service.h"

namespace patina::daemon {

inline constexpr const char* kMetricsContentType = "text/plain; version=0.0.4; charset=utf-8";

// What the API knows of itself.
struct ApiMetrics {
  int64_t requests = 0;
  int64_t refused = 0;  // answered with 4xx or 5xx
  int64_t event_clients = 0;
};

std::string MetricsText(const ServiceMetrics& metrics, const ApiMetrics& api);

}  // namespace patina::daemon
