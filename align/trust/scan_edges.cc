#include "align/trust/scan_edges.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <opencv2/imgproc.hpp>

#include "align/trust/scan_view.h"
#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

using Kind = ScanEdge::Kind;

// A step of the inverse range by this share from one sample to the next is a rim whatever lies
// around it; on a floor seen 85 degrees from its normal the share is 0.035.
constexpr float kRim = 0.05f;

// Samples; a bright or dark line narrower than this is not two steps.
constexpr float kThinLine = 3.5f;

// Where an edge crosses a line (row or column) of the grid.
struct Crossing {
  float at = 0;        // samples along the line
  float strength = 0;  // signed, in units of the threshold of its kind
  Eigen::Vector3d x_in_scan;
};
using Crossings = std::vector<std::vector<Crossing>>;  // by line, in order

// Least-squares line through `count` values at the positions 0.5, 1.5, ... in front of a boundary.
struct SideFit {
  double at_boundary = 0, slope = 0, squares = 0;
};
SideFit FitSide(const float* values, int count) {
  double sum = 0, moment = 0, mean_t = 0.5 * count, tt = 0;
  for (int k = 0; k < count; ++k) {
    const double t = k + 0.5 - mean_t;
    sum += values[k];
    moment += t * values[k];
    tt += t * t;
  }
  SideFit fit;
  const double mean = sum / count;
  fit.slope = moment / tt;
  fit.at_boundary = mean - fit.slope * mean_t;
  for (int k = 0; k < count; ++k) {
    const double residual = values[k] - mean - fit.slope * (k + 0.5 - mean_t);
    fit.squares += residual * residual;
  }
  return fit;
}

class GridEdgeFinder {
 public:
  GridEdgeFinder(const Scan& scan, const ScanEdgeOptions& options)
      : scan_(scan), options_(options), inverse_(scan.points.size(), 0.0f) {
    for (size_t i = 0; i < inverse_.size(); ++i) {
      const double range = (scan.points[i] - scan.Station()).norm();
      if (range > 0) inverse_[i] = static_cast<float>(1 / range);
    }
    smooth_ = FindSmoothSamples(scan);
    const std::vector<uint8_t> grey = IntensityAsGrey(scan);
    cv::Mat1f values(scan.num_rows, scan.num_columns);
    std::copy(grey.begin(), grey.end(), values.begin());
    cv::GaussianBlur(values, values, cv::Size(), 1.0);
    const cv::Mat1f kernel = (cv::Mat1f(1, 3) << -0.5f, 0, 0.5f);
    cv::filter2D(values, across_, CV_32F, kernel);
    cv::filter2D(values, down_, CV_32F, kernel.t());
    grey_noise_ = MedianSlope();
  }

  std::vector<ScanEdge> Find() const {
    std::vector<ScanEdge> edges;
    for (const bool along_rows : {true, false}) {
      Crossings depth(NumLines(along_rows)), crease(depth.size()), intensity(depth.size());
      for (int line = 0; line < NumLines(along_rows); ++line) {
        Line(along_rows, line, &depth[line], &crease[line], &intensity[line]);
      }
      Link(depth, Kind::kDepth, &edges);
      Link(crease, Kind::kCrease, &edges);
      Link(intensity, Kind::kIntensity, &edges);
    }
    return edges;
  }

 private:
  int NumLines(bool along_rows) const { return along_rows ? scan_.num_rows : scan_.num_columns; }

  double MedianSlope() const {
    std::vector<float> slopes;
    const size_t stride = smooth_.size() / 200000 + 1;
    for (size_t i = 0; i < smooth_.size(); i += stride) {
      if (!smooth_[i]) continue;
      const int row = static_cast<int>(i) / scan_.num_columns;
      slopes.push_back(std::abs(across_(row, static_cast<int>(i) % scan_.num_columns)));
    }
    // kSigmaPerMad with fewer digits: what is found depends on it.
    return 1.48 * Median(&slopes);
  }

