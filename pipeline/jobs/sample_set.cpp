#include "pipeline/jobs/sample_set.h"

#include "formats/base/file_io.h"
#include "pipeline/image/image_io.h"
#include "pipeline/jobs/job.h"

namespace patina {

Result<SampleMaterial> StartSample(const std::string& folder, int size, uint64_t seed,
                                   ThreadPool& pool) {
  if (size < 1 || size > kMaxSampleSide) {
    return Fail(ErrorCode::kInvalidArgument, "the size of a sample must be between 1 and " +
                                                 std::to_string(kMaxSampleSide) + " texels; is " +
                                                 std::to_string(size));
  }
  PATINA_TRY(MakeDirectories(folder));
  return MakeSampleMaterial(size, seed, pool);
}

Result<std::vector<std::string>> WriteSampleSet(const std::string& folder, int size, uint64_t seed,
                                                ThreadPool& pool) {
  PATINA_ASSIGN(const SampleMaterial material, StartSample(folder, size, seed, pool));
  struct File {
    const char* name;
    WriteFormat format;
    int channels;
    const std::vector<float>& values;
  };
  const File files[] = {{"mosaic_floor_basecolor.png", WriteFormat::kPng8, 3, material.albedo},
                        {"mosaic_floor_normal_gl.png", WriteFormat::kPng16, 3, material.normal},
                        {"mosaic_floor_arm.png", WriteFormat::kPng8, 3, material.arm},
                        {"mosaic_floor_height.png", WriteFormat::kPng16, 1, material.height},
                        {"mosaic_floor_emissive.png", WriteFormat::kPng8, 3, material.emissive}};
  std::vector<std::string> written;
  for (const File& file : files) {
    const std::string path = folder + "/" + file.name;
    PATINA_TRY(WriteImage(path, file.format, size, size, file.channels, file.values.data()));
    written.push_back(path);
  }
  Job job;
  job.asset = "mosaic_floor";
  job.folder = ".";
  job.out = "baked";
  const std::string job_path = folder + "/job.json";
  PATINA_TRY(WriteFileDurably(job_path, std::string_view(JobToJson(job))));
  written.push_back(job_path);
  return written;
}

}  // namespace patina
