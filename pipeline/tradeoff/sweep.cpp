#include "pipeline/tradeoff/sweep.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "formats/base/file_io.h"
#include "formats/base/sha256.h"
#include "formats/container.h"
#include "formats/model_bytes.h"
#include "pipeline/jobs/brdf_group.h"
#include "pipeline/jobs/job_runner.h"
#include "pipeline/jobs/package.h"
#include "pipeline/tradeoff/decode_time.h"

namespace patina {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMaxRecordBytes = size_t{1} << 24;

// What run.json says of a bake; see run_record.h.
struct Cost {
  double seconds = 0, cpu_seconds = 0;
};

Result<Cost> CostOf(const std::string& container) {
  const std::string path = container + "/run.json";
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxRecordBytes));
  const Json json = Json::parse(text, nullptr, false);
  const auto number = [&json](const char* key) {
    return json.is_object() && json.contains(key) && json[key].is_number() ? json[key].get<double>()
                                                                          : -1;
  };
  const Cost cost{number("seconds"), number("cpu_seconds")};
  if (cost.seconds < 0 || cost.cpu_seconds < 0) {
    return Fail(ErrorCode::kCorruptData,
                path + ": has no seconds and cpu_seconds; remove its folder, and sweep again");
  }
  return cost;
}

// Figures from the files alone.
Status Describe(const std::string& folder, SweepRow* row) {
  PATINA_ASSIGN(const Container container, OpenContainer(folder));
  PATINA_ASSIGN(const Cost cost, CostOf(container.directory));
  row->container = container.directory;
  row->bytes = ModelBytes(container.manifest.payloads);
  row->encode_s = cost.seconds;
  row->encode_cpu_s = cost.cpu_seconds;
  if (!container.manifest.brdf) {
    row->quality_db = std::min(container.manifest.quality.psnr_overall_db, 99.99);
    return {};
  }
  const std::optional<double> rmse = container.manifest.brdf->quality.image_rmse;
  if (!rmse) {
    return Fail(ErrorCode::kUnsupported,
                row->asset + ": a list of measurements has no lit sphere to compare; sweep files "
                             "that cover all directions");
  }
  row->quality_db = *rmse > 0 ? std::min(99.99, -20 * std::log10(*rmse)) : 99.99;
  return {};
}

SweepRow RowOf(const Job& job, const Variant& variant) {
  SweepRow row;
  row.asset = job.asset;
  row.kind = job.kind;
  row.variant = variant.name;
  row.settings = variant.settings;
  return row;
}

// What decides the result of jobs that share codebooks, and how long each then took.
Result<std::string> KeyOfShared(std::span<const Job> jobs, const Variant& variant) {
  std::string text = std::string(PATINA_VERSION) + "\n" + variant.name + "\n";
  for (const Job& job : jobs) {
    PATINA_ASSIGN(const FileDigest digest, Sha256OfFile(job.file));
    text += CanonicalJob(job) + digest.sha256 + "\n";
  }
  return Sha256Hex(text);
}

// Bakes all at once. A group's time is that of its first job; each row gets the mean.
Status RunShared(std::span<const Job> jobs, const Variant& variant, const std::string& folder,
                 const std::function<JobObserver&(const std::string&)>& observer,
                 const CancelToken& cancel, std::vector<SweepRow>* rows) {
  PATINA_ASSIGN(const std::string key, KeyOfShared(jobs, variant));
  const std::string record = folder + "/shared.json";
  Cost each{-1, -1};
  if (const auto text = ReadTextFile(record, kMaxRecordBytes)) {
    const Json json = Json::parse(*text, nullptr, false);
    const bool whole = std::all_of(jobs.begin(), jobs.end(), [&folder](const Job& job) {
      return OpenContainer(folder + "/" + job.asset).has_value();
    });
    if (whole && json.is_object() && json.value("key", "") == key)
      each = {json.value("seconds", -1.0), json.value("cpu_seconds", -1.0)};
  }
  std::map<std::string, std::string> problems;
  if (each.seconds < 0) {
    const std::vector<JobResult> results = RunSharedBrdfJobs(
        jobs, static_cast<size_t>(variant.share),
        [&](size_t i) -> JobObserver& { return observer(variant.name + " " + jobs[i].asset); },
        cancel);
    each = {0, 0};
    for (const JobResult& result : results) {
      each.seconds += result.seconds / static_cast<double>(jobs.size());
      each.cpu_seconds += result.cpu_seconds / static_cast<double>(jobs.size());
      if (result.error) problems[result.asset] = result.error->message;
    }
    if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
    if (problems.empty()) {
      const Json json{{"key", key}, {"seconds", each.seconds}, {"cpu_seconds", each.cpu_seconds}};
      PATINA_TRY(WriteFileDurably(record, std::string_view(json.dump() + "\n")));
    }
  }
  for (const Job& job : jobs) {
    SweepRow row = RowOf(job, variant);
    row.problem = problems[job.asset];
    if (row.problem.empty()) {
      const Status described = Describe(folder + "/" + job.asset, &row);
      if (!described) row.problem = described.error().message;
      row.encode_s = each.seconds;
      row.encode_cpu_s = each.cpu_seconds;
    }
    rows->push_back(std::move(row));
  }
  return {};
}

}  // namespace

