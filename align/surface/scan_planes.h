#pragma once
// The large planes of the scan (thesis 7.2, "detect large planes by PCA"), as bounded patches:
// segmentation by region growing, as of range images (Besl and Jain 1988, "Segmentation through
// Variable-Order Surface Fitting") and of point clouds (Rabbani et al. 2006, "Segmentation of Point
// Clouds Using Smoothness Constraint").

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

class OptionFields;

struct ScanPlane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();   // centre of gravity of its samples, `scan`
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // unit length, towards the scanner
  double rms = 0;      // of its samples' distances from it, metres: what the range noise leaves
  double area_m2 = 0;  // of the surface that its samples cover, without holes
  int num_samples = 0;

  // Where the plane has samples, as cells of a grid on it. Axes u, v: unit length, right-handed
  // with the normal; cell (i, j) covers cell_size * [i, i + 1) x [j, j + 1) of (u, v) coordinates
  // relative to `point`, shifted by min_cell.
  Eigen::Vector3d u = Eigen::Vector3d::Zero(), v = Eigen::Vector3d::Zero();
  double cell_size = 0;                                           // metres
  Eigen::Vector2i min_cell = Eigen::Vector2i::Zero();             // cell of covered(0, 0)
  Eigen::Array<uint8_t, Eigen::Dynamic, Eigen::Dynamic> covered;  // rows along u, columns along v

  // Signed distance, metres, positive on the scanner's side.
  double Distance(const Eigen::Vector3d& x_in_scan) const { return normal.dot(x_in_scan - point); }
  // The covered cell below x; outside of `covered` if there is none.
  Eigen::Vector2i CellOf(const Eigen::Vector3d& x_in_scan) const;
  // Whether the foot of x on the plane lies on a covered cell or at most one cell beside one.
  bool Covers(const Eigen::Vector3d& x_in_scan) const;
};

// Defaults: chosen on simulated rooms (flat, noisy, bent by 1 %) and on a real kitchen.
struct ScanPlaneOptions {
  double min_area_m2 = 0.2;  // smaller planes are not given; larger = fewer planes
  // Metres; how far the surface may lie from its plane once the range noise is averaged out: a wall
  // may be wavy, and the scan may be bent. Larger = more tolerant. This does not hide steps,
  // however large it is: min_step says which of them part two surfaces.
  double max_distance = 0.01;
  // Between the normal of a cell and that of the plane, beyond what the noise explains. Larger =
  // more tolerant. A surface whose ends are turned by more than 0.6 of it is curved, no plane.
  double max_angle_deg = 3;
  // Metres; surfaces with a smaller step between them count as one.
  double min_step = 0.0015;
  double max_noise = 3;      // standard deviations up to which a sample belongs; larger = more do
  double min_window = 0.04;  // metres; smallest window for a local normal; it grows with the noise
  double max_incidence_deg = 80;  // samples seen at a flatter angle are left out; 90 = none

  void Declare(OptionFields* fields);
  std::vector<std::string> Problems() const;
};

// The planes of all scans, largest area first; the same for every number of threads. Local normals
// by PCA over windows of the grid, regions grown over it, joined across what stands in front where
// they agree within their uncertainty, fitted by weighted total least squares without outliers,
// samples beside depth edges weighing little. A mesh without a grid: the same over cubes of space.
std::vector<ScanPlane> FindScanPlanes(const std::vector<Scan>& scans,
                                      const ScanPlaneOptions& options, int num_threads);

// Binary PLY point cloud of all measured samples (grid order; a mesh: its vertices): x y z, red
// green blue (a colour per plane, grey = none), nx ny nz (of the plane, 0 = none) and `plane`, the
// index into planes (int, -1 = none). Coordinates too large for float are written relative to the
// middle of the first scan; a comment in the header says so, as it does if the scans are given
// about another origin than their own. Throws InputError (cannot be written).
void WriteScanPlanes(const std::string& path, const std::vector<Scan>& scans,
                     const std::vector<ScanPlane>& planes, int num_threads,
                     const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

}  // namespace roomtex
