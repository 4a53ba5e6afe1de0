// The words of GLSL (450 and ES 3.00) for the decoders' cores (patina_*.core).
#ifndef PATINA_LANGUAGE
#define PATINA_LANGUAGE

#ifdef GL_ES
// Halves are not enough for texture coordinates, features and BRDF values: ES reads float textures
// in low precision unless told otherwise.
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
#endif

#define PATINA_VEC2 vec2
#define PATINA_VEC3 vec3
#define PATINA_VEC4 vec4
#define PATINA_MAT4 mat4
#define PATINA_UNROLL
#define PATINA_LOOP
#define PATINA_MUL(matrix, vector) ((matrix) * (vector))
#define PATINA_COLUMNS(a, b, c, d) mat4(a, b, c, d)
#define PATINA_DDX(value) dFdx(value)
#define PATINA_DDY(value) dFdy(value)
#define PATINA_SAMPLE(name, uv, level) textureLod(name, uv, level)
#define PATINA_FETCH(name, x, y) texelFetch(name, ivec2(x, y), 0)

// Vulkan: bindings of a set. OpenGL 4.2 and newer: texture units and uniform buffer bindings. ES
// 3.00 has no binding in the text: glUniform1i and glUniformBlockBinding by name.
#ifndef PATINA_SET
#define PATINA_SET 0
#endif
#ifdef VULKAN
#define PATINA_AT(number) layout(set = PATINA_SET, binding = number)
#define PATINA_BLOCK_AT(number) layout(std140, set = PATINA_SET, binding = number)
#elif defined(GL_ES)
#define PATINA_AT(number)
#define PATINA_BLOCK_AT(number) layout(std140)
#else
#define PATINA_AT(number) layout(binding = number)
#define PATINA_BLOCK_AT(number) layout(std140, binding = number)
#endif
#define PATINA_TEXTURE(name, number) PATINA_AT(number) uniform highp sampler2D name;
#define PATINA_INTEGER_TEXTURE(name, number) PATINA_AT(number) uniform highp usampler2D name;
#define PATINA_SAMPLER(number)
#define PATINA_BEGIN_CONSTANTS(name, number) PATINA_BLOCK_AT(number) uniform name {
#define PATINA_END_CONSTANTS };

#endif
