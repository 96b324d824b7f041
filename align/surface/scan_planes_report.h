#pragma once
// The planes of the scan in the report of roomtex-align.

#include <vector>

#include "align/surface/scan_planes.h"
#include "colmap_ext/sparse_model.h"
#include "core/report.h"

namespace roomtex {

// Points of a model in the scan frame that lie on the plane: where it has samples, within three
// standard deviations (ScanPlane::rms, at least 1 mm) and 1 cm of it.
int CountPointsOnPlane(const ScanPlane& plane, const SparseModel& aligned);

// The report's `planes`: [{normal, point, area_m2, num_samples, num_points, rms_m}], in the order
// of the planes.
Json ScanPlanesToJson(const std::vector<ScanPlane>& planes, const SparseModel& aligned);

}  // namespace roomtex
