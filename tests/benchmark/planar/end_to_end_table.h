#pragma once
// Whole reconstructions: `colmap mapper` and roomtex-mapper run as users run them, on databases of
// simulated keypoints, one thread each.

#include <cstdio>
#include <string>

#include "tests/benchmark/planar/planar_sets.h"
#include "tests/support/folders.h"

namespace roomtex {

struct EndToEndOptions {
  int sets_per_row = 50;
  std::string rows;  // only rows whose name holds this
  int jobs = 1;      // sets side by side
  std::string roomtex_mapper = BinFolder() + "/roomtex-mapper";
  std::string colmap = "colmap";
};

// table: "mapper", "sequences" or "adversarial". Sets where roomtex-mapper is wrong go to stderr as
// they are found, and below the table.
void PrintEndToEndTable(const std::string& table, const EndToEndOptions& options, std::FILE* out);

// One set: both verdicts and roomtex-mapper's report.
void ShowPrograms(const PlanarSet& set, int seed, const EndToEndOptions& options, std::FILE* out);

}  // namespace roomtex
