#pragma once
// From a place in the picture of a scan to the point that was measured there, and back.
//
// The picture is the grid as the scanner saw the room, x to the right and y down; sample (column,
// row) of the picture is centred at (column + 0.5, row + 0.5). Where the columns of the file run
// against the viewer's right, the picture is the grid turned the other way round.

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"

namespace roomtex {

class ScanPlaces {
 public:
  // scan: with a grid (of a mesh: PanoramaOfMesh); must outlive this.
  explicit ScanPlaces(const Scan& scan);

  const Scan& scan() const { return scan_; }
  int width() const { return scan_.num_columns; }
  int height() const { return scan_.num_rows; }
  // The columns of the grid run to the viewer's left.
  bool flipped() const { return flipped_; }
  // The first column and the last one are neighbours.
  bool closed() const { return closed_; }
  // Angle between two rows over the angle between two columns where those are farthest apart.
  double aspect() const { return aspect_; }
  // Radians between neighbouring samples, the larger of the two ways.
  double step() const { return std::max(column_step_, row_step_); }
  // Index of the sample at (column, row) of the picture.
  int SampleAt(int column, int row) const {
    return scan_.Index(flipped_ ? scan_.num_columns - 1 - column : column, row);
  }
  // What of the picture to look at first, {left, top, right, bottom}: without the rows and columns
  // at its rim that hold next to no samples.
  std::array<int, 4> Content() const;
  // Measured, and its neighbours continue its surface (FindSmoothSamples).
  bool IsSmooth(int sample) const { return smooth_[sample] != 0; }

  enum class Reason { kNone, kMissing, kDepthEdge, kOutside };
  struct Snap {
    Eigen::Vector2d place;
    Eigen::Vector3d x_in_scan;
  };
  struct Found {
    Reason reason = Reason::kNone;  // why there is no point
    Eigen::Vector3d x_in_scan = Eigen::Vector3d::Zero();
    double range = 0;          // metres from the scanner
    std::optional<Snap> snap;  // of a place without a point: the nearest that has one
  };
  // The point between the four samples around a place (bilinear), if these are one smooth surface.
  Found PointAt(const Eigen::Vector2d& place) const;

  // The place whose point lies in the direction of x_in_scan, seen from the scanner; inverse of
  // PointAt() for points of it. Between missing samples and across depth edges as near as the
  // samples tell. None for a direction in which the scanner did not look.
  std::optional<Eigen::Vector2d> PlaceOf(const Eigen::Vector3d& x_in_scan) const;

 private:
  struct Cell;
  Eigen::Vector2d GridFromPicture(const Eigen::Vector2d& place) const;
  Eigen::Vector2d PictureFromGrid(const Eigen::Vector2d& at) const;
  int WrappedColumn(int column) const;
  Eigen::Vector3d DirectionOf(int sample) const;
  std::optional<Snap> FindSnap(const Eigen::Vector2d& at) const;
  int NearestSample(const Eigen::Vector3d& direction) const;
  std::optional<Eigen::Vector2d> SolveInCell(int column, int row,
                                             const Eigen::Vector3d& direction) const;
  Eigen::Vector2d BesideSample(int sample, const Eigen::Vector3d& direction) const;

  const Scan& scan_;
  bool flipped_ = false, closed_ = false;
  double aspect_ = 1;
  double column_step_ = 0, row_step_ = 0;  // radians, the median; of columns where farthest apart
  std::vector<uint8_t> smooth_;
  // The measured samples of every thin_-th column and row, for a search to start from.
  int thin_ = 1;
  std::vector<int> thin_samples_;
  std::vector<Eigen::Vector3f> thin_directions_;
};

}  // namespace roomtex
