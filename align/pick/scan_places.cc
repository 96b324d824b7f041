#include "align/pick/scan_places.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "align/trust/scan_view.h"
#include "core/similarity.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// A place counts as at a sample when it is this near to it, in samples.
constexpr double kAtSample = 1e-6;
constexpr int kMaxSnap = 60;         // samples; farther away nothing is offered
constexpr int kThinSamples = 20000;  // that the search for a direction starts from
constexpr double kMaxOffGrid = 3;    // steps between samples that a direction may be off
constexpr double kSlack = 1e-6;      // share of a cell that its solution may be outside
constexpr double kSparse = 0.05;     // rows and columns at the rim with fewer samples are cut off
constexpr double kMaxRowsMissing = 0.02;  // of all: rows with fewer neighbours do not tell steps

// What the neighbours in the grid say about how it lies before the viewer.
struct Layout {
  double column_step = 0, row_step = 0;  // radians
  double rightness = 0;                  // > 0: columns run to the viewer's right
};

Layout FindLayout(const Scan& scan) {
  const int columns = scan.num_columns, rows = scan.num_rows;
  const Eigen::Vector3d station = scan.Station();
  const int column_stride = columns / 200 + 1, row_stride = rows / 200 + 1;
  std::vector<double> row_steps, steps_of_rows;
  Layout layout;
  for (int row = 0; row < rows; row += row_stride) {
    std::vector<double> steps;
    for (int column = 0; column + 1 < columns; column += column_stride) {
      const int i = scan.Index(column, row);
      if (scan.IsMissing(i)) continue;
      const Eigen::Vector3d d = (scan.points[i] - station).normalized();
      const bool has_right = !scan.IsMissing(i + 1);
      const bool has_down = row + 1 < rows && !scan.IsMissing(i + columns);
      Eigen::Vector3d right = d, down = d;
      if (has_right) {
        right = (scan.points[i + 1] - station).normalized();
        steps.push_back(AngleBetween(d, right));
      }
      if (has_down) {
        down = (scan.points[i + columns] - station).normalized();
        row_steps.push_back(AngleBetween(d, down));
      }
      // Right = down x forward for who looks that way.
      if (has_right && has_down) {
        layout.rightness += (right - d).dot((down - d).cross(d)) > 0 ? 1 : -1;
      }
    }
    if (steps.size() > kMaxRowsMissing * columns / column_stride) {
      steps_of_rows.push_back(Median(&steps));
    }
  }
  layout.row_step = Median(&row_steps);
  if (!steps_of_rows.empty()) {
    // Columns meet at the poles; near the horizon they are farthest apart.
    layout.column_step = AtRank(&steps_of_rows, steps_of_rows.size() * 95 / 100);
  }
  return layout;
}

// As BuildScanMesh sees it: in most rows the first and the last sample are neighbours.
bool IsFullTurn(const Scan& scan) {
  if (scan.num_columns < 8) return false;
  int near = 0, far = 0;
  for (int row = 0; row < scan.num_rows; row += scan.num_rows / 200 + 1) {
    const int first = scan.Index(0, row), second = scan.Index(1, row);
    const int last = scan.Index(scan.num_columns - 1, row);
    if (scan.IsMissing(first) || scan.IsMissing(second) || scan.IsMissing(last)) continue;
    const Eigen::Vector3d d = scan.points[first] - scan.Station();
    const double step = AngleBetween(d, scan.points[second] - scan.Station());
    const double seam = AngleBetween(d, scan.points[last] - scan.Station());
    (seam < 2.5 * step ? near : far) += 1;
  }
  return near > far;
}

}  // namespace

ScanPlaces::ScanPlaces(const Scan& scan)
    : scan_(scan), closed_(IsFullTurn(scan)), smooth_(FindSmoothSamples(scan)) {
  const Layout layout = FindLayout(scan);
  flipped_ = layout.rightness < 0;
  column_step_ = layout.column_step;
  row_step_ = layout.row_step;
  if (column_step_ > 0 && row_step_ > 0) {
    aspect_ = std::clamp(row_step_ / column_step_, 0.1, 10.0);
  }
  const double share = static_cast<double>(scan.points.size()) / kThinSamples;
  thin_ = std::max(1, static_cast<int>(std::ceil(std::sqrt(share))));
  for (int row = thin_ / 2; row < scan.num_rows; row += thin_) {
    for (int column = thin_ / 2; column < scan.num_columns; column += thin_) {
      const int sample = scan.Index(column, row);
      if (scan.IsMissing(sample)) continue;
      thin_samples_.push_back(sample);
      thin_directions_.push_back(DirectionOf(sample).cast<float>());
    }
  }
}

Eigen::Vector2d ScanPlaces::GridFromPicture(const Eigen::Vector2d& place) const {
  return {flipped_ ? width() - 0.5 - place.x() : place.x() - 0.5, place.y() - 0.5};
}

