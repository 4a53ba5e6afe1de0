// Little-endian integers in byte buffers, on any machine.
#pragma once

#include <cstdint>

namespace patina {

inline uint16_t LoadLittle16(const uint8_t* bytes) {
  return static_cast<uint16_t>(bytes[0] | bytes[1] << 8);
}

inline uint32_t LoadLittle32(const uint8_t* bytes) {
  return static_cast<uint32_t>(bytes[0]) | static_cast<uint32_t>(bytes[1]) << 8 |
         static_cast<uint32_t>(bytes[2]) << 16 | static_cast<uint32_t>(bytes[3]) << 24;
}

inline uint64_t LoadLittle64(const uint8_t* bytes) {
  return LoadLittle32(bytes) | static_cast<uint64_t>(LoadLittle32(bytes + 4)) << 32;
}

inline void StoreLittle16(uint8_t* bytes, uint16_t value) {
  for (int i = 0; i < 2; ++i) bytes[i] = static_cast<uint8_t>(value >> (8 * i));
}

inline void StoreLittle32(uint8_t* bytes, uint32_t value) {
  for (int i = 0; i < 4; ++i) bytes[i] = static_cast<uint8_t>(value >> (8 * i));
}

inline void StoreLittle64(uint8_t* bytes, uint64_t value) {
  for (int i = 0; i < 8; ++i) bytes[i] = static_cast<uint8_t>(value >> (8 * i));
}

}  // namespace patina
