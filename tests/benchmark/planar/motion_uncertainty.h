#pragma once
// How well keypoints with noise can fix a pair's motion at all.

#include "colmap_ext/seed_bundle.h"

namespace roomtex {

// Largest standard deviations over all directions.
struct MotionUncertainty {
  double rotation_deg = 0, baseline_deg = 0;
};

// The Cramer-Rao bound of views_from_left[1] at this geometry, everything else free (other views
// and points) and the baseline of unit length: no unbiased estimate is more certain. Infinite where
// the observations leave the motion open. noise_px: standard deviation of a keypoint's coordinate.
MotionUncertainty PairUncertainty(const SeedGeometry& geometry,
                                  const std::vector<SeedObservation>& observations,
                                  double noise_px);

}  // namespace roomtex
