#include "tests/formats/gpu/vulkan_runner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "formats/base/file_io.h"
#include "tests/formats/test_support.h"

namespace patina::gpu_test {
namespace {

constexpr uint32_t kGroup = 64;

VkFormat FormatOf(uint32_t dxgi_format) {
  switch (dxgi_format) {
    case 95:
      return VK_FORMAT_BC6H_UFLOAT_BLOCK;
    case 96:
      return VK_FORMAT_BC6H_SFLOAT_BLOCK;
    case 2:
      return VK_FORMAT_R32G32B32A32_SFLOAT;
    case 10:
      return VK_FORMAT_R16G16B16A16_SFLOAT;
    case 42:
      return VK_FORMAT_R32_UINT;
    default:
      return VK_FORMAT_R16_UINT;
  }
}

void Expect(VkResult result) { EXPECT_EQ(result, VK_SUCCESS); }

std::string ComputeShader(const GpuProgram& program) {
  const std::string n = std::to_string(program.outputs);
  const std::string work = "{\n" + program.body + "}\nfor (int k = 0; k < " + n + "; ++k)\n";
  if (program.language == ShaderLanguage::kHlsl) {
    return program.shader +
           "\nRWStructuredBuffer<float4> patina_in : register(u0);\n"
           "RWStructuredBuffer<float> patina_out : register(u1);\n"
           "[numthreads(64, 1, 1)]\nvoid main(uint3 id : SV_DispatchThreadID) {\n"
           "float4 in0 = patina_in[2 * id.x];\nfloat4 in1 = patina_in[2 * id.x + 1];\n"
           "float result[" +
           n + "];\n" + work + "patina_out[" + n + " * id.x + k] = result[k];\n}\n";
  }
  return "#version 450\n" + program.shader +
         "\nlayout(local_size_x = 64) in;\n"
         "layout(std430, set = 0, binding = 120) readonly buffer In { vec4 patina_in[]; };\n"
         "layout(std430, set = 0, binding = 121) buffer Out { float patina_out[]; };\n"
         "void main() {\nuint id = gl_GlobalInvocationID.x;\n"
         "vec4 in0 = patina_in[2u * id];\nvec4 in1 = patina_in[2u * id + 1u];\nfloat result[" +
         n + "];\n" + work + "patina_out[" + n + "u * id + uint(k)] = result[k];\n}\n";
}

}  // namespace

std::vector<uint32_t> CompileForVulkan(const GpuProgram& program) {
  const test::TemporaryDirectory folder;
  const std::string source = folder / "shader.txt", spirv = folder / "shader.spv";
  std::ofstream(source) << ComputeShader(program);
  std::string command = "glslangValidator -V -S comp -e main -o " + spirv;
  if (program.language == ShaderLanguage::kHlsl) {
    command += " -D --shift-sampler-binding 80 --shift-UBO-binding 100 --shift-ssbo-binding 120";
  }
  command += " " + source + " > " + (folder / "log") + " 2>&1";
  const int status = std::system(command.c_str());
  const auto log = ReadTextFile(folder / "log", 1 << 20);
  EXPECT_EQ(status, 0) << (log ? *log : command);
  const auto bytes = ReadFile(spirv, 1 << 26);
  if (!bytes) return {};
  std::vector<uint32_t> words(bytes->size() / 4);
  std::memcpy(words.data(), bytes->data(), words.size() * 4);
  return words;
}

std::unique_ptr<VulkanDevice> VulkanDevice::Create(std::string* why) {
  setenv("MESA_SHADER_CACHE_DISABLE", "true", 1);
  // As in gl_context.cpp: compiling takes longer than running.
  setenv("GALLIVM_PERF", "nopt", 1);
  setenv("LP_NATIVE_VECTOR_WIDTH", "128", 1);
  std::unique_ptr<VulkanDevice> device(new VulkanDevice);
  VkApplicationInfo application{};
  application.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
  application.apiVersion = VK_API_VERSION_1_1;
  VkInstanceCreateInfo instance{};
  instance.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
  instance.pApplicationInfo = &application;
  if (vkCreateInstance(&instance, nullptr, &device->instance_) != VK_SUCCESS) {
    *why = "there is no Vulkan driver";
    return nullptr;
  }
  uint32_t count = 0;
  vkEnumeratePhysicalDevices(device->instance_, &count, nullptr);
  std::vector<VkPhysicalDevice> found(count);
  vkEnumeratePhysicalDevices(device->instance_, &count, found.data());
  for (const VkPhysicalDevice candidate : found) {
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(candidate, &properties);
    // Never a real GPU: results would depend on the machine.
    if (properties.deviceType != VK_PHYSICAL_DEVICE_TYPE_CPU) continue;
    device->physical_ = candidate;
    device->name_ = properties.deviceName;
  }
  if (device->physical_ == VK_NULL_HANDLE) {
    *why = "no Vulkan driver runs on the CPU";
    return nullptr;
  }
  const float priority = 1;
  VkDeviceQueueCreateInfo queue{};
  queue.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO;
  queue.queueFamilyIndex = device->family_;  // lavapipe has one, which does everything
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;
  VkPhysicalDeviceFeatures features{};
  features.textureCompressionBC = VK_TRUE;
  VkDeviceCreateInfo create{};
  create.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO;
  create.queueCreateInfoCount = 1;
  create.pQueueCreateInfos = &queue;
  create.pEnabledFeatures = &features;
  if (vkCreateDevice(device->physical_, &create, nullptr, &device->device_) != VK_SUCCESS) {
    *why = device->name_ + " gives no device with BC textures";
    return nullptr;
  }
  vkGetDeviceQueue(device->device_, device->family_, 0, &device->queue_);
  return device;
}

VulkanDevice::~VulkanDevice() {
  if (device_ != VK_NULL_HANDLE) vkDestroyDevice(device_, nullptr);
  if (instance_ != VK_NULL_HANDLE) vkDestroyInstance(instance_, nullptr);
}

VkDeviceMemory VulkanDevice::Allocate(const VkMemoryRequirements& needs,
                                      VkMemoryPropertyFlags properties) {
  VkPhysicalDeviceMemoryProperties types;
  vkGetPhysicalDeviceMemoryProperties(physical_, &types);
  VkMemoryAllocateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  info.allocationSize = needs.size;
  for (uint32_t i = 0; i < types.memoryTypeCount; ++i) {
    const bool fits = (needs.memoryTypeBits >> i & 1) != 0 &&
                      (types.memoryTypes[i].propertyFlags & properties) == properties;
    if (fits) info.memoryTypeIndex = i;
  }
  VkDeviceMemory memory = VK_NULL_HANDLE;
  Expect(vkAllocateMemory(device_, &info, nullptr, &memory));
  return memory;
}

VulkanDevice::Buffer& VulkanDevice::MakeBuffer(Scratch* scratch, VkBufferUsageFlags usage,
                                               const void* bytes, size_t size) {
  Buffer buffer;
  buffer.bytes = size;
  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = size;
  info.usage = usage;
  Expect(vkCreateBuffer(device_, &info, nullptr, &buffer.buffer));
  VkMemoryRequirements needs;
  vkGetBufferMemoryRequirements(device_, buffer.buffer, &needs);
  buffer.memory =
      Allocate(needs, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
  Expect(vkBindBufferMemory(device_, buffer.buffer, buffer.memory, 0));
  Expect(vkMapMemory(device_, buffer.memory, 0, size, 0, &buffer.mapped));
  if (bytes != nullptr) std::memcpy(buffer.mapped, bytes, size);
  scratch->buffers.push_back(buffer);
  return scratch->buffers.back();
}

VulkanDevice::Image& VulkanDevice::MakeImage(Scratch* scratch, const DdsFile& file,
                                             VkCommandBuffer commands) {
  const auto levels = static_cast<uint32_t>(file.levels.size());
  Image image;
  VkImageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = FormatOf(file.dxgi_format);
  info.extent = {static_cast<uint32_t>(file.width), static_cast<uint32_t>(file.height), 1};
  info.mipLevels = levels;
  info.arrayLayers = 1;
  info.samples = VK_SAMPLE_COUNT_1_BIT;
  info.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  Expect(vkCreateImage(device_, &info, nullptr, &image.image));
  VkMemoryRequirements needs;
  vkGetImageMemoryRequirements(device_, image.image, &needs);
  image.memory = Allocate(needs, 0);
  Expect(vkBindImageMemory(device_, image.image, image.memory, 0));
  VkImageViewCreateInfo view{};
  view.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  view.image = image.image;
  view.viewType = VK_IMAGE_VIEW_TYPE_2D;
  view.format = info.format;
  view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, levels, 0, 1};
  Expect(vkCreateImageView(device_, &view, nullptr, &image.view));

  VkImageMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
  barrier.image = image.image;
  barrier.subresourceRange = view.subresourceRange;
  barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  barrier.dstAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT,
                       0, 0, nullptr, 0, nullptr, 1, &barrier);
  for (uint32_t level = 0; level < levels; ++level) {
    const auto& bytes = file.levels[level];
    const Buffer& staging =
        MakeBuffer(scratch, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, bytes.data(), bytes.size());
    VkBufferImageCopy copy{};
    copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, level, 0, 1};
    copy.imageExtent = {std::max(1u, info.extent.width >> level),
                        std::max(1u, info.extent.height >> level), 1};
    vkCmdCopyBufferToImage(commands, staging.buffer, image.image,
                           VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
  }
  barrier.oldLayout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL;
  barrier.newLayout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT,
                       VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 0, nullptr, 0, nullptr, 1,
                       &barrier);
  scratch->images.push_back(image);
  return scratch->images.back();
}

