// Patina BRDFs in HLSL, shader model 5 and newer: (wi, wo) -> f of a container of kind "brdf".
// FORMATS.md, sections 7 and 10, is what it computes; ENGINE.md is the guide. Copy it with
// patina_language.hlsl, patina_common.core and patina_brdf.core, or take the one file that
// `patina shader --lang hlsl` writes: these four behind the defines of a container.
//
//   float3 patina_brdf(float3 wi, float3 wo);   any stage
// and, of kind "svbrdf", in its place, with s in mips of the neural texture:
//   float3 patina_svbrdf(float3 wi, float3 wo, float2 uv, float s);
//
// Directions are unit vectors in the frame of the surface: z along the normal, x along the tangent;
// both point away from the surface. The result is f in 1/sr, linear in the container's working space
// (linear Rec.709 unless the manifest says otherwise), without the cosine; 0 unless both directions
// are above the horizon.
//
// Bind (numbers in bindings.json); all textures are read by texel, without a sampler:
//   patina_brdf_index, t      brdf_index.dds, unsigned integers: the entry of each corner
//   patina_brdf_codebook, t   brdf_codebook.dds, half floats: the entries, four values a texel
//   patina_feature_<i>, t     of kind "svbrdf": the container's features_<i>.dds
//   patina_sampler, s0        the same: as for materials (patina_material.hlsl)
//   PatinaBrdfWeights, b      the bytes of brdf_weights.bin as a constant buffer; where that would
//                             be too large: patina_brdf_weights, a texture, t
//
// The defines are those of patina_brdf.glsl. Yours, if you like: PATINA_BRDF_DECLARED if your code
// declares the resources itself: the names above may then be macros.
#include "patina_language.hlsl"
#include "patina_common.core"
#include "patina_brdf.core"
