#pragma once
// The first pair alone, without any program: what the thesis' rule, the lower two-view cost and our
// Initializer start from.

#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "tests/benchmark/planar/planar_sets.h"

namespace roomtex {

struct InProcessOptions {
  int sets_per_cell = 12;  // a row of the grid has 18 cells
  std::string rows;        // only rows whose name holds this
  int jobs = 1;            // sets side by side; changes the speed only
  // The first sets of a cell run the thesis' rule and the lower cost as well, three times the work.
  int rival_sets_per_cell = 12;
};

enum class SeedOutcome { kRight, kWrong, kAmbiguousRight, kAmbiguousWrong, kNone };

struct SetOutcome {
  std::string set;
  int seed = 0;
  bool with_rivals = false, thesis_right = false, lower_cost_right = false;
  SeedOutcome ours = SeedOutcome::kNone;
  bool identifiable = false;    // of the pair that ours chose
  bool strictly_right = false;  // PairVerdict::StrictlyRight, trusted or not
  double confidence = 0;
  double rotation_deg = 0, baseline_deg = 0;  // errors of ours
  double cpu_seconds = 0;                     // of ours
};

SetOutcome RunInProcess(const PlanarSet& set, int seed, bool rivals);

struct OutcomeCounts {
  int num_sets = 0, num_rivals = 0, thesis = 0, lower_cost = 0, right = 0, wrong = 0, ambiguous = 0;
  int identifiable = 0, identifiable_right = 0, no_seed = 0;
  int strictly_right = 0, strictly_wrong = 0;  // of the trusted ones
  double cpu_seconds = 0;

  void Add(const SetOutcome& outcome);
};

// Prints the rows as a Markdown table, the same sets by outliers, views and matches, and every set
// that is wrong or not decided. All outcomes in order.
std::vector<SetOutcome> PrintInProcessTable(const InProcessOptions& options, std::FILE* out);

// Everything there is to know of one set: pairs, hypotheses, costs and errors.
void ShowSet(const PlanarSet& set, int seed, std::FILE* out);

}  // namespace roomtex
