#include "texture/sampling/photo_mask.h"

namespace roomtex {

std::shared_ptr<const PhotoMask> MaskOfTransparency(const cv::Mat1b& transparent) {
  constexpr int kCell = 8;  // pixels, more than a cubic and a footprint reach beyond a position
  if (transparent.empty()) return nullptr;
  const int columns = (transparent.cols + kCell - 1) / kCell;
  const int rows = (transparent.rows + kCell - 1) / kCell;
  std::vector<uint8_t> is_masked(static_cast<size_t>(columns) * rows, 0);
  for (int y = 0; y < transparent.rows; ++y) {
    for (int x = 0; x < transparent.cols; ++x) {
      if (transparent(y, x) == 0) continue;
      const int left = std::max(0, x - kCell) / kCell, top = std::max(0, y - kCell) / kCell;
      const int right = std::min(columns - 1, (x + kCell) / kCell);
      const int bottom = std::min(rows - 1, (y + kCell) / kCell);
      for (const int row : {top, y / kCell, bottom}) {
        for (const int column : {left, x / kCell, right}) {
          is_masked[static_cast<size_t>(row) * columns + column] = 1;
        }
      }
    }
  }
  return std::make_shared<const PhotoMask>(kCell, columns, rows, std::move(is_masked));
}

}  // namespace roomtex
