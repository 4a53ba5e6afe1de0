#include "formats/brdf/sparse.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "formats/base/file_io.h"
#include "formats/base/names.h"
#include "formats/brdf/angles.h"
#include "formats/brdf/cells.h"
#include "formats/json_view.h"

namespace patina::brdf {
namespace {

constexpr double kMinHeight = 1e-6;
constexpr double kUnitTolerance = 1e-3;

using Vector = std::array<double, 3>;

// Collects samples, repairs or leaves out what is not as it should be, and keeps the account.
class SampleList {
 public:
  explicit SampleList(std::string name) : name_(std::move(name)) {}

  // `place` is "line 7" or "/samples/6".
  void Add(Vector wi, Vector wo, const Vector& rgb, double weight, const std::string& place) {
    ++rows_;
    bool rescaled = false;
    const int bad_directions = Normalise(&wi, &rescaled) + Normalise(&wo, &rescaled);
    if (bad_directions > 0) return no_length_.Note(place);
    if (wi[2] < kMinHeight || wo[2] < kMinHeight) return below_.Note(place);
    const double limit = static_cast<double>(kMaxValue);
    for (const double value : rgb) {
      if (!(std::abs(value) <= limit)) return not_finite_.Note(place);
    }
    if (std::min({rgb[0], rgb[1], rgb[2]}) < 0) return negative_.Note(place);
    if (!(weight > 1e-30 && weight <= limit)) return bad_weight_.Note(place);
    if (rescaled) rescaled_.Note(place);
    Sample sample;
    sample.wi = ToDirection(wi);
    sample.wo = ToDirection(wo);
    for (int c = 0; c < 3; ++c) sample.rgb[c] = static_cast<float>(rgb[c]);
    sample.weight = static_cast<float>(weight);
    samples_.push_back(sample);
  }

  Result<Source> Finish(bool isotropic) {
    Source source;
    source.format = "sparse";
    source.isotropic = isotropic;
    source.cells = rows_;
    source.invalid_cells = rows_ - samples_.size();
    const std::string left_out = " left out, the first at ";
    const auto warn = [&](const Account& account, const std::string& what) {
      if (account.count == 0) return;
      source.warnings.push_back(std::to_string(account.count) +
                                (account.count == 1 ? " sample " : " samples ") + what +
                                account.first);
    };
    warn(below_, "with a direction at or below the horizon" + left_out);
    warn(no_length_, "with a direction without a length" + left_out);
    warn(negative_, "with a negative value" + left_out);
    warn(not_finite_, "with a value that is not finite or above 1e30" + left_out);
    warn(bad_weight_, "with a weight that is not above 0" + left_out);
    warn(rescaled_, "with a direction that is not of length 1: normalised, the first at ");
    if (samples_.empty()) {
      std::string why;
      for (const std::string& warning : source.warnings) why += "; " + warning;
      return Fail(ErrorCode::kCorruptData,
                  name_ + ": no usable sample in the list" + why +
                      "; a sample needs wi and wo above the surface and rgb of 0 and more");
    }
    float max_theta = 0;
    for (const Sample& sample : samples_)
      max_theta = std::max({max_theta, Colatitude(sample.wi), Colatitude(sample.wo)});
    source.max_theta_rad = max_theta;
    source.samples = std::move(samples_);
    return source;
  }

 private:
  struct Account {
    uint64_t count = 0;
    std::string first;
    void Note(const std::string& place) {
      if (count++ == 0) first = place;
    }
  };

  // Returns 1 for a vector that has no direction, else 0.
  static int Normalise(Vector* v, bool* rescaled) {
    const double largest = std::max({std::abs((*v)[0]), std::abs((*v)[1]), std::abs((*v)[2])});
    const double sum = (*v)[0] + (*v)[1] + (*v)[2];  // not finite if a component is not
    if (!(largest > 1e-9) || !std::isfinite(largest) || sum != sum) return 1;
    double length = 0;
    for (const double c : *v) length += c / largest * (c / largest);
    length = largest * std::sqrt(length);
    *rescaled |= std::abs(length - 1) > kUnitTolerance;
    if (!std::isfinite(length)) return 1;
    for (double& c : *v) c /= length;
    return 0;
  }

  static Direction ToDirection(const Vector& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
  }

