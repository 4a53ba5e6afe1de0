// From a trained BRDF to the payloads and the manifest of a container.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/brdf/brdf_source.h"
#include "formats/container.h"
#include "formats/index_pack.h"
#include "formats/layered/layered_stack.h"
#include "formats/manifest.h"
#include "formats/weights.h"
#include "pipeline/brdf/train_brdf.h"
#include "pipeline/jobs/job.h"
#include "pipeline/jobs/measure_brdf.h"
#include "pipeline/jobs/run_record.h"

namespace patina {

// A BRDF file in memory, and the fingerprint of what is made from it.
struct BrdfSource {
  brdf::Source
      data;  // its warnings name no folder; isotropic where it is, whatever the format allows
  std::optional<layered::Stack> stack;  // that data simulates
  // What MeasureAnisotropy says of a table whose format allows for azimuths; else absent.
  std::optional<double> anisotropy;
  std::string sha256;
  std::string fingerprint;  // see BrdfFingerprint
};

// Errors: those of OpenBrdf, ReadStack and SimulatedSource; kConflict when the file changed while
// it was read.
Result<BrdfSource> ReadBrdfSource(const Job& job);

// Where the codebook of a model lies if it is shared; both empty if it is not.
struct SharedCodebook {
  std::string file;  // beside the assets
  std::string sha256;
};

// SHA-256 of what decides the bytes of the container: recipe version, canonical job, the file's
// hash, and those of the files that are trained together with it.
std::string BrdfFingerprint(const Job& job, const BrdfSource& source,
                            const std::vector<std::string>& group = {});

// Writes the codebook of a model to `folder`, under a name that its bytes decide. Errors: those of
// WriteFileDurably; kInternal.
Result<SharedCodebook> WriteSharedCodebook(const brdf::TrainedBrdf& model,
                                           const std::string& folder);

// Adds grid.hpx and decoder.weights. Errors: those of StagingArea::AddPayload; kInternal in place
// of kInvalidArgument, since what was trained must be writable.
Status AddBrdfModel(const brdf::TrainedBrdf& model, const SharedCodebook& shared,
                    StagingArea* staging);

// The same of a grid and a network as they are.
Status AddGridAndNetwork(const IndexPack& pack, const WeightBuffer& network, StagingArea* staging);

// Fits sampler.bin to what the staged files decode to, adds it and names it in the manifest, which
// must stand beside the payloads already. Errors: those of the decoder, EncodeBrdfSampler and
// AddPayload.
Status AddBrdfSampler(StagingArea* staging, ManifestBrdf* model);

// Payloads and shape of grid and network; texture_inputs: of a neural texture behind them.
void DescribeBrdfModel(const brdf::ModelShape& shape, int texture_inputs, ManifestBrdf* model);

// The same as in report.json, and what that begins with.
nlohmann::ordered_json BrdfModelJson(const ManifestBrdf& model);
nlohmann::ordered_json BeginBrdfReport(const Manifest& manifest);

// The accuracy along the training as run records have it.
std::vector<RunCurvePoint> CurveOf(const std::vector<brdf::CurvePoint>& points);

// The manifest of a container, without its quality.
Manifest DescribeBrdf(const Job& job, const BrdfSource& source, const brdf::ModelShape& shape,
                      const SharedCodebook& shared);

void DescribeBrdfQuality(const BrdfMeasurement& measurement, ManifestBrdf* model);

// The text of report.json, deterministic: no times, no paths of the machine. manifest: with its
// quality; payloads: the model's.
std::string BrdfReportToJson(const Manifest& manifest, const std::vector<ManifestPayload>& payloads,
                             const BrdfSource& source, const BrdfMeasurement& measurement,
                             const brdf::TrainedBrdf& model);

}  // namespace patina
