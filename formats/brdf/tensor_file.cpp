#include "formats/brdf/tensor_file.h"

#include <algorithm>
#include <cstring>

#include "formats/base/little_endian.h"
#include "formats/base/names.h"
#include "formats/brdf/cells.h"
#include "formats/half.h"

namespace patina::brdf {
namespace {

constexpr char kMagic[] = "tensor_file";  // with its closing zero
constexpr uint8_t kMajorVersion = 1;

uint16_t LoadLittle16(const uint8_t* bytes) {
  return static_cast<uint16_t>(bytes[0] | bytes[1] << 8);
}

// Reads forward through the field list, and remembers when the bytes ran out.
class Cursor {
 public:
  explicit Cursor(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  // The next `count` bytes; null, for good, when there are fewer.
  const uint8_t* Take(uint64_t count) {
    if (bytes_.size() - at_ < count) at_ = bytes_.size(), ended_ = true;
    if (ended_) return nullptr;
    const uint8_t* start = bytes_.data() + at_;
    at_ += count;
    return start;
  }
  uint64_t at() const { return at_; }

 private:
  std::span<const uint8_t> bytes_;
  uint64_t at_ = 0;
  bool ended_ = false;
};

std::string ShapeText(std::span<const uint64_t> shape) {
  std::string text;
  for (const uint64_t side : shape) text += (text.empty() ? "" : " x ") + std::to_string(side);
  return text;
}

}  // namespace

int TensorTypeBytes(uint8_t type) {
  constexpr int kBytes[12] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};
  return type < 12 ? kBytes[type] : 0;
}

double Tensor::At(uint64_t index) const {
  const uint8_t* p =
      bytes.data() + index * static_cast<uint64_t>(TensorTypeBytes(static_cast<uint8_t>(type)));
  switch (type) {
    case TensorType::kU8:
      return p[0];
    case TensorType::kI8:
      return static_cast<int8_t>(p[0]);
    case TensorType::kU16:
      return LoadLittle16(p);
    case TensorType::kI16:
      return static_cast<int16_t>(LoadLittle16(p));
    case TensorType::kU32:
      return LoadLittle32(p);
    case TensorType::kI32:
      return static_cast<int32_t>(LoadLittle32(p));
    case TensorType::kU64:
      return static_cast<double>(LoadLittle64(p));
    case TensorType::kI64:
      return static_cast<double>(static_cast<int64_t>(LoadLittle64(p)));
    case TensorType::kF16:
      return static_cast<double>(HalfToFloat(LoadLittle16(p)));
    case TensorType::kF32: {
      const uint32_t bits = LoadLittle32(p);
      float value;
      std::memcpy(&value, &bits, sizeof value);
      return static_cast<double>(value);
    }
    case TensorType::kF64:
      return LoadLittleDouble(p);
  }
  return 0;
}

const Tensor* TensorFile::Find(const std::string& name) const {
  const auto found = std::find_if(tensors.begin(), tensors.end(),
                                  [&](const Tensor& tensor) { return tensor.name == name; });
  return found == tensors.end() ? nullptr : &*found;
}

Result<TensorFile> ParseTensorFile(std::span<const uint8_t> bytes, const std::string& name) {
  const auto corrupt = [&](const std::string& what) {
    return Fail(ErrorCode::kCorruptData, name + ": " + what);
  };
  const std::string again = "; get the file again";
  if (bytes.size() < sizeof kMagic) {
    return corrupt("truncated: " + std::to_string(bytes.size()) +
                   " bytes, no room for the magic of a tensor file" + again);
  }
  if (std::memcmp(bytes.data(), kMagic, sizeof kMagic) != 0) {
    return corrupt(
        "bad magic: the file does not start with \"tensor_file\"; an RGL .bsdf file does");
  }
  Cursor cursor(bytes);
  cursor.Take(sizeof kMagic);
  const auto truncated = [&](const std::string& where) {
    return corrupt("truncated: the file ends at byte " + std::to_string(bytes.size()) + ", in " +
                   where + again);
  };
  const uint8_t* version = cursor.Take(2);
  const uint8_t* count_bytes = cursor.Take(4);
  if (count_bytes == nullptr) return truncated("the header");
  if (version[0] != kMajorVersion) {
    return Fail(ErrorCode::kUnsupported,
                name + ": tensor file version " + std::to_string(version[0]) + "." +
                    std::to_string(version[1]) + " at byte 12; only version 1 is read");
  }
  const uint32_t field_count = LoadLittle32(count_bytes);
  if (field_count == 0 || field_count > kMaxTensorFields) {
    return corrupt("bad header: field count at byte 14 is " + std::to_string(field_count) +
                   ", not 1 to " + std::to_string(kMaxTensorFields));
  }
  TensorFile file;
  uint64_t end = 0;
  for (uint32_t i = 0; i < field_count; ++i) {
    const std::string entry = "the entry of field " + std::to_string(i) +
                              ", which starts at byte " + std::to_string(cursor.at());
    const uint8_t* name_size = cursor.Take(2);
    if (name_size == nullptr) return truncated(entry);
    const uint16_t name_bytes = LoadLittle16(name_size);
    const uint8_t* text = cursor.Take(name_bytes);
    const uint8_t* fixed = cursor.Take(2 + 1 + 8);
    if (fixed == nullptr) return truncated(entry);
    Tensor tensor;
    tensor.name.assign(reinterpret_cast<const char*>(text), name_bytes);
    const std::string field = "field " + std::to_string(i) + " " + QuoteForMessage(tensor.name);
    if (file.Find(tensor.name) != nullptr) return corrupt(field + " is there twice");
    const uint16_t rank = LoadLittle16(fixed);
    if (rank < 1 || rank > kMaxTensorRank) {
      return corrupt(field + ": rank " + std::to_string(rank) + ", not 1 to " +
                     std::to_string(kMaxTensorRank));
    }
    const uint64_t element_bytes = static_cast<uint64_t>(TensorTypeBytes(fixed[2]));
    if (element_bytes == 0) {
      return corrupt(field + ": type " + std::to_string(fixed[2]) + ", not 1 to 11");
    }
    tensor.type = static_cast<TensorType>(fixed[2]);
    tensor.offset = LoadLittle64(fixed + 3);
    const uint8_t* sides = cursor.Take(uint64_t{8} * rank);
    if (sides == nullptr) return truncated(entry);
    for (int axis = 0; axis < rank; ++axis) tensor.shape.push_back(LoadLittle64(sides + 8 * axis));
    tensor.count = 1;
    bool too_large = false;
    for (const uint64_t side : tensor.shape) {
      if (side == 0)
        return corrupt(field + ": shape " + ShapeText(tensor.shape) + " has a side of zero");
      too_large |= side > bytes.size() / tensor.count;
      if (!too_large) tensor.count *= side;
    }
    if (too_large || tensor.count > bytes.size() / element_bytes) {
      return corrupt("truncated: " + field + ": shape " + ShapeText(tensor.shape) + " of " +
                     std::to_string(element_bytes) + "-byte elements is larger than the file of " +
                     std::to_string(bytes.size()) + " bytes" + again);
    }
    const uint64_t size = tensor.count * element_bytes;
    if (tensor.offset > bytes.size() - size) {
      return corrupt("truncated: " + field + ": " + std::to_string(size) + " bytes at offset " +
                     std::to_string(tensor.offset) + " reach beyond the end of the file at byte " +
                     std::to_string(bytes.size()) + again);
    }
    tensor.bytes = bytes.subspan(tensor.offset, size);
    end = std::max(end, tensor.offset + size);
    file.tensors.push_back(std::move(tensor));
  }
  for (const Tensor& tensor : file.tensors) {
    if (tensor.offset < cursor.at()) {
      return corrupt("field " + QuoteForMessage(tensor.name) + ": offset " +
                     std::to_string(tensor.offset) + " is within the header, which ends at byte " +
                     std::to_string(cursor.at()));
    }
  }
  if (end < bytes.size()) {
    return corrupt("trailing bytes: the last field ends at byte " + std::to_string(end) +
                   ", the file at " + std::to_string(bytes.size()) + again);
  }
  return file;
}

TensorToWrite FloatTensor(const std::string& name, std::vector<uint64_t> shape,
                          std::span<const float> values) {
  TensorToWrite tensor{name, TensorType::kF32, std::move(shape),
                       std::vector<uint8_t>(values.size() * 4)};
  for (size_t i = 0; i < values.size(); ++i) {
    uint32_t bits;
    std::memcpy(&bits, &values[i], sizeof bits);
    StoreLittle32(tensor.data.data() + 4 * i, bits);
  }
  return tensor;
}

TensorToWrite ByteTensor(const std::string& name, std::span<const uint8_t> values) {
  return {name, TensorType::kU8, {values.size()}, {values.begin(), values.end()}};
}

std::vector<uint8_t> EncodeTensorFile(std::span<const TensorToWrite> tensors) {
  const auto aligned = [](uint64_t at) { return (at + 7) / 8 * 8; };
  uint64_t at = sizeof kMagic + 2 + 4;
  for (const TensorToWrite& tensor : tensors)
    at += 2 + tensor.name.size() + 2 + 1 + 8 + 8 * tensor.shape.size();
  std::vector<uint64_t> offsets;
  for (const TensorToWrite& tensor : tensors) {
    offsets.push_back(aligned(at));
    at = offsets.back() + tensor.data.size();
  }
  std::vector<uint8_t> bytes(at, 0);
  uint8_t* out = bytes.data();
  const auto put16 = [&](uint64_t value) {
    *out++ = static_cast<uint8_t>(value);
    *out++ = static_cast<uint8_t>(value >> 8);
  };
  const auto put64 = [&](uint64_t value) { StoreLittle64(out, value), out += 8; };
  std::memcpy(out, kMagic, sizeof kMagic);
  out += sizeof kMagic;
  *out++ = kMajorVersion;
  *out++ = 0;
  StoreLittle32(out, static_cast<uint32_t>(tensors.size()));
  out += 4;
  for (size_t i = 0; i < tensors.size(); ++i) {
    const TensorToWrite& tensor = tensors[i];
    put16(tensor.name.size());
    std::memcpy(out, tensor.name.data(), tensor.name.size());
    out += tensor.name.size();
    put16(tensor.shape.size());
    *out++ = static_cast<uint8_t>(tensor.type);
    put64(offsets[i]);
    for (const uint64_t side : tensor.shape) put64(side);
    std::memcpy(bytes.data() + offsets[i], tensor.data.data(), tensor.data.size());
  }
  return bytes;
}

}  // namespace patina::brdf
