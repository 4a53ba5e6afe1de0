// Runs GpuPrograms with OpenGL.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tests/formats/gpu/gl_context.h"
#include "tests/formats/gpu/gpu_program.h"

namespace patina::gpu_test {

// A linked program with its textures and constants bound.
class GlProgram {
 public:
  // Vertex and fragment shader, without version lines; fragment may be empty. `captured`: the
  // output of the vertex shader to be kept by transform feedback, or empty. Fails the current test,
  // with the driver's message, if it does not compile.
  GlProgram(const GlContext& gl, const GpuProgram& program, const std::string& vertex,
            const std::string& fragment, const std::string& captured);
  ~GlProgram();
  GlProgram(const GlProgram&) = delete;
  GlProgram& operator=(const GlProgram&) = delete;
  bool good() const { return good_; }
  // Makes the program current and binds its textures and constants.
  void Use() const;

 private:
  void Upload(const GpuTexture& texture, bool wrap);
  const GlContext& gl_;
  GLuint program_ = 0;
  std::vector<std::pair<int, GLuint>> textures_;  // unit, texture
  GLuint constants_ = 0;
  int constants_binding_ = 0;
  bool good_ = false;
};

// For each item, eight floats of `inputs` (in0, in1), program.outputs floats: in the vertex stage,
// where each item has a level of detail of its own (llvmpipe shares it within a quad of fragments).
std::vector<float> RunOnGl(const GlContext& gl, const GpuProgram& program,
                           std::span<const float> inputs);

// A picture of floats to draw on. One at a time.
class GlPicture {
 public:
  GlPicture(const GlContext& gl, int width, int height);
  ~GlPicture();
  GlPicture(const GlPicture&) = delete;
  GlPicture& operator=(const GlPicture&) = delete;

  // The program's body as a fragment shader, which may use gl_FragCoord.
  std::unique_ptr<GlProgram> Compile(const GpuProgram& program) const;
  // Runs it for every pixel, to the end.
  void Draw(const GlProgram& program) const;
  // Four floats a pixel, from the bottom row: result[0] to result[3].
  std::vector<float> Pixels() const;

 private:
  const GlContext& gl_;
  int width_;
  int height_;
  GLuint texture_ = 0;
  GLuint framebuffer_ = 0;
  GLuint array_ = 0;
};

}  // namespace patina::gpu_test
