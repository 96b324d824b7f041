// ScanSurface of a grid: windows of neighbouring cells around each cell.

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "align/surface/scan_surface.h"
#include "core/frames.h"
#include "core/parallel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr double kCells = 400000;                 // about as many cells are made of a large scan
constexpr double kNormalSigma = RadFromDeg(1.0);  // windows grow until normals are this exact
constexpr double kLargestWindow = 0.4;            // metres
// RMS of a window over the expected noise: a larger one makes windows beside the cell be tried, a
// much larger one is no plane (surfaces differ in noise: dark ones have more).
constexpr double kSuspicious = 1.1;

using Sums = Eigen::Array<double, 10, 1>;

struct Window {
  double rms = 0, roughness = 1e9, noise = 0, normal_sigma = 1, weight = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
};

// What is known of a cell before its plane is.
struct Ray {
  Eigen::Vector3f direction = Eigen::Vector3f::Zero();  // mean of its samples, unit length
  float range = 0;                                      // mean; 0 = no samples
};

// Sums of the cells along each row, so that a window costs two looks a row.
class CellSums {
 public:
  CellSums(const Scan& scan, int cell_size, int num_columns, int num_rows, int num_threads)
      : num_columns_(num_columns),
        num_rows_(num_rows),
        sums_(static_cast<size_t>(num_rows) * (num_columns + 1)),
        rays_(static_cast<size_t>(num_rows) * num_columns) {
    const Eigen::Vector3d station = scan.Station();
    ParallelFor(num_threads, 0, num_rows, [&](int row) {
      std::vector<Moments> cells(num_columns);
      std::vector<Eigen::Vector4d> rays(num_columns, Eigen::Vector4d::Zero());
      const int end = std::min((row + 1) * cell_size, scan.num_rows);
      for (int sample_row = row * cell_size; sample_row < end; ++sample_row) {
        const Eigen::Vector3d* points = &scan.points[scan.Index(0, sample_row)];
        for (int column = 0; column < scan.num_columns; ++column) {
          const Eigen::Vector3d offset = points[column] - station;
          const double range = offset.norm();
          if (!(range > 0)) continue;
          cells[column / cell_size].Add(offset);
          rays[column / cell_size].head<3>() += offset / range;
          rays[column / cell_size][3] += range;
        }
      }
      Sums sum = Sums::Zero();
      for (int column = 0; column < num_columns; ++column) {
        sums_[Index(column, row)] = sum;
        sum += cells[column].sums;
        const double count = cells[column].weight();
        if (!(count > 0)) continue;
        rays_[row * num_columns + column] = {rays[column].head<3>().normalized().cast<float>(),
                                             static_cast<float>(rays[column][3] / count)};
      }
      sums_[Index(num_columns, row)] = sum;
    });
  }

  const Ray& ray(int column, int row) const { return rays_[row * num_columns_ + column]; }
  // first and last column may lie outside: a closed grid continues on its other side.
  Sums Sum(int first_column, int last_column, int first_row, int last_row, bool closed) const {
    Sums sum = Sums::Zero();
    const int from = std::max(first_column, 0), to = std::min(last_column, num_columns_ - 1) + 1;
    for (int row = std::max(first_row, 0); row <= std::min(last_row, num_rows_ - 1); ++row) {
      if (from < to) sum += sums_[Index(to, row)] - sums_[Index(from, row)];
      if (!closed) continue;
      if (first_column < 0) {
        sum += sums_[Index(num_columns_, row)] - sums_[Index(num_columns_ + first_column, row)];
      }
      if (last_column >= num_columns_) {
        sum += sums_[Index(last_column - num_columns_ + 1, row)] - sums_[Index(0, row)];
      }
    }
    return sum;
  }

 private:
  size_t Index(int column, int row) const {
    return static_cast<size_t>(row) * (num_columns_ + 1) + column;
  }

  int num_columns_, num_rows_;
  std::vector<Sums> sums_;
  std::vector<Ray> rays_;
};

// Angles between neighbouring cells, per row; 0 where it cannot be told.
struct CellSteps {
  std::vector<float> columns, rows;
  bool closed = false;
};

void FillGaps(std::vector<float>* values) {
  std::vector<float> known;
  for (float value : *values) {
    if (value > 0) known.push_back(value);
  }
  const float typical = known.empty() ? 0.01f : Median(&known);
  for (float& value : *values) {
    if (!(value > 0)) value = typical;
  }
}