  // The surface point between two samples: in the direction of the share `s` from a to b.
  Eigen::Vector3d Between(int a, int b, double s, double inverse_range) const {
    const Eigen::Vector3d station = scan_.Station();
    const Eigen::Vector3d direction = ((1 - s) * inverse_[a] * (scan_.points[a] - station) +
                                       s * inverse_[b] * (scan_.points[b] - station))
                                          .normalized();
    return station + direction / inverse_range;
  }

  void Line(bool along_rows, int line, std::vector<Crossing>* depth, std::vector<Crossing>* crease,
            std::vector<Crossing>* intensity) const {
    const int n = along_rows ? scan_.num_columns : scan_.num_rows;
    std::vector<int> index(n);
    std::vector<float> w(n), backwards(n);
    for (int i = 0; i < n; ++i) {
      index[i] = along_rows ? scan_.Index(i, line) : scan_.Index(line, i);
      w[i] = inverse_[index[i]];
      backwards[n - 1 - i] = w[i];
    }
    FindDepth(index, w, backwards, depth, crease);
    FindIntensity(along_rows, line, index, w, intensity);
    KeepPlainSteps(*crease, intensity);
  }

  // Rims, small steps and creases along one line: what two straight lines (planes have straight
  // inverse ranges, but for a curvature that both sides share) say about the place between them.
  void FindDepth(const std::vector<int>& index, const std::vector<float>& w,
                 const std::vector<float>& backwards, std::vector<Crossing>* depth,
                 std::vector<Crossing>* crease) const {
    const int n = static_cast<int>(w.size()), k = options_.crease_window;
    std::vector<float> step(n, 0), bend(n, 0), offset(n, 0), middle(n, 0);
    // missing_or_rim[i]: number of gaps and rims between samples 0 and i.
    std::vector<int> breaks(n + 1, 0);
    for (int i = 0; i + 1 < n; ++i) {
      const bool both = w[i] > 0 && w[i + 1] > 0;
      const bool rim = both && std::abs(w[i] - w[i + 1]) > kRim * std::min(w[i], w[i + 1]);
      breaks[i + 1] = breaks[i] + (!both || rim);
      const auto slope = [&](int j) {
        return j >= 0 && j + 1 < n && w[j] > 0 && w[j + 1] > 0 ? std::abs(w[j + 1] - w[j]) : 0.0f;
      };
      const float change = std::abs(w[i] - w[i + 1]);
      if (rim && change > 3 * slope(i - 1) && change > 3 * slope(i + 1)) {
        depth->push_back({i + 0.5f, w[i + 1] > w[i] ? 1.0f : -1.0f,
                          Between(index[i], index[i + 1], 0.5, std::max(w[i], w[i + 1]))});
      }
    }
    const double fit_tt = k * (static_cast<double>(k) * k - 1) / 12;  // sum of (t - mean)^2
    for (int i = k - 1; i + k < n; ++i) {
      if (breaks[i + k] != breaks[i - k + 1]) continue;
      const SideFit left = FitSide(&backwards[n - 1 - i], k), right = FitSide(&w[i + 1], k);
      const double variance = (left.squares + right.squares) / (2 * k - 4) + 1e-16;
      const double gap = right.at_boundary - left.at_boundary;
      const double bent = right.slope + left.slope;  // left.slope counts away from the boundary
      const double angle = AngleBetween(index[i], index[i + 1]);
      const double gap_sigma = std::sqrt(2 * variance * (1.0 / k + 0.25 * k * k / fit_tt));
      const double bend_sigma = std::sqrt(2 * variance / fit_tt);
      const double gap_limit =
          std::max(options_.min_step * w[i], options_.min_significance * gap_sigma);
      const double bend_limit =
          std::max(std::tan(RadFromDeg(options_.min_crease_deg)) * angle * w[i],
                   options_.min_significance * bend_sigma);
      step[i] = static_cast<float>(gap / gap_limit);
      if (std::abs(bent) > bend_limit) {
        // The two lines meet at at_boundary_left - slope_left t = at_boundary_right + slope_right
        // t.
        const double t = -gap / bent;
        if (std::abs(t) <= 1) {
          bend[i] = static_cast<float>(bent / bend_limit);
          offset[i] = static_cast<float>(t);
          middle[i] = static_cast<float>(left.at_boundary - left.slope * t);
        }
      }
    }
    for (int i = 1; i + 1 < n; ++i) {
      if (IsPeak(bend, i, 3)) {
        const float s = 0.5f + offset[i];
        crease->push_back({i + s, bend[i], Between(index[i], index[i + 1], s, middle[i])});
      } else if (std::abs(step[i]) > 1 && IsPeak(step, i, 3) && !NearPeak(bend, i, 3)) {
        depth->push_back(
            {i + 0.5f, step[i], Between(index[i], index[i + 1], 0.5, std::max(w[i], w[i + 1]))});
      }
    }
    std::sort(depth->begin(), depth->end(),
              [](const Crossing& a, const Crossing& b) { return a.at < b.at; });
  }

