#include "tests/bench/brdf_eval_run.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <system_error>
#include <utility>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "pipeline/image/image_io.h"
#include "tests/bench/brdf_eval_measures.h"
#include "tests/bench/brdf_eval_systems.h"
#include "tests/bench/brdf_eval_table.h"

namespace patina::bench {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr uint64_t kMaxRowsBytes = uint64_t{256} << 20;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// One system for one material and seed.
struct Unit {
  std::string system;
  uint64_t seed = 0;
};

std::vector<Unit> UnitsOf(const EvalOptions& options) {
  std::vector<Unit> units;
  for (const std::string& system : options.systems) {
    for (const uint64_t seed : options.seeds) {
      units.push_back({system, seed});
      if (!DependsOnSeed(system)) break;
    }
  }
  return units;
}

Result<std::vector<std::string>> TableFiles(const EvalOptions& options) {
  std::vector<std::string> files;
  std::error_code error;
  const auto take = [&](const fs::path& path) {
    const auto& only = options.only;
    const bool wanted =
        only.empty() || std::find(only.begin(), only.end(), path.stem()) != only.end();
    if (wanted && brdf::HasBrdfExtension(path.string())) files.push_back(path.string());
  };
  if (fs::is_regular_file(options.tables, error)) {
    take(options.tables);
  } else {
    for (const auto& entry : fs::directory_iterator(options.tables, error)) take(entry.path());
  }
  if (files.empty())
    return Fail(ErrorCode::kNotFound, options.tables + ": no BRDF files of these names");
  std::sort(files.begin(), files.end());
  return files;
}

Result<brdf::Environment> ReadEnvironment(const std::string& file, int columns) {
  PATINA_ASSIGN(const Image map, ReadImage(file));
  const int width = map.width(), height = map.height();
  if (map.info.loaded_channels < 3)
    return Fail(ErrorCode::kInvalidArgument, file + ": an environment map has three channels");
  if (width < columns || height < columns / 2) {
    return Fail(ErrorCode::kInvalidArgument, file + ": " + std::to_string(width) + " x " +
                                                 std::to_string(height) +
                                                 " texels are fewer than --map-columns " +
                                                 std::to_string(columns) + " asks for");
  }
  std::vector<float> values(static_cast<size_t>(width) * height * 3), row(width);
  for (int y = 0; y < height; ++y) {
    for (int c = 0; c < 3; ++c) {
      LoadRow(map, y, c, row.data());
      for (int x = 0; x < width; ++x) values[(static_cast<size_t>(y) * width + x) * 3 + c] = row[x];
    }
  }
  return brdf::ReduceEnvironmentEvenly(values, width, height, 3, columns);
}

// A file's name without extension, fit for a CSV field.
std::string NameOf(const std::string& path) {
  std::string name = fs::path(path).stem().string();
  for (char& c : name) {
    if (c == ',' || c == '"' || static_cast<unsigned char>(c) < ' ') c = '_';
  }
  return name;
}

class Evaluation {
 public:
  explicit Evaluation(const EvalOptions& options)
      : options_(options), pool_(options.threads), units_(UnitsOf(options)) {}

  Status Run() {
    PATINA_ASSIGN(const auto files, TableFiles(options_));
    PATINA_TRY(OpenLights());
    PATINA_TRY(OpenRows());
    if (!options_.nbrdf.empty()) {
      PATINA_ASSIGN(networks_, ReadNbrdfNetworks(options_.nbrdf));
    }
    if (!options_.truth.empty()) {
      PATINA_ASSIGN(const brdf::Source source, brdf::OpenBrdf(options_.truth));
      if (source.table == nullptr)
        return Fail(ErrorCode::kInvalidArgument,
                    options_.truth + ": a list of measurements is no table; give one as --truth");
      truth_table_ = source.table;
    }
    for (const std::string& file : files) {
      for (const Unit& unit : units_) todo_[unit.system] += IsDone(NameOf(file), unit) ? 0 : 1;
    }
    for (const std::string& file : files) PATINA_TRY(EvaluateFile(file));
    return WriteSummary();
  }