void VulkanDevice::ReleaseAll(Scratch* scratch) {
  vkDestroyCommandPool(device_, scratch->commands, nullptr);
  vkDestroyDescriptorPool(device_, scratch->descriptors, nullptr);
  vkDestroyPipeline(device_, scratch->pipeline, nullptr);
  vkDestroyShaderModule(device_, scratch->module, nullptr);
  vkDestroyPipelineLayout(device_, scratch->layout, nullptr);
  vkDestroyDescriptorSetLayout(device_, scratch->set_layout, nullptr);
  vkDestroySampler(device_, scratch->linear, nullptr);
  for (const Image& image : scratch->images) {
    vkDestroyImageView(device_, image.view, nullptr);
    vkDestroyImage(device_, image.image, nullptr);
    vkFreeMemory(device_, image.memory, nullptr);
  }
  for (const Buffer& buffer : scratch->buffers) {
    vkDestroyBuffer(device_, buffer.buffer, nullptr);
    vkFreeMemory(device_, buffer.memory, nullptr);
  }
}

std::vector<float> VulkanDevice::Run(const GpuProgram& program, std::span<const uint32_t> spirv,
                                     std::span<const float> inputs) {
  Scratch scratch;
  const bool hlsl = program.language == ShaderLanguage::kHlsl;
  const size_t items = inputs.size() / 8;
  const size_t groups = (items + kGroup - 1) / kGroup;

  VkCommandPoolCreateInfo pool{};
  pool.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
  pool.queueFamilyIndex = family_;
  Expect(vkCreateCommandPool(device_, &pool, nullptr, &scratch.commands));
  VkCommandBufferAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
  allocate.commandPool = scratch.commands;
  allocate.commandBufferCount = 1;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  Expect(vkAllocateCommandBuffers(device_, &allocate, &commands));
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  Expect(vkBeginCommandBuffer(commands, &begin));

  VkSamplerCreateInfo sampler{};
  sampler.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  sampler.magFilter = sampler.minFilter = VK_FILTER_LINEAR;
  sampler.mipmapMode = VK_SAMPLER_MIPMAP_MODE_LINEAR;
  sampler.addressModeU = sampler.addressModeV =
      program.wrap ? VK_SAMPLER_ADDRESS_MODE_REPEAT : VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  sampler.maxLod = VK_LOD_CLAMP_NONE;
  Expect(vkCreateSampler(device_, &sampler, nullptr, &scratch.linear));

  // One write for each resource; the infos must not move until they are written.
  std::vector<VkDescriptorImageInfo> image_infos;
  std::vector<VkDescriptorBufferInfo> buffer_infos;
  image_infos.reserve(program.textures.size() + 1);
  buffer_infos.reserve(3);
  std::vector<VkWriteDescriptorSet> writes;
  const auto add = [&](uint32_t binding, VkDescriptorType type) -> VkWriteDescriptorSet& {
    VkWriteDescriptorSet write{};
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstBinding = binding;
    write.descriptorCount = 1;
    write.descriptorType = type;
    writes.push_back(write);
    return writes.back();
  };
  const auto add_buffer = [&](uint32_t binding, VkDescriptorType type, const Buffer& buffer) {
    buffer_infos.push_back({buffer.buffer, 0, buffer.bytes});
    add(binding, type).pBufferInfo = &buffer_infos.back();
  };
  const auto add_image = [&](uint32_t binding, VkDescriptorType type, VkImageView view) {
    image_infos.push_back({scratch.linear, view, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL});
    add(binding, type).pImageInfo = &image_infos.back();
  };
  for (const GpuTexture& texture : program.textures) {
    add_image(static_cast<uint32_t>(texture.binding),
              hlsl ? VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE : VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER,
              MakeImage(&scratch, texture.file, commands).view);
  }
  if (hlsl) add_image(VulkanBindings::kSampler, VK_DESCRIPTOR_TYPE_SAMPLER, VK_NULL_HANDLE);
  if (!program.constants_name.empty()) {
    const auto binding = static_cast<uint32_t>(program.constants_binding);
    add_buffer(hlsl ? VulkanBindings::kHlslConstants + binding : binding,
               VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER,
               MakeBuffer(&scratch, VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT, program.constants.data(),
                          program.constants.size()));
  }
  // Whole groups: the last one may have items that nobody asked for.
  std::vector<float> padded(inputs.begin(), inputs.end());
  padded.resize(groups * kGroup * 8, 0.0f);
  add_buffer(VulkanBindings::kInput, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
             MakeBuffer(&scratch, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, padded.data(),
                        padded.size() * sizeof(float)));
  const size_t outputs = static_cast<size_t>(program.outputs);
  const Buffer output = MakeBuffer(&scratch, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, nullptr,
                                   groups * kGroup * outputs * sizeof(float));
  add_buffer(VulkanBindings::kOutput, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, output);

  std::vector<VkDescriptorSetLayoutBinding> bindings;
  std::vector<VkDescriptorPoolSize> sizes;
  for (const VkWriteDescriptorSet& write : writes) {
    bindings.push_back(
        {write.dstBinding, write.descriptorType, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr});
    sizes.push_back({write.descriptorType, 1});
  }
  VkDescriptorSetLayoutCreateInfo set_layout{};
  set_layout.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  set_layout.bindingCount = static_cast<uint32_t>(bindings.size());
  set_layout.pBindings = bindings.data();
  Expect(vkCreateDescriptorSetLayout(device_, &set_layout, nullptr, &scratch.set_layout));
  VkDescriptorPoolCreateInfo descriptors{};
  descriptors.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  descriptors.maxSets = 1;
  descriptors.poolSizeCount = static_cast<uint32_t>(sizes.size());
  descriptors.pPoolSizes = sizes.data();
  Expect(vkCreateDescriptorPool(device_, &descriptors, nullptr, &scratch.descriptors));
  VkDescriptorSetAllocateInfo set_info{};
  set_info.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  set_info.descriptorPool = scratch.descriptors;
  set_info.descriptorSetCount = 1;
  set_info.pSetLayouts = &scratch.set_layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  Expect(vkAllocateDescriptorSets(device_, &set_info, &set));
  for (VkWriteDescriptorSet& write : writes) write.dstSet = set;
  vkUpdateDescriptorSets(device_, static_cast<uint32_t>(writes.size()), writes.data(), 0, nullptr);

  VkPipelineLayoutCreateInfo layout{};
  layout.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layout.setLayoutCount = 1;
  layout.pSetLayouts = &scratch.set_layout;
  Expect(vkCreatePipelineLayout(device_, &layout, nullptr, &scratch.layout));
  VkShaderModuleCreateInfo module{};
  module.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  module.codeSize = spirv.size_bytes();
  module.pCode = spirv.data();
  Expect(vkCreateShaderModule(device_, &module, nullptr, &scratch.module));
  VkComputePipelineCreateInfo pipeline{};
  pipeline.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  pipeline.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  pipeline.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  pipeline.stage.module = scratch.module;
  pipeline.stage.pName = "main";
  pipeline.layout = scratch.layout;
  Expect(
      vkCreateComputePipelines(device_, VK_NULL_HANDLE, 1, &pipeline, nullptr, &scratch.pipeline));
  std::vector<float> results;
  if (!testing::Test::HasFailure()) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, scratch.pipeline);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, scratch.layout, 0, 1, &set, 0,
                            nullptr);
    vkCmdDispatch(commands, static_cast<uint32_t>(groups), 1, 1);
    Expect(vkEndCommandBuffer(commands));
    VkSubmitInfo submit{};
    submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    Expect(vkQueueSubmit(queue_, 1, &submit, VK_NULL_HANDLE));
    Expect(vkQueueWaitIdle(queue_));
    const auto* from = static_cast<const float*>(output.mapped);
    results.assign(from, from + items * outputs);
  }
  ReleaseAll(&scratch);
  return results;
}

}  // namespace patina::gpu_test