CellSteps FindSteps(const CellSums& sums, int num_columns, int num_rows) {
  CellSteps steps;
  std::vector<float> across;  // from the last to the first column, over the step within the row
  const auto angle = [](const Ray& a, const Ray& b) { return (a.direction - b.direction).norm(); };
  for (int row = 0; row < num_rows; ++row) {
    std::vector<float> along, down;
    const int stride = std::max(1, num_columns / 200);
    for (int column = 0; column + 1 < num_columns; column += stride) {
      const Ray& ray = sums.ray(column, row);
      const Ray& right = sums.ray(column + 1, row);
      if (ray.range > 0 && right.range > 0) along.push_back(angle(ray, right));
      if (row + 1 == num_rows) continue;
      const Ray& below = sums.ray(column, row + 1);
      if (ray.range > 0 && below.range > 0) down.push_back(angle(ray, below));
    }
    steps.columns.push_back(Median(&along));
    steps.rows.push_back(row + 1 < num_rows || steps.rows.empty() ? Median(&down)
                                                                  : steps.rows.back());
    const Ray& first = sums.ray(0, row);
    const Ray& last = sums.ray(num_columns - 1, row);
    if (first.range > 0 && last.range > 0 && steps.columns.back() > 0) {
      across.push_back(angle(first, last) / steps.columns.back());
    }
  }
  FillGaps(&steps.columns);
  FillGaps(&steps.rows);
  // The last cell may be narrower than the others.
  const float ratio = Median(&across);
  steps.closed = across.size() >= 4 && num_columns >= 16 && ratio > 0.2f && ratio < 1.75f;
  return steps;
}

// Finds the local plane of each cell.
class LocalPlanes {
 public:
  LocalPlanes(const CellSums& sums, const CellSteps& steps, int cell_size, int num_columns,
              int num_rows, const ScanPlaneOptions& options)
      : sums_(sums),
        steps_(steps),
        cell_size_(cell_size),
        num_columns_(num_columns),
        num_rows_(num_rows),
        options_(options),
        least_cosine_(std::cos(RadFromDeg(options.max_incidence_deg))) {}

  // From small windows all over the grid.
  RangeNoise EstimateNoise() const {
    std::vector<std::pair<float, float>> observations;
    const int stride = std::max(1, static_cast<int>(std::sqrt(num_columns_ * num_rows_ / 30000.0)));
    for (int row = stride / 2; row < num_rows_; row += stride) {
      for (int column = stride / 2; column < num_columns_; column += stride) {
        const Ray& ray = sums_.ray(column, row);
        if (!(ray.range > 0)) continue;
        const Window window =
            Fit(column, row, HalfSize(row, ray.range, options_.min_window), {0, 0});
        const double cosine = std::abs(window.normal.dot(ray.direction.cast<double>()));
        if (window.weight < 8 || !(cosine > 0.35)) continue;
        observations.emplace_back(ray.range, static_cast<float>(window.rms / cosine));
      }
    }
    return RangeNoise(std::move(observations));
  }

  // Columns and rows from a cell to the next one whose window shares no samples with its own.
  std::array<int, 2> Apart(int column, int row, const RangeNoise& noise) const {
    const double range = sums_.ray(column, row).range;
    const HalfSizes half = HalfSize(row, range, WindowSize(row, range, noise.At(range)));
    return {2 * half[0] + 1, 2 * half[1] + 1};
  }

  SurfaceCell MakeCell(int column, int row, const RangeNoise& noise) const {
    SurfaceCell cell;
    const Ray& ray = sums_.ray(column, row);
    if (!(ray.range > 0)) return cell;
    Moments own;
    own.sums = sums_.Sum(column, column, row, row, false);
    cell.count = static_cast<int>(std::lround(own.weight()));
    const Window window = BestWindow(column, row, noise);
    const Eigen::Vector3d mean(own.sums[1] / cell.count, own.sums[2] / cell.count,
                               own.sums[3] / cell.count);
    const double cosine = -window.normal.dot(ray.direction.cast<double>());
    const double offset = window.normal.dot(mean - window.mean);
    cell.point = mean - offset * window.normal;
    cell.normal = window.normal.cast<float>();
    cell.roughness = static_cast<float>(window.roughness);
    cell.noise = static_cast<float>(std::max(window.noise, window.rms));
    cell.point_sigma = static_cast<float>(cell.noise / std::sqrt(std::max(1.0, window.weight)));
    cell.normal_sigma = static_cast<float>(window.normal_sigma);
    // A cell that a depth edge crosses has its mean off the plane.
    const double tolerance = cell.noise * (0.3 + 3 / std::sqrt(static_cast<double>(cell.count)));
    cell.flat = window.roughness < kNotFlat && window.normal_sigma < kWorstNormalSigma &&
                cosine > least_cosine_ && std::abs(offset) < tolerance;
    return cell;
  }

