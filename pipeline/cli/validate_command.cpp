#include <cstdio>
#include <filesystem>

#include "formats/base/file_io.h"
#include "pipeline/cli/commands.h"
#include "pipeline/jobs/brdf_files.h"
#include "pipeline/jobs/job_result.h"
#include "pipeline/svbrdf/image_set.h"
#include "pipeline/validate/report.h"
#include "pipeline/validate/settings.h"

namespace patina {
namespace {

namespace fs = std::filesystem;
using validate::ReportFormat;
using validate::ValidateOptions;
using validate::ValidationReport;

enum ValidateExit : int { kValid = 0, kFindings = 1, kUsage = 2, kCannotRead = 3 };

int UsageError(const std::string& message) {
  PrintError(message);
  return kUsage;
}

// A job file, a BRDF file or a folder.
Result<Job> SourceJob(const std::string& source) {
  std::error_code ignored;
  Job job;
  if (fs::is_directory(source, ignored)) {
    job.folder = source;
  } else if (!fs::exists(source, ignored)) {
    return Fail(ErrorCode::kNotFound, source + ": there is no such source");
  } else if (svbrdf::IsImageSetFileName(source) || LooksLikeBrdfFile(source)) {
    job = JobOfBrdfFile("", source);
  } else {
    return ReadJobFile(source);
  }
  job.asset = AssetNameFromPath(source);
  return job;
}

// Options come over what a configuration file says.
Result<ValidateOptions> OptionsOf(const ValidateArguments& given,
                                  validate::RemeasureFunction remeasure) {
  ValidateOptions options;
  options.paths = given.paths;
  options.targets.current_only = given.current_only;
  options.inputs = given.inputs;
  if (!given.config.empty()) PATINA_TRY(validate::ReadSettings(given.config, &options));
  if (!given.fail_on.empty()) options.fail_on = *validate::ParseSeverity(given.fail_on);
  for (const std::string& severity : given.severities)
    PATINA_TRY(validate::ReadSeverity(severity, &options.severities));
  if (!given.baseline.empty()) {
    PATINA_ASSIGN(options.baseline, validate::ReadBaseline(given.baseline));
  }
  if (!given.against.empty()) {
    PATINA_ASSIGN(Job source, SourceJob(given.against));
    options.against = validate::Against{std::move(source), remeasure};
  }
  std::error_code ignored;
  if (!given.inputs.empty() && !fs::is_directory(given.inputs, ignored))
    return Fail(ErrorCode::kNotFound, given.inputs + ": there is no such folder");
  return options;
}

Status WriteText(const std::string& path, const std::string& text) {
  return WriteFileDurably(path, std::string_view(text));
}

// The last line of the text: how many findings of what kind.
std::string Summary(const ValidationReport& report) {
  const std::string text = validate::ReportText(report);
  const size_t last = text.rfind('\n', text.size() - 2);
  return last == std::string::npos ? text : text.substr(last + 1);
}

}  // namespace

int ValidateCommand(const CommandLine& line, validate::RemeasureFunction remeasure,
                    const CancelToken& cancel) {
  const ValidateArguments& given = line.validate;
  if (given.list_codes) {
    std::fputs(validate::CatalogueText().c_str(), stdout);
    return kValid;
  }
  if (given.paths.empty()) return UsageError("PATH is required; see `patina validate --help`");
  auto options = OptionsOf(given, remeasure);
  if (!options) return UsageError(options.error().message);
  ThreadPool pool(line.threads);
  TerminalProgress progress(stderr, line.verbosity, "patina");
  const ValidationReport report = validate::Validate(*options, pool, cancel, progress);
  progress.OnResult({});
  if (cancel.cancelled()) {
    PrintError("interrupted");
    return kExitInterrupted;
  }
  const ReportFormat format = *validate::ParseReportFormat(given.format);
  const std::string text = validate::FormatReport(report, format);
  if (given.out.empty()) {
    std::fputs(text.c_str(), stdout);
  } else {
    const Status written = WriteText(given.out, text);
    if (!written) return UsageError(written.error().message);
    if (line.verbosity != Verbosity::kQuiet) std::fputs(Summary(report).c_str(), stdout);
  }
  if (!given.write_baseline.empty()) {
    const Status written = WriteText(given.write_baseline, validate::BaselineText(report));
    return written ? static_cast<int>(kValid) : UsageError(written.error().message);
  }
  return report.unreadable() ? kCannotRead : report.valid() ? kValid : kFindings;
}

}  // namespace patina
