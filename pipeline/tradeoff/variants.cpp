#include "pipeline/tradeoff/variants.h"

#include <functional>

namespace patina {
namespace {

using Change = std::function<void(Variant*)>;

struct Setting {
  std::string name, value;
  Change change;
};

void Apply(const Setting& setting, Variant* variant) {
  variant->settings.emplace_back(setting.name, setting.value);
  setting.change(variant);
  variant->name = (variant->settings.size() == 1 ? "" : variant->name + "_") + setting.name + "-" +
                  setting.value;
}

template <class T, class Name>
std::vector<Setting> AxisOf(const char* name, const std::vector<T>& values, Name text,
                            const std::function<void(Variant*, const T&)>& change) {
  std::vector<Setting> axis;
  for (const T& value : values)
    axis.push_back({name, text(value), [change, value](Variant* v) { change(v, value); }});
  return axis;
}

std::vector<Setting> NumberAxis(const char* name, const std::vector<int>& values,
                                std::optional<int> JobModel::*member) {
  return AxisOf<int>(
      name, values, [](int v) { return std::to_string(v); },
      [member](Variant* variant, const int& v) { variant->model.*member = v; });
}

std::vector<std::vector<Setting>> AxesOf(const SweepAxes& axes, JobKind kind) {
  std::vector<std::vector<Setting>> all;
  if (kind == JobKind::kMaterial) {
    all.push_back(AxisOf<Profile>("profile", axes.profiles, ProfileName,
                                  [](Variant* v, const Profile& p) { v->profile = p; }));
  }
  all.push_back(AxisOf<Quality>("quality", axes.qualities, QualityName,
                                [](Variant* v, const Quality& q) { v->quality = q; }));
  all.push_back(AxisOf<Recipe>("recipe", axes.recipes, RecipeName,
                               [](Variant* v, const Recipe& r) { v->recipe = r; }));
  if (kind == JobKind::kMaterial) return all;
  all.push_back(NumberAxis("nside", axes.nsides, &JobModel::nside));
  all.push_back(NumberAxis("bits", axes.index_bits, &JobModel::index_bits));
  all.push_back(NumberAxis("hidden", axes.hidden, &JobModel::hidden));
  all.push_back(NumberAxis("layers", axes.hidden_layers, &JobModel::hidden_layers));
  all.push_back(AxisOf<std::string>(
      "interpolation", axes.interpolations, [](const std::string& v) { return v; },
      [](Variant* variant, const std::string& v) { variant->model.interpolation = v; }));
  all.push_back(AxisOf<int>(
      "share", axes.shares, [](int v) { return std::to_string(v); },
      [](Variant* variant, const int& v) { variant->share = v; }));
  return all;
}

}  // namespace

SweepAxes DefaultMaterialAxes() {
  SweepAxes axes;
  axes.profiles = {Profile::kBcf05k, Profile::kBcf1k, Profile::kBcf2k, Profile::kBcf2kPlus};
  axes.qualities = {Quality::kPreview, Quality::kStandard, Quality::kReference};
  return axes;
}

void Variant::ApplyTo(Job* job) const {
  // A sweep shows what each variant gives: nothing that a job file asks for ends it early or keeps
  // it from being counted.
  job->choose_profile = false;
  job->target_psnr_db = job->target_bpp = job->time_budget_s = job->min_psnr_db = 0;
  job->size_budget_bytes = 0;
  if (profile) job->profile = *profile;
  if (quality) job->quality = *quality;
  if (recipe) job->recipe = *recipe;
  const auto override_with = [](const auto& given, auto* value) {
    if (given) *value = given;
  };
  override_with(model.nside, &job->model.nside);
  override_with(model.index_bits, &job->model.index_bits);
  override_with(model.hidden, &job->model.hidden);
  override_with(model.hidden_layers, &job->model.hidden_layers);
  override_with(model.interpolation, &job->model.interpolation);
}

std::vector<Variant> ProductOf(const SweepAxes& axes, JobKind kind) {
  Variant plain;
  plain.name = "default";
  std::vector<Variant> variants = {plain};
  for (const std::vector<Setting>& axis : AxesOf(axes, kind)) {
    if (axis.empty()) continue;
    std::vector<Variant> next;
    for (const Variant& variant : variants) {
      for (const Setting& setting : axis) {
        next.push_back(variant);
        Apply(setting, &next.back());
      }
    }
    variants = std::move(next);
  }
  return variants;
}

std::vector<Variant> DefaultBrdfVariants() {
  SweepAxes axes;
  axes.qualities = {Quality::kPreview, Quality::kReference};
  axes.nsides = {8, 16, 64};
  axes.index_bits = {5, 7, 11};
  axes.hidden = {16, 64};
  axes.hidden_layers = {2};
  axes.interpolations = {"uniform", "inverse_distance"};
  axes.shares = {4, 8};
  axes.recipes = {Recipe::kPaper};
  Variant plain;
  plain.name = "default";
  std::vector<Variant> variants = {plain};
  for (const std::vector<Setting>& axis : AxesOf(axes, JobKind::kBrdf)) {
    for (const Setting& setting : axis) {
      variants.push_back(plain);
      Apply(setting, &variants.back());
    }
  }
  return variants;
}

}  // namespace patina
