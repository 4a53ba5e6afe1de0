#include "tests/formats/gpu/gl_runner.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace patina::gpu_test {
namespace {

// How OpenGL names a DXGI format; blocks have no format and type of pixels.
struct PixelFormat {
  uint32_t dxgi;
  GLenum internal;
  GLenum format;
  GLenum type;
};

const PixelFormat& FormatOf(uint32_t dxgi) {
  static constexpr PixelFormat kFormats[] = {
      {95, GL_COMPRESSED_RGB_BPTC_UNSIGNED_FLOAT, 0, 0},
      {96, GL_COMPRESSED_RGB_BPTC_SIGNED_FLOAT, 0, 0},
      {71, 0x83F0 /* GL_COMPRESSED_RGB_S3TC_DXT1_EXT */, 0, 0},
      {83, GL_COMPRESSED_RG_RGTC2, 0, 0},
      {2, GL_RGBA32F, GL_RGBA, GL_FLOAT},
      {10, GL_RGBA16F, GL_RGBA, GL_HALF_FLOAT},
      {28, GL_RGBA8, GL_RGBA, GL_UNSIGNED_BYTE},
      {42, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT},
      {57, GL_R16UI, GL_RED_INTEGER, GL_UNSIGNED_SHORT}};
  for (const PixelFormat& format : kFormats) {
    if (format.dxgi == dxgi) return format;
  }
  ADD_FAILURE() << "DXGI format " << dxgi;
  return kFormats[0];
}

GLuint Compile(const GlContext& gl, GLenum stage, const std::string& text) {
  const GLuint shader = gl.CreateShader(stage);
  const std::string whole = gl.version_line() + text;
  const char* source = whole.c_str();
  gl.ShaderSource(shader, 1, &source, nullptr);
  gl.CompileShader(shader);
  GLint compiled = 0;
  gl.GetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  char log[4096] = "";
  gl.GetShaderInfoLog(shader, sizeof log, nullptr, log);
  EXPECT_TRUE(compiled) << log;
  return shader;
}

}  // namespace

GlProgram::GlProgram(const GlContext& gl, const GpuProgram& program, const std::string& vertex,
                     const std::string& fragment, const std::string& captured)
    : gl_(gl) {
  program_ = gl.CreateProgram();
  const GLuint vertex_shader = Compile(gl, GL_VERTEX_SHADER, vertex);
  // OpenGL ES links no program without both stages.
  const GLuint fragment_shader =
      Compile(gl, GL_FRAGMENT_SHADER,
              fragment.empty() ? "precision highp float;\nvoid main() {}\n" : fragment);
  gl.AttachShader(program_, vertex_shader);
  gl.AttachShader(program_, fragment_shader);
  gl.BindAttribLocation(program_, 0, "in0");
  gl.BindAttribLocation(program_, 1, "in1");
  if (!captured.empty()) {
    const char* name = captured.c_str();
    gl.TransformFeedbackVaryings(program_, 1, &name, GL_INTERLEAVED_ATTRIBS);
  }
  gl.LinkProgram(program_);
  gl.DeleteShader(vertex_shader);
  gl.DeleteShader(fragment_shader);
  GLint linked = 0;
  gl.GetProgramiv(program_, GL_LINK_STATUS, &linked);
  char log[4096] = "";
  gl.GetProgramInfoLog(program_, sizeof log, nullptr, log);
  EXPECT_TRUE(linked) << log;
  if (!linked) return;
  gl.UseProgram(program_);
  for (const GpuTexture& texture : program.textures) {
    Upload(texture, program.wrap);
    // ES 3.00 has no binding in the shader; for 450 it must be there.
    if (gl.api() == GlApi::kEs30)
      gl.Uniform1i(gl.GetUniformLocation(program_, texture.name.c_str()), texture.binding);
  }
  if (!program.constants_name.empty()) {
    constants_binding_ = program.constants_binding;
    if (gl.api() == GlApi::kEs30) {
      const GLuint block = gl.GetUniformBlockIndex(program_, program.constants_name.c_str());
      EXPECT_NE(block, GL_INVALID_INDEX);
      gl.UniformBlockBinding(program_, block, static_cast<GLuint>(constants_binding_));
    }
    gl.GenBuffers(1, &constants_);
    gl.BindBuffer(GL_UNIFORM_BUFFER, constants_);
    gl.BufferData(GL_UNIFORM_BUFFER, static_cast<GLsizeiptr>(program.constants.size()),
                  program.constants.data(), GL_STATIC_DRAW);
  }
  const GLenum error = gl.GetError();
  EXPECT_EQ(error, static_cast<GLenum>(GL_NO_ERROR));
  good_ = error == GL_NO_ERROR;
}

