#pragma once
// The scan as a photo would see it: its intensity at full resolution, and where that is to be
// trusted. Frames: `scan`, `cam`, `img`.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "align/surface/scan_surface.h"
#include "align/trust/free_space.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"
#include "core/scan.h"

namespace roomtex {

// Viewing rays of a camera through a lattice of positions in its photos. Made once per camera:
// inverting the distortion is the slow part of looking from a photo.
class RayLattice {
 public:
  // step: pixels between the nodes.
  RayLattice(const CameraProjection& projection, double step);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  double step() const { return step_; }
  // Unit vector in `cam` through the `img` position (column * step, row * step); NaN where the lens
  // has no ray. The last column and row lie on or just outside the far edges of the photo.
  const Eigen::Vector3d& Ray(int column, int row) const { return rays_[row * columns_ + column]; }
  // The same anywhere in the photo, linear between the nodes; x/z, y/z.
  Eigen::Vector2d RayAt(const Eigen::Vector2d& x_in_img) const;

 private:
  int columns_, rows_;
  double step_;
  std::vector<Eigen::Vector3d> rays_;
};

// What a photo would show if it showed the scan's intensity: rasters of cells of cell_px x cell_px
// pixels of the photo as taken (lens distortion included); cell (i, j) is centred at
// img = cell_px * (i + 0.5, j + 0.5).
struct ScanView {
  int cell_px = 1;
  cv::Mat1f grey;         // 0..255 (IntensityAsGrey), between the scan's samples; 0 where invalid
  cv::Mat1b valid;        // 255 where one smooth surface with samples all around is seen, else 0
  cv::Mat1f depth;        // metres along the optical axis; 0 where invalid
  cv::Mat1f column, row;  // in the scan's grid; NaN where invalid, or for a mesh without a grid
  cv::Mat1w scan;         // index into the scans
  cv::Mat1b unseen;  // 255 where the photo itself shows nothing (LeaveOutTransparent()); empty =
                     // it is opaque
  double valid_share = 0;
};

class ScanViewer {
 public:
  // Both must outlive it. Keeps two bytes per sample.
  ScanViewer(const std::vector<Scan>& scans, const FreeSpace& free_space);

  const std::vector<Scan>& scans() const { return scans_; }
  const FreeSpace& free_space() const { return free_space_; }

  // Angle between neighbouring samples seen from the scanner, radians: the larger of the median
  // steps of columns and of rows, of the coarsest scan; for meshes, of their median edge at their
  // median distance from their centre. 0 without samples.
  double sample_angle() const { return sample_angle_; }
  // Any of the scans has no grid: every cell costs a ray.
  bool has_mesh() const { return has_mesh_; }

  // cells: rays through the corners of cells of the view are taken from `lattice`, whose step must
  // be a multiple of cell_px (equal to it for a scan without a grid).
  ScanView Look(const RayLattice& lattice, const Camera& camera, const Rigid& cam_from_scan,
                int cell_px) const;

 private:
  struct Node {
    bool hit = false;
    int scan = 0;
    float column = 0, row = 0, inverse_depth = 0, grey = 0;
    float noise = 0;  // of a sample there, metres
  };
  std::vector<Node> CastRays(const RayLattice& lattice, const Rigid& cam_from_scan) const;
  // Intensity between four samples; none if one of them is missing or lies at a depth edge.
  std::optional<float> GreyAt(int scan, float column, float row) const;

  const std::vector<Scan>& scans_;
  const FreeSpace& free_space_;
  std::vector<std::vector<uint8_t>> grey_;
  std::vector<std::vector<uint8_t>> smooth_;  // 1 = measured, and no depth edge beside it
  std::vector<RangeNoise> noise_;
  double sample_angle_ = 0;
  bool has_mesh_ = false;
};

// What all photos of one camera share when the scan is looked at from them. Must not outlive the
// camera.
struct LookSetup {
  LookSetup(const Camera& camera, const ScanViewer& viewer, int view_cell_px);
  ScanView Look(const ScanViewer& viewer, const Rigid& cam_from_scan) const {
    return viewer.Look(lattice, projection.camera(), cam_from_scan, cell_px);
  }

  CameraProjection projection;
  int cell_px;  // of the view
  RayLattice lattice;
};
// The cells that show all that the scan holds: two per sample. Scans without a grid cost a ray per
// cell: not more than 320 in a row.
int FinestCell(const Camera& camera, const ScanViewer& viewer);

// 1 for samples that are measured and whose eight neighbours continue their surface: no missing
// sample and no depth jump beside them. Grid order; a full turn is not closed (its seam counts as
// an edge only where it is one).
std::vector<uint8_t> FindSmoothSamples(const Scan& scan);
std::vector<uint8_t> FindSmoothSamples(const Scan& scan, const RangeNoise& noise);

// `count` images evenly taken from all, in the order of their names.
std::vector<const SparseImage*> SpreadImages(const SparseModel& model, int count);

// The photo of an image as 8-bit BGR in its camera's pixels; none, and a warning, if it cannot be
// used (FitPhotoToCamera).
std::optional<cv::Mat> ReadPhotoOf(const SparseImage& image, const Camera& camera,
                                   const std::string& image_path, std::string* warning);
// The same in cells of cell_px x cell_px of these pixels (whole ones only), as a ScanView has them;
// a JPEG is made smaller while it is decoded.
std::optional<cv::Mat> ReadCellsOf(const SparseImage& image, const Camera& camera, int cell_px,
                                   const std::string& image_path, std::string* warning);

}  // namespace roomtex
