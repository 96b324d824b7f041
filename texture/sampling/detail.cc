#include "texture/sampling/detail.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "core/option_fields.h"
#include "texture/sampling/grid_runs.h"

namespace roomtex {
namespace {

std::vector<float> HalfGaussian(double sigma) {
  const int radius = std::max(1, static_cast<int>(std::ceil(3 * sigma)));
  std::vector<float> kernel(radius + 1);
  for (int i = 0; i <= radius; ++i) {
    kernel[i] = static_cast<float>(std::exp(-0.5 * i * i / (sigma * sigma)));
  }
  return kernel;
}

// One direction of the Gaussian within the runs of connected, coloured samples.
void BlurAlong(const Scan& scan, const GridLinks& links, bool columns,
               const std::vector<uint8_t>& fits, const std::vector<float>& kernel, int num_threads,
               std::vector<Eigen::Vector3f>* values) {
  const int radius = static_cast<int>(kernel.size()) - 1;
  ForEachRun(scan, links, columns, num_threads, [&](const std::vector<int>& run, int) {
    const int n = static_cast<int>(run.size());
    std::vector<Eigen::Vector4f> line(n);  // value and whether there is one
    for (int i = 0; i < n; ++i) {
      line[i] << (*values)[run[i]], 1.0f;
      if (fits[run[i]] == 0) line[i].setZero();
    }
    for (int i = 0; i < n; ++i) {
      if (fits[run[i]] == 0) continue;
      Eigen::Vector4f sum = kernel[0] * line[i];
      for (int k = 1; k <= std::min(radius, i); ++k) sum += kernel[k] * line[i - k];
      for (int k = 1; k <= std::min(radius, n - 1 - i); ++k) sum += kernel[k] * line[i + k];
      (*values)[run[i]] = sum.head<3>() / sum[3];
    }
  });
}

}  // namespace

void DetailOptions::Declare(OptionFields* fields) {
  fields
      ->Number("Blend.detail_sigma", &sigma,
               "What counts as detail: Gaussian sigma in samples. Larger = coarser.")
      .Above(0)
      .AtMost(100)
      .Says("must be positive, at most 100 samples");
  fields
      ->Int("Blend.detail_border", &border,
            "Samples beside a change of the dominant photo that get no detail.")
      .Within(0, 100, "dilations");
}

std::vector<std::string> DetailOptions::Problems() const { return ProblemsOf(*this); }

std::vector<uint8_t> DominanceBorders(int num_columns, int num_rows,
                                      const std::vector<int16_t>& photo, int times) {
  cv::Mat1b borders(num_rows, num_columns, uint8_t{0});
  const auto mark = [&](int row, int column, int other_row, int other_column) {
    if (photo[row * num_columns + column] == photo[other_row * num_columns + other_column]) return;
    borders(row, column) = borders(other_row, other_column) = 1;
  };
  for (int row = 0; row < num_rows; ++row) {
    for (int column = 0; column < num_columns; ++column) {
      if (column + 1 < num_columns) mark(row, column, row, column + 1);
      if (row + 1 < num_rows) mark(row, column, row + 1, column);
    }
  }
  if (times > 0) cv::dilate(borders, borders, cv::Mat(), {-1, -1}, times);
  return {borders.begin(), borders.end()};
}

void PreserveDetail(const Scan& scan, const GridLinks& links, const DominantMap& dominant,
                    const DetailOptions& options, int num_threads,
                    std::vector<Eigen::Vector3f>* blend) {
  if (!scan.organised) return;
  const std::vector<float>& strength = dominant.strength;
  std::vector<uint8_t> borders;
  if (strength.empty()) {
    borders = DominanceBorders(scan.num_columns, scan.num_rows, dominant.photo, options.border);
  }
  // H is linear: H(C) - H(M) = H(C - M), one convolution.
  std::vector<Eigen::Vector3f> low(blend->size());
  for (size_t i = 0; i < low.size(); ++i) low[i] = dominant.color[i] - (*blend)[i];
  const std::vector<float> kernel = HalfGaussian(options.sigma);
  BlurAlong(scan, links, false, dominant.fits, kernel, num_threads, &low);
  BlurAlong(scan, links, true, dominant.fits, kernel, num_threads, &low);
  for (size_t i = 0; i < low.size(); ++i) {
    if (dominant.fits[i] == 0 || (strength.empty() && borders[i] != 0)) continue;
    const float share = strength.empty() ? 1 : strength[i];
    const Eigen::Vector3f detail = dominant.color[i] - (*blend)[i] - low[i];
    (*blend)[i] = ((*blend)[i] + share * detail).cwiseMax(0);
  }
}

}  // namespace roomtex