  std::string name_;
  uint64_t rows_ = 0;
  std::vector<Sample> samples_;
  Account below_, no_length_, negative_, not_finite_, bad_weight_, rescaled_;
};

std::string_view Trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

constexpr size_t kMaxColumns = 32;

// The fields of a line; one more than kMaxColumns at most.
std::vector<std::string_view> Split(std::string_view line) {
  std::vector<std::string_view> fields;
  while (fields.size() <= kMaxColumns) {
    const size_t comma = line.find(',');
    fields.push_back(Trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) break;
    line.remove_prefix(comma + 1);
  }
  return fields;
}

bool ParseNumber(std::string_view text, double* value) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *value);
  if (error == std::errc::result_out_of_range && end == text.data() + text.size()) {
    *value = std::numeric_limits<double>::infinity();  // left out later, as not finite
    return true;
  }
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

enum Column : int {
  kWix,
  kWiy,
  kWiz,
  kWox,
  kWoy,
  kWoz,
  kThetaI,
  kPhiI,
  kThetaO,
  kPhiO,
  kRed,
  kGreen,
  kBlue,
  kWeight,
  kColumnCount
};
constexpr const char* kColumnNames[kColumnCount] = {"wix", "wiy",     "wiz",   "wox",     "woy",
                                                    "woz", "theta_i", "phi_i", "theta_o", "phi_o",
                                                    "r",   "g",       "b",     "weight"};

constexpr char kColumnRemedy[] =
    "the columns are wix,wiy,wiz,wox,woy,woz,r,g,b[,weight] or "
    "theta_i,phi_i,theta_o,phi_o,r,g,b[,weight] (degrees)";

// Where each column stands in a line; -1: not there.
struct Columns {
  int place[kColumnCount];
  size_t count = 0;
  bool angles = false;
};

Result<Columns> ColumnsOfHeader(const std::vector<std::string_view>& names,
                                const std::string& where) {
  Columns columns;
  columns.count = names.size();
  std::fill(std::begin(columns.place), std::end(columns.place), -1);
  for (size_t i = 0; i < names.size(); ++i) {
    std::string lower(names[i]);
    for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    const auto found = std::find(std::begin(kColumnNames), std::end(kColumnNames), lower);
    if (found == std::end(kColumnNames)) {
      return Fail(ErrorCode::kCorruptData,
                  where + ": unknown column " + QuoteForMessage(names[i]) + "; " + kColumnRemedy);
    }
    int& place = columns.place[found - std::begin(kColumnNames)];
    if (place >= 0) {
      return Fail(ErrorCode::kCorruptData,
                  where + ": column " + QuoteForMessage(names[i]) + " is there twice");
    }
    place = static_cast<int>(i);
  }
  const auto complete = [&](int first, int last) {
    return std::all_of(columns.place + first, columns.place + last + 1,
                       [](int place) { return place >= 0; });
  };
  const auto any = [&](int first, int last) {
    return std::any_of(columns.place + first, columns.place + last + 1,
                       [](int place) { return place >= 0; });
  };
  columns.angles = complete(kThetaI, kPhiO);
  const bool one_kind =
      columns.angles ? !any(kWix, kWoz) : complete(kWix, kWoz) && !any(kThetaI, kPhiO);
  if (!one_kind || !complete(kRed, kBlue)) {
    return Fail(ErrorCode::kCorruptData,
                where + ": the names do not make a list of measurements; " + kColumnRemedy);
  }
  return columns;
}

Result<Columns> ColumnsOfNumbers(size_t count, const std::string& where) {
  if (count != 9 && count != 10) {
    return Fail(ErrorCode::kCorruptData, where + ": " + std::to_string(count) +
                                             " columns without names, not 9 or 10; " +
                                             kColumnRemedy);
  }
  Columns columns;
  columns.count = count;
  std::fill(std::begin(columns.place), std::end(columns.place), -1);
  for (int i = 0; i < 6; ++i) columns.place[kWix + i] = i;
  for (int c = 0; c < 3; ++c) columns.place[kRed + c] = 6 + c;
  if (count == 10) columns.place[kWeight] = 9;
  return columns;
}

Vector FromDegrees(double theta, double phi) {
  const double t = theta * (std::numbers::pi / 180);
  const double p = phi * (std::numbers::pi / 180);
  return {std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t)};
}

}  // namespace

