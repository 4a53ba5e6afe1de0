#include "formats/weights.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "formats/base/file_io.h"
#include "formats/base/little_endian.h"
#include "formats/half.h"

namespace patina {
namespace {

constexpr char kMagic[] = "PATINAWT";
constexpr uint32_t kElementHalf = 1;
constexpr size_t kMaxTensors = 64;
constexpr uint64_t kMaxElements = uint64_t{1} << 22;

enum HeaderOffset : int { kVersionAt = 8, kCountAt = 12, kFileBytesAt = 16, kCrcAt = 24 };
constexpr size_t kHeaderBytes = 64;

enum EntryOffset : int { kNameAt = 0, kTypeAt = 32, kRankAt = 36, kShapeAt = 40, kOffsetAt = 56 };
constexpr size_t kEntryBytes = 64;
constexpr size_t kNameBytes = 32;  // with the closing zero

uint64_t Align(uint64_t offset) {
  return (offset + kWeightsAlignment - 1) / kWeightsAlignment * kWeightsAlignment;
}

bool NameIsLegal(const std::string& name) {
  return !name.empty() && name.size() < kNameBytes &&
         std::all_of(name.begin(), name.end(), [](char c) { return c > 0x20 && c < 0x7F; });
}

// The product of 1..4 dimensions; 0 when a dimension is 0 or the product is above kMaxElements.
uint64_t ElementCount(std::span<const uint32_t> shape) {
  uint64_t count = 1;
  for (const uint32_t side : shape) {
    if (side == 0 || side > kMaxElements) return 0;
    count *= side;
    if (count > kMaxElements) return 0;
  }
  return count;
}

// Of the file with the checksum's own four bytes as zeros.
uint32_t FileCrc(std::span<const uint8_t> bytes) {
  const uint8_t zeros[4] = {};
  uint32_t crc = Crc32(bytes.first(kCrcAt));
  crc = Crc32(zeros, crc);
  return Crc32(bytes.subspan(kCrcAt + 4), crc);
}

std::string Quoted(const std::string& name) {
  std::string text = "\"";
  for (const char c : name.substr(0, 40)) text += c >= 0x20 && c < 0x7F ? c : '?';
  return text + "\"";
}

// Names the first element that is not finite, or returns an empty string.
std::string NonFinite(const WeightTensor& tensor) {
  for (size_t i = 0; i < tensor.elements.size(); ++i) {
    if (!HalfIsFinite(tensor.elements[i])) {
      return "non-finite weight: element " + std::to_string(i) + " of tensor " +
             Quoted(tensor.name) + " is " +
             ((tensor.elements[i] & 0x3FF) != 0 ? "NaN" : "infinite");
    }
  }
  return "";
}

bool HasName(const WeightBuffer& buffer, size_t count, const std::string& name) {
  return std::any_of(buffer.tensors.begin(),
                     buffer.tensors.begin() + static_cast<std::ptrdiff_t>(count),
                     [&](const WeightTensor& tensor) { return tensor.name == name; });
}

tl::unexpected<Error> BadTensor(size_t index, const std::string& what) {
  return Fail(ErrorCode::kCorruptData, "bad tensor " + std::to_string(index) + " (entry at byte " +
                                           std::to_string(kHeaderBytes + index * kEntryBytes) +
                                           "): " + what);
}

}  // namespace

uint32_t Crc32(std::span<const uint8_t> bytes, uint32_t crc) {
  static const std::array<uint32_t, 256> kTable = [] {
    std::array<uint32_t, 256> table{};
    for (uint32_t i = 0; i < 256; ++i) {
      uint32_t value = i;
      for (int bit = 0; bit < 8; ++bit)
        value = (value & 1) != 0 ? (value >> 1) ^ 0xEDB88320u : value >> 1;
      table[i] = value;
    }
    return table;
  }();
  crc = ~crc;
  for (const uint8_t byte : bytes) crc = kTable[(crc ^ byte) & 0xFF] ^ (crc >> 8);
  return ~crc;
}

Result<std::vector<uint8_t>> EncodeWeights(const WeightBuffer& buffer) {
  const size_t count = buffer.tensors.size();
  if (count == 0 || count > kMaxTensors) {
    return Fail(ErrorCode::kInvalidArgument,
                "a weight buffer of " + std::to_string(count) + " tensors; 1 to 64 are legal");
  }
  uint64_t end = kHeaderBytes + count * kEntryBytes;
  std::vector<uint64_t> offsets;
  for (size_t i = 0; i < count; ++i) {
    const WeightTensor& tensor = buffer.tensors[i];
    if (!NameIsLegal(tensor.name) || HasName(buffer, i, tensor.name)) {
      return Fail(ErrorCode::kInvalidArgument,
                  "tensor name " + Quoted(tensor.name) +
                      " is repeated or not 1 to 31 printable ASCII characters");
    }
    if (tensor.shape.empty() || tensor.shape.size() > 4 || ElementCount(tensor.shape) == 0 ||
        ElementCount(tensor.shape) != tensor.elements.size()) {
      return Fail(ErrorCode::kInvalidArgument, "tensor " + Quoted(tensor.name) + " has " +
                                                   std::to_string(tensor.elements.size()) +
                                                   " elements, which does not match its shape");
    }
    const std::string bad = NonFinite(tensor);
    if (!bad.empty()) return Fail(ErrorCode::kInvalidArgument, bad);
    offsets.push_back(Align(end));
    end = offsets.back() + tensor.elements.size() * 2;
  }
  const uint64_t total = Align(end);
  if (total > kMaxWeightsBytes)
    return Fail(ErrorCode::kInvalidArgument, "a weight buffer above 16 MiB");

  std::vector<uint8_t> bytes(total, 0);
  std::memcpy(bytes.data(), kMagic, 8);
  StoreLittle32(&bytes[kVersionAt], kWeightsVersion);
  StoreLittle32(&bytes[kCountAt], static_cast<uint32_t>(count));
  StoreLittle64(&bytes[kFileBytesAt], total);
  for (size_t i = 0; i < count; ++i) {
    const WeightTensor& tensor = buffer.tensors[i];
    uint8_t* entry = &bytes[kHeaderBytes + i * kEntryBytes];
    std::memcpy(entry + kNameAt, tensor.name.data(), tensor.name.size());
    StoreLittle32(entry + kTypeAt, kElementHalf);
    StoreLittle32(entry + kRankAt, static_cast<uint32_t>(tensor.shape.size()));
    for (size_t d = 0; d < tensor.shape.size(); ++d)
      StoreLittle32(entry + kShapeAt + 4 * d, tensor.shape[d]);
    StoreLittle64(entry + kOffsetAt, offsets[i]);
    uint8_t* out = &bytes[offsets[i]];
    for (const uint16_t half : tensor.elements) {
      *out++ = static_cast<uint8_t>(half & 0xFF);
      *out++ = static_cast<uint8_t>(half >> 8);
    }
  }
  StoreLittle32(&bytes[kCrcAt], FileCrc(bytes));
  return bytes;
}

Result<WeightBuffer> ParseWeights(std::span<const uint8_t> bytes) {
  const size_t magic_bytes = std::min<size_t>(bytes.size(), 8);
  if (magic_bytes == 0) return Fail(ErrorCode::kCorruptData, "truncated: the file is empty");
  if (std::memcmp(bytes.data(), kMagic, magic_bytes) != 0) {
    return Fail(ErrorCode::kCorruptData, "bad magic: the file does not start with \"PATINAWT\"");
  }
  if (bytes.size() < kHeaderBytes) {
    return Fail(ErrorCode::kCorruptData,
                "truncated: " + std::to_string(bytes.size()) + " of 64 header bytes");
  }
  const uint32_t version = LoadLittle32(&bytes[kVersionAt]);
  if (version == 0) return Fail(ErrorCode::kCorruptData, "bad header: version 0 at byte 8");
  if (version > kWeightsVersion) {
    return Fail(ErrorCode::kUnsupported, "weight buffer version " + std::to_string(version) +
                                             " is newer than this program, which reads up to " +
                                             std::to_string(kWeightsVersion) +
                                             "; use a newer patina");
  }
  const uint32_t count = LoadLittle32(&bytes[kCountAt]);
  if (count == 0 || count > kMaxTensors) {
    return Fail(ErrorCode::kCorruptData,
                "bad header: " + std::to_string(count) + " tensors at byte 12, not 1 to 64");
  }
  const uint64_t file_bytes = LoadLittle64(&bytes[kFileBytesAt]);
  if (file_bytes < kHeaderBytes + count * kEntryBytes || file_bytes > kMaxWeightsBytes) {
    return Fail(ErrorCode::kCorruptData,
                "bad header: file size " + std::to_string(file_bytes) + " at byte 16");
  }
  if (bytes.size() < file_bytes) {
    return Fail(ErrorCode::kCorruptData, "truncated: " + std::to_string(bytes.size()) + " of " +
                                             std::to_string(file_bytes) + " bytes");
  }
  if (bytes.size() > file_bytes) {
    return Fail(ErrorCode::kCorruptData, "trailing bytes: the buffer ends at byte " +
                                             std::to_string(file_bytes) + ", the file at " +
                                             std::to_string(bytes.size()));
  }
  const uint32_t crc = FileCrc(bytes);
  if (crc != LoadLittle32(&bytes[kCrcAt])) {
    return Fail(ErrorCode::kCorruptData, "bad checksum: the file says " +
                                             std::to_string(LoadLittle32(&bytes[kCrcAt])) +
                                             " at byte 24, its bytes give " + std::to_string(crc) +
                                             "; bake or copy it again");
  }

  WeightBuffer buffer;
  uint64_t end = kHeaderBytes + count * kEntryBytes;
  for (uint32_t i = 0; i < count; ++i) {
    const uint8_t* entry = &bytes[kHeaderBytes + i * kEntryBytes];
    const auto* text = reinterpret_cast<const char*>(entry + kNameAt);
    WeightTensor tensor;
    tensor.name.assign(text, static_cast<size_t>(std::find(text, text + kNameBytes, '\0') - text));
    if (!NameIsLegal(tensor.name) || HasName(buffer, i, tensor.name)) {
      return BadTensor(i, "name " + Quoted(tensor.name) +
                              " is repeated or not 1 to 31 printable ASCII characters");
    }
    if (LoadLittle32(entry + kTypeAt) != kElementHalf) {
      return Fail(ErrorCode::kUnsupported, "tensor " + Quoted(tensor.name) + " has element type " +
                                               std::to_string(LoadLittle32(entry + kTypeAt)) +
                                               "; only 1 (fp16) is read");
    }
    const uint32_t rank = LoadLittle32(entry + kRankAt);
    if (rank < 1 || rank > 4) return BadTensor(i, std::to_string(rank) + " dimensions, not 1 to 4");
    for (uint32_t d = 0; d < rank; ++d)
      tensor.shape.push_back(LoadLittle32(entry + kShapeAt + 4 * d));
    const uint64_t elements = ElementCount(tensor.shape);
    if (elements == 0) return BadTensor(i, "a dimension is zero or the tensor is too large");
    const uint64_t offset = LoadLittle64(entry + kOffsetAt);
    if (offset != Align(end)) {
      return BadTensor(
          i, "data at byte " + std::to_string(offset) + ", not at " + std::to_string(Align(end)));
    }
    end = offset + elements * 2;
    if (end > file_bytes)
      return BadTensor(i, "its data ends at byte " + std::to_string(end) + ", beyond the file");
    tensor.elements.resize(elements);
    for (uint64_t e = 0; e < elements; ++e) {
      tensor.elements[e] =
          static_cast<uint16_t>(bytes[offset + 2 * e] | bytes[offset + 2 * e + 1] << 8);
    }
    const std::string bad = NonFinite(tensor);
    if (!bad.empty()) return Fail(ErrorCode::kCorruptData, bad);
    buffer.tensors.push_back(std::move(tensor));
  }
  if (Align(end) != file_bytes) {
    return Fail(ErrorCode::kCorruptData, "bad header: file size " + std::to_string(file_bytes) +
                                             " at byte 16, but the last tensor ends at " +
                                             std::to_string(end));
  }
  return buffer;
}

Status WriteWeights(const std::string& path, const WeightBuffer& buffer) {
  auto bytes = EncodeWeights(buffer);
  if (!bytes) return Fail(std::move(bytes).error(), path);
  return WriteFileDurably(path, std::span<const uint8_t>(*bytes));
}

Result<WeightBuffer> ReadWeights(const std::string& path) {
  PATINA_ASSIGN(const std::vector<uint8_t> bytes, ReadFile(path, kMaxWeightsBytes));
  auto buffer = ParseWeights(bytes);
  if (!buffer) return Fail(std::move(buffer).error(), path);
  return buffer;
}

Result<WeightBuffer> PackNetwork(const NetworkWeights& network) {
  if (network.inputs < 1 || network.hidden < 1 || network.outputs < 1) {
    return Fail(ErrorCode::kInvalidArgument, "a network without inputs, hidden units or outputs");
  }
  const auto inputs = static_cast<uint32_t>(network.inputs);
  const auto hidden = static_cast<uint32_t>(network.hidden);
  const auto outputs = static_cast<uint32_t>(network.outputs);
  WeightBuffer buffer;
  const auto add = [&](const char* name, std::vector<uint32_t> shape,
                       const std::vector<float>& values) -> Status {
    if (ElementCount(shape) != values.size()) {
      return Fail(ErrorCode::kInvalidArgument,
                  std::string(name) + " has " + std::to_string(values.size()) +
                      " values, which does not match the network's sizes");
    }
    WeightTensor tensor{name, std::move(shape), {}};
    for (const float value : values) tensor.elements.push_back(FloatToHalf(value));
    const std::string bad = NonFinite(tensor);
    if (!bad.empty()) return Fail(ErrorCode::kInvalidArgument, bad);
    buffer.tensors.push_back(std::move(tensor));
    return {};
  };
  PATINA_TRY(add("layer0.weight", {hidden, inputs}, network.w1));
  PATINA_TRY(add("layer0.bias", {hidden}, network.b1));
  PATINA_TRY(add("layer1.weight", {outputs, hidden}, network.w2));
  PATINA_TRY(add("layer1.bias", {outputs}, network.b2));
  return buffer;
}

Result<NetworkWeights> UnpackNetwork(const WeightBuffer& buffer) {
  const auto find = [&](const char* name, size_t rank) -> const WeightTensor* {
    for (const WeightTensor& tensor : buffer.tensors) {
      if (tensor.name == name && tensor.shape.size() == rank) return &tensor;
    }
    return nullptr;
  };
  const WeightTensor* w1 = find("layer0.weight", 2);
  const WeightTensor* b1 = find("layer0.bias", 1);
  const WeightTensor* w2 = find("layer1.weight", 2);
  const WeightTensor* b2 = find("layer1.bias", 1);
  if (w1 == nullptr || b1 == nullptr || w2 == nullptr || b2 == nullptr ||
      buffer.tensors.size() != 4) {
    return Fail(ErrorCode::kCorruptData,
                "the tensors are not layer0.weight, layer0.bias, layer1.weight and layer1.bias of "
                "two, one, two and one "
                "dimensions");
  }
  if (b1->shape[0] != w1->shape[0] || w2->shape[1] != w1->shape[0] ||
      b2->shape[0] != w2->shape[0]) {
    return Fail(ErrorCode::kCorruptData, "the shapes of the layers do not match each other");
  }
  NetworkWeights network;
  network.inputs = static_cast<int>(w1->shape[1]);
  network.hidden = static_cast<int>(w1->shape[0]);
  network.outputs = static_cast<int>(w2->shape[0]);
  const auto floats = [](const WeightTensor& tensor) {
    std::vector<float> values;
    for (const uint16_t half : tensor.elements) values.push_back(HalfToFloat(half));
    return values;
  };
  network.w1 = floats(*w1);
  network.b1 = floats(*b1);
  network.w2 = floats(*w2);
  network.b2 = floats(*b2);
  return network;
}

}  // namespace patina
