// Prints the physical values of a baked material at one place: decode CONTAINER U V [LOD]
#include <patina/patina_decoder.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

int main(int argc, char** argv) {
  if (argc < 4 || argc > 5) {
    std::fprintf(stderr, "usage: decode CONTAINER U V [LOD]\n");
    return 2;
  }
  patina::Decoder material;
  std::string problem;
  if (patina::Decoder::Load(argv[1], &material, &problem) != patina::Decoder::LoadStatus::kOk) {
    std::fprintf(stderr, "decode: error: %s\n", problem.c_str());
    return 3;
  }
  std::vector<float> values(material.channels().size());
  material.Physical(std::atof(argv[2]), std::atof(argv[3]), argc > 4 ? std::atof(argv[4]) : 0.0,
                    values.data());
  for (size_t i = 0; i < values.size(); ++i) {
    const patina::Decoder::Channel& channel = material.channels()[i];
    std::printf("%s%s%s %.9g\n", channel.map.c_str(), channel.component.empty() ? "" : ".",
                channel.component.c_str(), static_cast<double>(values[i]));
  }
  return 0;
}
