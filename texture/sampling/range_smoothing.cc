#include "texture/sampling/range_smoothing.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/statistics.h"
#include "texture/sampling/grid_runs.h"

namespace roomtex {
namespace {

// Standard deviations of the noise that a sample may be moved by.
constexpr double kLargestMove = 4;

// Sums over a line of values, for fitting straight lines to any part of it.
class LineSums {
 public:
  // Values near their mean keep the sums of squares exact enough.
  void Reset(const std::vector<int>& run, const std::vector<float>& values) {
    const size_t n = run.size();
    y_.assign(n + 1, 0);
    xy_.assign(n + 1, 0);
    yy_.assign(n + 1, 0);
    base_ = values[run[n / 2]];
    for (size_t i = 0; i < n; ++i) {
      const double y = values[run[i]] - base_, x = static_cast<double>(i);
      y_[i + 1] = y_[i] + y;
      xy_[i + 1] = xy_[i] + x * y;
      yy_[i + 1] = yy_[i] + y * y;
    }
  }

  struct Fit {
    double value = 0;     // of the line at the place asked for
    double variance = 0;  // of the values around the line
  };
  // The line through the places first..last (at least three), at the place `at`.
  Fit FitLine(int first, int last, int at) const {
    const double n = last - first + 1, middle = 0.5 * (first + last);
    const double sum = y_[last + 1] - y_[first];
    const double moment = xy_[last + 1] - xy_[first] - middle * sum;
    const double spread = n * (n * n - 1) / 12;  // of the places around their middle
    const double slope = moment / spread;
    const double squares = yy_[last + 1] - yy_[first] - sum * sum / n - slope * moment;
    return {base_ + sum / n + slope * (at - middle), std::max(squares, 0.0) / (n - 2)};
  }

