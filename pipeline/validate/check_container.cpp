#include "pipeline/validate/check_container.h"

#include <algorithm>
#include <set>

#include "formats/base/names.h"
#include "formats/base/sha256.h"
#include "formats/container.h"
#include "formats/index_pack.h"

namespace patina::validate {
namespace {

void CheckListing(const ContainerFiles& files, const Manifest& manifest, const std::string& label,
                  FindingList* findings) {
  const auto entries = files.List();
  if (!entries) {
    findings->AddUnreadable(label, entries.error());
    return;
  }
  std::set<std::string> known = {kManifestName};
  known.insert(std::begin(kUnlistedFiles), std::end(kUnlistedFiles));
  for (const ManifestPayload& payload : manifest.payloads) known.insert(payload.name);
  if (manifest.brdf && !manifest.brdf->shared_codebook_file.empty())
    known.insert(manifest.brdf->shared_codebook_file);
  for (const ContainerEntry& entry : *entries) {
    const bool listed = known.count(entry.name) != 0;
    if (!entry.is_regular && !listed) {
      findings->Add(1105, JoinLabel(label, entry.name), {}, "not a regular file");
    } else if (!listed) {
      findings->Add(1104, JoinLabel(label, entry.name), {}, "the manifest does not list it");
    }
  }
}

void CheckSharedCodebook(const ContainerFiles& files, const ManifestBrdf& brdf,
                         const std::string& label, FindingList* findings) {
  if (brdf.shared_codebook_file.empty()) return;
  const std::string file = JoinLabel(label, kManifestName);
  const auto bytes = files.ReadShared(brdf.shared_codebook_file, kMaxIndexPackBytes);
  if (!bytes) {
    findings->Add(1107, file, {"/brdf/codebook/file", {}}, bytes.error().message);
    return;
  }
  const std::string sha256 = Sha256Hex(*bytes);
  if (sha256 != brdf.shared_codebook_sha256) {
    findings->Add(1108, file, {"/brdf/codebook/sha256", {}},
                  QuoteForMessage(brdf.shared_codebook_file) + " has the SHA-256 " + sha256 +
                      ", the manifest says " + brdf.shared_codebook_sha256);
  }
}

void CheckPayload(const ContainerFiles& files, const Manifest& manifest, size_t index,
                  const std::string& label, FindingList* findings) {
  const ManifestPayload& payload = manifest.payloads[index];
  const std::string file = JoinLabel(label, payload.name);
  const auto bytes = files.Read(payload.name, kMaxValidatedBytes);
  if (!bytes) {
    const ErrorCode code = bytes.error().code;
    const bool absent = code == ErrorCode::kNotFound || code == ErrorCode::kInvalidArgument;
    findings->Add(absent ? 1101 : 9002, file, {}, bytes.error().message);
    return;
  }
  if (bytes->size() != payload.bytes) {
    findings->Add(1102, file, {},
                  std::to_string(bytes->size()) + " bytes, the manifest says " +
                      std::to_string(payload.bytes));
  }
  const std::string sha256 = Sha256Hex(*bytes);
  if (sha256 != payload.sha256) {
    findings->Add(1103, file, {},
                  "the SHA-256 is " + sha256 + ", the manifest says " + payload.sha256);
  }
  CheckPayloadBytes(manifest, payload, *bytes, files, file, findings);
}

}  // namespace

std::string JoinLabel(const std::string& label, const std::string& name) {
  return label.empty() || label == "." ? name : label + "/" + name;
}

std::optional<Manifest> CheckContainer(const ContainerFiles& files, const std::string& label,
                                       FindingList* findings) {
  const std::string file = JoinLabel(label, kManifestName);
  const auto bytes = files.Read(kManifestName, kMaxManifestBytes);
  if (!bytes) {
    const ErrorCode code = bytes.error().code;
    findings->Add(code == ErrorCode::kNotFound     ? 1001
                  : code == ErrorCode::kOutOfRange ? 1002
                                                   : 9002,
                  file, {}, bytes.error().message);
    return std::nullopt;
  }
  const std::string_view text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  std::optional<Manifest> manifest = CheckManifestText(text, file, findings);
  if (!manifest) return std::nullopt;
  CheckConsistency(*manifest, file, findings);
  CheckGate(*manifest, file, findings);
  CheckListing(files, *manifest, label, findings);
  if (manifest->brdf) CheckSharedCodebook(files, *manifest->brdf, label, findings);
  for (size_t i = 0; i < manifest->payloads.size(); ++i)
    CheckPayload(files, *manifest, i, label, findings);
  return manifest;
}

}  // namespace patina::validate
