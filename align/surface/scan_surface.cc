#include "align/surface/scan_surface.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "core/free_vectors.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// Noise of the directions and of the surface itself, as a share of the range noise: what is left
// of it at a grazing angle.
constexpr double kAcrossFloor = 0.2;
constexpr double kLeastNoise = 2e-5;  // metres; files hold no more digits

}  // namespace

void Moments::Add(const Eigen::Vector3d& x, double weight) {
  Eigen::Array<double, 10, 1> products;
  products << 1, x[0], x[1], x[2], x[0] * x[0], x[0] * x[1], x[0] * x[2], x[1] * x[1], x[1] * x[2],
      x[2] * x[2];
  sums += weight * products;
}

PlaneFit FitPlane(const Moments& moments) {
  const auto& s = moments.sums;
  PlaneFit fit;
  fit.mean = Eigen::Vector3d(s[1], s[2], s[3]) / s[0];
  Eigen::Matrix3d products;
  products << s[4], s[5], s[6], s[5], s[7], s[8], s[6], s[8], s[9];
  const Eigen::Matrix3d covariance = products / s[0] - fit.mean * fit.mean.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  fit.variances = solver.eigenvalues().cwiseMax(0);
  fit.axes = solver.eigenvectors();
  fit.normal = fit.axes.col(0).normalized();
  return fit;
}

RangeNoise::RangeNoise(std::vector<std::pair<float, float>> observations) {
  std::sort(observations.begin(), observations.end());
  const size_t per_bin = std::max<size_t>(100, observations.size() / 24 + 1);
  for (size_t begin = 0; begin < observations.size(); begin += per_bin) {
    const size_t end = std::min(begin + per_bin, observations.size());
    if (end - begin < per_bin / 2 && !knots_.empty()) break;
    std::vector<float> noise;
    for (size_t i = begin; i < end; ++i) noise.push_back(observations[i].second);
    // Windows over edges and clutter look noisier than they are, never quieter: a value below the
    // median.
    knots_.emplace_back(observations[(begin + end) / 2].first,
                        AtRank(&noise, noise.size() * 2 / 5));
  }
}

double RangeNoise::At(double range) const {
  if (knots_.empty()) return kLeastNoise;
  const auto above = std::lower_bound(
      knots_.begin(), knots_.end(), range,
      [](const std::pair<double, double>& knot, double value) { return knot.first < value; });
  double noise;
  if (above == knots_.begin()) {
    noise = above->second;
  } else if (above == knots_.end()) {
    noise = knots_.back().second;
  } else {
    const auto below = above - 1;
    const double width = above->first - below->first;
    const double share = width > 0 ? (range - below->first) / width : 0;
    noise = (1 - share) * below->second + share * above->second;
  }
  return std::max(noise, kLeastNoise);
}

double RangeNoise::Across(double range, double cosine) const {
  return At(range) * std::sqrt(cosine * cosine + kAcrossFloor * kAcrossFloor);
}

ScanSurface::ScanSurface(const Scan& scan, const Eigen::Vector3d& origin,
                         const ScanPlaneOptions& options, int num_threads)
    : scan_(scan), origin_(origin) {
  is_grid_ = scan.organised && scan.num_columns >= 4 && scan.num_rows >= 4;
  if (is_grid_) {
    BuildGrid(options, num_threads);
  } else {
    BuildMesh(options, num_threads);
  }
}

void ScanSurface::ForgetCells() { FreeVectors(&cells_, &neighbour_begin_, &neighbours_); }

int ScanSurface::NumSamples() const {
  return static_cast<int>(is_grid_ ? scan_.points.size() : points_.size());
}

bool ScanSurface::IsMissing(int sample) const { return is_grid_ && scan_.IsMissing(sample); }

Eigen::Vector3d ScanSurface::Point(int sample) const {
  return is_grid_ ? Eigen::Vector3d(scan_.points[sample] - origin_) : points_[sample];
}

int ScanSurface::CellOf(int sample) const {
  if (!is_grid_) return cell_of_[sample];
  const int column = sample % scan_.num_columns / cell_size_;
  return sample / scan_.num_columns / cell_size_ * num_columns_ + column;
}

int ScanSurface::CellBeside(int cell, int columns, int rows) const {
  if (!is_grid_) return -1;
  int column = cell % num_columns_ + columns;
  const int row = cell / num_columns_ + rows;
  if (row < 0 || row >= num_rows_) return -1;
  if (closed_) column = (column + num_columns_) % num_columns_;
  if (column < 0 || column >= num_columns_) return -1;
  return row * num_columns_ + column;
}

double ScanSurface::Footprint(int sample, const Eigen::Vector3d& x,
                              const Eigen::Vector3d& normal) const {
  if (!is_grid_) return areas_[sample];
  const Eigen::Vector3d ray = x - station();
  const double across = std::abs(normal.dot(ray));
  const double range = ray.norm();
  if (!(across > 0.01 * range)) return 0;
  return solid_angle_[CellOf(sample)] * range * range * range / across;
}

double ScanSurface::Spacing(int sample, const Eigen::Vector3d& x,
                            const Eigen::Vector3d& normal) const {
  if (!is_grid_) return spacing_;
  const Eigen::Vector3d ray = x - station();
  const double range = ray.norm();
  const double across = std::max(std::abs(normal.dot(ray)), 0.05 * range);
  return step_[CellOf(sample) / num_columns_] * range * range / across;
}

double ScanSurface::NoiseAcross(const Eigen::Vector3d& x, const Eigen::Vector3d& normal) const {
  const Eigen::Vector3d ray = x - station();
  const double range = ray.norm();
  // A mesh has noise of its own, across its surface wherever the scanner stood.
  if (!is_grid_ || !(range > 0)) return noise_.At(range);
  return noise_.Across(range, std::abs(normal.dot(ray)) / range);
}

}  // namespace roomtex
