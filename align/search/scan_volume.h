#pragma once
// The scans as a volume of cells that says what a sparse point there is worth: near a surface, in
// space that a scanner saw to be empty, or where nobody looked (occupancy grids: Moravec and Elfes
// 1985, "High Resolution Maps from Wide Angle Sonar"). Frame: `level`, the scan's turned so that z
// is up.

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/scan.h"

namespace roomtex {

struct ScanVolumeOptions {
  double least_cell = 0.2;  // metres
  int max_cells = 10000;    // larger rooms get larger cells; larger = exacter and slower
  // What a point is worth: 1 at a surface, falling off with a Gaussian of so many cells.
  double sigma_cells = 0.8;
  double of_free = -0.35;     // in space that a scanner saw to be empty
  double of_unknown = -0.15;  // where no scanner looked
  double of_outside = -0.25;  // outside of all
};

class ScanVolume {
 public:
  enum class State : uint8_t { kUnknown, kFree, kSurface };

  // up: of the scan frame, unit length.
  ScanVolume(const std::vector<Scan>& scans, const Eigen::Vector3d& up,
             const ScanVolumeOptions& options);

  const Eigen::Quaterniond& level_from_scan() const { return level_from_scan_; }
  double cell_size() const { return cell_; }
  const Eigen::Vector3i& size() const { return size_; }      // cells
  const Eigen::Vector3d& origin() const { return origin_; }  // `level`: corner of the first cell
  // Root mean square distance of the samples' cells from their middle, metres, along x and y and
  // along z.
  double Extent() const { return extent_; }

  // What points in a cell are worth; x runs fastest.
  const std::vector<float>& worth() const { return worth_; }
  double of_outside() const { return options_.of_outside; }
  State StateAt(const Eigen::Vector3d& x_in_level) const;

 private:
  int Index(const Eigen::Vector3i& cell) const {
    return (cell.z() * size_.y() + cell.y()) * size_.x() + cell.x();
  }
  bool Contains(const Eigen::Vector3i& cell) const {
    return (cell.array() >= 0).all() && (cell.array() < size_.array()).all();
  }
  Eigen::Vector3i CellOf(const Eigen::Vector3d& x_in_level) const {
    return ((x_in_level - origin_) / cell_).array().floor().cast<int>();
  }
  void FindSize(const std::vector<Scan>& scans);
  void MarkSurface(const std::vector<Scan>& scans);
  void MarkFree(const Scan& scan);
  void FindWorth();

  const ScanVolumeOptions options_;
  Eigen::Quaterniond level_from_scan_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  Eigen::Vector3i size_ = Eigen::Vector3i::Zero();
  double cell_ = 0, extent_ = 0;
  std::vector<State> state_;
  std::vector<float> worth_;
};

}  // namespace roomtex
