// Everything that can be told of a container from its own files.
#pragma once

#include <optional>
#include <string>

#include "formats/manifest.h"
#include "pipeline/validate/container_files.h"
#include "pipeline/validate/findings.h"

namespace patina::validate {

// Checks manifest and payloads. label: the container's path in findings, "" or without a final
// '/'. Returns the manifest if it can be used.
std::optional<Manifest> CheckContainer(const ContainerFiles& files, const std::string& label,
                                       FindingList* findings);

// The parts of CheckContainer. `file`: as findings name it.
std::optional<Manifest> CheckManifestText(std::string_view text, const std::string& file,
                                          FindingList* findings);
// Rules between members of a manifest that decoders do without.
void CheckConsistency(const Manifest& manifest, const std::string& file, FindingList* findings);
void CheckGate(const Manifest& manifest, const std::string& file, FindingList* findings);
// The content of a payload, by its role. codebook: for an index pack that shares one.
void CheckPayloadBytes(const Manifest& manifest, const ManifestPayload& payload,
                       std::span<const uint8_t> bytes, const ContainerFiles& files,
                       const std::string& file, FindingList* findings);

// "label/name"; the name alone for "" and ".".
std::string JoinLabel(const std::string& label, const std::string& name);

}  // namespace patina::validate