 private:
  Status OpenLights() {
    for (const std::string& file : options_.envs) {
      PATINA_ASSIGN(auto environment, ReadEnvironment(file, options_.map_columns));
      environments_.push_back(std::move(environment));
      env_names_.push_back(NameOf(file));
    }
    if (environments_.empty()) {
      environments_.push_back(
          brdf::StudioEnvironment(options_.map_columns, options_.map_columns / 2));
      env_names_.push_back("studio");
    }
    return {};
  }

  Status OpenRows() {
    PATINA_TRY(MakeDirectories(options_.out));
    rows_path_ = options_.out + "/rows.csv";
    std::error_code error;
    if (!fs::exists(rows_path_, error)) return WriteFileDurably(rows_path_, CsvHeader() + "\n");
    PATINA_ASSIGN(const std::string text, ReadTextFile(rows_path_, kMaxRowsBytes));
    size_t good = 0;
    PATINA_ASSIGN(rows_, ParseCsv(text, rows_path_, &good));
    if (good == text.size() && good > 0) return {};
    const std::string kept = good > 0 ? text.substr(0, good) : CsvHeader() + "\n";
    return WriteFileDurably(rows_path_, kept);
  }

  bool IsRow(const Row& row, const std::string& material, const Unit& unit,
             const std::string& env) const {
    return row.material == material && row.system == unit.system && row.seed == unit.seed &&
           row.env == env && row.side == options_.side && row.map_columns == options_.map_columns;
  }

  bool HasRow(const std::string& material, const Unit& unit, const std::string& env) const {
    return std::any_of(rows_.begin(), rows_.end(),
                       [&](const Row& row) { return IsRow(row, material, unit, env); });
  }

  bool IsDone(const std::string& material, const Unit& unit) const {
    return std::all_of(env_names_.begin(), env_names_.end(),
                       [&](const std::string& env) { return HasRow(material, unit, env); });
  }

  Status EvaluateFile(const std::string& file) {
    const std::string name = NameOf(file);
    if (std::all_of(units_.begin(), units_.end(),
                    [&](const Unit& unit) { return IsDone(name, unit); }))
      return {};
    Material material;
    material.name = name;
    PATINA_ASSIGN(material.source, brdf::OpenBrdf(file));
    material.networks = &networks_;
    const auto table = truth_table_ != nullptr ? truth_table_ : material.source.table;
    if (table == nullptr) {
      std::fprintf(stderr, "%s: a list of measurements needs a table as --truth; left out\n",
                   file.c_str());
      for (const Unit& unit : units_) --todo_[unit.system];
      return {};
    }
    const Truth truth(table, environments_, options_.side, pool_);
    for (const Unit& unit : units_) {
      if (!IsDone(name, unit)) PATINA_TRY(EvaluateUnit(material, truth, FunctionOf(table), unit));
    }
    return {};
  }

  Status EvaluateUnit(const Material& material, const Truth& truth,
                      const brdf::EvaluatePairs& table, const Unit& unit) {
    const auto start = Clock::now();
    auto fitted = FitSystem(unit.system, material, unit.seed, pool_);
    if (!fitted) return Fail(fitted.error(), material.name + ", " + unit.system);
    --todo_[unit.system];
    if (!fitted->has_value()) {
      std::fprintf(stderr, "%s: nothing of %s for this material\n", material.name.c_str(),
                   unit.system.c_str());
      return {};
    }
    const FittedSystem& system = **fitted;
    std::vector<Values> measured = truth.Measure(system.evaluate, pool_);
    const Speed speed = MeasureSpeed(system.evaluate, table);
    std::string lines;
    for (size_t e = 0; e < measured.size(); ++e) {
      if (HasRow(material.name, unit, env_names_[e])) continue;
      Row row{material.name, unit.system,          unit.seed,  env_names_[e],
              options_.side, options_.map_columns, measured[e]};
      row.values[kBytes] = system.bytes;
      row.values[kTrainSeconds] = system.train_seconds;
      row.values[kNanoseconds] = speed.nanoseconds;
      row.values[kTimesTable] = speed.times_other;
      lines += CsvLine(row) + "\n";
      rows_.push_back(std::move(row));
    }
    PATINA_TRY(Append(lines));
    Report(material.name, unit, measured, SecondsSince(start));
    return {};
  }

