#pragma once
// Where many matches of photos and scan (appearance_matches.h) agree on one similarity: RANSAC
// (Fischler and Bolles 1981) with samples of three matches, locally optimised (Chum et al. 2003).

#include <optional>
#include <vector>

#include "align/trust/appearance_matches.h"
#include "core/similarity.h"

namespace roomtex {

struct AppearanceSearchOptions {
  int num_samples = 1500000;  // most are dropped by their lengths alone
  double tolerance = 0.07;    // metres
  double cell = 0.15;         // metres; matches in one cell of the scan are one
  double min_length = 0.8;    // metres between the matches of a sample
  double max_stretch = 1.15;  // by which the scales of a sample's three lengths may differ
  double max_lean_deg = 15;   // by which up may be off
  double scale_reach = 4.6;   // times the ratio of the extents of what matches, either way
  double distinct = 0.5;      // metres between places that are different
  int num_kept = 5;
};

struct AppearancePlace {
  Similarity scan_from_sparse;
  int num_cells = 0;  // of the scan, with matches that agree
};

// Clearly different places, the best first; those behind the first say what comes by chance. The
// same for every number of threads. Unit vectors; up_in_sparse may not be known.
std::vector<AppearancePlace> SearchByAppearance(const std::vector<AppearanceMatch>& matches,
                                                const std::optional<Eigen::Vector3d>& up_in_sparse,
                                                const Eigen::Vector3d& up_in_scan,
                                                const AppearanceSearchOptions& options,
                                                int num_threads);

}  // namespace roomtex