 private:
  using HalfSizes = std::array<int, 2>;  // columns, rows

  HalfSizes HalfSize(int row, double range, double window) const {
    const auto half = [&](double step, int limit) {
      const double cells = window / (range * step);
      return std::clamp(static_cast<int>(std::lround((cells - 1) / 2 + 0.2)), 1, limit);
    };
    return {half(steps_.columns[row], std::max(1, num_columns_ / 16)),
            half(steps_.rows[row], std::max(1, num_rows_ / 8))};
  }

  // Large enough for the normal to be exact to kNormalSigma on a surface facing the scanner: the
  // angle of a line through N = L^2 / s^2 points with noise sigma over the length L has the
  // deviation sigma sqrt(12 / N) / L.
  double WindowSize(int row, double range, double noise) const {
    const double spacing = range * std::sqrt(steps_.columns[row] * steps_.rows[row]) / cell_size_;
    const double size = std::sqrt(std::sqrt(12.0) * noise * spacing / kNormalSigma);
    return std::clamp(size, options_.min_window, std::max(kLargestWindow, options_.min_window));
  }

  Window Fit(int column, int row, const HalfSizes& half, const HalfSizes& shift) const {
    Window window;
    const int middle_column = column + shift[0], middle_row = row + shift[1];
    const Sums s = sums_.Sum(middle_column - half[0], middle_column + half[0], middle_row - half[1],
                             middle_row + half[1], steps_.closed);
    window.weight = s[0];
    if (s[0] < kFewestSamples) return window;
    window.mean = Eigen::Vector3d(s[1], s[2], s[3]) / s[0];
    Eigen::Matrix3d products;
    products << s[4], s[5], s[6], s[5], s[7], s[8], s[6], s[8], s[9];
    const Eigen::Matrix3d covariance = products / s[0] - window.mean * window.mean.transpose();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(covariance);
    window.normal = solver.eigenvectors().col(0);
    if (window.normal.dot(window.mean) > 0) window.normal *= -1;
    window.rms = std::sqrt(std::max(solver.eigenvalues()[0], 0.0) * s[0] / (s[0] - 3));
    // For now the smaller extent of the window, metres.
    window.normal_sigma = std::sqrt(std::max(solver.eigenvalues()[1], 1e-12));
    return window;
  }

  Window FitAndJudge(int column, int row, const HalfSizes& half, const HalfSizes& shift,
                     const RangeNoise& noise) const {
    Window window = Fit(column, row, half, shift);
    if (window.weight < kFewestSamples) return window;
    const Ray& ray = sums_.ray(column, row);
    const double cosine = std::abs(window.normal.dot(ray.direction.cast<double>()));
    window.noise = noise.Across(ray.range, cosine);
    window.roughness = window.rms / window.noise;
    window.normal_sigma =
        std::max(window.noise, window.rms) / (window.normal_sigma * std::sqrt(window.weight));
    return window;
  }

  // The window around the cell; where an edge may cross it, the flattest of the windows that have
  // the cell at their side or corner, large and small.
  Window BestWindow(int column, int row, const RangeNoise& noise) const {
    const Ray& ray = sums_.ray(column, row);
    const double size = WindowSize(row, ray.range, noise.At(ray.range));
    HalfSizes half = HalfSize(row, ray.range, size);
    Window best = FitAndJudge(column, row, half, {0, 0}, noise);
    for (int attempt = 0; attempt < 2; ++attempt) {
      const auto limit = [](const Window& w) {
        return kSuspicious + 1.5 / std::sqrt(2 * std::max(w.weight - 3, 1.0));
      };
      if (best.roughness < limit(best)) return best;
      for (int i = 0; i < 9; ++i) {
        const HalfSizes shift = {(i % 3 - 1) * half[0], (i / 3 - 1) * half[1]};
        const Window window = FitAndJudge(column, row, half, shift, noise);
        if (window.normal_sigma > kWorstNormalSigma) continue;
        if (window.roughness / limit(window) < best.roughness / limit(best)) best = window;
      }
      if (half[0] < 2 && half[1] < 2) break;
      half = {std::max(1, half[0] / 2), std::max(1, half[1] / 2)};
    }
    return best;
  }

  const CellSums& sums_;
  const CellSteps& steps_;
  const int cell_size_, num_columns_, num_rows_;
  const ScanPlaneOptions& options_;
  const double least_cosine_;
};

