// Patina BRDFs in GLSL 450 (OpenGL, Vulkan) and ES 3.00: (wi, wo) -> f of a container of kind
// "brdf". FORMATS.md, sections 7 and 10, is what it computes; ENGINE.md is the guide. Copy it with
// patina_language.glsl, patina_common.core and patina_brdf.core, or take the one file that
// `patina shader` writes: these four behind the defines of a container.
//
//   vec3 patina_brdf(vec3 wi, vec3 wo);   any stage
// and, of kind "svbrdf", in its place, with s in mips of the neural texture:
//   vec3 patina_svbrdf(vec3 wi, vec3 wo, vec2 uv, float s);
//
// Directions are unit vectors in the frame of the surface: z along the normal, x along the tangent;
// both point away from the surface. The result is f in 1/sr, linear in the container's working space
// (linear Rec.709 unless the manifest says otherwise), without the cosine; 0 unless both directions
// are above the horizon.
//
// Bind (numbers in bindings.json); all textures are read by texel, without a filter:
//   patina_brdf_index      brdf_index.dds, unsigned integers: the entry of each corner
//   patina_brdf_codebook   brdf_codebook.dds, half floats: the entries, four values a texel
//   patina_feature_<i>     of kind "svbrdf": the container's features_<i>.dds, with a filter, as for
//                          materials (patina_material.glsl)
//   PatinaBrdfWeights      the bytes of brdf_weights.bin as a uniform buffer (std140); where that
//                          would be too large: patina_brdf_weights, a texture
//
// Defines, all written by `patina shader` (PATINA_BRDF_...):
//   NSIDE, CORNERS         of the lattice, and corners of one hemisphere
//   PRIMITIVE4             values of an entry, divided by 4 and rounded up
//   INTERPOLATION          0 bilinear, 1 inverse distance, 2 uniform
//   ISOTROPIC, CANONICAL_ORDER, ANGLE_INPUTS, HALF_VECTOR_INPUTS   0 or 1
//   MATRICES, VECTORS      of the weights: 4 x 4 and 4 floats
//   LAYERS, WIDTH4         (inputs / 4, outputs / 4, first matrix, first vector) of each layer
//   INDEX_SHIFT, CODEBOOK_SHIFT, and WEIGHTS_SHIFT where the weights are a texture: log2 of widths
//   INDEX_BINDING, CODEBOOK_BINDING, WEIGHTS_BINDING
//   TEXTURES, SAMPLES      of kind "svbrdf": PATINA_TEXTURE(name, binding) for each texture of the
//                          neural texture; how they are sampled
//   FIRST_FEATURE, TOP     the same: vector of the network's input that they begin with; vector of the
//                          weights with their last level
// And by you, if you like: PATINA_SET, the Vulkan descriptor set; and PATINA_BRDF_DECLARED if your
// code declares the resources itself: the names above may then be macros.
//
// In ES this file sets the default precision to highp: say yours after it.
#include "patina_language.glsl"
#include "patina_common.core"
#include "patina_brdf.core"