 private:
  double base_ = 0;
  std::vector<double> y_, xy_, yy_;
};

// Chooses for each place of a run the widest part around it that is straight within the noise, on
// both sides if possible, else on one: so that corners and steps are not rounded. Where nothing is
// straight, three samples on either side. sigma: standard deviation of each place's value.
void ChooseWindows(const std::vector<int>& run, int radius, const LineSums& sums,
                   const std::vector<float>& sigma, std::vector<SmoothingWindow>* windows) {
  constexpr int kLeast = 2;  // samples beside the place, of a fit that says anything about noise
  const int n = static_cast<int>(run.size());
  for (int i = 0; i < n; ++i) {
    const double noise = static_cast<double>(sigma[run[i]]) * sigma[run[i]];
    const auto fits = [&](int before, int after) {
      const int count = before + after + 1;
      // Twice the standard deviation of the variance itself.
      const double allowed = noise * (1 + 2 * std::sqrt(2.0 / (count - 2)));
      return sums.FitLine(i - before, i + after, i).variance <= allowed;
    };
    const int before = std::min(i, radius), after = std::min(n - 1 - i, radius);
    SmoothingWindow best{static_cast<int8_t>(std::min(before, 3)),
                         static_cast<int8_t>(std::min(after, 3))};
    for (int r = radius; r >= kLeast; r = r * 2 / 3) {
      const int b = std::min(before, r), a = std::min(after, r);
      if (b + a < 2 * kLeast) continue;
      if (fits(b, a)) {
        best = {static_cast<int8_t>(b), static_cast<int8_t>(a)};
        break;
      }
      // On one side as far as on both: what the other side would have added is missing.
      const int wide_b = std::min(i, 2 * r), wide_a = std::min(n - 1 - i, 2 * r);
      const bool left = wide_b >= 2 * kLeast && fits(wide_b, 0);
      const bool right = wide_a >= 2 * kLeast && fits(0, wide_a);
      if (!left && !right) continue;
      const bool take_left = left && (!right || sums.FitLine(i - wide_b, i, i).variance <=
                                                    sums.FitLine(i, i + wide_a, i).variance);
      best = take_left ? SmoothingWindow{static_cast<int8_t>(wide_b), 0}
                       : SmoothingWindow{0, static_cast<int8_t>(wide_a)};
      break;
    }
    (*windows)[run[i]] = best;
  }
}

// *values = those of the lines through the chosen windows.
void SmoothRuns(const Scan& scan, const GridLinks& links, bool columns, int radius, int num_threads,
                const std::vector<float>& measured, const std::vector<float>& sigma,
                std::vector<SmoothingWindow>* windows, std::vector<float>* values) {
  windows->assign(measured.size(), {});
  const std::vector<float> in = *values;
  ForEachRun(scan, links, columns, num_threads, [&](const std::vector<int>& run, int) {
    if (run.size() < 3) return;
    // Windows by what was measured: its noise is known.
    LineSums sums;
    sums.Reset(run, measured);
    ChooseWindows(run, radius, sums, sigma, windows);
    if (columns) sums.Reset(run, in);
    for (int i = 0; i < static_cast<int>(run.size()); ++i) {
      const SmoothingWindow& window = (*windows)[run[i]];
      if (window.before + window.after < 2) continue;
      (*values)[run[i]] =
          static_cast<float>(sums.FitLine(i - window.before, i + window.after, i).value);
    }
  });
}

// Standard deviation of one sample's range by range: the second difference of inverse range
// vanishes on a plane, its noise is sqrt(6) times that of one sample. The median shrugs off edges
// and corners.
class NoiseByRange {
 public:
  NoiseByRange(const Scan& scan, const GridLinks& links, const std::vector<float>& inverse_range) {
    struct Deviation {
      float range, size;
    };
    std::vector<Deviation> all;
    const size_t stride = std::max<size_t>(1, inverse_range.size() / 200000);
    for (size_t i = 1; i + 1 < inverse_range.size(); i += stride) {
      if (i % scan.num_columns == 0 || (i + 1) % scan.num_columns == 0) continue;
      if (!(links.bits[i - 1] & GridLinks::kRight) || !(links.bits[i] & GridLinks::kRight))
        continue;
      const float w = inverse_range[i];
      const float second = inverse_range[i - 1] - 2 * w + inverse_range[i + 1];
      all.push_back({1 / w, std::abs(second) / (w * w)});  // dr = dw / w^2
    }
    std::sort(all.begin(), all.end(), [](const Deviation& a, const Deviation& b) {
      return a.range != b.range ? a.range < b.range : a.size < b.size;
    });
    const size_t num_parts = std::clamp<size_t>(all.size() / 2000, 1, 8);
    std::vector<float> sizes;
    for (size_t part = 0; part < num_parts; ++part) {
      const size_t begin = all.size() * part / num_parts, end = all.size() * (part + 1) / num_parts;
      if (begin == end) continue;
      sizes.clear();
      for (size_t i = begin; i < end; ++i) sizes.push_back(all[i].size);
      nodes_.push_back({all[(begin + end) / 2].range, Sigma(&sizes)});
    }
    sizes.clear();
    for (const Deviation& deviation : all) sizes.push_back(deviation.size);
    overall_ = Sigma(&sizes);
  }

  float overall() const { return overall_; }
  // Linear between the parts of equally many samples.
  float At(float range) const {
    if (nodes_.empty()) return 0;
    size_t next = 0;
    while (next < nodes_.size() && nodes_[next].range < range) ++next;
    if (next == 0) return nodes_.front().sigma;
    if (next == nodes_.size()) return nodes_.back().sigma;
    const Node &a = nodes_[next - 1], &b = nodes_[next];
    return a.sigma + (b.sigma - a.sigma) * (range - a.range) / std::max(b.range - a.range, 1e-6f);
  }

