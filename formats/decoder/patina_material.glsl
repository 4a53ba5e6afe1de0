// Patina materials in GLSL 450 (OpenGL, Vulkan) and ES 3.00: (u, v, level of detail) -> the channels
// of a container of kind "material". FORMATS.md, section 6, is what it computes; ENGINE.md is the
// guide. Copy it with patina_language.glsl, patina_common.core and patina_material.core, or take the
// one file that `patina shader` writes: these four behind the defines of a container.
//
//   PatinaMaterial patina_material_lod(vec2 uv, float s);   any stage; s in mips of the source
//   PatinaMaterial patina_material(vec2 uv);                fragment stage; #define PATINA_DERIVATIVES
//   float patina_material_scale(vec2 uv_dx, vec2 uv_dy);    s from derivatives of (u, v)
//   vec3 patina_map_albedo(PatinaMaterial m); ...           each map by name (`patina shader`)
//
// u runs to the right and v downwards, 0 to 1 across the texture. Values are physical: colour linear
// in the container's working space (linear Rec.709 unless the manifest says otherwise), emissive in
// the source's unit, normals in [-1, 1] in tangent space with Y up, all others as in the source.
//
// Bind (numbers in bindings.json):
//   patina_feature_<i>     the container's features_<i>.dds with all its levels; linear filter for
//                          minifying, magnifying and between levels; repeat or clamp to edge, as
//                          `address` says; no lod bias and no anisotropy
//   PatinaMaterialWeights  the bytes of material_weights.bin as a uniform buffer (std140); where
//                          that would be too large: patina_material_weights, a texture
//
// Defines, all written by `patina shader` (PATINA_MATERIAL_...):
//   CHANNELS, CHANNEL_LIST number of channels; PATINA_LEARNED(channel, output, encoding) or
//                          PATINA_CONSTANT(channel, coded value, scale, encoding) for each, with
//                          encoding PATINA_LINEAR, _SCALED, _SRGB, _NORMAL_XY or _SIGNED_LOG
//   TEXTURES, GROUPS       PATINA_TEXTURE(name, binding) for each texture; how they are sampled
//   MATRICES, VECTORS      of the weights: 4 x 4 and 4 floats; MATRICES 0: all channels are constant
//   LAYERS, WIDTH4         (inputs / 4, outputs / 4, first matrix, first vector) of each layer
//   SOURCE, BIAS, TOP, MINIMUM, MAXIMUM, SCALE   first vectors of: size of the source in texels; lod
//                          bias and last level of each texture; range and scale of each channel
//   WEIGHTS_BINDING, and WEIGHTS_SHIFT where the weights are a texture (log2 of its width)
// And by you, if you like: PATINA_DERIVATIVES as above; PATINA_SET, the Vulkan descriptor set; and
// PATINA_MATERIAL_DECLARED if your code declares the resources itself (arrays of textures, bindless
// handles): the names above may then be macros.
//
// In ES this file sets the default precision to highp: say yours after it.
#include "patina_language.glsl"
#include "patina_common.core"
#include "patina_material.core"
