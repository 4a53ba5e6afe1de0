// Patina materials in HLSL, shader model 5 and newer: (u, v, level of detail) -> the channels of a
// container of kind "material". FORMATS.md, section 6, is what it computes; ENGINE.md is the guide.
// Copy it with patina_language.hlsl, patina_common.core and patina_material.core, or take the one
// file that `patina shader --lang hlsl` writes: these four behind the defines of a container.
//
//   PatinaMaterial patina_material_lod(float2 uv, float s);   any stage; s in mips of the source
//   PatinaMaterial patina_material(float2 uv);                pixel stage; #define PATINA_DERIVATIVES
//   float patina_material_scale(float2 uv_dx, float2 uv_dy);  s from derivatives of (u, v)
//   float3 patina_map_albedo(PatinaMaterial m); ...           each map by name (`patina shader`)
//
// u runs to the right and v downwards, 0 to 1 across the texture. Values are physical: colour linear
// in the container's working space (linear Rec.709 unless the manifest says otherwise), emissive in
// the source's unit, normals in [-1, 1] in tangent space with Y up, all others as in the source.
//
// Bind (numbers in bindings.json):
//   patina_feature_<i>, t  the container's features_<i>.dds with all its levels
//   patina_sampler, s0     MIN_MAG_MIP_LINEAR; WRAP or CLAMP, as `address` says; MipLODBias 0
//   PatinaMaterialWeights, b   the bytes of material_weights.bin as a constant buffer; where that
//                          would be too large: patina_material_weights, a texture, t
//
// The defines are those of patina_material.glsl. Yours, if you like: PATINA_DERIVATIVES as above,
// and PATINA_MATERIAL_DECLARED if your code declares the resources itself (other registers, spaces,
// bindless handles): the names above may then be macros.
#include "patina_language.hlsl"
#include "patina_common.core"
#include "patina_material.core"
