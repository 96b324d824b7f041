#include "align/search/scan_volume.h"

#include <algorithm>
#include <cmath>

#include "align/surface/scan_patches.h"
#include "core/decompositions.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr size_t kBoundingSamples = 50000;
constexpr size_t kRays = 60000;  // per scan: of the space that a scanner saw to be empty
// A window lets some samples far out of the room: the box holds all but this share on each side.
constexpr double kOutliers = 0.004;
constexpr double kMargin = 1.5;   // cells around the box
constexpr int kFewestInCell = 2;  // samples that make a surface

std::vector<Eigen::Vector3d> SomeSamples(const Scan& scan, size_t count) {
  std::vector<Eigen::Vector3d> samples;
  const size_t stride = std::max<size_t>(1, scan.points.size() / count);
  for (size_t i = 0; i < scan.points.size(); i += stride) {
    if (!scan.IsMissing(static_cast<int>(i))) samples.push_back(scan.points[i]);
  }
  return samples;
}

}  // namespace

ScanVolume::ScanVolume(const std::vector<Scan>& scans, const Eigen::Vector3d& up,
                       const ScanVolumeOptions& options)
    : options_(options), level_from_scan_(RotationBetween(up, Eigen::Vector3d::UnitZ())) {
  FindSize(scans);
  if (size_.prod() == 0) return;
  state_.assign(size_.prod(), State::kUnknown);
  for (const Scan& scan : scans) {
    if (scan.organised) MarkFree(scan);
  }
  MarkSurface(scans);
  FindWorth();
}

void ScanVolume::FindSize(const std::vector<Scan>& scans) {
  std::vector<double> along[3];
  for (const Scan& scan : scans) {
    for (const Eigen::Vector3d& x : SomeSamples(scan, kBoundingSamples / scans.size())) {
      const Eigen::Vector3d x_in_level = level_from_scan_ * x;
      for (int k = 0; k < 3; ++k) along[k].push_back(x_in_level[k]);
    }
  }
  if (along[0].empty()) return;
  Eigen::Vector3d low, high;
  for (int k = 0; k < 3; ++k) {
    low[k] = Quantile(&along[k], kOutliers);
    high[k] = Quantile(&along[k], 1 - kOutliers);
  }
  const Eigen::Vector3d box = (high - low).cwiseMax(0.1);
  cell_ = std::max(options_.least_cell, std::cbrt(box.prod() / options_.max_cells));
  origin_ = low - Eigen::Vector3d::Constant(kMargin * cell_);
  size_ = (box / cell_).array().ceil().cast<int>() + static_cast<int>(2 * kMargin);
}

// Along the rays from the scanner up to shortly before what they met.
void ScanVolume::MarkFree(const Scan& scan) {
  const Eigen::Vector3d station = level_from_scan_ * scan.Station();
  for (const Eigen::Vector3d& x : SomeSamples(scan, kRays)) {
    const Eigen::Vector3d ray = level_from_scan_ * x - station;
    const double range = ray.norm();
    const Eigen::Vector3d step = ray * (0.7 * cell_ / range);
    const int count = static_cast<int>((range - cell_) / (0.7 * cell_));
    Eigen::Vector3d at = station;
    bool is_inside = false;
    for (int i = 0; i <= count; ++i, at += step) {
      const Eigen::Vector3i cell = CellOf(at);
      if (!Contains(cell)) {
        if (is_inside) break;
        continue;  // the scanner may stand outside of all that it measured
      }
      is_inside = true;
      state_[Index(cell)] = State::kFree;
    }
  }
}

void ScanVolume::MarkSurface(const std::vector<Scan>& scans) {
  std::vector<uint8_t> counts(state_.size(), 0);
  for (const Scan& scan : scans) {
    VisitSurface(scan, 0.3 * cell_, [&](const Eigen::Vector3d& x_in_scan) {
      const Eigen::Vector3i cell = CellOf(level_from_scan_ * x_in_scan);
      if (!Contains(cell)) return;
      uint8_t& count = counts[Index(cell)];
      if (count < kFewestInCell) ++count;
    });
  }
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0, number = 0;
  for (int z = 0; z < size_.z(); ++z) {
    for (int y = 0; y < size_.y(); ++y) {
      for (int x = 0; x < size_.x(); ++x) {
        const int index = Index({x, y, z});
        if (counts[index] < kFewestInCell) continue;
        state_[index] = State::kSurface;
        const Eigen::Vector3d middle = cell_ * Eigen::Vector3d(x, y, z);
        sum += middle;
        squares += middle.squaredNorm();
        ++number;
      }
    }
  }
  if (number > 0) extent_ = std::sqrt(squares / number - (sum / number).squaredNorm());
}

void ScanVolume::FindWorth() {
  const double variance = options_.sigma_cells * options_.sigma_cells;
  const int reach = 2;
  worth_.resize(state_.size());
  for (int z = 0; z < size_.z(); ++z) {
    for (int y = 0; y < size_.y(); ++y) {
      for (int x = 0; x < size_.x(); ++x) {
        int nearest2 = 1 << 20;
        for (int dz = -reach; dz <= reach; ++dz) {
          for (int dy = -reach; dy <= reach; ++dy) {
            for (int dx = -reach; dx <= reach; ++dx) {
              const int distance2 = dx * dx + dy * dy + dz * dz;
              const Eigen::Vector3i other(x + dx, y + dy, z + dz);
              if (distance2 >= nearest2 || !Contains(other)) continue;
              if (state_[Index(other)] == State::kSurface) nearest2 = distance2;
            }
          }
        }
        const int index = Index({x, y, z});
        const double base = state_[index] == State::kFree ? options_.of_free : options_.of_unknown;
        const double near = std::exp(-nearest2 / (2 * variance));
        worth_[index] = static_cast<float>(near + (1 - near) * base);
      }
    }
  }
}

ScanVolume::State ScanVolume::StateAt(const Eigen::Vector3d& x_in_level) const {
  const Eigen::Vector3i cell = CellOf(x_in_level);
  return Contains(cell) ? state_[Index(cell)] : State::kUnknown;
}

}  // namespace roomtex
