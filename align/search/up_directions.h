#pragma once
// Which way is up: in a sparse model by how the photos were held and by the planes that its points
// lie on, in a scan by what its file says, as far as its planes do not contradict it.

#include <vector>

#include <Eigen/Core>

#include "align/search/search_cloud.h"
#include "align/surface/scan_patches.h"
#include "core/scan.h"

namespace roomtex {

struct UpDirections {
  std::vector<Eigen::Vector3d> ups;  // unit length, the likeliest first
  // One direction, and no doubt about it; else up is any of several.
  bool known = false;
};

// `sparse`. By the photos, if they were held level (or upright) and do not all look one way; else
// those across planes with many points, too.
UpDirections FindModelUps(const SearchCloud& cloud);

// `scan`. The scan's own, or what lies across the largest surfaces near it if none lies across its
// own: a scan that was put together by a program need not be level.
UpDirections FindScanUps(const std::vector<Scan>& scans, const ScanPatches& surface);

}  // namespace roomtex
