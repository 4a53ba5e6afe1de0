#include "daemon/api/metrics_text.h"

#include <unistd.h>

#include <cstdio>
#include <fstream>

namespace patina::daemon {
namespace {

std::string Number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

std::string LabelValue(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\' || c == '"') {
      out += std::string("\\") + c;
    } else if (c == '\n') {
      out += "\\n";
    } else {
      out += c;
    }
  }
  return out;
}

class Writer {
 public:
  void Family(const char* name, const char* type, const char* help) {
    name_ = std::string("patina_") + name;
    text_ += "# HELP " + name_ + " " + help + "\n# TYPE " + name_ + " " + type + "\n";
  }
  void Sample(int64_t value, const std::string& labels = "") {
    text_ +=
        name_ + (labels.empty() ? "" : "{" + labels + "}") + " " + std::to_string(value) + "\n";
  }
  void Counter(const char* name, const char* help, int64_t value) {
    Family(name, "counter", help);
    Sample(value);
  }
  void Gauge(const char* name, const char* help, int64_t value) {
    Family(name, "gauge", help);
    Sample(value);
  }
  void Distribution(const char* name, const char* help, const Histogram& histogram) {
    Family(name, "histogram", help);
    int64_t below = 0;
    for (size_t i = 0; i < histogram.counts.size(); ++i) {
      below += histogram.counts[i];
      const std::string bound =
          i < histogram.bounds.size() ? Number(histogram.bounds[i]) : std::string("+Inf");
      text_ += name_ + "_bucket{le=\"" + bound + "\"} " + std::to_string(below) + "\n";
    }
    text_ += name_ + "_sum " + Number(histogram.sum) + "\n";
    text_ += name_ + "_count " + std::to_string(histogram.count) + "\n";
  }
  std::string Take() { return std::move(text_); }

 private:
  std::string text_, name_;
};

int64_t ResidentBytes() {
  int64_t size = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

}  // namespace

std::string MetricsText(const ServiceMetrics& metrics, const ApiMetrics& api) {
  Writer out;
  out.Family("jobs", "gauge", "Jobs in the queue by state.");
  for (const auto& [state, count] : metrics.counts.by_state)
    out.Sample(count, std::string("state=\"") + JobStateName(state) + "\"");
  out.Family("jobs_submitted_total", "counter", "Jobs that were submitted, by where from.");
  out.Sample(metrics.submitted_api, "origin=\"api\"");
  out.Sample(metrics.submitted_watch, "origin=\"watch\"");
  out.Counter("offers_unchanged_total", "Assets of the watcher that needed no job.",
              metrics.offers_unchanged);
  out.Counter("attempts_started_total", "Attempts at jobs.", metrics.attempts_started);
  out.Counter("attempts_adopted_total", "Attempts taken over from an earlier daemon.",
              metrics.attempts_adopted);
  out.Family("jobs_ended_total", "counter", "Attempts that ended, by outcome.");
  out.Sample(metrics.succeeded, "outcome=\"succeeded\"");
  out.Sample(metrics.found_unchanged, "outcome=\"unchanged\"");
  out.Sample(metrics.failed, "outcome=\"failed\"");
  out.Sample(metrics.cancelled, "outcome=\"cancelled\"");
  out.Sample(metrics.retried, "outcome=\"retried\"");
  out.Sample(metrics.buried, "outcome=\"buried\"");
  out.Counter("stale_reports_total", "Reports of attempts that were no longer the current ones.",
              metrics.stale_reports);
  out.Counter("bytes_published_total", "Bytes that an engine loads, of published containers.",
              metrics.bytes_published);
  out.Counter("revisions_pruned_total", "Old revisions that were removed.",
              metrics.revisions_pruned);
  out.Counter("jobs_pruned_total", "Old jobs that were removed.", metrics.jobs_pruned);
  out.Counter("store_errors_total", "Calls of the queue's database that failed.",
              metrics.store_errors);
  out.Gauge("cores", "Core budget.", metrics.cores);
  out.Gauge("cores_used", "Cores that running jobs have been given.", metrics.cores_used);
  out.Gauge("event_subscribers", "Listeners to events.", metrics.subscribers);
  out.Counter("event_gaps_total", "Times that a listener missed events.", metrics.subscriber_gaps);
  out.Distribution("queue_seconds", "From submission to the first attempt.", metrics.queue_seconds);
  out.Distribution("job_seconds", "Of attempts that succeeded.", metrics.job_seconds);
  out.Gauge("watch_healthy", "1 if the watcher can vouch for what it sees.",
            metrics.watch.healthy ? 1 : 0);
  out.Family("watch_folders", "gauge", "Watched folders, by root and how they are watched.");
  for (const WatchedRoot& root : metrics.watch.roots) {
    out.Sample(root.folders,
               "root=\"" + LabelValue(root.path) + "\",mode=\"" + LabelValue(root.mode) + "\"");
  }
  out.Counter("watch_events_total", "Events that the kernel reported.", metrics.watch.events);
  out.Counter("watch_overflows_total", "Times that the kernel lost events.",
              metrics.watch.overflows);
  out.Counter("watch_rescans_total", "Looks at everything.", metrics.watch.rescans);
  out.Counter("http_requests_total", "Requests of the API.", api.requests);
  out.Counter("http_refused_total", "Requests that were answered with an error.", api.refused);
  out.Gauge("http_event_clients", "Clients of /v1/events.", api.event_clients);
  out.Gauge("resident_bytes", "Memory of the daemon.", ResidentBytes());
  return out.Take();
}

}  // namespace patina::daemon
