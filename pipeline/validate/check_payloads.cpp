#include <algorithm>
#include <array>

#include "formats/base/names.h"
#include "formats/base/zstd_frame.h"
#include "formats/bc6h.h"
#include "formats/brdf_sampler.h"
#include "formats/container_match.h"
#include "formats/half.h"
#include "pipeline/validate/check_container.h"

namespace patina::validate {
namespace {

constexpr int kModeBitsOfMinusInfinity = 0x0F;  // see FORMATS.md, section 4

// A texture of a million bad blocks or texels is one finding, not a million.
struct BadPlaces {
  const char* what = "block";
  uint64_t count = 0;
  uint64_t first_offset = 0;
  std::string first = {};
};

void Note(BadPlaces* bad, size_t level, size_t index, size_t across, uint64_t offset) {
  if (bad->count++ != 0) return;
  bad->first_offset = offset;
  bad->first = std::string(bad->what) + " (" + std::to_string(index % across) + ", " +
               std::to_string(index / across) + ") of level " + std::to_string(level);
}

void Report(int number, const BadPlaces& bad, const std::string& file, const char* what,
            FindingList* findings) {
  if (bad.count == 0) return;
  std::string message = bad.first + " " + what;
  if (bad.count > 1) message += ", and " + std::to_string(bad.count - 1) + " more";
  findings->Add(number, file, {"", bad.first_offset}, std::move(message));
}

bool IsReserved(const bc6h::Block& block) {
  // With the low two bits set and bit 4 too, one-region modes 0x13, 0x17, 0x1B, 0x1F.
  return (block[0] & 0x13) == 0x13;
}

bool DecodesToInfinity(const bc6h::Block& block) {
  if ((block[0] & 0x1F) != kModeBitsOfMinusInfinity) return false;
  uint16_t texels[16][3];
  bc6h::Decode(block.data(), bc6h::Format::kSf16, texels);
  for (const auto& texel : texels) {
    for (const uint16_t half : texel) {
      if (!HalfIsFinite(half)) return true;
    }
  }
  return false;
}

void CheckBlocks(const DdsTexture& texture, const std::string& file, FindingList* findings) {
  BadPlaces reserved, infinite;
  uint64_t offset = kDdsHeaderBytes;
  for (size_t level = 0; level < texture.levels.size(); ++level) {
    const auto across =
        static_cast<size_t>(DdsBlocks(DdsLevelSide(texture.width, static_cast<int>(level))));
    const std::vector<bc6h::Block>& blocks = texture.levels[level];
    for (size_t b = 0; b < blocks.size(); ++b, offset += bc6h::kBlockBytes) {
      if (IsReserved(blocks[b])) Note(&reserved, level, b, across, offset);
      if (texture.format == TextureFormat::kBc6hSf16 && DecodesToInfinity(blocks[b]))
        Note(&infinite, level, b, across, offset);
    }
  }
  Report(2101, reserved, file, "has a reserved mode", findings);
  Report(2102, infinite, file, "decodes to minus infinity", findings);
}

void CheckHalves(const DdsTexture& texture, const std::string& file, FindingList* findings) {
  constexpr uint64_t kTexelBytes = DataTexelBytes(DataFormat::kRgba16Float);
  BadPlaces bad{"texel"};
  uint64_t offset = kDdsHeaderBytes;
  for (size_t level = 0; level < texture.halves.size(); ++level) {
    const auto across = static_cast<size_t>(DdsLevelSide(texture.width, static_cast<int>(level)));
    const std::vector<uint16_t>& halves = texture.halves[level];
    for (size_t i = 0; i < halves.size(); i += 3, offset += kTexelBytes) {
      if (!HalfIsFinite(halves[i]) || !HalfIsFinite(halves[i + 1]) || !HalfIsFinite(halves[i + 2]))
        Note(&bad, level, i / 3, across, offset);
    }
  }
  Report(2103, bad, file, "is infinite or not a number", findings);
}

// Where the writer would have put another byte.
void CompareWithWriter(int number, const std::string& file,
                       const Result<std::vector<uint8_t>>& written, std::span<const uint8_t> bytes,
                       FindingList* findings) {
  if (!written) return;  // the reader takes more than the writer writes
  const size_t common = std::min(written->size(), bytes.size());
  const auto at = static_cast<size_t>(
      std::mismatch(written->begin(), written->begin() + static_cast<std::ptrdiff_t>(common),
                    bytes.begin())
          .first -
      written->begin());
  if (at == common && written->size() == bytes.size()) return;
  std::string message = at == common
                            ? "it has another length than `patina` writes"
                            : "byte " + std::to_string(at) + " is " + std::to_string(bytes[at]) +
                                  ", `patina` writes " + std::to_string((*written)[at]);
  findings->Add(number, file, {"", at}, std::move(message));
}

bool Refers(const Manifest& manifest, const ManifestPayload& payload) {
  if (payload.role == "features") {
    return std::any_of(manifest.features.begin(), manifest.features.end(),
                       [&](const ManifestFeature& f) { return f.payload == payload.name; });
  }
  if (payload.role == "weights") {
    return (manifest.network && manifest.network->payload == payload.name) ||
           (manifest.brdf && manifest.brdf->network == payload.name);
  }
  if (payload.role == "grid") return manifest.brdf && manifest.brdf->grid == payload.name;
  if (payload.role == "codebook") return manifest.brdf && manifest.brdf->codebook == payload.name;
  if (payload.role == "sampler") return manifest.brdf && manifest.brdf->sampler == payload.name;
  return true;  // for people
}

void CheckTexture(const Manifest& manifest, const ManifestPayload& payload,
                  std::span<const uint8_t> bytes, const std::string& file, FindingList* findings) {
  const auto texture = ParseDds(bytes);
  if (!texture) {
    findings->AddReaderError(ReaderFamily::kDds, file, texture.error());
    return;
  }
  for (const ManifestFeature& feature : manifest.features) {
    if (feature.payload != payload.name) continue;
    if (const Status matches = MatchTexture(feature, *texture); !matches)
      findings->AddError(2006, file, matches.error());
  }
  CheckBlocks(*texture, file, findings);
  CheckHalves(*texture, file, findings);
  CompareWithWriter(2007, file, EncodeDds(*texture), bytes, findings);
}

void CheckWeights(const Manifest& manifest, bool used, std::span<const uint8_t> bytes,
                  const std::string& file, FindingList* findings) {
  const auto weights = ParseWeights(bytes);
  if (!weights) {
    findings->AddReaderError(ReaderFamily::kWeights, file, weights.error());
    return;
  }
  if (used) {
    if (const auto layers = MatchNetwork(manifest, *weights); !layers)
      findings->AddError(3009, file, layers.error());
  }
  CompareWithWriter(3010, file, EncodeWeights(*weights), bytes, findings);
}

// The writer's bytes against the content of a file that may be a zstd frame.
void CompareUnframed(const std::string& file, const Result<std::vector<uint8_t>>& written,
                     std::span<const uint8_t> bytes, FindingList* findings) {
  if (!IsZstdFrame(bytes)) {
    CompareWithWriter(4013, file, written, bytes, findings);
    return;
  }
  if (const auto content = DecompressZstd(bytes, kMaxIndexPackBytes))
    CompareWithWriter(4013, file, written, *content, findings);
}

void CheckGrid(const Manifest& manifest, bool used, std::span<const uint8_t> bytes,
               const ContainerFiles& files, const std::string& file, FindingList* findings) {
  const auto pack = ParseIndexPack(bytes);
  if (!pack) {
    findings->AddReaderError(ReaderFamily::kIndexPack, file, pack.error());
    return;
  }
  if (used) {
    if (const Status matches = MatchIndexPack(*manifest.brdf, *pack); !matches)
      findings->AddError(4012, file, matches.error());
  }
  CompareUnframed(file, EncodeIndexPack(*pack), bytes, findings);
  if (pack->codebook_file.empty()) return;
  const auto shared = files.ReadShared(pack->codebook_file, kMaxIndexPackBytes);
  if (!shared) {
    findings->Add(4009, file, {}, shared.error().message);
    return;
  }
  const auto codebook = SharedCodebookOf(*pack, *shared, pack->codebook_file);
  if (!codebook) {
    findings->AddError(4009, file, codebook.error());
  } else if (const Status indices = CheckIndices(*pack, *codebook); !indices) {
    findings->AddReaderError(ReaderFamily::kIndexPack, file, indices.error());
  }
}

}  // namespace

void CheckPayloadBytes(const Manifest& manifest, const ManifestPayload& payload,
                       std::span<const uint8_t> bytes, const ContainerFiles& files,
                       const std::string& file, FindingList* findings) {
  const bool used = Refers(manifest, payload);
  if (!used) {
    findings->Add(1106, file, {},
                  "nothing refers to this payload of role " + QuoteForMessage(payload.role));
  }
  if (payload.role == "features") {
    CheckTexture(manifest, payload, bytes, file, findings);
  } else if (payload.role == "weights") {
    CheckWeights(manifest, used, bytes, file, findings);
  } else if (payload.role == "grid") {
    CheckGrid(manifest, used, bytes, files, file, findings);
  } else if (payload.role == "codebook") {
    const auto codebook = ParseCodebook(bytes);
    if (!codebook) {
      findings->AddReaderError(ReaderFamily::kIndexPack, file, codebook.error());
    } else {
      CompareUnframed(file, EncodeCodebook(*codebook), bytes, findings);
    }
  } else if (payload.role == "sampler") {
    const auto sampler = ParseBrdfSampler(bytes);
    if (!sampler) {
      findings->AddReaderError(ReaderFamily::kSampler, file, sampler.error());
    } else {
      CompareWithWriter(4108, file, EncodeBrdfSampler(*sampler), bytes, findings);
    }
  }
}

}  // namespace patina::validate
