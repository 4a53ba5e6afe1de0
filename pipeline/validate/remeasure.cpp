#include "pipeline/validate/remeasure.h"

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "formats/base/names.h"
#include "formats/container.h"
#include "pipeline/jobs/brdf_package.h"
#include "pipeline/jobs/compare.h"
#include "pipeline/jobs/measure_brdf.h"
#include "pipeline/jobs/svbrdf_package.h"
#include "pipeline/validate/check_container.h"

namespace patina::validate {
namespace {

namespace fs = std::filesystem;

std::string Numbers(double recorded, double measured, const char* unit) {
  char text[96];
  std::snprintf(text, sizeof text, "recorded %.6g%s, measured %.6g%s", recorded, unit, measured,
                unit);
  return text;
}

void ComparePsnr(const std::string& pointer, double recorded, double measured,
                 const std::string& file, FindingList* findings) {
  if (std::abs(CapPsnr(recorded) - CapPsnr(measured)) <= kPsnrBoundDb) return;
  findings->Add(6101, file, {pointer, {}}, Numbers(recorded, measured, " dB"));
}

void CompareError(const std::string& pointer, const std::optional<double>& recorded,
                  const std::optional<double>& measured, const std::string& file,
                  FindingList* findings) {
  if (!recorded || !measured) return;
  if (std::abs(*recorded - *measured) <= kBrdfErrorBound * std::max(*recorded, *measured)) return;
  findings->Add(6101, file, {pointer, {}}, Numbers(*recorded, *measured, ""));
}

// The folder of the asset where `source` is one of several.
Job SourceFor(const Job& source, const Manifest& manifest) {
  Job job = source;
  if (!source.scene.empty() || !source.maps.empty()) return job;
  std::error_code ignored;
  const fs::path folder = source.folder.empty() ? source.file : source.folder;
  if (!fs::is_directory(folder, ignored)) return job;
  job.file.clear();
  if (manifest.brdf) {
    job.kind = manifest.brdf->images ? JobKind::kSvbrdf : JobKind::kBrdf;
    if (manifest.brdf->source_format == kTextureSetFormat) {
      const fs::path inner = folder / manifest.asset;
      job.folder = fs::is_directory(inner, ignored) ? inner.string() : folder.string();
      return job;
    }
    job.folder.clear();
    if (!manifest.brdf->files.empty()) {
      const std::string& name = manifest.brdf->files[0].path;
      const fs::path inner = folder / manifest.asset / name;
      job.file = fs::exists(inner, ignored) ? inner.string() : (folder / name).string();
    }
    return job;
  }
  const fs::path inner = folder / manifest.asset;
  job.folder = fs::is_directory(inner, ignored) ? inner.string() : folder.string();
  return job;
}

void CompareErrors(const ManifestBrdfQuality& was, const ManifestBrdfQuality& is,
                   const std::string& file, FindingList* findings) {
  CompareError("/quality/image_mae", was.image_mae, is.image_mae, file, findings);
  CompareError("/quality/image_rmse", was.image_rmse, is.image_rmse, file, findings);
  CompareError("/quality/log1p_mse", was.log1p_mse, is.log1p_mse, file, findings);
  CompareError("/quality/reciprocity_error", was.reciprocity_error, is.reciprocity_error, file,
               findings);
}

void RemeasureBrdf(const Container& container, const Job& job, ThreadPool& pool,
                   const CancelToken& cancel, ProgressSink& progress, const std::string& file,
                   FindingList* findings) {
  const auto refuse = [&](const Error& error) { findings->Add(6102, file, {}, error.message); };
  const auto source = ReadBrdfSource(job);
  if (!source) return refuse(source.error());
  const ManifestBrdf& model = *container.manifest.brdf;
  if (!model.files.empty() && model.files[0].sha256 != source->sha256) {
    findings->Add(1401, file, {"/source/files/0", {}},
                  "the container was baked from another " + QuoteForMessage(model.files[0].path));
  }
  const auto measured =
      MeasureBrdf(container.directory, model, source->data, pool, cancel, progress);
  if (!measured) return refuse(measured.error());
  ManifestBrdf again;
  DescribeBrdfQuality(*measured, &again);
  CompareErrors(model.quality, again.quality, file, findings);
}

void RemeasureSvbrdf(const Container& container, const Job& job, ThreadPool& pool,
                     const CancelToken& cancel, ProgressSink& progress, const std::string& file,
                     FindingList* findings) {
  const auto refuse = [&](const Error& error) { findings->Add(6102, file, {}, error.message); };
  const ManifestBrdf& model = *container.manifest.brdf;
  // What is simulated to compare with is the same then.
  Job again_job = job;
  again_job.seed = container.manifest.seed;
  again_job.quality = ParseQuality(container.manifest.quality_setting).value_or(job.quality);
  again_job.address = model.images->address == "wrap" ? AddressMode::kWrap : AddressMode::kClamp;
  if (!job.scene.empty()) {
    return refuse(
        {ErrorCode::kUnsupported,
         job.scene + ": materials of scenes are not measured again; leave out --against"});
  }
  const auto source = ReadSvbrdfSource(again_job, "", pool, cancel, progress);
  if (!source) return refuse(source.error());
  if (model.images->sha256 != source->images_sha256) {
    findings->Add(1401, file, {"/source/images", {}},
                  "the images or maps are not those that the container was baked from");
  }
  const auto measured = MeasureSvbrdf(container.directory, *source->texels, pool, cancel, progress);
  if (!measured) return refuse(measured.error());
  ManifestBrdf again;
  DescribeSvbrdfQuality(*measured, &again);
  CompareErrors(model.quality, again.quality, file, findings);
}

}  // namespace

void Remeasure(const Target& target, const Job& source, ThreadPool& pool, const CancelToken& cancel,
               ProgressSink& progress, FindingList* findings) {
  if (target.kind == TargetKind::kArchive) {
    findings->Add(6102, target.label, {},
                  "archives are not measured; `patina unpack-archive` makes a container of it");
  }
  if (target.kind != TargetKind::kContainer) return;
  const auto container = OpenContainer(target.path);
  if (!container) return;  // found before
  const Manifest& manifest = container->manifest;
  const std::string file = JoinLabel(target.label, kManifestName);
  const Job job = SourceFor(source, manifest);
  if (manifest.brdf && manifest.brdf->images)
    return RemeasureSvbrdf(*container, job, pool, cancel, progress, file, findings);
  if (manifest.brdf) return RemeasureBrdf(*container, job, pool, cancel, progress, file, findings);
  const auto compared = CompareContainer(target.path, job, pool, cancel, progress);
  if (!compared) {
    // Told without the folder of the machine.
    std::string message = compared.error().message;
    for (size_t at; (at = message.find(container->directory)) != std::string::npos;)
      message.replace(at, container->directory.size(), target.label);
    findings->Add(6102, file, {}, message);
    return;
  }
  if (!compared->same_source) {
    findings->Add(1401, file, {"/source/files", {}},
                  "the source's files are not those that the container was baked from");
  }
  const metrics::PsnrTable& psnr = compared->measurement.quality.psnr;
  const ManifestQuality& was = manifest.quality;
  ComparePsnr("/quality/psnr_db/overall", was.psnr_overall_db, psnr.overall_db, file, findings);
  ComparePsnr("/quality/psnr_db/mip0", was.psnr_mip0_db, psnr.mip0_db, file, findings);
  ComparePsnr("/quality/psnr_db/mean_mips", was.psnr_mean_mips_db, psnr.mean_mips_db, file,
              findings);
}

}  // namespace patina::validate