GlProgram::~GlProgram() {
  for (const auto& [unit, texture] : textures_) gl_.DeleteTextures(1, &texture);
  gl_.DeleteBuffers(1, &constants_);
  gl_.DeleteProgram(program_);
}

void GlProgram::Upload(const GpuTexture& texture, bool wrap) {
  GLuint name = 0;
  gl_.GenTextures(1, &name);
  textures_.push_back({texture.binding, name});
  gl_.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(texture.binding));
  gl_.BindTexture(GL_TEXTURE_2D, name);
  gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  const DdsFile& file = texture.file;
  const PixelFormat& format = FormatOf(file.dxgi_format);
  for (size_t level = 0; level < file.levels.size(); ++level) {
    const auto l = static_cast<GLint>(level);
    const GLsizei w = std::max(1, file.width >> level), h = std::max(1, file.height >> level);
    const auto& bytes = file.levels[level];
    if (format.format == 0) {
      gl_.CompressedTexImage2D(GL_TEXTURE_2D, l, format.internal, w, h, 0,
                               static_cast<GLsizei>(bytes.size()), bytes.data());
    } else {
      gl_.TexImage2D(GL_TEXTURE_2D, l, static_cast<GLint>(format.internal), w, h, 0, format.format,
                     format.type, bytes.data());
    }
  }
  const auto set = [&](GLenum parameter, GLint value) {
    gl_.TexParameteri(GL_TEXTURE_2D, parameter, value);
  };
  set(GL_TEXTURE_MAX_LEVEL, static_cast<GLint>(file.levels.size()) - 1);
  set(GL_TEXTURE_MIN_FILTER, texture.filtered ? GL_LINEAR_MIPMAP_LINEAR : GL_NEAREST);
  set(GL_TEXTURE_MAG_FILTER, texture.filtered ? GL_LINEAR : GL_NEAREST);
  set(GL_TEXTURE_WRAP_S, wrap ? GL_REPEAT : GL_CLAMP_TO_EDGE);
  set(GL_TEXTURE_WRAP_T, wrap ? GL_REPEAT : GL_CLAMP_TO_EDGE);
}

void GlProgram::Use() const {
  gl_.UseProgram(program_);
  for (const auto& [unit, texture] : textures_) {
    gl_.ActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    gl_.BindTexture(GL_TEXTURE_2D, texture);
  }
  if (constants_ != 0)
    gl_.BindBufferBase(GL_UNIFORM_BUFFER, static_cast<GLuint>(constants_binding_), constants_);
}

