// OpenGL without a window, on Mesa's software renderer (llvmpipe).
#pragma once

#include <EGL/egl.h>
#include <GL/glcorearb.h>

#include <memory>
#include <string>

namespace patina::gpu_test {

// Functions that OpenGL 4.5 core and OpenGL ES 3.0 share, by their names.
#define PATINA_GL_FUNCTIONS(F)                                     \
  F(PFNGLACTIVETEXTUREPROC, ActiveTexture)                         \
  F(PFNGLATTACHSHADERPROC, AttachShader)                           \
  F(PFNGLBEGINTRANSFORMFEEDBACKPROC, BeginTransformFeedback)       \
  F(PFNGLBINDATTRIBLOCATIONPROC, BindAttribLocation)               \
  F(PFNGLBINDBUFFERPROC, BindBuffer)                               \
  F(PFNGLBINDBUFFERBASEPROC, BindBufferBase)                       \
  F(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                     \
  F(PFNGLBINDTEXTUREPROC, BindTexture)                             \
  F(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                     \
  F(PFNGLBUFFERDATAPROC, BufferData)                               \
  F(PFNGLCHECKFRAMEBUFFERSTATUSPROC, CheckFramebufferStatus)       \
  F(PFNGLCOMPILESHADERPROC, CompileShader)                         \
  F(PFNGLCOMPRESSEDTEXIMAGE2DPROC, CompressedTexImage2D)           \
  F(PFNGLCREATEPROGRAMPROC, CreateProgram)                         \
  F(PFNGLCREATESHADERPROC, CreateShader)                           \
  F(PFNGLDELETEBUFFERSPROC, DeleteBuffers)                         \
  F(PFNGLDELETEFRAMEBUFFERSPROC, DeleteFramebuffers)               \
  F(PFNGLDELETEPROGRAMPROC, DeleteProgram)                         \
  F(PFNGLDELETESHADERPROC, DeleteShader)                           \
  F(PFNGLDELETETEXTURESPROC, DeleteTextures)                       \
  F(PFNGLDELETEVERTEXARRAYSPROC, DeleteVertexArrays)               \
  F(PFNGLDISABLEPROC, Disable)                                     \
  F(PFNGLDRAWARRAYSPROC, DrawArrays)                               \
  F(PFNGLENABLEPROC, Enable)                                       \
  F(PFNGLENABLEVERTEXATTRIBARRAYPROC, EnableVertexAttribArray)     \
  F(PFNGLENDTRANSFORMFEEDBACKPROC, EndTransformFeedback)           \
  F(PFNGLFINISHPROC, Finish)                                       \
  F(PFNGLFRAMEBUFFERTEXTURE2DPROC, FramebufferTexture2D)           \
  F(PFNGLGENBUFFERSPROC, GenBuffers)                               \
  F(PFNGLGENFRAMEBUFFERSPROC, GenFramebuffers)                     \
  F(PFNGLGENTEXTURESPROC, GenTextures)                             \
  F(PFNGLGENVERTEXARRAYSPROC, GenVertexArrays)                     \
  F(PFNGLGETERRORPROC, GetError)                                   \
  F(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)                 \
  F(PFNGLGETPROGRAMIVPROC, GetProgramiv)                           \
  F(PFNGLGETSHADERINFOLOGPROC, GetShaderInfoLog)                   \
  F(PFNGLGETSHADERIVPROC, GetShaderiv)                             \
  F(PFNGLGETSTRINGPROC, GetString)                                 \
  F(PFNGLGETUNIFORMBLOCKINDEXPROC, GetUniformBlockIndex)           \
  F(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)               \
  F(PFNGLLINKPROGRAMPROC, LinkProgram)                             \
  F(PFNGLMAPBUFFERRANGEPROC, MapBufferRange)                       \
  F(PFNGLPIXELSTOREIPROC, PixelStorei)                             \
  F(PFNGLREADPIXELSPROC, ReadPixels)                               \
  F(PFNGLSHADERSOURCEPROC, ShaderSource)                           \
  F(PFNGLTEXIMAGE2DPROC, TexImage2D)                               \
  F(PFNGLTEXPARAMETERIPROC, TexParameteri)                         \
  F(PFNGLTRANSFORMFEEDBACKVARYINGSPROC, TransformFeedbackVaryings) \
  F(PFNGLUNIFORM1IPROC, Uniform1i)                                 \
  F(PFNGLUNIFORMBLOCKBINDINGPROC, UniformBlockBinding)             \
  F(PFNGLUNMAPBUFFERPROC, UnmapBuffer)                             \
  F(PFNGLUSEPROGRAMPROC, UseProgram)                               \
  F(PFNGLVERTEXATTRIBPOINTERPROC, VertexAttribPointer)             \
  F(PFNGLVIEWPORTPROC, Viewport)

enum class GlApi { kGl45, kEs30 };

// kQuick: without LLVM's optimiser, which takes many times as long as a test's few thousand items.
enum class GlCompiler { kQuick, kOptimizing };

// A current context on this thread. One at a time.
class GlContext {
 public:
  // Null if there is none; *why then says what failed.
  static std::unique_ptr<GlContext> Create(GlApi api, GlCompiler compiler, std::string* why);
  ~GlContext();
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  GlApi api() const { return api_; }
  const char* version_line() const {
    return api_ == GlApi::kGl45 ? "#version 450 core\n" : "#version 300 es\n";
  }
  std::string renderer() const;
  // To be bound when no other framebuffer is.
  GLuint base_framebuffer() const { return base_framebuffer_; }

#define PATINA_GL_MEMBER(type, name) type name = nullptr;
  PATINA_GL_FUNCTIONS(PATINA_GL_MEMBER)
#undef PATINA_GL_MEMBER

 private:
  GlContext() = default;
  GlApi api_ = GlApi::kGl45;
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
  GLuint base_framebuffer_ = 0;
};

}  // namespace patina::gpu_test
