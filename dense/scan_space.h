#pragma once
// What scans know of space: where their surface is, what the scanner saw empty, and what it could
// not see at all.

#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/camera_model.h"
#include "core/ray_caster.h"
#include "core/scan.h"

namespace roomtex {

class ScanSpace {
 public:
  // Scans with a grid know what they saw empty; meshes know their surface alone.
  ScanSpace(const std::vector<Scan>& scans, int num_threads);

  const RayCaster& surface() const { return surface_; }
  // A scanner looked past this place, to something at least `margin` metres farther away.
  bool IsSeenEmpty(const Eigen::Vector3d& x_in_scan, double margin) const;
  // Within the box around all samples, `margin` metres larger on all sides.
  bool IsInRoom(const Eigen::Vector3d& x_in_scan, double margin) const;
  const Bounds& bounds() const { return bounds_; }

 private:
  // Ranges from a station on a raster of azimuth and elevation, metres; 0 = no echo of its own.
  struct Station {
    Eigen::Vector3d place;
    Eigen::Matrix3d station_from_scan;  // z up
    cv::Mat1f range;                    // nearest of the directions around
  };
  RayCaster surface_;
  Bounds bounds_;
  std::vector<Station> stations_;
};

// Depth of the surface at every pixel of a pinhole camera, metres along its axis; 0 = none.
cv::Mat1f DepthOfSurface(const RayCaster& surface, const Camera& pinhole,
                         const Rigid& cam_from_scan, int num_threads);

}  // namespace roomtex
