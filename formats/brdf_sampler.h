// sampler.bin: the tables of a BRDF's importance sampler as bytes. What the tables mean and how
// they are sampled is in the standalone header; the byte table is in FORMATS.md.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/decoder/patina_brdf_sampler.h"

namespace patina {

// Errors: kInvalidArgument (a broken rule of BrdfSamplerTables).
Result<std::vector<uint8_t>> EncodeBrdfSampler(const BrdfSamplerTables& tables);

// Errors: kCorruptData, with a message that starts with "bad magic", "bad header", "bad table",
// "truncated", "trailing bytes" or "bad checksum"; kUnsupported for a newer version.
Result<BrdfSamplerTables> ParseBrdfSampler(std::span<const uint8_t> bytes);

Status WriteBrdfSampler(const std::string& path, const BrdfSamplerTables& tables);
Result<BrdfSamplerTables> ReadBrdfSamplerFile(const std::string& path);

}  // namespace patina
