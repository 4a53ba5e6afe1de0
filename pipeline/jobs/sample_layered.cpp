#include "pipeline/jobs/sample_layered.h"

#include "formats/base/file_io.h"
#include "formats/layered/layered_file.h"
#include "pipeline/layered/presets.h"

namespace patina {

Result<std::vector<std::string>> WriteSampleLayers(const std::string& folder) {
  PATINA_TRY(MakeDirectories(folder));
  std::vector<std::string> paths;
  for (const layered::Preset& preset : layered::Presets()) {
    paths.push_back(folder + "/" + preset.name + std::string(layered::kLayersSuffix));
    const std::string text = layered::FormatStack(preset.stack);
    PATINA_TRY(WriteFileDurably(paths.back(), std::string_view(text)));
  }
  return paths;
}

}  // namespace patina
