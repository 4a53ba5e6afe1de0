#include "formats/brdf_sampler.h"

#include <array>
#include <utility>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"

namespace patina {
namespace {

constexpr uint64_t kMaxSamplerBytes = uint64_t{1} << 21;  // above 32 + 64 * (1 + 256 * 64)

}  // namespace

Result<std::vector<uint8_t>> EncodeBrdfSampler(const BrdfSamplerTables& tables) {
  const std::string problem = brdf_sampler_detail::Problem(tables);
  if (!problem.empty()) return Fail(ErrorCode::kInvalidArgument, "sampler: " + problem);
  std::array<uint8_t, brdf_sampler_detail::kHeaderBytes> header{};
  const char* magic = "PATINASM";
  for (size_t i = 0; i < 8; ++i) header[i] = static_cast<uint8_t>(magic[i]);
  StoreLittle32(&header[8], brdf_sampler_detail::kVersion);
  StoreLittle32(&header[16], static_cast<uint32_t>(tables.theta_i_bins) |
                                 static_cast<uint32_t>(tables.theta_h_cells) << 16);
  StoreLittle32(&header[20],
                static_cast<uint32_t>(tables.phi_cells) | (tables.relative_phi ? 1u : 0u) << 16);
  std::vector<uint8_t> bytes(header.begin(), header.end());
  bytes.insert(bytes.end(), tables.mixture.begin(), tables.mixture.end());
  bytes.insert(bytes.end(), tables.mass.begin(), tables.mass.end());
  StoreLittle32(&bytes[12], brdf_sampler_detail::FileCrc(bytes.data(), bytes.size()));
  return bytes;
}

Result<BrdfSamplerTables> ParseBrdfSampler(std::span<const uint8_t> bytes) {
  BrdfSamplerTables tables;
  const std::string problem = ReadBrdfSampler(bytes.data(), bytes.size(), &tables);
  if (problem.empty()) return tables;
  return Fail(problem.rfind("newer", 0) == 0 ? ErrorCode::kUnsupported : ErrorCode::kCorruptData,
              problem);
}

Status WriteBrdfSampler(const std::string& path, const BrdfSamplerTables& tables) {
  auto bytes = EncodeBrdfSampler(tables);
  if (!bytes) return Fail(std::move(bytes).error(), path);
  return WriteFileDurably(path, std::span<const uint8_t>(*bytes));
}

Result<BrdfSamplerTables> ReadBrdfSamplerFile(const std::string& path) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, kMaxSamplerBytes));
  auto tables = ParseBrdfSampler(bytes);
  if (!tables) return Fail(std::move(tables).error(), path);
  return tables;
}

}  // namespace patina
