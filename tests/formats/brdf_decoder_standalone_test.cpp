// Compiled as C++17 without the project's include path: what a renderer that copies the headers
// does.
#include <gtest/gtest.h>

#include "patina_brdf_decoder.h"

TEST(BrdfDecoderStandalone, NeedsOnlyTheStandardLibraryAndNlohmannJson) {
  static_assert(__cplusplus == 201703L);
  patina::BrdfDecoder decoder;
  std::string message;
  EXPECT_EQ(patina::BrdfDecoder::Load("no/such/container", &decoder, &message),
            patina::BrdfDecoder::LoadStatus::kNotFound);
  EXPECT_NE(message.find("no/such/container"), std::string::npos);
}
