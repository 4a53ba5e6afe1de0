// The decoder's own status as a Status.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/decoder/patina_decoder.h"

namespace patina {

inline Status DecoderStatus(Decoder::LoadStatus status, const std::string& message) {
  switch (status) {
    case Decoder::LoadStatus::kOk:
      return {};
    case Decoder::LoadStatus::kNotFound:
      return Fail(ErrorCode::kNotFound, message);
    case Decoder::LoadStatus::kCorrupt:
      return Fail(ErrorCode::kCorruptData, message);
    case Decoder::LoadStatus::kUnsupported:
      return Fail(ErrorCode::kUnsupported, message);
    case Decoder::LoadStatus::kNoMemory:
      break;
  }
  return Fail(ErrorCode::kResourceExhausted, message);
}

}  // namespace patina
