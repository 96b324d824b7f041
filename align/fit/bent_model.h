#pragma once
// A sparse model put onto a bent scan.

#include "align/fit/scan_bend.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

// The points where the scan has them (ScanBend::Bend), and each photo where it shows the bent
// points as nearly as it can where it showed the straight ones. A photo cannot be bent, so its
// reprojection errors grow: a little of the bend is left within each photo, instead of all of it
// between photos and scan. straight: the model in the scan frame, true to the room.
SparseModel BendModel(const SparseModel& straight, const ScanBend& bend);

}  // namespace roomtex
