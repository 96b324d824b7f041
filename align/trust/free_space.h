#pragma once
// A coarse mesh of the scans for questions that do not need every sample: what the scanner looked
// through to see the surface behind (free space, as in Curless and Levoy 1996, "A Volumetric Method
// for Building Complex Models from Range Images"), and the intensity that a camera would see.

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/ray_caster.h"
#include "core/scan.h"

namespace roomtex {

class FreeSpace {
 public:
  // Takes every k-th column and row so that at most max_samples samples remain.
  FreeSpace(const std::vector<Scan>& scans, int max_samples);

  // False if all scans are meshes without a grid: where they were taken from is not known.
  bool HasStations() const { return !stations_.empty(); }

  enum class Place {
    kUnknown,   // no scanner has a surface in that direction, or none is known (meshes only)
    kFloating,  // nearer to a scanner, by more than the tolerance, than the surface it saw there
    kSurface,   // within the tolerance of a surface, along a scanner's ray
    kHidden,    // farther from every scanner than the surface
  };
  // tolerance: metres.
  Place Locate(const Eigen::Vector3d& x_in_scan, double tolerance) const;

  struct Sight {
    Eigen::Vector3d x_in_scan = Eigen::Vector3d::Zero();
    float grey = 0;  // 0..255, see IntensityAsGrey; between the samples of the coarse mesh
    int scan = 0;    // index into the scans
    // Position in that scan's grid, whole numbers at its samples; in a closed grid the column may
    // lie between the last and num_columns. NaN for a mesh without a grid.
    double column = 0, row = 0;
  };
  // What a ray from `origin` along the unit `direction` meets first. Of several scans that have
  // that surface, as the one with the nearest station has it: the noise of one is not taken for
  // that of another from ray to ray.
  std::optional<Sight> Look(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

 private:
  // How the coarse grid of one scan lies in its own.
  struct Thinning {
    bool organised = true;
    int first_point = 0, first_triangle = 0;  // indices into points_, triangles_
    int stride = 1;
    int thin_columns = 0;
    int num_columns = 0;  // of the scan itself
  };
  void LocateInGrid(const Triangle& triangle, const Eigen::Vector3d& weights, Sight* sight) const;
  // The same surface in the scan that was taken from nearest by; its triangle is one of all.
  RayHit AsNearestStationHasIt(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                               const RayHit& hit) const;

  std::vector<Thinning> thinnings_;  // one per scan
  std::vector<Eigen::Vector3d> stations_;
  std::vector<int> scan_of_station_;  // index into the scans
  std::vector<Eigen::Vector3d> points_;
  std::vector<Triangle> triangles_;
  std::vector<uint8_t> grey_;
  std::unique_ptr<RayCaster> caster_;
  // One per station: only what it saw itself.
  std::vector<std::unique_ptr<RayCaster>> station_casters_;
};

}  // namespace roomtex
