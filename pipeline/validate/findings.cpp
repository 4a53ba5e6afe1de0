#include "pipeline/validate/findings.h"

#include <algorithm>
#include <charconv>

namespace patina::validate {
namespace {

struct PrefixCode {
  ReaderFamily family;
  const char* prefix;  // of the reader's message; its header promises it
  int number;          // within the family
};

constexpr PrefixCode kPrefixes[] = {
    {ReaderFamily::kWeights, "bad tensor", 7},
    {ReaderFamily::kWeights, "non-finite weight", 8},
    {ReaderFamily::kIndexPack, "bad map", 7},
    {ReaderFamily::kIndexPack, "bad index", 8},
    {ReaderFamily::kIndexPack, "bad codebook", 9},
    {ReaderFamily::kIndexPack, "non-finite primitive", 10},
    {ReaderFamily::kIndexPack, "bad zstd frame", 11},
    {ReaderFamily::kSampler, "bad table", 7},
};

constexpr const char* kCommonPrefixes[] = {"bad magic", "bad header",     nullptr,
                                           "truncated", "trailing bytes", "bad checksum"};

bool StartsWith(const std::string& text, std::string_view prefix) {
  return text.compare(0, prefix.size(), prefix) == 0;
}

int NumberOf(ReaderFamily family, const Error& error) {
  if (error.code == ErrorCode::kUnsupported) return 3;
  for (const PrefixCode& entry : kPrefixes) {
    if (entry.family == family && StartsWith(error.message, entry.prefix)) return entry.number;
  }
  for (int i = 0; i < 6; ++i) {
    if (kCommonPrefixes[i] != nullptr && StartsWith(error.message, kCommonPrefixes[i]))
      return i + 1;
  }
  // The only other error of these readers: a zstd frame above the limit.
  return family == ReaderFamily::kIndexPack && error.code == ErrorCode::kOutOfRange ? 11 : 2;
}

Place PlaceIn(const std::string& message) {
  Place place;
  if (!message.empty() && message[0] == '/') {
    place.pointer = message.substr(0, message.find(": "));
    return place;
  }
  constexpr std::string_view kAtByte = "at byte ";
  const size_t at = message.find(kAtByte);
  if (at == std::string::npos) return place;
  uint64_t offset = 0;
  const char* begin = message.data() + at + kAtByte.size();
  if (std::from_chars(begin, message.data() + message.size(), offset).ec == std::errc())
    place.offset = offset;
  return place;
}

}  // namespace

const char* SeverityName(Severity severity) {
  switch (severity) {
    case Severity::kOff:
      return "off";
    case Severity::kNote:
      return "note";
    case Severity::kWarning:
      return "warning";
    case Severity::kError:
      break;
  }
  return "error";
}

std::optional<Severity> ParseSeverity(std::string_view name) {
  for (const Severity severity :
       {Severity::kOff, Severity::kNote, Severity::kWarning, Severity::kError}) {
    if (name == SeverityName(severity)) return severity;
  }
  return std::nullopt;
}

void FindingList::Add(int number, const std::string& file, Place place, std::string message) {
  Severity severity = KindOf(number).severity;
  if (overrides_ != nullptr) {
    const auto given = overrides_->find(number);
    if (given != overrides_->end()) severity = given->second;
  }
  if (severity == Severity::kOff) return;
  findings_.push_back(
      {number, severity, file, std::move(place.pointer), place.offset, std::move(message), false});
}

void FindingList::AddReaderError(ReaderFamily family, const std::string& file, const Error& error) {
  AddError(static_cast<int>(family) + NumberOf(family, error), file, error);
}

void FindingList::AddError(int number, const std::string& file, const Error& error) {
  Place place = PlaceIn(error.message);
  std::string message = error.message;
  // The place is told by itself.
  if (!place.pointer.empty() && message.size() > place.pointer.size() + 2)
    message = message.substr(place.pointer.size() + 2);
  Add(number, file, std::move(place), std::move(message));
}

void FindingList::AddUnreadable(const std::string& file, const Error& error) {
  Add(error.code == ErrorCode::kNotFound ? 9001 : 9002, file, {}, error.message);
}

bool FindingList::Has(int number) const {
  return std::any_of(findings_.begin(), findings_.end(),
                     [&](const Finding& finding) { return finding.number == number; });
}

}  // namespace patina::validate
