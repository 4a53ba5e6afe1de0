// Values of a container by the C++ decoders: decoder_values CONTAINER < places. Of a material a
// place is a line "u v mip", and for each there is a line of the physical values of all channels.
// Of a BRDF that varies it goes on with wi and wo, "u v mip wix wiy wiz wox woy woz", for a line of
// f.
#include <cstdio>
#include <string>
#include <vector>

#include "formats/decoder/patina_decoder.h"
#include "formats/decoder/patina_svbrdf_decoder.h"

namespace {

void Print(const std::vector<float>& values) {
  for (const float value : values) std::printf("%.9g ", static_cast<double>(value));
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  patina::Decoder material;
  patina::SvbrdfDecoder varying;
  std::string no_material, no_varying;
  if (argc != 2) return 2;
  double u = 0, v = 0, mip = 0;
  if (patina::Decoder::Load(argv[1], &material, &no_material) == patina::Decoder::LoadStatus::kOk) {
    std::vector<float> values(material.channels().size());
    while (std::scanf("%lf %lf %lf", &u, &v, &mip) == 3) {
      material.Physical(u, v, mip, values.data());
      Print(values);
    }
    return 0;
  }
  if (patina::SvbrdfDecoder::Load(argv[1], &varying, &no_varying) !=
      patina::SvbrdfDecoder::LoadStatus::kOk) {
    std::fprintf(stderr, "decoder_values: %s; %s\n", no_material.c_str(), no_varying.c_str());
    return 1;
  }
  float wi[3], wo[3];
  std::vector<float> f(3);
  while (std::scanf("%lf %lf %lf %f %f %f %f %f %f", &u, &v, &mip, &wi[0], &wi[1], &wi[2], &wo[0],
                    &wo[1], &wo[2]) == 9) {
    varying.Evaluate(wi, wo, u, v, mip, f.data());
    Print(f);
  }
  return 0;
}
