#pragma once
// Bundle adjustment of a seed (thesis 6.1, last step): a pair of views, or a pair and the further
// views that validated it. Intrinsics are fixed (they are inside the rays); the first view stays
// where it is, the second keeps unit distance from it, so that nothing can drift.

#include <vector>

#include <Eigen/Core>

#include "colmap_ext/triangulation.h"
#include "colmap_ext/view_rays.h"
#include "core/similarity.h"

namespace roomtex {

struct SeedObservation {
  int view = 0;   // index into SeedGeometry::views_from_left
  int point = 0;  // index into SeedGeometry::points
  Ray ray;
};

struct SeedGeometry {
  // [0] is the first view (left) itself: identity. [1] has a translation of length 1.
  std::vector<Rigid> views_from_left;
  std::vector<InverseDepthPoint> points;
};

struct SeedBundleOptions {
  // Cauchy loss: errors beyond this many pixels pull less and less. 0 = plain squares, for starts
  // far from the answer whose matches are known to be good.
  double loss_scale_px = 2;
  int max_iterations = 30;
  // Same-pose start (thesis 6.1.3): the second view stands on the first one, so its distance cannot
  // be held at 1; it is freed, and the result is scaled to 1 afterwards.
  bool free_baseline = false;
  // Leading views that stay where they are. With more than one they hold the scale: the second one
  // may be at any distance, and nothing is scaled.
  int num_fixed_views = 1;
};

struct SeedBundleResult {
  SeedGeometry geometry;
  double initial_cost = 0, final_cost = 0;  // half the sum of (robust) squared errors, px^2
  bool usable = false;                      // false: diverged, or a baseline that stayed zero
};

SeedBundleResult AdjustSeed(const SeedGeometry& start,
                            const std::vector<SeedObservation>& observations,
                            const SeedBundleOptions& options);

// Moves one view only; `observations` of other views are ignored. The view may be at any distance.
Rigid AdjustView(const SeedGeometry& geometry, int view,
                 const std::vector<SeedObservation>& observations,
                 const SeedBundleOptions& options);

// The errors of AdjustSeed's cost at a geometry without moving anything: pixels, one per
// observation; infinite for points behind the view.
std::vector<double> ObservationErrors(const SeedGeometry& geometry,
                                      const std::vector<SeedObservation>& observations);

}  // namespace roomtex