 private:
  struct Node {
    float range, sigma;
  };
  static float Sigma(std::vector<float>* sizes) {
    return static_cast<float>(kSigmaPerMad * Median(sizes) / std::sqrt(6.0));
  }
  float overall_ = 0;
  std::vector<Node> nodes_;
};

// What a line through a window of a parabola with this second difference has too much in the
// sample's place.
double ParabolaExcess(const SmoothingWindow& window, double second_difference) {
  const double n = window.before + window.after + 1, off = 0.5 * (window.after - window.before);
  if (n < 3) return 0;
  return 0.5 * second_difference * ((n * n - 1) / 12 - off * off);
}

}  // namespace

RangeSmoother::RangeSmoother(const Scan& scan, const GridLinks& links, int radius, int num_threads)
    : scan_(scan),
      links_(links),
      radius_(radius),
      num_threads_(num_threads),
      inverse_range_(scan.points.size(), 0.0f),
      sigma_(scan.points.size(), 0.0f) {
  const size_t count = scan.points.size();
  for (size_t i = 0; i < count; ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const double range = (scan.points[i] - scan.Station()).norm();
    if (range > 0) inverse_range_[i] = static_cast<float>(1 / range);
  }
  const NoiseByRange noise(scan, links, inverse_range_);
  noise_ = noise.overall();
  for (size_t i = 0; i < count; ++i) {
    const float w = inverse_range_[i];
    if (w > 0) sigma_[i] = noise.At(1 / w) * w * w;
  }
}

double RangeSmoother::noise() const { return noise_; }

void RangeSmoother::Smooth(std::vector<Eigen::Vector3d>* points) {
  if (!(noise_ > 0)) return;
  std::vector<float> smooth = inverse_range_;
  SmoothRuns(scan_, links_, false, radius_, num_threads_, inverse_range_, sigma_, &in_rows_,
             &smooth);
  SmoothRuns(scan_, links_, true, radius_, num_threads_, inverse_range_, sigma_, &in_columns_,
             &smooth);
  for (size_t i = 0; i < smooth.size(); ++i) {
    if (!(inverse_range_[i] > 0) || !(smooth[i] > 0)) continue;
    // A larger move is no noise but shape: the sample keeps its measured place.
    if (std::abs(smooth[i] - inverse_range_[i]) > kLargestMove * sigma_[i]) continue;
    (*points)[i] =
        scan_.Station() + inverse_range_[i] / smooth[i] * (scan_.points[i] - scan_.Station());
  }
}

void RangeSmoother::Straighten(const std::vector<Eigen::Vector3f>& normals,
                               std::vector<Eigen::Vector3d>* points) const {
  if (in_rows_.empty()) return;
  const auto direction = [this](int index) -> Eigen::Vector3d {
    return (scan_.points[index] - scan_.Station()) * static_cast<double>(inverse_range_[index]);
  };
  ParallelFor(num_threads_, 1, std::max(1, scan_.num_rows - 1), [&](int row) {
    for (int column = 1; column + 1 < scan_.num_columns; ++column) {
      const int i = scan_.Index(column, row);
      // Samples that were not moved stay where they were measured.
      if (scan_.IsMissing(i) || normals[i].isZero() || (*points)[i] == scan_.points[i]) continue;
      const Eigen::Vector3d ray = (*points)[i] - scan_.Station();
      const Eigen::Vector3d here = direction(i), normal = normals[i].cast<double>();
      const double slope = normal.dot(ray);
      if (std::abs(slope) < 0.02 * ray.norm()) continue;
      // The plane through the sample has the inverse range (normal / slope) . d along a ray d.
      const auto second_difference = [&](int before, int after) {
        if (scan_.IsMissing(before) || scan_.IsMissing(after)) return 0.0;
        return normal.dot(direction(before) - 2 * here + direction(after)) / slope;
      };
      const double excess =
          ParabolaExcess(in_rows_[i], second_difference(i - 1, i + 1)) +
          ParabolaExcess(in_columns_[i],
                         second_difference(i - scan_.num_columns, i + scan_.num_columns));
      const double inverse_range = 1 / ray.norm();
      if (std::abs(excess) > 0.01 * inverse_range) continue;
      (*points)[i] = scan_.Station() + inverse_range / (inverse_range - excess) * ray;
    }
  });
}

}  // namespace roomtex
