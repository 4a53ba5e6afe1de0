#include <cstdio>

#include "formats/base/file_io.h"
#include "formats/shader_package.h"
#include "pipeline/cli/commands.h"
#include "pipeline/jobs/job_result.h"

namespace patina {

int ShaderCommand(const CommandLine& line) {
  const ShaderCommandOptions& given = line.shader;
  auto container = OpenContainer(given.container);
  if (!container) return FailCommand(container.error());
  ShaderOptions options;
  options.language = given.language == "hlsl"   ? ShaderLanguage::kHlsl
                     : given.language == "essl" ? ShaderLanguage::kEssl
                                                : ShaderLanguage::kGlsl;
  options.first_binding = given.first_binding;
  auto package = BuildShaderPackage(*container, options);
  if (!package) return FailCommand(package.error());
  const Status made = MakeDirectories(given.out);
  if (!made) return FailCommand(made.error());
  for (const ShaderFile& file : package->files) {
    const std::string path = given.out + "/" + file.name;
    const Status written = WriteFileDurably(path, file.bytes);
    if (!written) return FailCommand(written.error());
    if (line.verbosity != Verbosity::kQuiet) std::printf("%s\n", path.c_str());
  }
  return kExitDone;
}

}  // namespace patina