  Status Append(const std::string& lines) {
    std::FILE* file = std::fopen(rows_path_.c_str(), "ab");
    if (file == nullptr) return FailErrno(errno, "cannot append to", rows_path_);
    const bool written = std::fwrite(lines.data(), 1, lines.size(), file) == lines.size();
    const int error = errno;
    if (std::fclose(file) != 0 || !written) return FailErrno(error, "cannot append to", rows_path_);
    return {};
  }

  // With the time to go, from the mean of each system so far.
  void Report(const std::string& material, const Unit& unit, const std::vector<Values>& measured,
              double seconds) {
    auto& [spent, count] = spent_[unit.system];
    spent += seconds;
    ++count;
    double all_spent = 0, all_count = 0, to_go = 0;
    for (const auto& [system, own] : spent_) all_spent += own.first, all_count += own.second;
    int left = 0;
    for (const auto& [system, todo] : todo_) {
      const auto known = spent_.find(system);
      const double each = known != spent_.end() ? known->second.first / known->second.second
                                                : all_spent / all_count;
      to_go += todo * each;
      left += todo;
    }
    double mae = 0, ssim = 0;
    for (const Values& values : measured) {
      mae += values[kMaeSrgb] / static_cast<double>(measured.size());
      ssim += values[kSsim] / static_cast<double>(measured.size());
    }
    std::fprintf(stderr, "%s, %s, seed %llu: MAE sRGB %.5f, SSIM %.5f, %.1f s; %d left, %.1f min\n",
                 material.c_str(), unit.system.c_str(), static_cast<unsigned long long>(unit.seed),
                 mae, ssim, seconds, left, to_go / 60);
  }

  Status WriteSummary() {
    std::vector<Row> wanted;
    for (const Row& row : rows_) {
      const bool env = std::find(env_names_.begin(), env_names_.end(), row.env) != env_names_.end();
      const bool unit = std::any_of(units_.begin(), units_.end(), [&](const Unit& u) {
        return row.system == u.system && row.seed == u.seed;
      });
      const auto& only = options_.only;
      const bool material =
          only.empty() || std::find(only.begin(), only.end(), row.material) != only.end();
      if (env && unit && material && row.side == options_.side &&
          row.map_columns == options_.map_columns)
        wanted.push_back(row);
    }
    const auto statistics = Summarize(wanted, options_.systems);
    const std::string table = SummaryMarkdown(statistics);
    PATINA_TRY(WriteFileDurably(options_.out + "/summary.csv", SummaryCsv(statistics)));
    PATINA_TRY(WriteFileDurably(options_.out + "/table.md", table));
    std::fputs(table.c_str(), stdout);
    return {};
  }

  const EvalOptions& options_;
  ThreadPool pool_;
  std::vector<Unit> units_;
  std::vector<brdf::Environment> environments_;
  std::vector<std::string> env_names_;
  std::map<std::string, NbrdfNetwork> networks_;
  std::shared_ptr<const brdf::Table> truth_table_;
  std::string rows_path_;
  std::vector<Row> rows_;
  std::map<std::string, int> todo_;
  std::map<std::string, std::pair<double, int>> spent_;  // seconds, runs
};

}  // namespace

Status RunEvaluation(const EvalOptions& options) {
  const std::vector<std::string> known = SystemNames();
  for (const std::string& system : options.systems) {
    if (std::find(known.begin(), known.end(), system) == known.end())
      return Fail(ErrorCode::kInvalidArgument, "no system is called " + QuoteForMessage(system));
    if (system == "nbrdf" && options.nbrdf.empty())
      return Fail(ErrorCode::kInvalidArgument,
                  "the system nbrdf needs --nbrdf FILE; tests/bench/nbrdf_networks.py writes it");
  }
  return Evaluation(options).Run();
}

}  // namespace patina::bench