  void FindIntensity(bool along_rows, int line, const std::vector<int>& index,
                     const std::vector<float>& w, std::vector<Crossing>* intensity) const {
    const int n = static_cast<int>(index.size());
    const auto limit = static_cast<float>(
        std::max(options_.min_intensity_step, options_.min_significance * grey_noise_));
    const auto slope = [&](const cv::Mat1f& slopes, int i) {
      return along_rows ? slopes(line, i) : slopes(i, line);
    };
    const cv::Mat1f& own = along_rows ? across_ : down_;
    const cv::Mat1f& other = along_rows ? down_ : across_;
    for (int i = 2; i + 2 < n; ++i) {
      const float before = std::abs(slope(own, i - 1)), at = std::abs(slope(own, i));
      const float behind = std::abs(slope(own, i + 1));
      if (at < 0.5f * limit || at < before || at <= behind) continue;
      if (at < 0.9f * std::abs(slope(other, i))) continue;  // the other direction sees it better
      if (!(smooth_[index[i - 1]] && smooth_[index[i]] && smooth_[index[i + 1]])) continue;
      const float s =
          std::clamp(0.5f * (before - behind) / (before - 2 * at + behind), -0.5f, 0.5f);
      const int next = s < 0 ? i - 1 : i + 1;
      const float share = std::abs(s);
      intensity->push_back(
          {i + s, slope(own, i) / limit,
           Between(index[i], index[next], share, (1 - share) * w[i] + share * w[next])});
    }
  }

  // The two sides of a thin line pull each other away from where they are, and a crease says more
  // exactly what the step of intensity along it says.
  static void KeepPlainSteps(const std::vector<Crossing>& creases,
                             std::vector<Crossing>* intensity) {
    std::vector<Crossing> kept;
    for (const Crossing& step : *intensity) {
      const auto opposes = [&](const Crossing& other) {
        return std::abs(other.at - step.at) < kThinLine && other.strength * step.strength < 0;
      };
      const auto is_crease = [&](const Crossing& other) {
        return std::abs(other.at - step.at) < 2;
      };
      if (std::any_of(intensity->begin(), intensity->end(), opposes)) continue;
      if (std::any_of(creases.begin(), creases.end(), is_crease)) continue;
      kept.push_back(step);
    }
    *intensity = std::move(kept);
  }

  static bool IsPeak(const std::vector<float>& values, int i, int reach) {
    if (values[i] == 0) return false;
    const int n = static_cast<int>(values.size());
    for (int j = std::max(0, i - reach); j <= std::min(n - 1, i + reach); ++j) {
      if (std::abs(values[j]) > std::abs(values[i])) return false;
      if (j < i && std::abs(values[j]) == std::abs(values[i])) return false;
    }
    return true;
  }
  static bool NearPeak(const std::vector<float>& values, int i, int reach) {
    const int n = static_cast<int>(values.size());
    for (int j = std::max(0, i - reach); j <= std::min(n - 1, i + reach); ++j) {
      if (values[j] != 0) return true;
    }
    return false;
  }