Result<Source> ParseSparseCsv(std::string_view text, const std::string& name) {
  SampleList list(name);
  bool isotropic = true;
  bool have_columns = false;
  Columns columns;
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  for (uint64_t number = 1; !text.empty(); ++number) {
    const size_t end = text.find('\n');
    const std::string_view line = Trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty()) continue;
    if (line.front() == '#') {
      if (Trimmed(line.substr(1)) == "anisotropic") isotropic = false;
      continue;
    }
    const auto where = [&] { return name + ": line " + std::to_string(number); };
    const std::vector<std::string_view> fields = Split(line);
    if (!have_columns) {
      have_columns = true;
      double ignored;
      if (ParseNumber(fields[0], &ignored)) {
        PATINA_ASSIGN(columns, ColumnsOfNumbers(fields.size(), where()));
      } else {
        PATINA_ASSIGN(columns, ColumnsOfHeader(fields, where()));
        continue;
      }
    }
    if (fields.size() != columns.count) {
      return Fail(ErrorCode::kCorruptData,
                  where() + ": " + std::to_string(fields.size()) + " columns instead of " +
                      std::to_string(columns.count) + "; is the line cut off?");
    }
    double values[kColumnCount] = {};
    values[kWeight] = 1;
    for (int c = 0; c < kColumnCount; ++c) {
      if (columns.place[c] < 0) continue;
      const std::string_view field = fields[static_cast<size_t>(columns.place[c])];
      if (!ParseNumber(field, &values[c])) {
        return Fail(ErrorCode::kCorruptData, where() + ", column " + kColumnNames[c] + ": " +
                                                 QuoteForMessage(field) +
                                                 " is not a number; write it with a decimal point");
      }
    }
    const Vector wi = columns.angles ? FromDegrees(values[kThetaI], values[kPhiI])
                                     : Vector{values[kWix], values[kWiy], values[kWiz]};
    const Vector wo = columns.angles ? FromDegrees(values[kThetaO], values[kPhiO])
                                     : Vector{values[kWox], values[kWoy], values[kWoz]};
    list.Add(wi, wo, {values[kRed], values[kGreen], values[kBlue]}, values[kWeight],
             "line " + std::to_string(number));
  }
  return list.Finish(isotropic);
}

Result<Source> ParseSparseJson(std::string_view text, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Fail(ErrorCode::kCorruptData, name + ": " + what);
  };
  const nlohmann::json document =
      nlohmann::json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
  if (document.is_discarded()) return corrupt("not valid JSON; is the file cut off?");
  JsonProblem problem;
  const JsonView root(&document, &problem);
  bool isotropic = true;
  if (const JsonView stated = root.Optional("isotropic")) isotropic = stated.Bool();
  SampleList list(name);
  size_t index = 0;
  const auto vector = [](const JsonView& view) {
    Vector result = {0, 0, 0};
    size_t count = 0;
    view.ForEach(3, [&](const JsonView& element) { result[count++] = element.Number(); });
    return std::pair(result, count == 3);
  };
  std::string short_vector;
  root.Field("samples").ForEach(kMaxSparseJsonBytes, [&](const JsonView& sample) {
    if (!problem.text.empty() || !short_vector.empty()) return;
    const std::string place = "/samples/" + std::to_string(index++);
    const auto [wi, wi_complete] = vector(sample.Field("wi"));
    const auto [wo, wo_complete] = vector(sample.Field("wo"));
    const auto [rgb, rgb_complete] = vector(sample.Field("rgb"));
    double weight = 1;
    if (const JsonView stated = sample.Optional("weight")) weight = stated.Number();
    if (!problem.text.empty()) return;
    if (!wi_complete || !wo_complete || !rgb_complete) {
      short_vector = place + ": \"wi\", \"wo\" and \"rgb\" are arrays of three numbers";
      return;
    }
    list.Add(wi, wo, rgb, weight, place);
  });
  const std::string wrong = problem.text.empty() ? short_vector : problem.text;
  if (!wrong.empty()) {
    return corrupt(wrong +
                   "; a sparse list is {\"samples\": [{\"wi\": [x, y, z], \"wo\": [x, y, z], "
                   "\"rgb\": [r, g, b]}, ...]}");
  }
  return list.Finish(isotropic);
}

Result<Source> ReadSparseCsv(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxSparseCsvBytes));
  return ParseSparseCsv(text, path);
}

Result<Source> ReadSparseJson(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, kMaxSparseJsonBytes));
  return ParseSparseJson(text, path);
}

}  // namespace patina::brdf
