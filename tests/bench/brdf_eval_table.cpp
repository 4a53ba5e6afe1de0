#include "tests/bench/brdf_eval_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>

#include "formats/base/names.h"

namespace patina::bench {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr char kKeyHeader[] = "material,system,seed,env,side,map_columns";
constexpr int kKeyFields = 6;

struct ColumnInfo {
  const char* name;
  bool less_is_worse;
};

constexpr ColumnInfo kColumns[kColumnCount] = {
    {"mae", false},
    {"rmse", false},
    {"mae_srgb", false},
    {"rmse_srgb", false},
    {"mae_frame", false},
    {"rmse_frame", false},
    {"mae_srgb_frame", false},
    {"rmse_srgb_frame", false},
    {"ssim", true},
    {"log1p_mse_table", false},
    {"log1p_mse_directions", false},
    {"log1p_mae_directions", false},
    {"ghost_max", false},
    {"ghost_mean", false},
    {"peak_error", false},
    {"reciprocity", false},
    {"albedo_0", false},
    {"albedo_30", false},
    {"albedo_60", false},
    {"albedo_80", false},
    {"albedo_89", false},
    {"true_albedo_0", false},
    {"true_albedo_30", false},
    {"true_albedo_60", false},
    {"true_albedo_80", false},
    {"true_albedo_89", false},
    {"albedo_error", false},
    {"albedo_above_1", false},
    {"true_albedo_above_1", false},
    {"minimum", true},
    {"finite", true},
    {"grazing_ratio", false},
    {"bytes", false},
    {"train_s", false},
    {"ns", false},
    {"ns_times_table", false},
};

std::string Number(double value) {
  if (std::isnan(value)) return "";
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

std::vector<std::string_view> Split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (size_t from = 0;;) {
    const size_t comma = line.find(',', from);
    fields.push_back(line.substr(from, comma - from));
    if (comma == std::string_view::npos) return fields;
    from = comma + 1;
  }
}

template <class T>
bool ParseNumber(std::string_view text, T* value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  return error == std::errc() && end == text.data() + text.size();
}

bool ParseRow(std::string_view line, Row* row) {
  const std::vector<std::string_view> fields = Split(line);
  if (fields.size() != kKeyFields + kColumnCount) return false;
  row->material = fields[0];
  row->system = fields[1];
  row->env = fields[3];
  if (!ParseNumber(fields[2], &row->seed) || !ParseNumber(fields[4], &row->side) ||
      !ParseNumber(fields[5], &row->map_columns))
    return false;
  for (int c = 0; c < kColumnCount; ++c) {
    const std::string_view field = fields[kKeyFields + c];
    if (field.empty()) {
      row->values[c] = kNan;
    } else if (!ParseNumber(field, &row->values[c])) {
      return false;
    }
  }
  return true;
}

struct Moments {
  double mean = kNan, deviation = kNan;
};

// Of the values that were measured.
Moments MomentsOf(const std::vector<double>& values) {
  double sum = 0, squares = 0, count = 0;
  for (const double v : values) {
    if (std::isnan(v)) continue;
    sum += v;
    ++count;
  }
  Moments moments;
  if (count == 0) return moments;
  moments.mean = sum / count;
  for (const double v : values) {
    if (!std::isnan(v)) squares += (v - moments.mean) * (v - moments.mean);
  }
  if (count > 1) moments.deviation = std::sqrt(squares / (count - 1));
  return moments;
}

// Values of one material: over environments of a seed first, then over seeds.
using Seeds = std::map<uint64_t, std::vector<Values>>;

Statistics StatisticsOf(const std::map<std::string, Seeds>& materials) {
  Statistics s;
  s.materials = static_cast<int>(materials.size());
  for (const auto& [material, seeds] : materials) s.runs += static_cast<int>(seeds.size());
  for (int c = 0; c < kColumnCount; ++c) {
    std::vector<double> means, deviations;
    s.worst[c] = kNan;
    for (const auto& [material, seeds] : materials) {
      std::vector<double> of_seeds;
      for (const auto& [seed, rows] : seeds) {
        std::vector<double> of_environments;
        of_environments.reserve(rows.size());
        for (const Values& values : rows) of_environments.push_back(values[c]);
        of_seeds.push_back(MomentsOf(of_environments).mean);
      }
      const Moments moments = MomentsOf(of_seeds);
      means.push_back(moments.mean);
      deviations.push_back(moments.deviation);
      const double sign = kColumns[c].less_is_worse ? -1 : 1;
      if (std::isnan(s.worst[c]) || sign * moments.mean > sign * s.worst[c]) {
        s.worst[c] = moments.mean;
        s.worst_material[c] = material;
      }
    }
    const Moments moments = MomentsOf(means);
    s.mean[c] = moments.mean;
    s.deviation[c] = moments.deviation;
    s.seed_deviation[c] = MomentsOf(deviations).mean;
  }
  return s;
}

std::string Format(const char* format, double value) {
  if (std::isnan(value)) return "";
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string MeanAndDeviation(const Statistics& s, int column, const char* format) {
  std::string text = Format(format, s.mean[column]);
  if (!std::isnan(s.deviation[column])) text += " ± " + Format(format, s.deviation[column]);
  return text;
}

std::string WorstOf(const Statistics& s, int column, const char* format) {
  return Format(format, s.worst[column]) + " " + s.worst_material[column];
}

using Cell = std::string (*)(const Statistics&);

struct TableColumn {
  const char* title;
  Cell cell;
};

std::string Table(const char* title, std::span<const Statistics> statistics, bool all_environments,
                  std::span<const TableColumn> columns) {
  std::string text = std::string("**") + title + "**\n\n| system |", rule = "|---|";
  if (all_environments) text += " environment |", rule += "---|";
  for (const TableColumn& column : columns) {
    text += std::string(" ") + column.title + " |";
    rule += "---|";
  }
  text += "\n" + rule + "\n";
  for (size_t i = 0; i < statistics.size(); ++i) {
    const Statistics& s = statistics[i];
    // The last of a system stands for all its environments.
    const bool last = i + 1 == statistics.size() || statistics[i + 1].system != s.system;
    if (!all_environments && !last) continue;
    text += "| " + s.system + " |";
    if (all_environments) text += " " + s.env + " |";
    for (const TableColumn& column : columns) text += " " + column.cell(s) + " |";
    text += "\n";
  }
  return text + "\n";
}

}  // namespace

std::string CsvHeader() {
  std::string header = kKeyHeader;
  for (const ColumnInfo& column : kColumns) header += std::string(",") + column.name;
  return header;
}

std::string CsvLine(const Row& row) {
  std::string line = row.material + "," + row.system + "," + std::to_string(row.seed) + "," +
                     row.env + "," + std::to_string(row.side) + "," +
                     std::to_string(row.map_columns);
  for (const double value : row.values) line += "," + Number(value);
  return line;
}

Result<std::vector<Row>> ParseCsv(std::string_view text, const std::string& name,
                                  size_t* good_bytes) {
  std::vector<Row> rows;
  *good_bytes = 0;
  for (int number = 1;; ++number) {
    const size_t end = text.find('\n', *good_bytes);
    if (end == std::string_view::npos) return rows;
    const std::string_view line = text.substr(*good_bytes, end - *good_bytes);
    Row row;
    if (number == 1 ? line != CsvHeader() : !ParseRow(line, &row)) {
      return Fail(ErrorCode::kCorruptData,
                  name + ": line " + std::to_string(number) + ", " +
                      QuoteForMessage(std::string(line.substr(0, 80))) +
                      ", is not of this version of the program; move the file away or choose "
                      "another --out");
    }
    if (number > 1) rows.push_back(row);
    *good_bytes = end + 1;
  }
}

std::vector<Statistics> Summarize(std::span<const Row> rows, std::span<const std::string> systems) {
  std::vector<std::string> environments;
  for (const Row& row : rows) {
    if (std::find(environments.begin(), environments.end(), row.env) == environments.end())
      environments.push_back(row.env);
  }
  std::vector<Statistics> statistics;
  for (const std::string& system : systems) {
    const auto add = [&](const std::string& env, bool all) {
      std::map<std::string, Seeds> materials;
      for (const Row& row : rows) {
        if (row.system == system && (all || row.env == env))
          materials[row.material][row.seed].push_back(row.values);
      }
      if (materials.empty()) return;
      Statistics s = StatisticsOf(materials);
      s.system = system;
      s.env = env;
      statistics.push_back(std::move(s));
    };
    for (const std::string& env : environments) add(env, false);
    if (environments.size() > 1) add("mean", true);
  }
  return statistics;
}

std::string SummaryCsv(std::span<const Statistics> statistics) {
  std::string text = "system,env,materials,runs,statistic";
  for (const ColumnInfo& column : kColumns) text += std::string(",") + column.name;
  text += "\n";
  for (const Statistics& s : statistics) {
    const std::string key =
        s.system + "," + s.env + "," + std::to_string(s.materials) + "," + std::to_string(s.runs);
    const auto line = [&](const char* statistic, const Values& values) {
      text += key + "," + statistic;
      for (const double value : values) text += "," + Number(value);
      text += "\n";
    };
    line("mean", s.mean);
    line("std", s.deviation);
    line("worst", s.worst);
    text += key + ",worst_material";
    for (const std::string& material : s.worst_material) text += "," + material;
    text += "\n";
    line("seed_std", s.seed_deviation);
  }
  return text;
}

std::string SummaryMarkdown(std::span<const Statistics> statistics) {
  const TableColumn images[] = {
      {"materials, runs",
       [](const Statistics& s) {
         return std::to_string(s.materials) + ", " + std::to_string(s.runs);
       }},
      {"kB", [](const Statistics& s) { return Format("%.1f", s.mean[kBytes] * 1e-3); }},
      {"training, s", [](const Statistics& s) { return Format("%.1f", s.mean[kTrainSeconds]); }},
      {"ns", [](const Statistics& s) { return Format("%.0f", s.mean[kNanoseconds]); }},
      {"× table", [](const Statistics& s) { return Format("%.2f", s.mean[kTimesTable]); }},
      {"MAE", [](const Statistics& s) { return MeanAndDeviation(s, kMae, "%.5f"); }},
      {"RMSE", [](const Statistics& s) { return MeanAndDeviation(s, kRmse, "%.5f"); }},
      {"MAE sRGB", [](const Statistics& s) { return MeanAndDeviation(s, kMaeSrgb, "%.5f"); }},
      {"RMSE sRGB", [](const Statistics& s) { return MeanAndDeviation(s, kRmseSrgb, "%.5f"); }},
      {"SSIM", [](const Statistics& s) { return MeanAndDeviation(s, kSsim, "%.5f"); }},
  };
  const TableColumn frames[] = {
      {"MAE", [](const Statistics& s) { return MeanAndDeviation(s, kMaeFrame, "%.5f"); }},
      {"RMSE", [](const Statistics& s) { return MeanAndDeviation(s, kRmseFrame, "%.5f"); }},
      {"MAE sRGB", [](const Statistics& s) { return MeanAndDeviation(s, kMaeSrgbFrame, "%.5f"); }},
      {"RMSE sRGB",
       [](const Statistics& s) { return MeanAndDeviation(s, kRmseSrgbFrame, "%.5f"); }},
      {"MAE sRGB between seeds, ±",
       [](const Statistics& s) { return Format("%.5f", s.seed_deviation[kMaeSrgb]); }},
  };
  const TableColumn worst[] = {
      {"MAE", [](const Statistics& s) { return WorstOf(s, kMae, "%.5f"); }},
      {"MAE sRGB", [](const Statistics& s) { return WorstOf(s, kMaeSrgb, "%.5f"); }},
      {"SSIM", [](const Statistics& s) { return WorstOf(s, kSsim, "%.5f"); }},
      {"ghost", [](const Statistics& s) { return WorstOf(s, kGhostMax, "%.3g"); }},
      {"peak", [](const Statistics& s) { return WorstOf(s, kPeak, "%.3f"); }},
      {"grazing ratio", [](const Statistics& s) { return WorstOf(s, kGrazingRatio, "%.2f"); }},
  };
  const TableColumn data[] = {
      {"log1p MSE, table",
       [](const Statistics& s) { return MeanAndDeviation(s, kLog1pMseTable, "%.5f"); }},
      {"log1p MSE, directions",
       [](const Statistics& s) { return MeanAndDeviation(s, kLog1pMseDirections, "%.5f"); }},
      {"log1p MAE, directions",
       [](const Statistics& s) { return MeanAndDeviation(s, kLog1pMaeDirections, "%.5f"); }},
      {"ghost max / mean",
       [](const Statistics& s) {
         return Format("%.3g", s.mean[kGhostMax]) + " / " + Format("%.2g", s.mean[kGhostMean]);
       }},
      {"peak error", [](const Statistics& s) { return MeanAndDeviation(s, kPeak, "%.4f"); }},
      {"reciprocity", [](const Statistics& s) { return Format("%.5f", s.mean[kReciprocity]); }},
      {"albedo error", [](const Statistics& s) { return Format("%.5f", s.mean[kAlbedoError]); }},
      {"albedos above 1 / of the data",
       [](const Statistics& s) {
         return Format("%.2f", s.mean[kAlbedoAboveOne]) + " / " +
                Format("%.2f", s.mean[kTrueAlbedoAboveOne]);
       }},
      {"minimum", [](const Statistics& s) { return Format("%.3g", s.worst[kMinimum]); }},
      {"finite", [](const Statistics& s) { return Format("%.2f", s.mean[kFinite]); }},
      {"grazing ratio", [](const Statistics& s) { return Format("%.3f", s.mean[kGrazingRatio]); }},
  };
  const TableColumn environments[] = {
      {"MAE", [](const Statistics& s) { return Format("%.5f", s.mean[kMae]); }},
      {"RMSE", [](const Statistics& s) { return Format("%.5f", s.mean[kRmse]); }},
      {"MAE sRGB", [](const Statistics& s) { return Format("%.5f", s.mean[kMaeSrgb]); }},
      {"RMSE sRGB", [](const Statistics& s) { return Format("%.5f", s.mean[kRmseSrgb]); }},
      {"SSIM", [](const Statistics& s) { return Format("%.5f", s.mean[kSsim]); }},
      {"worst SSIM", [](const Statistics& s) { return WorstOf(s, kSsim, "%.5f"); }},
  };
  return Table("Images: mean ± standard deviation over materials, on the sphere's pixels",
               statistics, false, images) +
         Table("Images over the whole frame", statistics, false, frames) +
         Table("Worst materials", statistics, false, worst) +
         Table("Values of the BRDF", statistics, false, data) +
         Table("By environment", statistics, true, environments);
}

}  // namespace patina::bench
