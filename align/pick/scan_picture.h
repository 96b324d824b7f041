#pragma once
// Pictures of a scan to pick on: its grid as the scanner saw the room (scan_places.h), 8-bit BGR.

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "align/pick/scan_places.h"

namespace roomtex {

// "intensity": 1st to 99th percentile grey. "local": every place against what surrounds it, so that
// dark walls become readable. "shaded": the surface by its normals, depth edges dark.
const std::vector<std::string>& ScanPictureNames();
// Those that show something, the best first: without intensities only the shading.
std::vector<std::string> ScanPicturesOf(const Scan& scan);

// Missing samples are dark blue. An unknown name gives an empty picture.
cv::Mat DrawScanPicture(const ScanPlaces& places, const std::string& name);

}  // namespace roomtex
