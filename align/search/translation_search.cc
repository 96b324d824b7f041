#include "align/search/translation_search.h"

#include <algorithm>
#include <limits>

#include <opencv2/core.hpp>

namespace roomtex {
namespace {

constexpr int kNeighbour = 2;  // cells
constexpr float kTaken = -std::numeric_limits<float>::max();

}  // namespace

TranslationSearch::TranslationSearch(const ScanVolume& volume, const Eigen::Vector3i& reach)
    : volume_(volume), reach_(reach) {
  const Eigen::Vector3i& size = volume.size();
  step_ = size.x() + reach.x();
  rows_ = cv::getOptimalDFTSize(size.y() + reach.y());
  columns_ = cv::getOptimalDFTSize(step_ * (size.z() + reach.z()));
  cv::Mat1f picture(rows_, columns_, 0.0f);
  const auto outside = static_cast<float>(volume.of_outside());
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) {
        picture(y, Column(x, z)) = volume.worth()[(z * size.y() + y) * size.x() + x] - outside;
      }
    }
  }
  cv::dft(picture, spectrum_, 0, size.y());
}

// Shifts to lower x, y or z have wrapped around.
Eigen::Vector3d TranslationSearch::Shift(int row, int column) const {
  const int y = row < volume_.size().y() ? row : row - rows_;
  if (column >= step_ * volume_.size().z()) column -= columns_;
  const int z = (column + reach_.x() + step_ * reach_.z()) / step_ - reach_.z();
  return volume_.cell_size() * Eigen::Vector3d(column - step_ * z, y, z);
}

std::vector<TranslationSearch::Place> TranslationSearch::FindBest(
    const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& low, int count,
    const std::function<bool(const Eigen::Vector3d&)>& allowed) const {
  cv::Mat1f picture(rows_, columns_, 0.0f);
  int num_cells = 0;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3i cell = ((point - low) / volume_.cell_size()).array().floor().cast<int>();
    if (!((cell.array() >= 0).all() && (cell.array() < reach_.array()).all())) continue;
    float& at = picture(cell.y(), Column(cell.x(), cell.z()));
    num_cells += at == 0;
    at = 1;
  }
  if (num_cells == 0) return {};
  cv::Mat1f spectrum, score;
  cv::dft(picture, spectrum, 0, reach_.y());
  cv::mulSpectrums(spectrum_, spectrum, spectrum, 0, true);
  cv::dft(spectrum, score, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);

  const Eigen::Vector3d corner = volume_.origin() - low;
  if (allowed) {
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        if (!allowed(corner + Shift(row, column))) score(row, column) = kTaken;
      }
    }
  }
  std::vector<Place> places;
  while (static_cast<int>(places.size()) < count) {
    double most = 0;
    cv::Point at;
    cv::minMaxLoc(score, nullptr, &most, nullptr, &at);
    if (most == kTaken) break;
    places.push_back({corner + Shift(at.y, at.x), most / num_cells + volume_.of_outside()});
    for (int dz = -kNeighbour; dz <= kNeighbour; ++dz) {
      for (int dy = -kNeighbour; dy <= kNeighbour; ++dy) {
        for (int dx = -kNeighbour; dx <= kNeighbour; ++dx) {
          score((at.y + dy + rows_) % rows_,
                ((at.x + Column(dx, dz)) % columns_ + columns_) % columns_) = kTaken;
        }
      }
    }
  }
  return places;
}

}  // namespace roomtex
