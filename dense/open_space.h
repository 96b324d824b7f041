#pragma once
// Where along the rays of a photo something may be that scans do not have.

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dense/scan_space.h"
#include "dense/stereo_window.h"

namespace roomtex {

class OpenSpace {
 public:
  // margin: metres that it must be away from the scan's surface, and from what was seen empty;
  // gaps that are less than four times as wide are not searched.
  OpenSpace(const ScanSpace& space, const StereoPicture& picture, double margin, int num_threads);

  // Metres along the optical axis, 0 = none; and its normals (colmap_ext/dense_workspace.h).
  const cv::Mat1f& scan_depth() const { return scan_depth_; }
  const std::vector<cv::Mat1f>& scan_normals() const { return scan_normals_; }

  static constexpr int kBins = 64;  // of the inverse depth
  // One bit per bin that is open, for a position as share of the picture's width and height.
  uint64_t BinsAt(double x_share, double y_share) const;
  // The same without those behind the scan's surface.
  uint64_t BinsInFront(double x_share, double y_share) const;
  // Something that the scan does not have may be seen at this pixel.
  bool IsOpen(int x, int y) const {
    return BinsInFront((x + 0.5) / scan_depth_.cols, (y + 0.5) / scan_depth_.rows) != 0;
  }
  // Inverse depths, 1/metres, of the first and the last bin.
  float first() const { return first_; }
  float last() const { return last_; }
  int Bin(float inverse_depth) const {
    return static_cast<int>((inverse_depth - first_) / (last_ - first_) * kBins);
  }

 private:
  cv::Mat1f scan_depth_;
  std::vector<cv::Mat1f> scan_normals_;
  int columns_ = 0, rows_ = 0;
  std::vector<uint64_t> bins_;  // of blocks of pixels
  float first_ = 0, last_ = 1;
};

}  // namespace roomtex