std::vector<SweepRow> Sweep(std::span<const Job> jobs, std::span<const Variant> variants,
                            const std::string& out,
                            const std::function<JobObserver&(const std::string& label)>& observer,
                            const CancelToken& cancel) {
  std::vector<SweepRow> rows;
  for (const Variant& variant : variants) {
    const std::string folder = out + "/runs/" + variant.name;
    std::vector<Job> changed(jobs.begin(), jobs.end());
    for (Job& job : changed) {
      variant.ApplyTo(&job);
      job.out = folder;
    }
    if (variant.share > 1) {
      if (cancel.cancelled()) return rows;
      const Status done = RunShared(changed, variant, folder, observer, cancel, &rows);
      if (done) continue;
      for (const Job& job : changed) {
        rows.push_back(RowOf(job, variant));
        rows.back().problem = done.error().message;
      }
      continue;
    }
    for (const Job& job : changed) {
      if (cancel.cancelled()) return rows;
      RunGuards guards;
      guards.skip_unchanged = true;
      const JobResult result = RunJob(job, observer(variant.name + " " + job.asset), cancel, guards);
      SweepRow row = RowOf(job, variant);
      if (result.error) {
        row.problem = result.error->message;
      } else if (const Status described = Describe(result.container, &row); !described) {
        row.problem = described.error().message;
      }
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

Status MeasureDecoding(std::vector<SweepRow>* rows, const CancelToken& cancel) {
  std::map<std::string, std::vector<SweepRow*>> of_asset;
  for (SweepRow& row : *rows) {
    if (row.problem.empty()) of_asset[row.asset].push_back(&row);
  }
  for (const auto& [asset, timed] : of_asset) {
    std::vector<std::unique_ptr<DecodeTimer>> timers;
    for (const SweepRow* row : timed) {
      PATINA_ASSIGN(std::unique_ptr<DecodeTimer> timer, DecodeTimer::Open(row->container));
      timers.push_back(std::move(timer));
    }
    for (int round = 0; round < DecodeTimer::kRounds; ++round) {
      for (const auto& timer : timers) {
        if (cancel.cancelled()) return Fail(ErrorCode::kCancelled, "interrupted");
        timer->Round();
      }
    }
    for (size_t i = 0; i < timed.size(); ++i) timed[i]->decode_ns = timers[i]->MedianNs();
  }
  return {};
}

void MarkFronts(std::span<SweepRow> rows) {
  const auto mark = [rows](bool SweepRow::*flag, const auto& cost) {
    for (SweepRow& row : rows) {
      row.*flag = row.problem.empty();
      for (const SweepRow& other : rows) {
        if (!other.problem.empty()) continue;
        const double mine = static_cast<double>(cost(row)), theirs = static_cast<double>(cost(other));
        const bool no_worse = theirs <= mine && other.quality_db >= row.quality_db;
        if (no_worse && (theirs < mine || other.quality_db > row.quality_db)) row.*flag = false;
      }
    }
  };
  mark(&SweepRow::front_encode, [](const SweepRow& r) { return r.encode_s; });
  mark(&SweepRow::front_bytes, [](const SweepRow& r) { return r.bytes; });
  mark(&SweepRow::front_decode, [](const SweepRow& r) { return r.decode_ns; });
}

std::vector<SweepRow> MeansOf(const std::vector<SweepRow>& rows) {
  std::vector<SweepRow> means;
  for (const JobKind kind : {JobKind::kMaterial, JobKind::kBrdf}) {
    const size_t first = means.size();
    std::map<std::string, std::vector<const SweepRow*>> of;
    std::vector<std::string> order;
    size_t inputs = 0;
    for (const SweepRow& row : rows) {
      if (row.kind != kind) continue;
      auto& list = of[row.variant];
      if (list.empty()) order.push_back(row.variant);
      list.push_back(&row);
      inputs = std::max(inputs, list.size());
    }
    for (const std::string& variant : order) {
      const auto& list = of[variant];
      const bool whole = list.size() == inputs && std::all_of(list.begin(), list.end(), [](auto* r) {
        return r->problem.empty();
      });
      if (!whole) continue;
      SweepRow mean = *list[0];
      mean.asset.clear();
      mean.container.clear();
      mean.inputs = static_cast<int>(list.size());
      const auto count = static_cast<double>(list.size());
      mean.quality_db = mean.encode_s = mean.encode_cpu_s = mean.decode_ns = 0;
      double bytes = 0;
      for (const SweepRow* row : list) {
        mean.quality_db += row->quality_db / count;
        mean.encode_s += row->encode_s / count;
        mean.encode_cpu_s += row->encode_cpu_s / count;
        mean.decode_ns += row->decode_ns / count;
        bytes += static_cast<double>(row->bytes) / count;
      }
      mean.bytes = static_cast<uint64_t>(std::llround(bytes));
      means.push_back(std::move(mean));
    }
    MarkFronts(std::span<SweepRow>(means).subspan(first));
  }
  return means;
}

}  // namespace patina