  double AngleBetween(int a, int b) const {
    const Eigen::Vector3d u = scan_.points[a] - scan_.Station(),
                          v = scan_.points[b] - scan_.Station();
    return u.cross(v).norm() * inverse_[a] * inverse_[b];
  }

  // Crossings of neighbouring lines that are each other's nearest, of one sign, make a polyline.
  void Link(const Crossings& crossings, Kind kind, std::vector<ScanEdge>* edges) const {
    std::vector<std::vector<int>> next(crossings.size());
    std::vector<std::vector<uint8_t>> has_previous(crossings.size());
    for (size_t line = 0; line < crossings.size(); ++line) {
      next[line].assign(crossings[line].size(), -1);
      has_previous[line].assign(crossings[line].size(), 0);
    }
    for (size_t line = 0; line + 1 < crossings.size(); ++line) {
      for (size_t i = 0; i < crossings[line].size(); ++i) {
        const int j = NearestIn(crossings[line + 1], crossings[line][i]);
        if (j < 0) continue;
        if (NearestIn(crossings[line], crossings[line + 1][j]) != static_cast<int>(i)) continue;
        next[line][i] = j;
        has_previous[line + 1][j] = 1;
      }
    }
    for (size_t line = 0; line < crossings.size(); ++line) {
      for (size_t i = 0; i < crossings[line].size(); ++i) {
        if (has_previous[line][i]) continue;
        std::vector<Eigen::Vector3d> chain;
        float strongest = 0;
        int at = static_cast<int>(i);
        for (size_t l = line; at >= 0; at = next[l][at], ++l) {
          chain.push_back(crossings[l][at].x_in_scan);
          strongest = std::max(strongest, std::abs(crossings[l][at].strength));
        }
        if (static_cast<int>(chain.size()) < options_.min_length || strongest < 1) continue;
        edges->push_back({kind, Smoothed(chain)});
      }
    }
  }

  static int NearestIn(const std::vector<Crossing>& line, const Crossing& crossing) {
    const auto begin = std::lower_bound(line.begin(), line.end(), crossing.at - 1.5f,
                                        [](const Crossing& c, float at) { return c.at < at; });
    int best = -1;
    float best_distance = 1.5f;
    for (auto c = begin; c != line.end() && c->at <= crossing.at + 1.5f; ++c) {
      const bool same_sign = (c->strength > 0) == (crossing.strength > 0);
      const float distance = std::abs(c->at - crossing.at);
      if (!same_sign || distance > best_distance) continue;
      best = static_cast<int>(c - line.begin());
      best_distance = distance;
    }
    return best;
  }

  // Each point is the mean of up to five around it, fewer towards the ends.
  static std::vector<Eigen::Vector3d> Smoothed(const std::vector<Eigen::Vector3d>& chain) {
    std::vector<Eigen::Vector3d> smooth(chain.size());
    const int n = static_cast<int>(chain.size());
    for (int i = 0; i < n; ++i) {
      const int reach = std::min({2, i, n - 1 - i});
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int j = i - reach; j <= i + reach; ++j) sum += chain[j];
      smooth[i] = sum / (2 * reach + 1);
    }
    return smooth;
  }

  const Scan& scan_;
  const ScanEdgeOptions& options_;
  std::vector<float> inverse_;  // 1 / range, 0 where missing
  std::vector<uint8_t> smooth_;
  cv::Mat1f across_, down_;  // slopes of the intensity, grey levels per sample
  double grey_noise_ = 0;
};

}  // namespace

std::vector<ScanEdge> FindScanEdges(const Scan& scan, const ScanEdgeOptions& options) {
  if (!scan.organised || scan.num_columns < 3 || scan.num_rows < 3) return {};
  return GridEdgeFinder(scan, options).Find();
}

}  // namespace roomtex
