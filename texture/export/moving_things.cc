#include "texture/export/moving_things.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "core/photo.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// A cell contradicts when its mean colours differ by this much, mean of the channels, sRGB 0..1:
// fine print that lies off by a little has the same mean. Chosen on simulated rooms with somebody
// in a third of the photos (docs/export.md).
constexpr float kContradiction = 0.08f;
constexpr float kMinSamples = 4;  // of a cell
constexpr int kMinCells = 6;      // that hang together

std::array<double, 3> GainOfPhoto(const std::vector<ColorPair>& pairs) {
  std::array<double, 3> gain{1, 1, 1};
  const auto& linear = LinearFromSrgbByte();
  for (int k = 0; k < 3; ++k) {
    std::vector<float> ratios;
    for (const ColorPair& pair : pairs) {
      if (pair.photo[k] < 10 || pair.photo[k] > 245 || pair.agreed[k] < 10) continue;
      ratios.push_back(std::log(linear[pair.agreed[k]] / linear[pair.photo[k]]));
    }
    if (!ratios.empty()) gain[k] = std::exp(Median(&ratios));
  }
  return gain;
}

}  // namespace

cv::Mat1b MaskOfMovingThings(const std::vector<ColorPair>& pairs, int width, int height,
                             int cell_px) {
  const std::array<double, 3> gain = GainOfPhoto(pairs);
  std::array<std::array<uint8_t, 256>, 3> corrected;
  for (int k = 0; k < 3; ++k) {
    for (int level = 0; level < 256; ++level) {
      corrected[k][level] =
          SrgbByteFromLinear(static_cast<float>(gain[k]) * LinearFromSrgbByte()[level]);
    }
  }
  const int columns = (width + cell_px - 1) / cell_px, rows = (height + cell_px - 1) / cell_px;
  cv::Mat_<cv::Vec4f> sums(rows, columns, cv::Vec4f(0, 0, 0, 0));  // differences; samples
  for (const ColorPair& pair : pairs) {
    cv::Vec4f& sum = sums(std::clamp(static_cast<int>(pair.y) / cell_px, 0, rows - 1),
                          std::clamp(static_cast<int>(pair.x) / cell_px, 0, columns - 1));
    for (int k = 0; k < 3; ++k) {
      // What is clipped may be as light as anything.
      if (pair.photo[k] >= 254 && pair.agreed[k] > corrected[k][pair.photo[k]]) continue;
      sum[k] += static_cast<float>(corrected[k][pair.photo[k]] - pair.agreed[k]);
    }
    sum[3] += 1;
  }
  cv::Mat1b contradicts(rows, columns, uint8_t{0});
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const cv::Vec4f& sum = sums(row, column);
      if (sum[3] < kMinSamples) continue;
      const float difference =
          (std::abs(sum[0]) + std::abs(sum[1]) + std::abs(sum[2])) / (3 * 255 * sum[3]);
      if (difference > kContradiction) contradicts(row, column) = 255;
    }
  }
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {3, 3});
  cv::morphologyEx(contradicts, contradicts, cv::MORPH_CLOSE,
                   cv::getStructuringElement(cv::MORPH_RECT, {5, 5}));
  cv::Mat labels, statistics, centres;
  const int count = cv::connectedComponentsWithStats(contradicts, labels, statistics, centres, 4);
  for (int label = 1; label < count; ++label) {
    if (statistics.at<int>(label, cv::CC_STAT_AREA) < kMinCells) {
      contradicts.setTo(0, labels == label);
    }
  }
  cv::dilate(contradicts, contradicts, square);
  cv::Mat1b mask(height, width, uint8_t{255});
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (contradicts(y / cell_px, x / cell_px) != 0) mask(y, x) = 0;
    }
  }
  return mask;
}

}  // namespace roomtex