Eigen::Vector2d ScanPlaces::PictureFromGrid(const Eigen::Vector2d& at) const {
  double x = flipped_ ? width() - 0.5 - at.x() : at.x() + 0.5;
  if (closed_ && x < 0) x += width();
  if (closed_ && x > width()) x -= width();
  return {std::clamp(x, 0.0, static_cast<double>(width())),
          std::clamp(at.y() + 0.5, 0.0, static_cast<double>(height()))};
}

// -1 beside the grid.
int ScanPlaces::WrappedColumn(int column) const {
  if (closed_) return (column % width() + width()) % width();
  return column < 0 || column >= width() ? -1 : column;
}

Eigen::Vector3d ScanPlaces::DirectionOf(int sample) const {
  return (scan_.points[sample] - scan_.Station()).normalized();
}

std::array<int, 4> ScanPlaces::Content() const {
  std::vector<int> in_column(width(), 0), in_row(height(), 0);
  for (int row = 0; row < height(); ++row) {
    for (int column = 0; column < width(); ++column) {
      if (scan_.IsMissing(SampleAt(column, row))) continue;
      ++in_column[column];
      ++in_row[row];
    }
  }
  // of: how many a full one has.
  const auto between = [](const std::vector<int>& counts, int of) {
    const auto holds_some = [&](int count) { return count >= kSparse * of; };
    const auto first = std::find_if(counts.begin(), counts.end(), holds_some);
    const auto last = std::find_if(counts.rbegin(), counts.rend(), holds_some).base();
    const bool any = first < last;
    return std::array<int, 2>{
        any ? static_cast<int>(first - counts.begin()) : 0,
        static_cast<int>(any ? last - counts.begin() : counts.end() - counts.begin())};
  };
  const auto [left, right] = between(in_column, height());
  const auto [top, bottom] = between(in_row, width());
  return {left, top, right, bottom};
}

ScanPlaces::Found ScanPlaces::PointAt(const Eigen::Vector2d& place) const {
  Found found;
  const bool inside =
      place.x() >= 0 && place.y() >= 0 && place.x() <= width() && place.y() <= height();
  if (!inside) {
    found.reason = Reason::kOutside;
    return found;
  }
  Eigen::Vector2d at = GridFromPicture(place);
  // Half a sample along the border has no neighbour beyond.
  if (!closed_) at.x() = std::clamp(at.x(), 0.0, width() - 1.0);
  at.y() = std::clamp(at.y(), 0.0, height() - 1.0);
  const int left = static_cast<int>(std::floor(at.x()));
  const int top = static_cast<int>(std::floor(at.y()));
  const double s = at.x() - left, t = at.y() - top;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < 4; ++k) {
    const double weight = (k % 2 == 0 ? 1 - s : s) * (k / 2 == 0 ? 1 - t : t);
    if (weight < kAtSample) continue;
    const int sample = scan_.Index(WrappedColumn(left + k % 2), top + k / 2);
    if (scan_.IsMissing(sample)) {
      found.reason = Reason::kMissing;
    } else if (!IsSmooth(sample) && found.reason == Reason::kNone) {
      found.reason = Reason::kDepthEdge;
    }
    sum += weight * scan_.points[sample];
    found.x_in_scan = sum;
  }
  if (found.reason != Reason::kNone) {
    found.x_in_scan.setZero();
    found.snap = FindSnap(at);
    return found;
  }
  // Weights below kAtSample are missing in the sum.
  double total = 0;
  for (int k = 0; k < 4; ++k) {
    const double weight = (k % 2 == 0 ? 1 - s : s) * (k / 2 == 0 ? 1 - t : t);
    if (weight >= kAtSample) total += weight;
  }
  found.x_in_scan = sum / total;
  found.range = (found.x_in_scan - scan_.Station()).norm();
  return found;
}

std::optional<ScanPlaces::Snap> ScanPlaces::FindSnap(const Eigen::Vector2d& at) const {
  const int column = static_cast<int>(std::lround(at.x()));
  const int row = static_cast<int>(std::lround(at.y()));
  double nearest = std::numeric_limits<double>::infinity();
  std::optional<Snap> snap;
  for (int ring = 0; ring <= kMaxSnap && ring - 1 < nearest; ++ring) {
    for (int r = std::max(row - ring, 0); r <= std::min(row + ring, height() - 1); ++r) {
      const bool whole = std::abs(r - row) == ring;
      for (int c = column - ring; c <= column + ring; c += whole || ring == 0 ? 1 : 2 * ring) {
        const int wrapped = WrappedColumn(c);
        if (wrapped < 0) continue;
        const int sample = scan_.Index(wrapped, r);
        const double distance = (Eigen::Vector2d(c, r) - at).norm();
        if (!IsSmooth(sample) || distance >= nearest) continue;
        nearest = distance;
        snap = Snap{PictureFromGrid({wrapped, r}), scan_.points[sample]};
      }
    }
  }
  return snap;
}

