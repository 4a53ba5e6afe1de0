// Whether the payloads of a container are the ones that its manifest describes.
#pragma once

#include <vector>

#include "formats/base/result.h"
#include "formats/dds.h"
#include "formats/index_pack.h"
#include "formats/manifest.h"
#include "formats/shader_constants.h"
#include "formats/weights.h"

namespace patina {

// Sizes, levels and format. Errors: kCorruptData; the message does not name the file.
Status MatchTexture(const ManifestFeature& feature, const DdsTexture& texture);

// The layers of the network of a material (which has one) or a BRDF. Errors: those of
// DenseLayersOf; kCorruptData for other widths than the manifest's.
Result<std::vector<DenseLayer>> MatchNetwork(const Manifest& manifest, const WeightBuffer& buffer);

// What the manifest repeats of the pack's header, and where the codebook is. Errors: kCorruptData;
// the message begins with the JSON pointer of the member that differs.
Status MatchIndexPack(const ManifestBrdf& brdf, const IndexPack& pack);

}  // namespace patina
