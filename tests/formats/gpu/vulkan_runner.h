// Runs GpuPrograms as compute shaders on Vulkan's software driver (lavapipe), from GLSL or HLSL
// that glslang has compiled to SPIR-V.
#pragma once

#include <vulkan/vulkan.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tests/formats/gpu/gpu_program.h"

namespace patina::gpu_test {

// Where the resources of a program stand in set 0. HLSL counts textures, samplers, constants and
// buffers each by themselves; glslang moves them apart.
struct VulkanBindings {
  static constexpr uint32_t kSampler = 80;
  static constexpr uint32_t kHlslConstants = 100;
  static constexpr uint32_t kInput = 120;
  static constexpr uint32_t kOutput = 121;
};

// The program as a compute shader: SPIR-V by glslangValidator, whose messages fail the current
// test. Empty on a failure.
std::vector<uint32_t> CompileForVulkan(const GpuProgram& program);

class VulkanDevice {
 public:
  // Null if there is none; *why then says what failed.
  static std::unique_ptr<VulkanDevice> Create(std::string* why);
  ~VulkanDevice();
  VulkanDevice(const VulkanDevice&) = delete;
  VulkanDevice& operator=(const VulkanDevice&) = delete;
  const std::string& name() const { return name_; }

  // For each item, eight floats of `inputs` (in0, in1), program.outputs floats.
  std::vector<float> Run(const GpuProgram& program, std::span<const uint32_t> spirv,
                         std::span<const float> inputs);

 private:
  VulkanDevice() = default;
  struct Buffer {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkDeviceSize bytes = 0;
    void* mapped = nullptr;
  };
  struct Image {
    VkImage image = VK_NULL_HANDLE;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    VkImageView view = VK_NULL_HANDLE;
  };
  // What one Run makes, in the order of making; ReleaseAll destroys it.
  struct Scratch {
    std::vector<Buffer> buffers;
    std::vector<Image> images;
    VkSampler linear = VK_NULL_HANDLE;
    VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkShaderModule module = VK_NULL_HANDLE;
    VkPipeline pipeline = VK_NULL_HANDLE;
    VkDescriptorPool descriptors = VK_NULL_HANDLE;
    VkCommandPool commands = VK_NULL_HANDLE;
  };
  VkDeviceMemory Allocate(const VkMemoryRequirements& needs, VkMemoryPropertyFlags properties);
  Buffer& MakeBuffer(Scratch* scratch, VkBufferUsageFlags usage, const void* bytes, size_t size);
  Image& MakeImage(Scratch* scratch, const DdsFile& file, VkCommandBuffer commands);
  void ReleaseAll(Scratch* scratch);

  std::string name_;
  VkInstance instance_ = VK_NULL_HANDLE;
  VkPhysicalDevice physical_ = VK_NULL_HANDLE;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  uint32_t family_ = 0;
};

}  // namespace patina::gpu_test
