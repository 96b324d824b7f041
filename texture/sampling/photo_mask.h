#pragma once
// Parts of a photo that do not show the surface: somebody stood before it, or it was cut out.

#include <algorithm>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace roomtex {

// Squares of cell_px pixels over a picture of columns x rows squares.
class PhotoMask {
 public:
  PhotoMask(int cell_px, int columns, int rows, std::vector<uint8_t> is_masked)
      : cell_px_(cell_px), columns_(columns), rows_(rows), is_masked_(std::move(is_masked)) {}

  // Positions in `img`, also on its border.
  bool At(float x, float y) const {
    const int column = std::clamp(static_cast<int>(x) / cell_px_, 0, columns_ - 1);
    const int row = std::clamp(static_cast<int>(y) / cell_px_, 0, rows_ - 1);
    return is_masked_[static_cast<size_t>(row) * columns_ + column] != 0;
  }
  // Of the picture.
  double Share() const {
    return static_cast<double>(std::count_if(is_masked_.begin(), is_masked_.end(),
                                             [](uint8_t masked) { return masked != 0; })) /
           static_cast<double>(is_masked_.size());
  }

 private:
  int cell_px_, columns_, rows_;
  std::vector<uint8_t> is_masked_;  // row by row
};

// Of ReadTransparency(), and as far around as a look at a photo reaches; none if that is empty.
std::shared_ptr<const PhotoMask> MaskOfTransparency(const cv::Mat1b& transparent);

}  // namespace roomtex
