// Checks a container and lists what an engine has to load: list_payloads CONTAINER
#include <cstdio>

#include "formats/container.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: list_payloads CONTAINER\n");
    return 2;
  }
  const auto container = patina::OpenContainer(argv[1]);
  if (!container) {
    std::fprintf(stderr, "list_payloads: error: %s\n", container.error().message.c_str());
    return 3;
  }
  const patina::Status whole = patina::VerifyPayloads(*container);
  if (!whole) {
    std::fprintf(stderr, "list_payloads: error: %s\n", whole.error().message.c_str());
    return 3;
  }
  const patina::Manifest& manifest = container->manifest;
  std::printf("%s: %s\n", manifest.asset.c_str(), manifest.kind.c_str());
  for (const patina::ManifestPayload& payload : manifest.payloads) {
    std::printf("%s %s %llu\n", payload.name.c_str(), payload.role.c_str(),
                static_cast<unsigned long long>(payload.bytes));
  }
  return 0;
}
