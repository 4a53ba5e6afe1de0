// Physical values of a material's container by the C++ decoder: decoder_values CONTAINER < places,
// where a place is a line "u v mip". For each a line of all channels.
#include <cstdio>
#include <string>
#include <vector>

#include "formats/decoder/patina_decoder.h"

int main(int argc, char** argv) {
  patina::Decoder material;
  std::string problem;
  if (argc != 2 ||
      patina::Decoder::Load(argv[1], &material, &problem) != patina::Decoder::LoadStatus::kOk) {
    std::fprintf(stderr, "decoder_values: %s\n", problem.c_str());
    return 1;
  }
  std::vector<float> values(material.channels().size());
  double u = 0, v = 0, mip = 0;
  while (std::scanf("%lf %lf %lf", &u, &v, &mip) == 3) {
    material.Physical(u, v, mip, values.data());
    for (const float value : values) std::printf("%.9g ", static_cast<double>(value));
    std::printf("\n");
  }
  return 0;
}
