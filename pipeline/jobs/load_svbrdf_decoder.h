// The reference decoder of a spatially varying BRDF's container, with its status as an error.
#pragma once

#include <string>

#include "formats/base/result.h"
#include "formats/decoder/patina_svbrdf_decoder.h"

namespace patina {

inline Result<SvbrdfDecoder> LoadSvbrdfDecoder(const std::string& directory) {
  SvbrdfDecoder decoder;
  std::string problem;
  switch (SvbrdfDecoder::Load(directory, &decoder, &problem)) {
    case SvbrdfDecoder::LoadStatus::kOk:
      return decoder;
    case SvbrdfDecoder::LoadStatus::kNotFound:
      return Fail(ErrorCode::kNotFound, problem);
    case SvbrdfDecoder::LoadStatus::kUnsupported:
      return Fail(ErrorCode::kUnsupported, problem);
    case SvbrdfDecoder::LoadStatus::kNoMemory:
      return Fail(ErrorCode::kResourceExhausted, problem);
    case SvbrdfDecoder::LoadStatus::kCorrupt:
      break;
  }
  return Fail(ErrorCode::kCorruptData, problem);
}

}  // namespace patina
