#pragma once
// One round of the plane-constrained bundle adjustment: the least squares problem itself.

#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "align/fit/plane_bundle.h"

namespace roomtex {

struct BundleRound {
  const PlaneBundleInput& input;
  const PlaneBundleOptions& options;
  double sigma_px;                                    // image noise
  const std::set<uint32_t>& idle_images;              // take no part
  const std::vector<SurfaceConstraint>& constraints;  // of the room as it is: not bent
};

// motions: of the photos whose rows are read one after the other, adjusted, too; others stand
// still. Adjusts poses and points (and cameras, if refined) of the model by Ceres; what takes no
// part stays. False, and the model as it was, without a solution. The same to the last bit every
// time: Ceres orders parameters by their addresses and adds up in the order of its threads, so
// parameters lie in arrays and it gets one thread.
bool SolveRound(const BundleRound& round, SparseModel* model, RowMotions* motions);

// Whether a camera has moved by more than `share` of what counts from round to round: 5e-5 metres,
// 2e-5 radians.
bool HasMoved(const Rigid& before, const Rigid& after, double share);

}  // namespace roomtex
