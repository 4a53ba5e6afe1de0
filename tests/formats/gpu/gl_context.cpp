#include "tests/formats/gpu/gl_context.h"

#include <EGL/eglext.h>

#include <cstdlib>

namespace patina::gpu_test {

std::unique_ptr<GlContext> GlContext::Create(GlApi api, GlCompiler compiler, std::string* why) {
  // Never a real GPU: results would depend on the machine.
  setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
  setenv("GALLIUM_DRIVER", "llvmpipe", 1);
  if (compiler == GlCompiler::kQuick) {
    setenv("MESA_SHADER_CACHE_DISABLE", "true", 1);  // no files outside the test
    setenv("GALLIVM_PERF", "nopt", 1);
    setenv("LP_NATIVE_VECTOR_WIDTH", "128", 1);
  }
  const auto get_display = reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(
      eglGetProcAddress("eglGetPlatformDisplayEXT"));
  if (get_display == nullptr) {
    *why = "EGL has no platform displays";
    return nullptr;
  }
  std::unique_ptr<GlContext> context(new GlContext);
  context->api_ = api;
  context->display_ = get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (context->display_ == EGL_NO_DISPLAY || !eglInitialize(context->display_, nullptr, nullptr)) {
    *why = "EGL has no surfaceless display";
    return nullptr;
  }
  const bool es = api == GlApi::kEs30;
  const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                               es ? 3 : 4,
                               EGL_CONTEXT_MINOR_VERSION,
                               es ? 0 : 5,
                               es ? EGL_NONE : EGL_CONTEXT_OPENGL_PROFILE_MASK,
                               EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                               EGL_NONE};
  if (!eglBindAPI(es ? EGL_OPENGL_ES_API : EGL_OPENGL_API)) {
    *why = "EGL does not have this API";
    return nullptr;
  }
  context->context_ =
      eglCreateContext(context->display_, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes);
  if (context->context_ == EGL_NO_CONTEXT ||
      !eglMakeCurrent(context->display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context->context_)) {
    *why = std::string("EGL has no context of OpenGL ") + (es ? "ES 3.0" : "4.5");
    return nullptr;
  }
#define PATINA_GL_LOAD(type, name)                                       \
  context->name = reinterpret_cast<type>(eglGetProcAddress("gl" #name)); \
  if (context->name == nullptr) {                                        \
    *why = "EGL has no function gl" #name;                               \
    return nullptr;                                                      \
  }
  PATINA_GL_FUNCTIONS(PATINA_GL_LOAD)
#undef PATINA_GL_LOAD
  // Without a surface there is no framebuffer, and without one no draw, not even a discarded one.
  GLuint texture = 0;
  context->GenTextures(1, &texture);
  context->BindTexture(GL_TEXTURE_2D, texture);
  context->TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, 1, 1, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  context->GenFramebuffers(1, &context->base_framebuffer_);
  context->BindFramebuffer(GL_FRAMEBUFFER, context->base_framebuffer_);
  context->FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture, 0);
  return context;
}

GlContext::~GlContext() {
  if (display_ == EGL_NO_DISPLAY) return;
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
  eglTerminate(display_);
}

std::string GlContext::renderer() const {
  return reinterpret_cast<const char*>(GetString(GL_RENDERER));
}

}  // namespace patina::gpu_test
