// What validation can find: the catalogue of codes, and findings with their places.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/result.h"

namespace patina::validate {

enum class Severity { kOff, kNote, kWarning, kError };  // "off", "note", "warning", "error"
const char* SeverityName(Severity severity);
std::optional<Severity> ParseSeverity(std::string_view name);

// One entry of the catalogue. A code is never reused for another meaning.
struct FindingKind {
  int number;         // PAT-<number>, four digits
  Severity severity;  // unless somebody asks for another
  const char* name;   // lower case, with dashes: for SARIF and people
  const char* meaning;
  const char* remedy;
};

// Rising numbers. 1xxx container and manifest, 2xxx feature textures, 3xxx weights, 4xxx index
// packs, codebooks and samplers, 5xxx documents, 6xxx quality, 7xxx archives, 9xxx what cannot be
// read at all.
std::span<const FindingKind> Catalogue();
// The entry of a number that is in the catalogue.
const FindingKind& KindOf(int number);
std::string CodeText(int number);  // "PAT-1103"
// The number of "PAT-1103"; absent if the catalogue has no such code.
std::optional<int> ParseCode(std::string_view text);
// The catalogue as a document: the text of FINDINGS.md.
std::string CatalogueText();

struct Finding {
  int number = 0;
  Severity severity = Severity::kError;
  std::string file;                // relative to what was asked for
  std::string pointer;             // JSON pointer within it, or empty
  std::optional<uint64_t> offset;  // byte within it
  std::string message;
  bool accepted = false;  // by a baseline
};

// Where a finding is, beside its file.
struct Place {
  std::string pointer;
  std::optional<uint64_t> offset;
};

// The readers whose errors are findings; the value is the number before the first of their codes.
// Of each family 1 is a wrong magic, 2 a wrong header, 3 what this version does not read, 4
// truncated, 5 trailing bytes, 6 a wrong checksum.
enum class ReaderFamily { kDds = 2000, kWeights = 3000, kIndexPack = 4000, kSampler = 4100 };

// Findings of one target, in the order they were added.
class FindingList {
 public:
  void Add(int number, const std::string& file, Place place, std::string message);
  // A reader's error about the bytes of a file.
  void AddReaderError(ReaderFamily family, const std::string& file, const Error& error);
  // An error whose message may begin with a JSON pointer or hold "at byte N".
  void AddError(int number, const std::string& file, const Error& error);
  // 9001 or 9002.
  void AddUnreadable(const std::string& file, const Error& error);

  // Code by code what Add shall take for the catalogue's severity.
  explicit FindingList(const std::map<int, Severity>* overrides = nullptr)
      : overrides_(overrides) {}
  bool Has(int number) const;
  std::vector<Finding> Take() { return std::move(findings_); }
  const std::vector<Finding>& findings() const { return findings_; }

 private:
  std::vector<Finding> findings_;
  const std::map<int, Severity>* overrides_;
};

}  // namespace patina::validate
