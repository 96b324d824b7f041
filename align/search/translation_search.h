#pragma once
// All translations of a set of points over a ScanVolume at once, for one turn and one scale.

#include <functional>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "align/search/scan_volume.h"

namespace roomtex {

class TranslationSearch {
 public:
  // reach: cells that the points extend over, at most, along each axis. The volume must outlive it.
  TranslationSearch(const ScanVolume& volume, const Eigen::Vector3i& reach);

  struct Place {
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // to be added to the points, metres
    double score = 0;                                       // mean worth of the points' cells
  };
  // The `count` best translations, no two of them neighbours; points that share a cell count once.
  // Points outside of `reach`, counted from `low`, do not count. allowed: may be empty.
  std::vector<Place> FindBest(const std::vector<Eigen::Vector3d>& points,
                              const Eigen::Vector3d& low, int count,
                              const std::function<bool(const Eigen::Vector3d&)>& allowed) const;

 private:
  // A volume as a picture: rows are y, columns run over x and, every step_ of them, z. What lies
  // side by side in one lies side by side in the other as long as nothing is longer than step_, so
  // that one correlation in two dimensions does for three.
  int Column(int x, int z) const { return x + step_ * z; }
  Eigen::Vector3d Shift(int row, int column) const;  // metres

  const ScanVolume& volume_;
  const Eigen::Vector3i reach_;
  int step_ = 0, rows_ = 0, columns_ = 0;
  cv::Mat1f spectrum_;  // of the volume
};

}  // namespace roomtex
