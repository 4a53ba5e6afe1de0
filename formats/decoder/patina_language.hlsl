// The words of HLSL (shader model 5 and newer) for the decoders' cores (patina_*.core).
#ifndef PATINA_LANGUAGE
#define PATINA_LANGUAGE

#define PATINA_VEC2 float2
#define PATINA_VEC3 float3
#define PATINA_VEC4 float4
#define PATINA_MAT4 column_major float4x4
#define PATINA_UNROLL [unroll]
#define PATINA_LOOP [loop]
#define PATINA_MUL(matrix_, vector_) mul(matrix_, vector_)
#define PATINA_COLUMNS(a, b, c, d) transpose(float4x4(a, b, c, d))
#define PATINA_DDX(value) ddx(value)
#define PATINA_DDY(value) ddy(value)
#define PATINA_SAMPLE(name, uv, level) name.SampleLevel(patina_sampler, uv, level)
#define PATINA_FETCH(name, x, y) name.Load(int3(x, y, 0))

// Registers t<number>, b<number>, s<number>. For Vulkan, dxc's -fvk-t-shift and so on (glslang:
// --shift-texture-binding) move them apart.
#define PATINA_TEXTURE(name, number) Texture2D<float4> name : register(t##number);
#define PATINA_INTEGER_TEXTURE(name, number) Texture2D<uint> name : register(t##number);
#define PATINA_SAMPLER(number) SamplerState patina_sampler : register(s##number);
#define PATINA_BEGIN_CONSTANTS(name, number) cbuffer name : register(b##number) {
#define PATINA_END_CONSTANTS };

#endif
