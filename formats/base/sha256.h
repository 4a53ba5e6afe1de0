// SHA-256 of bytes in pieces.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "formats/base/result.h"

namespace patina {

using Sha256Digest = std::array<uint8_t, 32>;

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void Update(std::span<const uint8_t> bytes);
  void Update(std::string_view text);
  // Ends the computation; call once, nothing after.
  Sha256Digest Finish();
  std::string FinishHex();  // 64 lower-case digits

 private:
  struct State;
  std::unique_ptr<State> state_;
};

std::string ToHex(std::span<const uint8_t> bytes);  // lower case
std::string Sha256Hex(std::span<const uint8_t> bytes);
std::string Sha256Hex(std::string_view text);
// Of a file, read in pieces, and its size. Errors: kNotFound, kIo, kInvalidArgument (not a regular
// file).
struct FileDigest {
  std::string sha256;
  uint64_t bytes = 0;
};
Result<FileDigest> Sha256OfFile(const std::string& path);

}  // namespace patina
