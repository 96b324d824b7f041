#pragma once
// Starts without a click, by geometry alone: every way to stand, turn and size the sparse model so
// that its points lie on the scan's surface, and not in space that the scanner saw to be empty.
// Translations by correlation in the Fourier domain (as phase correlation does: Kuglin and Hines
// 1975; of volumes for a search over poses: Katchalski-Katzir et al. 1992, "Molecular Surface
// Recognition"), one for each turn about the vertical and each scale.

#include <vector>

#include "align/search/scan_volume.h"
#include "align/search/search_cloud.h"
#include "align/search/search_hint.h"
#include "core/similarity.h"

namespace roomtex {

struct GeometrySearchOptions {
  double turn_step_deg = 9;  // smaller = finer and slower
  double scale_step = 0.07;  // of the logarithm of the scale; smaller = finer and slower
  // The scale is looked for within this factor, either way, of the ratio of the extents of scan and
  // model.
  double scale_reach = 2.3;
  int num_kept = 60;           // hypotheses, the best of all
  int num_kept_per_scale = 0;  // and of each scale
  ScanVolumeOptions volume;
};

// A start: for the mirror image of a model if the cloud is one.
struct StartHypothesis {
  Similarity scan_from_sparse;
  double score = 0;  // mean worth of its points (ScanVolumeOptions), less what cameras cost
};

// The best first, all clearly different; the same for every number of threads. ups: of the cloud,
// see FindUpDirections().
std::vector<StartHypothesis> SearchByGeometry(
    const SearchCloud& cloud, const std::vector<Eigen::Vector3d>& ups, const ScanVolume& volume,
    const std::vector<HintRay>& hints, const GeometrySearchOptions& options, int num_threads);

}  // namespace roomtex
