#include "tests/bench/nbrdf.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "formats/base/file_io.h"

namespace patina::bench {

NbrdfNetwork::NbrdfNetwork(const float numbers[kNbrdfParameters]) : NbrdfNetwork() {
  for (int l = 0; l < kNbrdfLayers; ++l) {
    for (int i = 0; i <= kNbrdfInputs[l]; ++i) {  // the last row is the biases'
      for (int o = 0; o < kNbrdfOutputs[l]; ++o) weight(l, i, o) = *numbers++;
    }
  }
}

Result<std::map<std::string, NbrdfNetwork>> ReadNbrdfNetworks(const std::string& path) {
  PATINA_ASSIGN(const std::string text, ReadTextFile(path, uint64_t{64} << 20));
  std::map<std::string, NbrdfNetwork> networks;
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::istringstream words(line);
    std::string name;
    float values[kNbrdfParameters];
    words >> name;
    int count = 0;
    while (count < kNbrdfParameters && words >> values[count] && std::isfinite(values[count]))
      ++count;
    if (count < kNbrdfParameters || !(words >> std::ws).eof()) {
      return Fail(ErrorCode::kCorruptData,
                  path + ": line " + std::to_string(number) + " is not a name and " +
                      std::to_string(kNbrdfParameters) +
                      " numbers; write the file with tests/bench/nbrdf_networks.py");
    }
    networks[name] = NbrdfNetwork(values);
  }
  return networks;
}

}  // namespace patina::bench
