#pragma once
// Picks (docs/commands.md, roomtex-align) that follow from photos whose place in the scan is known:
// a sparse model that such photos are part of is aligned by them without clicks.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "importers/e57_images.h"

namespace roomtex {

struct PhotoPick {
  std::string image_name;
  Eigen::Vector2d x_in_img;   // pixels, as in COLMAP
  Eigen::Vector3d x_in_scan;  // metres
};

// In each photo (at most 24 of them, spread over the list) up to nine, spread over the picture:
// samples of the scans where they appear in the photo, the nearest of those around. A photo that
// shows fewer than six gives none.
std::vector<PhotoPick> PicksOfPosedPhotos(const std::vector<PosedPhoto>& photos,
                                          const std::vector<Scan>& scans);

// As CSV: image_name,x,y,scan_x,scan_y,scan_z. Throws InputError if it cannot be written.
void WritePhotoPicks(const std::vector<PhotoPick>& picks, const std::string& path);

}  // namespace roomtex
