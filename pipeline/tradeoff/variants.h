// The configurations that a sweep bakes each input with.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pipeline/jobs/job.h"

namespace patina {

// The values of each setting that is swept. An empty list: the default of the job alone.
struct SweepAxes {
  // Of materials.
  std::vector<Profile> profiles;
  // Of both kinds.
  std::vector<Quality> qualities;
  std::vector<Recipe> recipes;
  // Of BRDFs.
  std::vector<int> nsides, index_bits, hidden, hidden_layers;
  std::vector<std::string> interpolations;
  std::vector<int> shares;  // materials on one codebook
};

// What a sweep takes if nothing is asked for: four profiles and three qualities of materials; of BRDFs
// a change of each setting by itself around the default.
SweepAxes DefaultMaterialAxes();

struct Variant {
  std::string name;  // a folder's name: its settings in a fixed order, "default" without any
  std::vector<std::pair<std::string, std::string>> settings;
  std::optional<Profile> profile;
  std::optional<Quality> quality;
  std::optional<Recipe> recipe;
  JobModel model;
  int share = 1;

  // Also takes back targets, budgets and gates.
  void ApplyTo(Job* job) const;
};

// The product of all axes that belong to the kind.
std::vector<Variant> ProductOf(const SweepAxes& axes, JobKind kind);
// The default, and each value of each axis of BRDFs by itself.
std::vector<Variant> DefaultBrdfVariants();

}  // namespace patina
