// report.json: what was found, what was made of it and how good it is, for people and tools that
// look closer than the manifest. Deterministic: no times, no paths of the machine.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "formats/manifest.h"
#include "pipeline/jobs/ingest.h"
#include "pipeline/jobs/measure.h"
#include "pipeline/material/train.h"

namespace patina {

// The text of report.json. manifest: with its quality; payloads: the model's. model: null when
// every channel is constant. Members: asset, fingerprint, inputs (every file of the folder: found,
// guessed or ignored, and why), channels (with ranges and constants), quality (over all, per mip,
// per map and mip), training (samples, what stopped it, the accuracy along the way, what the export
// to BC6H and half precision cost), bytes, warnings.
std::string ReportToJson(const Manifest& manifest, const std::vector<ManifestPayload>& payloads,
                         const JobSource& source, const Measurement& measurement,
                         const TrainedMaterial* model);

// What reports of every kind end with (bytes of the payloads, warnings), and their text.
std::string EndReport(nlohmann::ordered_json json, const Manifest& manifest,
                      const std::vector<ManifestPayload>& payloads);

}  // namespace patina
