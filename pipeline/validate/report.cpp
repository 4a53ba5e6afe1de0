#include "pipeline/validate/report.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "formats/base/names.h"
#include "pipeline/report/html.h"

namespace patina::validate {
namespace {

using Json = nlohmann::ordered_json;

std::string Dump(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

// Where a finding is, for a person: "wall/r0001/manifest.json /seed", "a.dds byte 128".
std::string PlaceText(const Finding& finding) {
  std::string text = finding.file;
  if (!finding.pointer.empty()) text += " " + finding.pointer;
  if (finding.offset) text += " byte " + std::to_string(*finding.offset);
  return text;
}

// Controls and bytes that are not UTF-8, of names and messages, do not reach a terminal.
std::string Printable(std::string_view text) {
  if (!IsUtf8(text)) {
    std::string ascii(text);
    for (char& c : ascii) c = static_cast<unsigned char>(c) < 0x80 ? c : '?';
    return Printable(ascii);
  }
  std::string printable(text);
  for (char& c : printable) c = static_cast<unsigned char>(c) < 0x20 || c == 0x7F ? '?' : c;
  return printable;
}

// A path as a relative URI reference (RFC 3986).
std::string Uri(std::string_view path) {
  constexpr char kDigits[] = "0123456789ABCDEF";
  std::string uri;
  for (const char c : path) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("-._~/").find(c) != std::string_view::npos;
    const auto byte = static_cast<unsigned char>(c);
    if (plain) {
      uri += c;
    } else {
      uri += {'%', kDigits[byte >> 4], kDigits[byte & 15]};
    }
  }
  return uri;
}

std::string Plural(size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

Json RuleOf(const FindingKind& kind) {
  return {{"id", CodeText(kind.number)},
          {"name", kind.name},
          {"shortDescription", {{"text", kind.meaning}}},
          {"help", {{"text", kind.remedy}}},
          {"defaultConfiguration", {{"level", SeverityName(kind.severity)}}}};
}

}  // namespace

std::optional<ReportFormat> ParseReportFormat(std::string_view name) {
  if (name == "text") return ReportFormat::kText;
  if (name == "json") return ReportFormat::kJson;
  if (name == "junit") return ReportFormat::kJunit;
  if (name == "sarif") return ReportFormat::kSarif;
  return std::nullopt;
}

std::string ReportText(const ValidationReport& report) {
  std::string text;
  std::set<int> remedies;  // told once
  for (const PlacedFinding& placed : report.findings) {
    const Finding& finding = placed.finding;
    if (finding.accepted) continue;
    text += Printable(PlaceText(finding)) + ": " + SeverityName(finding.severity) + " " +
            CodeText(finding.number) + ": " + Printable(finding.message) + "\n";
    if (remedies.insert(finding.number).second)
      text += std::string("    ") + KindOf(finding.number).remedy + "\n";
  }
  text += Plural(report.targets.size(), "target") + ": " +
          Plural(report.Count(Severity::kError), "error") + ", " +
          Plural(report.Count(Severity::kWarning), "warning") + ", " +
          Plural(report.Count(Severity::kNote), "note");
  if (report.accepted() > 0)
    text += ", " + std::to_string(report.accepted()) + " accepted by the baseline";
  if (report.stale > 0)
    text += ", " + std::to_string(report.stale) + " of the baseline not found any more";
  return text + (report.valid() ? "; valid\n" : "; not valid\n");
}

std::string ReportJson(const ValidationReport& report) {
  Json json;
  json["version"] = 1;
  json["tool"] = {{"name", "patina validate"}, {"version", report.version}};
  json["fail_on"] = SeverityName(report.fail_on);
  json["valid"] = report.valid();
  json["targets"] = Json::array();
  for (const Target& target : report.targets)
    json["targets"].push_back({{"path", target.label}, {"kind", KindName(target)}});
  json["counts"] = {{"error", report.Count(Severity::kError)},
                    {"warning", report.Count(Severity::kWarning)},
                    {"note", report.Count(Severity::kNote)},
                    {"accepted", report.accepted()},
                    {"stale", report.stale}};
  json["findings"] = Json::array();
  for (const PlacedFinding& placed : report.findings) {
    const Finding& finding = placed.finding;
    const FindingKind& kind = KindOf(finding.number);
    Json entry = {{"code", CodeText(finding.number)},
                  {"name", kind.name},
                  {"severity", SeverityName(finding.severity)},
                  {"target", placed.target},
                  {"file", finding.file}};
    if (!finding.pointer.empty()) entry["pointer"] = finding.pointer;
    if (finding.offset) entry["offset"] = *finding.offset;
    entry["message"] = finding.message;
    entry["remedy"] = kind.remedy;
    if (finding.accepted) entry["accepted"] = true;
    json["findings"].push_back(std::move(entry));
  }
  return Dump(json);
}

std::string ReportJunit(const ValidationReport& report) {
  struct Case {
    std::string failure, first, below;
    bool unreadable = false;
  };
  std::vector<Case> cases(report.targets.size());
  for (const PlacedFinding& placed : report.findings) {
    const Finding& finding = placed.finding;
    if (finding.accepted) continue;
    Case& test = cases[placed.target];
    const std::string line = std::string(SeverityName(finding.severity)) + " " +
                             CodeText(finding.number) + " " + PlaceText(finding) + ": " +
                             finding.message;
    if (finding.severity < report.fail_on) {
      test.below += EscapeHtml(line) + "\n";
      continue;
    }
    if (test.failure.empty()) test.first = line;
    test.failure += EscapeHtml(line) + "\n" + EscapeHtml(KindOf(finding.number).remedy) + "\n";
    test.unreadable = test.unreadable || finding.number >= 9000;
  }
  size_t failures = 0, errors = 0;
  std::string body;
  for (size_t i = 0; i < cases.size(); ++i) {
    const Case& test = cases[i];
    body += "    <testcase classname=\"patina." + std::string(KindName(report.targets[i])) +
            "\" name=\"" + EscapeHtml(report.targets[i].label) + "\"";
    if (test.failure.empty() && test.below.empty()) {
      body += "/>\n";
      continue;
    }
    body += ">\n";
    if (!test.failure.empty()) {
      ++(test.unreadable ? errors : failures);
      const std::string element = test.unreadable ? "error" : "failure";
      body += "      <" + element + " message=\"" + EscapeHtml(test.first) + "\">" + test.failure + "</" +
              element + ">\n";
    }
    if (!test.below.empty()) body += "      <system-out>" + test.below + "</system-out>\n";
    body += "    </testcase>\n";
  }
  const std::string counts = "tests=\"" + std::to_string(cases.size()) + "\" failures=\"" +
                             std::to_string(failures) + "\" errors=\"" + std::to_string(errors) +
                             "\"";
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites " + counts +
         ">\n  <testsuite name=\"patina validate\" " + counts + ">\n" + body +
         "  </testsuite>\n</testsuites>\n";
}

std::string ReportSarif(const ValidationReport& report) {
  Json rules = Json::array();
  std::map<int, size_t> index_of;
  for (const FindingKind& kind : Catalogue()) {
    index_of[kind.number] = rules.size();
    rules.push_back(RuleOf(kind));
  }
  Json results = Json::array();
  for (const PlacedFinding& placed : report.findings) {
    const Finding& finding = placed.finding;
    Json physical = {
        {"artifactLocation", {{"uri", Uri(finding.file)}, {"uriBaseId", "%SRCROOT%"}}}};
    if (finding.offset) physical["region"] = {{"byteOffset", *finding.offset}, {"byteLength", 1}};
    Json location = {{"physicalLocation", std::move(physical)}};
    if (!finding.pointer.empty())
      location["logicalLocations"] = {
          {{"fullyQualifiedName", finding.pointer}, {"kind", "member"}}};
    Json result = {{"ruleId", CodeText(finding.number)},
                   {"ruleIndex", index_of[finding.number]},
                   {"level", SeverityName(finding.severity)},
                   {"message", {{"text", finding.message}}},
                   {"locations", {std::move(location)}}};
    if (finding.accepted) result["suppressions"] = {{{"kind", "external"}}};
    results.push_back(std::move(result));
  }
  const Json driver = {{"name", "patina validate"},
                       {"semanticVersion", report.version},
                       {"rules", std::move(rules)}};
  Json json;
  json["$schema"] = "https://json.schemastore.org/sarif-2.1.0.json";
  json["version"] = "2.1.0";
  json["runs"] = Json::array();
  json["runs"].push_back({{"tool", {{"driver", driver}}},
                          {"columnKind", "unicodeCodePoints"},
                          {"results", std::move(results)}});
  return Dump(json);
}

std::string FormatReport(const ValidationReport& report, ReportFormat format) {
  switch (format) {
    case ReportFormat::kText:
      return ReportText(report);
    case ReportFormat::kJson:
      return ReportJson(report);
    case ReportFormat::kJunit:
      return ReportJunit(report);
    case ReportFormat::kSarif:
      break;
  }
  return ReportSarif(report);
}

}  // namespace patina::validate
