#pragma once
// Takes the range noise out of a scan's surface, keeping its corners and steps.

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/scan.h"
#include "texture/sampling/grid_links.h"

namespace roomtex {

struct SmoothingWindow {
  int8_t before = 0, after = 0;  // samples on either side
};

// Fits straight lines to the inverse ranges (nearly linear from ray to ray on a plane) along rows,
// then along columns, each over the widest part around a sample that is straight within the noise.
class RangeSmoother {
 public:
  // radius: samples on either side at most. Both references must outlive the smoother.
  RangeSmoother(const Scan& scan, const GridLinks& links, int radius, int num_threads);

  // Metres, standard deviation of one sample; 0 = not known.
  double noise() const;
  // Moves points (grid order, at first those of the scan) along their rays.
  void Smooth(std::vector<Eigen::Vector3d>* points);
  // Between rays of even angles the inverse range of a plane is a cosine, not a line. Takes out of
  // the smoothed points what that makes, given their normals (unit or zero).
  void Straighten(const std::vector<Eigen::Vector3f>& normals,
                  std::vector<Eigen::Vector3d>* points) const;

 private:
  const Scan& scan_;
  const GridLinks& links_;
  int radius_, num_threads_;
  std::vector<float> inverse_range_, sigma_;  // per sample; sigma: noise of the inverse range
  float noise_ = 0;
  std::vector<SmoothingWindow> in_rows_, in_columns_;
};

}  // namespace roomtex
