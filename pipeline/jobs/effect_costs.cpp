#include "pipeline/jobs/effect_costs.h"

#include <algorithm>

#include "formats/dds.h"

namespace patina {
namespace {

constexpr uint64_t kBytesOfHalf = 2;
// Forward, backward to the inputs of a layer, gradient of its weights.
constexpr uint64_t kTrainPasses = 3;

ManifestSavings SavedOutputs(int outputs, const TrainedMaterial* model) {
  const auto count = static_cast<uint64_t>(outputs);
  ManifestSavings saved;
  saved.bytes = count * (kNetworkHidden + 1) * kBytesOfHalf;
  saved.decode_multiply_adds = count * kNetworkHidden;
  if (model != nullptr) {
    saved.train_multiply_adds =
        kTrainPasses * saved.decode_multiply_adds * static_cast<uint64_t>(model->samples);
  }
  return saved;
}

// The finer and coarser mips are saved together: the entry of the finer ones has it all, or that of
// the coarser ones if there are no others.
ManifestSavings SavedMips(const Job& job, const SourceReference& reference,
                          const TrainedMaterial& model) {
  ManifestSavings saved;
  const ModelShape full = ShapeForProfile(job.profile, reference.width, reference.height);
  const uint64_t all = TextureBytes(full), kept = TextureBytes(model.shape);
  saved.bytes = all > kept ? all - kept : 0;
  if (job.samples > 0) return saved;
  TrainOptions options;
  options.quality = job.quality;
  MaterialReference whole;
  int width = reference.width, height = reference.height;
  for (;;) {
    TargetLevel level;  // sizes alone
    level.width = width;
    level.height = height;
    whole.pyramid.levels.push_back(std::move(level));
    if (width == 1 && height == 1) break;
    width = std::max(1, width / 2);
    height = std::max(1, height / 2);
  }
  const double budget = SampleBudget(whole, options);
  const double drawn = SampleBudget(reference.material, options);
  saved.train_samples = budget > drawn ? static_cast<uint64_t>(budget - drawn) : 0;
  saved.train_multiply_adds =
      kTrainPasses * saved.train_samples *
      static_cast<uint64_t>(kNetworkHidden * (kNetworkInputs + model.outputs));
  return saved;
}

}  // namespace

uint64_t TextureBytes(const ModelShape& shape) {
  uint64_t bytes = 0;
  for (const FeatureShape& feature : shape) {
    bytes += kDdsHeaderBytes;
    for (int level = 0; level < feature.levels; ++level) {
      const auto blocks = [level](int side) {
        return static_cast<uint64_t>(std::max(1, side >> level) + 3) / 4;
      };
      bytes += sizeof(bc6h::Block) * blocks(feature.width) * blocks(feature.height);
    }
  }
  return bytes;
}

std::vector<ManifestEffect> DescribeEffects(const Job& job, const SourceReference& reference,
                                            const TrainedMaterial* model) {
  std::vector<ManifestEffect> described;
  bool mips_told = false;
  for (const Effect& effect : reference.effects) {
    ManifestEffect entry;
    entry.what = effect.what;
    entry.state = EffectStateName(effect.state);
    entry.reason = effect.reason;
    if (effect.outputs > 0) {
      entry.saved = SavedOutputs(effect.outputs, model);
    } else if (effect.state == EffectState::kLeftOut && model != nullptr && !mips_told) {
      entry.saved = SavedMips(job, reference, *model);
      mips_told = true;
    }
    described.push_back(std::move(entry));
  }
  if (model == nullptr) {
    ManifestEffect entry;
    entry.what = "textures and network";
    entry.state = EffectStateName(EffectState::kLeftOut);
    entry.reason = "no channel has to be learned";
    ManifestSavings saved;
    saved.bytes = TextureBytes(ShapeForProfile(job.profile, reference.width, reference.height)) +
                  kBytesOfHalf * kNetworkHidden * (kNetworkInputs + 1);
    saved.decode_multiply_adds = static_cast<uint64_t>(kNetworkHidden) * kNetworkInputs;
    TrainOptions options;
    options.quality = job.quality;
    options.samples = job.samples;
    saved.train_samples = static_cast<uint64_t>(SampleBudget(reference.material, options));
    saved.train_multiply_adds = kTrainPasses * saved.train_samples * saved.decode_multiply_adds;
    entry.saved = saved;
    described.push_back(std::move(entry));
  }
  return described;
}

}  // namespace patina