std::vector<float> RunOnGl(const GlContext& gl, const GpuProgram& program,
                           std::span<const float> inputs) {
  const int vectors = (program.outputs + 3) / 4;
  const std::string vertex = program.shader + "\nin vec4 in0;\nin vec4 in1;\nout vec4 captured[" +
                             std::to_string(vectors) + "];\nvoid main() {\nfloat result[" +
                             std::to_string(4 * vectors) + "];\n" + program.body +
                             "for (int i = 0; i < " + std::to_string(vectors) +
                             "; ++i)\n  captured[i] = vec4(result[4 * i], result[4 * i + 1], "
                             "result[4 * i + 2], result[4 * i + 3]);\n"
                             "gl_Position = vec4(0.0, 0.0, 0.0, 1.0);\n}\n";
  const GlProgram linked(gl, program, vertex, "", "captured");
  if (!linked.good()) return {};
  const size_t items = inputs.size() / 8;
  GLuint array = 0, buffers[2] = {};
  gl.GenVertexArrays(1, &array);
  gl.BindVertexArray(array);
  gl.GenBuffers(2, buffers);
  gl.BindBuffer(GL_ARRAY_BUFFER, buffers[0]);
  gl.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(inputs.size_bytes()), inputs.data(),
                GL_STATIC_DRAW);
  for (GLuint i = 0; i < 2; ++i) {
    gl.EnableVertexAttribArray(i);
    gl.VertexAttribPointer(i, 4, GL_FLOAT, GL_FALSE, 32,
                           reinterpret_cast<const void*>(static_cast<uintptr_t>(16 * i)));
  }
  const auto bytes = static_cast<GLsizeiptr>(items * static_cast<size_t>(vectors) * 16);
  gl.BindBuffer(GL_TRANSFORM_FEEDBACK_BUFFER, buffers[1]);
  gl.BufferData(GL_TRANSFORM_FEEDBACK_BUFFER, bytes, nullptr, GL_STATIC_READ);
  linked.Use();
  gl.BindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, buffers[1]);
  gl.Enable(GL_RASTERIZER_DISCARD);
  gl.BeginTransformFeedback(GL_POINTS);
  gl.DrawArrays(GL_POINTS, 0, static_cast<GLsizei>(items));
  gl.EndTransformFeedback();
  gl.Disable(GL_RASTERIZER_DISCARD);
  std::vector<float> results;
  const auto* mapped = static_cast<const float*>(
      gl.MapBufferRange(GL_TRANSFORM_FEEDBACK_BUFFER, 0, bytes, GL_MAP_READ_BIT));
  EXPECT_NE(mapped, nullptr);
  for (size_t item = 0; mapped != nullptr && item < items; ++item) {
    const float* from = mapped + item * static_cast<size_t>(vectors) * 4;
    results.insert(results.end(), from, from + program.outputs);
  }
  gl.UnmapBuffer(GL_TRANSFORM_FEEDBACK_BUFFER);
  gl.DeleteBuffers(2, buffers);
  gl.DeleteVertexArrays(1, &array);
  EXPECT_EQ(gl.GetError(), static_cast<GLenum>(GL_NO_ERROR));
  return results;
}

GlPicture::GlPicture(const GlContext& gl, int width, int height)
    : gl_(gl), width_(width), height_(height) {
  gl.GenTextures(1, &texture_);
  gl.ActiveTexture(GL_TEXTURE0 + 31);
  gl.BindTexture(GL_TEXTURE_2D, texture_);
  gl.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, width, height, 0, GL_RGBA, GL_FLOAT, nullptr);
  gl.GenFramebuffers(1, &framebuffer_);
  gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture_, 0);
  EXPECT_EQ(gl.CheckFramebufferStatus(GL_FRAMEBUFFER),
            static_cast<GLenum>(GL_FRAMEBUFFER_COMPLETE));
  gl.GenVertexArrays(1, &array_);
  gl.BindVertexArray(array_);
  gl.Viewport(0, 0, width, height);
}

GlPicture::~GlPicture() {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, gl_.base_framebuffer());
  gl_.DeleteFramebuffers(1, &framebuffer_);
  gl_.DeleteTextures(1, &texture_);
  gl_.DeleteVertexArrays(1, &array_);
}

std::unique_ptr<GlProgram> GlPicture::Compile(const GpuProgram& program) const {
  // One triangle over the whole picture, made of the vertex number alone.
  const std::string vertex =
      "void main() {\n"
      "  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, "
      "1.0);\n"
      "}\n";
  const std::string fragment = program.shader + "\nout vec4 color;\nvoid main() {\nfloat result[" +
                               std::to_string(std::max(4, program.outputs)) + "];\n" +
                               program.body +
                               "color = vec4(result[0], result[1], result[2], result[3]);\n}\n";
  return std::make_unique<GlProgram>(gl_, program, vertex, fragment, "");
}

void GlPicture::Draw(const GlProgram& program) const {
  program.Use();
  gl_.DrawArrays(GL_TRIANGLES, 0, 3);
  gl_.Finish();
}

std::vector<float> GlPicture::Pixels() const {
  std::vector<float> pixels(static_cast<size_t>(width_) * height_ * 4);
  gl_.ReadPixels(0, 0, width_, height_, GL_RGBA, GL_FLOAT, pixels.data());
  EXPECT_EQ(gl_.GetError(), static_cast<GLenum>(GL_NO_ERROR));
  return pixels;
}

}  // namespace patina::gpu_test
