// Compiled as C++17 without the project's include path: what a renderer that copies the header
// does.
#include <gtest/gtest.h>

#include "patina_decoder.h"

TEST(DecoderStandalone, NeedsOnlyTheStandardLibraryAndNlohmannJson) {
  static_assert(__cplusplus == 201703L);
  patina::Decoder decoder;
  std::string message;
  EXPECT_EQ(patina::Decoder::Load("no/such/container", &decoder, &message),
            patina::Decoder::LoadStatus::kNotFound);
  EXPECT_NE(message.find("no/such/container"), std::string::npos);
}
