#pragma once
// The plane-constrained bundle adjustment in the report of the command.

#include "align/alignment.h"
#include "align/fit/plane_bundle.h"
#include "core/report.h"

namespace roomtex {

// The report's `plane_bundle`; null if the adjustment was not tried. {used, reason, num_points,
// num_on_patches, sigma_px, num_rounds, bending_m, not_adjusted [image names], scan_bend {rms_m,
// max_range_share, max_azimuth_deg} or null}.
Json PlaneBundleToJson(const Alignment& alignment);

// num_points of the report's `planes`: the points that the adjustment gave to each.
void SetNumPointsOfPlanes(const Alignment& alignment, Json* planes);

}  // namespace roomtex