// Solid angle of one sample of a cell: spanned by the directions a few cells apart, so that a
// missing sample in one of them does not matter much.
float SolidAngle(const CellSums& sums, const CellSteps& steps, int cell_size, int num_columns,
                 int num_rows, int column, int row) {
  constexpr int kReach = 3;
  const float typical =
      steps.columns[row] * steps.rows[row] / static_cast<float>(cell_size * cell_size);
  const int left = std::max(column - kReach, 0), right = std::min(column + kReach, num_columns - 1);
  const int up = std::max(row - kReach, 0), down = std::min(row + kReach, num_rows - 1);
  const Ray *a = &sums.ray(left, row), *b = &sums.ray(right, row);
  const Ray *c = &sums.ray(column, up), *d = &sums.ray(column, down);
  if (!(a->range > 0 && b->range > 0 && c->range > 0 && d->range > 0)) return typical;
  const float cells = static_cast<float>((right - left) * (down - up) * cell_size * cell_size);
  const float angle =
      (b->direction - a->direction).cross(d->direction - c->direction).norm() / cells;
  return angle > 0.5f * typical && angle < 2 * typical ? angle : typical;
}

// What the samples of a window share (noise that is not independent, a wavy surface) does not
// average out: by how much normals differ from window to window more than the samples' noise says.
double FindCorrelation(const ScanSurface& surface, const LocalPlanes& planes, int num_columns) {
  const std::vector<SurfaceCell>& cells = surface.cells();
  std::vector<float> ratios;
  const size_t stride = cells.size() / 30000 + 1;
  for (size_t i = 0; i < cells.size(); i += stride) {
    if (!cells[i].flat) continue;
    const int index = static_cast<int>(i);
    const auto apart = planes.Apart(index % num_columns, index / num_columns, surface.noise());
    for (const bool right : {true, false}) {
      const int other = surface.CellBeside(index, right ? apart[0] : 0, right ? 0 : apart[1]);
      if (other < 0 || !cells[other].flat) continue;
      const SurfaceCell &a = cells[i], &b = cells[other];
      if (std::abs(a.normal.dot((b.point - a.point).cast<float>())) > 0.05f) continue;
      const float sigma = std::hypot(a.normal_sigma, b.normal_sigma);
      ratios.push_back(a.normal.cross(b.normal).norm() / sigma);
    }
  }
  if (ratios.size() < 50) return 1;
  // kMedianLengthPerSigma with fewer digits: the planes that are found depend on it.
  return std::clamp(Median(&ratios) / 1.177, 1.0, 5.0);
}

}  // namespace

void ScanSurface::BuildGrid(const ScanPlaneOptions& options, int num_threads) {
  const double num_samples = static_cast<double>(scan_.num_columns) * scan_.num_rows;
  cell_size_ = std::max(1, static_cast<int>(std::lround(std::sqrt(num_samples / kCells))));
  num_columns_ = (scan_.num_columns + cell_size_ - 1) / cell_size_;
  num_rows_ = (scan_.num_rows + cell_size_ - 1) / cell_size_;
  const CellSums sums(scan_, cell_size_, num_columns_, num_rows_, num_threads);
  const CellSteps steps = FindSteps(sums, num_columns_, num_rows_);
  closed_ = steps.closed;
  for (int row = 0; row < num_rows_; ++row) {
    step_.push_back(std::max(steps.columns[row], steps.rows[row]) / static_cast<float>(cell_size_));
  }
  const LocalPlanes planes(sums, steps, cell_size_, num_columns_, num_rows_, options);
  noise_ = planes.EstimateNoise();
  cells_.resize(static_cast<size_t>(num_columns_) * num_rows_);
  solid_angle_.resize(cells_.size());
  ParallelFor(num_threads, 0, num_rows_, [&](int row) {
    for (int column = 0; column < num_columns_; ++column) {
      const int index = row * num_columns_ + column;
      SurfaceCell& cell = cells_[index];
      cell = planes.MakeCell(column, row, noise_);
      solid_angle_[index] =
          SolidAngle(sums, steps, cell_size_, num_columns_, num_rows_, column, row);
      if (cell.count == 0) continue;
      const double range = cell.point.norm();
      const double cosine = std::max(0.05, -cell.normal.cast<double>().dot(cell.point) / range);
      cell.area = static_cast<float>(cell.count * solid_angle_[index] * range * range / cosine);
      cell.point += scan_.Station() - origin_;
    }
  });
  const auto correlation = static_cast<float>(FindCorrelation(*this, planes, num_columns_));
  for (SurfaceCell& cell : cells_) cell.normal_sigma *= correlation;
}

}  // namespace roomtex
