#pragma once
// Which sparse points lie on which surface of the scan (thesis 7.2, step 2; chapter 10: "or any
// surfaces").

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "align/fit/similarity_fit.h"
#include "align/surface/scan_patches.h"
#include "align/surface/scan_planes.h"

namespace roomtex {

// A sparse point that is held on the scan's surface. Frame: `scan`.
struct SurfaceConstraint {
  uint64_t point3d_id = 0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();   // on the surface
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit length, towards the scanner
  // Metres; how far the true surface may lie from this plane. The sparse point's own uncertainty is
  // not in it.
  double sigma = 0;
  int plane = -1;         // index of the plane that the point belongs to; -1 = none
  bool on_patch = false;  // point and normal are those of a patch, not of the plane

  // Signed distance, metres, positive on the scanner's side.
  double Distance(const Eigen::Vector3d& x_in_scan) const { return normal.dot(x_in_scan - point); }
};

struct PlaneAssociationOptions {
  double max_distance = 0.10;  // metres; a point farther from a surface never belongs to it
  // A point belongs to a surface up to this many standard deviations of their distance: the point's
  // own and the surface's. Larger = more points, more wrong ones among them.
  double gate = 3.5;
  bool surface = true;  // points on no plane may belong to a patch
  // Metres; what stays unknown of every surface however many samples show it: waviness, and what is
  // too thin for the scanner. Larger = farther from the scan.
  double surface_noise = kSurfaceNoise;
};

// In the order of `points`, at most one each. `points` are those of a model in the scan frame
// (FindSurfacePoints). The thesis' one threshold of distance becomes:
//  - distance along the normal within the gate; where most distances are larger than their standard
//    deviations say (a first guess of the alignment, a bent scan), the gate widens with them;
//  - the plane has samples there (ScanPlane::Covers);
//  - the surface faces the cameras that see the point;
//  - a point that two photos alone show is known to a centimetre along the normal;
//  - only one plane claims it: at the edge where two meet the point is left out.
// `planes` come first. With `surface`, a flat patch near the point holds it where no plane does,
// and where the patch shows that the scan leaves the plane there: a bent wall, a picture on it.
std::vector<SurfaceConstraint> AssociateWithSurface(const std::vector<SurfacePoint>& points,
                                                    const std::vector<ScanPlane>& planes,
                                                    const ScanPatches& patches,
                                                    const PlaneAssociationOptions& options);

}  // namespace roomtex