// -1 without samples.
int ScanPlaces::NearestSample(const Eigen::Vector3d& direction) const {
  const Eigen::Vector3f d = direction.cast<float>();
  float best_dot = -2;
  int best = -1;
  for (size_t i = 0; i < thin_samples_.size(); ++i) {
    const float dot = thin_directions_[i].dot(d);
    if (dot <= best_dot) continue;
    best_dot = dot;
    best = thin_samples_[i];
  }
  double distance = std::numeric_limits<double>::infinity();
  while (best >= 0) {  // uphill in windows that reach from one thin sample to the next
    const int column = best % width(), row = best / width();
    int next = -1;
    for (int r = std::max(row - thin_, 0); r <= std::min(row + thin_, height() - 1); ++r) {
      for (int c = column - thin_; c <= column + thin_; ++c) {
        const int wrapped = WrappedColumn(c);
        if (wrapped < 0) continue;
        const int sample = scan_.Index(wrapped, r);
        if (scan_.IsMissing(sample)) continue;
        const double d2 = (DirectionOf(sample) - direction).squaredNorm();
        if (d2 >= distance) continue;
        distance = d2;
        next = sample;
      }
    }
    if (next < 0) break;
    best = next;
  }
  return best;
}

// Position in the grid where the bilinear surface of the cell meets the ray; none if it passes by.
std::optional<Eigen::Vector2d> ScanPlaces::SolveInCell(int column, int row,
                                                       const Eigen::Vector3d& direction) const {
  const int left = WrappedColumn(column), right = WrappedColumn(column + 1);
  if (left < 0 || right < 0 || row < 0 || row + 1 >= height()) return std::nullopt;
  Eigen::Vector3d corners[4];
  for (int k = 0; k < 4; ++k) {
    const int sample = scan_.Index(k % 2 == 0 ? left : right, row + k / 2);
    if (scan_.IsMissing(sample)) return std::nullopt;
    corners[k] = scan_.points[sample] - scan_.Station();
  }
  const Eigen::Vector3d u = direction.unitOrthogonal(), v = direction.cross(u);
  double s = 0.5, t = 0.5;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d x = (1 - t) * ((1 - s) * corners[0] + s * corners[1]) +
                              t * ((1 - s) * corners[2] + s * corners[3]);
    const Eigen::Vector3d ds = (1 - t) * (corners[1] - corners[0]) + t * (corners[3] - corners[2]);
    const Eigen::Vector3d dt = (1 - s) * (corners[2] - corners[0]) + s * (corners[3] - corners[1]);
    Eigen::Matrix2d jacobian;
    jacobian << u.dot(ds), u.dot(dt), v.dot(ds), v.dot(dt);
    const double determinant = jacobian.determinant();
    if (!(std::abs(determinant) > 1e-18)) return std::nullopt;
    const Eigen::Vector2d step = jacobian.inverse() * Eigen::Vector2d(u.dot(x), v.dot(x));
    s = std::clamp(s - step.x(), -1.0, 2.0);
    t = std::clamp(t - step.y(), -1.0, 2.0);
    if (step.norm() < 1e-12) break;
  }
  const bool inside = s >= -kSlack && s <= 1 + kSlack && t >= -kSlack && t <= 1 + kSlack;
  if (!inside) return std::nullopt;
  return Eigen::Vector2d(column + s, row + t);
}

// Position in the grid by the direction of one sample and the steps between samples.
Eigen::Vector2d ScanPlaces::BesideSample(int sample, const Eigen::Vector3d& direction) const {
  const int column = sample % width(), row = sample / width();
  const Eigen::Vector3d d = DirectionOf(sample), offset = direction - d;
  const auto step_to = [&](int columns, int rows) -> Eigen::Vector3d {
    for (const int sign : {1, -1}) {
      const int c = WrappedColumn(column + sign * columns), r = row + sign * rows;
      if (c < 0 || r < 0 || r >= height() || scan_.IsMissing(scan_.Index(c, r))) continue;
      return sign * (DirectionOf(scan_.Index(c, r)) - d);
    }
    return Eigen::Vector3d::Zero();
  };
  const Eigen::Vector3d right = step_to(1, 0), down = step_to(0, 1);
  const auto along = [&](const Eigen::Vector3d& step) {
    const double length2 = step.squaredNorm();
    return length2 > 0 ? std::clamp(offset.dot(step) / length2, -kMaxOffGrid, kMaxOffGrid) : 0.0;
  };
  return {column + along(right), row + along(down)};
}

std::optional<Eigen::Vector2d> ScanPlaces::PlaceOf(const Eigen::Vector3d& x_in_scan) const {
  const Eigen::Vector3d offset = x_in_scan - scan_.Station();
  if (!(offset.norm() > 0) || !offset.allFinite()) return std::nullopt;
  const Eigen::Vector3d direction = offset.normalized();
  const int nearest = NearestSample(direction);
  if (nearest < 0) return std::nullopt;
  const int column = nearest % width(), row = nearest / width();
  for (int k = 0; k < 4; ++k) {
    const auto at = SolveInCell(column - k % 2, row - k / 2, direction);
    if (at) return PictureFromGrid(*at);
  }
  const double off = AngleBetween(direction, DirectionOf(nearest));
  // Holes where nothing was measured may be many samples wide.
  if (off > kMaxSnap * std::max(column_step_, row_step_)) return std::nullopt;
  return PictureFromGrid(BesideSample(nearest, direction));
}

}  // namespace roomtex
