#pragma once
// The photos as pinhole pictures for stereo, and which of them go together.

#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/similarity.h"
#include "dense/scan_space.h"

namespace roomtex {

struct StereoView {
  std::string name;  // as in the model
  Camera camera;     // PINHOLE, of the picture
  Rigid cam_from_scan;
  std::vector<int> neighbours;  // best first: views that see the same surface from beside

  Eigen::Vector3d Centre() const { return cam_from_scan.TargetOriginInSource(); }
};

// Places of photos that differ by less, as what they see has it, are one place: copies, bursts.
inline constexpr double kSamePlace_deg = 2;

// Fills `neighbours`, at most max_neighbours: by how much of the scan's surface two photos share,
// at what angle. Too small an angle says little about depth, too large a one looks different. Of
// photos from one place the best is taken.
void FindNeighbours(const ScanSpace& space, int max_neighbours, std::vector<StereoView>* views);

}  // namespace roomtex
