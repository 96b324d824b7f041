#pragma once
// Regions of flat surface: grown over the cells of one scan, joined across what stands in front and
// over several scans. A part of plane detection (scan_planes.h).

#include <vector>

#include <Eigen/Core>

#include "align/surface/scan_planes.h"
#include "align/surface/scan_surface.h"

namespace roomtex {

// A piece of a region: a point on the surface with the noise averaged out.
struct RegionCell {
  Eigen::Vector3d point;  // relative to the origin of the ScanSurface
  float area = 0;         // m2
  float variance = 0;     // of the point along the normal by the noise alone, m2
  float noise = 0;        // of one sample across the surface, metres
};

struct PlaneRegion {
  int scan = 0;  // index; -1 = several
  std::vector<RegionCell> cells;

  // What SummariseRegion finds.
  Eigen::Vector3d mean, normal, u, v;  // principal axes; the normal on the scanner's side
  double area = 0;                     // m2
  double extent_u = 0, extent_v = 0;   // standard deviations along u and v
  double waviness = 0;   // RMS distance of the surface from the plane, noise taken out, metres
  double noise = 0;      // of one sample, metres
  double end_slope = 0;  // radians; how far its ends are turned against its plane: curvature
  Eigen::Matrix3d covariance;  // of height and slopes (1, u, v) at the mean

  double Distance(const Eigen::Vector3d& x) const { return normal.dot(x - mean); }
  // Standard deviation of the plane's height there.
  double Sigma(const Eigen::Vector3d& x) const;
};

// station: where the scanner stood (for the side of the normal).
void SummariseRegion(const Eigen::Vector3d& station, PlaneRegion* region);

// What lies between two regions that meet in the grid: the step from a to b along the normal.
struct RegionStep {
  int a = 0, b = 0;
  double height = 0;  // metres, mean
  double sigma = 0;   // of the mean
};

struct GrownRegions {
  std::vector<PlaneRegion> regions;
  std::vector<int> region_of_cell;  // -1 = none
  std::vector<RegionStep> steps;
};

// Regions of at least `min_area` m2. The same whatever the number of threads.
GrownRegions GrowRegions(const ScanSurface& surface, const ScanPlaneOptions& options,
                         double min_area);

// Joins regions that are parts of one plane. Gives the joined ones, largest first, and for each of
// the given the index of the one that holds it.
struct JoinedRegions {
  std::vector<PlaneRegion> regions;
  std::vector<int> joined_of_region;
};
JoinedRegions JoinRegions(std::vector<PlaneRegion> regions, const std::vector<RegionStep>& steps,
                          const ScanPlaneOptions& options);

}  // namespace roomtex
