#pragma once
// One scan as small cells of its surface, each with a local plane by PCA: what plane detection
// (scan_planes.h) grows its regions from. Frame: `scan`, relative to an origin near the scan, so
// that large coordinates keep their precision.

#include <algorithm>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "align/surface/scan_planes.h"
#include "core/frames.h"
#include "core/scan.h"

namespace roomtex {

// Weighted sums of points and of their products.
struct Moments {
  Eigen::Array<double, 10, 1> sums = Eigen::Array<double, 10, 1>::Zero();  // w, x y z, xx xy xz ...

  void Add(const Eigen::Vector3d& x, double weight = 1);
  double weight() const { return sums[0]; }
};

// The plane of total least squares through points, by PCA.
struct PlaneFit {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
  Eigen::Vector3d variances = Eigen::Vector3d::Zero();  // along the axes, ascending
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();   // columns; the first is the normal
};
PlaneFit FitPlane(const Moments& moments);

// Standard deviation of a measured range as a function of the range, as the scan itself shows it.
class RangeNoise {
 public:
  RangeNoise() = default;
  // Pairs of range and noise seen there, metres; some of them too large (edges, curved surfaces).
  explicit RangeNoise(std::vector<std::pair<float, float>> observations);

  double At(double range) const;
  // Across a surface that the ray meets with this cosine to its normal.
  double Across(double range, double cosine) const;

 private:
  std::vector<std::pair<double, double>> knots_;  // range, noise; between them linear
};

// Fewer samples make no cell, and a cell whose normal is less certain (radians) belongs to no
// plane.
inline constexpr int kFewestSamples = 6;
// A cell whose samples scatter more than this many times the noise expected there is not flat.
inline constexpr double kNotFlat = 3;
inline constexpr double kWorstNormalSigma = RadFromDeg(4.0);

struct SurfaceCell {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();   // on the local plane, amid its samples
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // towards the scanner
  float noise = 0;                                   // of one sample across the local plane, metres
  float point_sigma = 0;                             // of `point` along the normal
  float normal_sigma = 0;                            // radians
  float roughness = 0;  // RMS of the window's samples over the noise expected there
  float area = 0;       // of the surface that its samples cover, m2
  int count = 0;        // its samples
  bool flat = false;    // the local plane is one
};

// The cells of a scan, and its samples for a second look. The scan must outlive it.
class ScanSurface {
 public:
  ScanSurface(const Scan& scan, const Eigen::Vector3d& origin, const ScanPlaneOptions& options,
              int num_threads);

  const Scan& scan() const { return scan_; }
  bool is_grid() const { return is_grid_; }
  Eigen::Vector3d station() const { return scan_.Station() - origin_; }
  const RangeNoise& noise() const { return noise_; }
  const std::vector<SurfaceCell>& cells() const { return cells_; }
  void ForgetCells();

  // Samples: those of the grid; of a mesh without a grid points all over its triangles.
  int NumSamples() const;
  bool IsMissing(int sample) const;
  Eigen::Vector3d Point(int sample) const;  // relative to the origin
  int CellOf(int sample) const;
  // Surface that a sample on a plane with this normal stands for, m2; 0 where it cannot be told.
  double Footprint(int sample, const Eigen::Vector3d& x, const Eigen::Vector3d& normal) const;
  // Longest distance between neighbouring samples there, metres.
  double Spacing(int sample, const Eigen::Vector3d& x, const Eigen::Vector3d& normal) const;
  double NoiseAcross(const Eigen::Vector3d& x, const Eigen::Vector3d& normal) const;
  // The samples beside this one in the grid (up to 8), measured or not; none without a grid.
  template <typename Function>
  void ForAround(int sample, const Function& function) const;

  // The cells around one.
  template <typename Function>
  void ForNeighbours(int cell, const Function& function) const;
  // The cell `steps` columns to the right or rows down; -1 outside, and without a grid.
  int CellBeside(int cell, int columns, int rows) const;

 private:
  void BuildGrid(const ScanPlaneOptions& options, int num_threads);
  void BuildMesh(const ScanPlaneOptions& options, int num_threads);

  const Scan& scan_;
  Eigen::Vector3d origin_;
  RangeNoise noise_;
  std::vector<SurfaceCell> cells_;
  bool is_grid_ = false;
  // Grid: cells of cell_size_ x cell_size_ samples.
  int cell_size_ = 1, num_columns_ = 0, num_rows_ = 0;  // in cells
  bool closed_ = false;                                 // the last column is beside the first
  std::vector<float> solid_angle_;                      // per cell: of one sample, steradians
  std::vector<float> step_;                             // per row of cells: larger angle, radians
  // Without a grid.
  std::vector<Eigen::Vector3d> points_;
  std::vector<float> areas_;
  std::vector<int> cell_of_, neighbour_begin_, neighbours_;
  double spacing_ = 0;
};

template <typename Function>
void ScanSurface::ForNeighbours(int cell, const Function& function) const {
  if (!is_grid_) {
    for (int i = neighbour_begin_[cell]; i < neighbour_begin_[cell + 1]; ++i) {
      function(neighbours_[i]);
    }
    return;
  }
  for (int rows = -1; rows <= 1; ++rows) {
    for (int columns = -1; columns <= 1; ++columns) {
      const int other = rows == 0 && columns == 0 ? -1 : CellBeside(cell, columns, rows);
      if (other >= 0) function(other);
    }
  }
}

template <typename Function>
void ScanSurface::ForAround(int sample, const Function& function) const {
  if (!is_grid_) return;
  const int column = sample % scan_.num_columns, row = sample / scan_.num_columns;
  for (int r = std::max(row - 1, 0); r <= std::min(row + 1, scan_.num_rows - 1); ++r) {
    for (int c = std::max(column - 1, 0); c <= std::min(column + 1, scan_.num_columns - 1); ++c) {
      if (r != row || c != column) function(scan_.Index(c, r));
    }
  }
}

}  // namespace roomtex
