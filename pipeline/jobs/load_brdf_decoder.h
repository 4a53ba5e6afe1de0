// The reference decoder of a BRDF's container, with its status as an error.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/decoder/patina_brdf_decoder.h"

namespace patina {

inline Result<BrdfDecoder> LoadBrdfDecoder(const std::string& directory) {
  BrdfDecoder decoder;
  std::string problem;
  switch (BrdfDecoder::Load(directory, &decoder, &problem)) {
    case BrdfDecoder::LoadStatus::kOk:
      return decoder;
    case BrdfDecoder::LoadStatus::kNotFound:
      return Fail(ErrorCode::kNotFound, problem);
    case BrdfDecoder::LoadStatus::kUnsupported:
      return Fail(ErrorCode::kUnsupported, problem);
    case BrdfDecoder::LoadStatus::kCorrupt:
      break;
  }
  return Fail(ErrorCode::kCorruptData, problem);
}

}  // namespace patina
