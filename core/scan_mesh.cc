#include "core/scan_mesh.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"
#include "core/option_fields.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

// What the connection tests need of a sample: its direction from the scanner and its range (0 =
// missing).
struct Ray {
  Eigen::Vector3f direction = Eigen::Vector3f::Zero();
  float range = 0;
};

class GridConnector {
 public:
  GridConnector(const Scan& scan, const ScanMeshOptions& options)
      : scan_(scan), options_(options), rays_(scan.points.size()) {
    for (size_t i = 0; i < rays_.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      const Eigen::Vector3d offset = scan.points[i] - scan.Station();
      const double range = offset.norm();
      if (range > 0) rays_[i] = {(offset / range).cast<float>(), static_cast<float>(range)};
    }
    closed_ = IsFullTurn();
    range_noise_ = EstimateRangeNoise();
  }

  bool closed() const { return closed_; }

  bool IsMeasured(int column, int row) const { return rays_[Index(column, row)].range > 0; }

  // The sample at (column, row) and its neighbour at (column + dc, row + dr), dc and dr 0 or +-1,
  // lie on one surface.
  bool AreConnected(int column, int row, int dc, int dr) const {
    const Ray& a = rays_[Index(column, row)];
    const Ray& b = rays_[Index(column + dc, row + dr)];
    if (!(a.range > 0) || !(b.range > 0)) return false;
    const float nearer = std::min(a.range, b.range);
    // Close to the scanner, and around its zenith, neighbouring rays span less than the noise.
    const float noise = std::min(range_noise_, kLargestNoise * nearer);
    if (std::abs(a.range - b.range) <= kNoiseOfTwo * noise) return true;
    const float chord = (a.direction - b.direction).norm();
    const float facing_length = chord * nearer;
    const float length = (a.range * a.direction - b.range * b.direction).norm();
    if (!(facing_length > 0)) return false;
    const float ratio = length / facing_length;
    if (ratio > options_.max_edge_ratio) return false;
    if (ratio <= kFacingRatio) return true;
    // On a plane the inverse range changes evenly from ray to ray; over a jump it does not.
    const float step = 1 / b.range - 1 / a.range;
    const float tolerance =
        options_.max_bend * std::abs(step) + kNoiseOfFour * noise / (nearer * nearer);
    return Continues(column - dc, row - dr, 1 / a.range, step, +1, tolerance) ||
           Continues(column + 2 * dc, row + 2 * dr, 1 / b.range, step, -1, tolerance);
  }

 private:
  static constexpr float kFacingRatio = 3.0f;
  // Limits in standard deviations of one range: 4.2 of a difference of two ranges, 3 of a
  // difference of two such differences (one side of two must hold).
  static constexpr float kNoiseOfTwo = 6.0f, kNoiseOfFour = 7.0f;
  static constexpr float kLargestNoise = 0.005f;  // share of the range; rough scenes look noisy

  int Index(int column, int row) const {
    if (closed_) column = (column + scan_.num_columns) % scan_.num_columns;
    return scan_.Index(column, row);
  }

  // The step between the sample at (column, row), just outside the edge, and the end of the edge
  // with inverse range `end` is about `step` as well. side: +1 before the edge, -1 behind it.
  bool Continues(int column, int row, float end, float step, int side, float tolerance) const {
    if (row < 0 || row >= scan_.num_rows) return false;
    if (!closed_ && (column < 0 || column >= scan_.num_columns)) return false;
    const Ray& outside = rays_[Index(column, row)];
    if (!(outside.range > 0)) return false;
    const float outside_step = side * (end - 1 / outside.range);
    return std::abs(outside_step - step) <= tolerance;
  }

  // Standard deviation of one range. On a plane the inverse range of three neighbours in a row
  // changes almost evenly whatever the angle, so that most second differences are noise (their
  // median is used).
  float EstimateRangeNoise() const {
    std::vector<float> differences;
    const size_t stride = rays_.size() / 1000000 + 1;
    for (size_t i = 1; i + 1 < rays_.size(); i += stride) {
      const size_t column = i % scan_.num_columns;
      if (column == 0 || column + 1 == static_cast<size_t>(scan_.num_columns)) continue;
      const float before = rays_[i - 1].range, at = rays_[i].range, behind = rays_[i + 1].range;
      if (!(before > 0) || !(at > 0) || !(behind > 0)) continue;
      differences.push_back(std::abs(1 / before - 2 / at + 1 / behind) * at * at);
    }
    if (differences.size() < 100) return 0;
    // The second difference has 1 + 4 + 1 = 6 variances.
    return Median(&differences) / static_cast<float>(kMadPerSigma) / std::sqrt(6.0f);
  }

  // The last and the first column are as near as two neighbouring columns (median over the rows).
  bool IsFullTurn() const {
    if (scan_.num_columns < 16) return false;
    std::vector<float> inside, across;
    for (int row = 0; row < scan_.num_rows; ++row) {
      const Ray& first = rays_[scan_.Index(0, row)];
      const Ray& second = rays_[scan_.Index(1, row)];
      const Ray& last = rays_[scan_.Index(scan_.num_columns - 1, row)];
      if (first.range > 0 && second.range > 0) {
        inside.push_back((first.direction - second.direction).norm());
      }
      if (first.range > 0 && last.range > 0) {
        across.push_back((first.direction - last.direction).norm());
      }
    }
    if (inside.size() < 8 || across.size() < 8) return false;
    const float inside_chord = Median(&inside), across_chord = Median(&across);
    return across_chord < 1.75f * inside_chord && across_chord > 0.25f * inside_chord;
  }

  const Scan& scan_;
  const ScanMeshOptions& options_;
  std::vector<Ray> rays_;
  bool closed_ = false;
  float range_noise_ = 0;  // standard deviation, metres
};

// Turns the triangle so that its front faces the scanner.
Triangle FacingStation(const Scan& scan, Triangle triangle) {
  const Eigen::Vector3d& a = scan.points[triangle[0]];
  const Eigen::Vector3d normal = (scan.points[triangle[1]] - a).cross(scan.points[triangle[2]] - a);
  if (normal.dot(scan.Station() - a) < 0) std::swap(triangle[1], triangle[2]);
  return triangle;
}

}  // namespace

void ScanMeshOptions::Declare(OptionFields* fields) {
  fields
      ->Number("Mesh.max_edge_ratio", &max_edge_ratio,
               "Neighbouring samples are connected if they are at most this many times as far "
               "apart as on a surface that faces the scanner. Larger = connects over larger "
               "depth steps.")
      .Above(1);
  fields
      ->Number("Mesh.max_bend", &max_bend,
               "An edge on a slanted surface is kept if the step in inverse range beside it "
               "differs by at most this share. Larger = more tolerant.")
      .NotNegative();
}

std::vector<std::string> ScanMeshOptions::Problems() const { return ProblemsOf(*this); }

std::vector<Triangle> BuildScanMesh(const Scan& scan, const ScanMeshOptions& options) {
  if (!scan.organised) return scan.triangles;
  std::vector<Triangle> triangles;
  if (scan.num_columns < 2 || scan.num_rows < 2) return triangles;
  const GridConnector connector(scan, options);
  const int num_quads = connector.closed() ? scan.num_columns : scan.num_columns - 1;
  for (int row = 0; row + 1 < scan.num_rows; ++row) {
    for (int column = 0; column < num_quads; ++column) {
      const int right = (column + 1) % scan.num_columns;
      // Corners 0 1 / 3 2 (upper left, upper right, lower right, lower left), edges between
      // neighbours.
      const int corner[4] = {scan.Index(column, row), scan.Index(right, row),
                             scan.Index(right, row + 1), scan.Index(column, row + 1)};
      const bool top = connector.AreConnected(column, row, 1, 0);
      const bool bottom = connector.AreConnected(column, row + 1, 1, 0);
      const bool left = connector.AreConnected(column, row, 0, 1);
      const bool right_side = connector.AreConnected(right, row, 0, 1);
      const bool down = connector.AreConnected(column, row, 1, 1);     // 0-2
      const bool up = connector.AreConnected(column, row + 1, 1, -1);  // 3-1
      const double down_length = (scan.points[corner[0]] - scan.points[corner[2]]).squaredNorm();
      const double up_length = (scan.points[corner[1]] - scan.points[corner[3]]).squaredNorm();
      const bool upper_right = top && right_side && down, lower_left = left && bottom && down;
      const bool upper_left = top && left && up, lower_right = right_side && bottom && up;
      const int with_down = upper_right + lower_left, with_up = upper_left + lower_right;
      const bool take_down =
          with_down != with_up ? with_down > with_up : !(up_length < down_length);
      const auto add = [&](bool wanted, int a, int b, int c) {
        if (wanted) triangles.push_back(FacingStation(scan, {corner[a], corner[b], corner[c]}));
      };
      if (take_down) {
        add(upper_right, 0, 2, 1);
        add(lower_left, 0, 3, 2);
      } else {
        add(upper_left, 0, 3, 1);
        add(lower_right, 1, 3, 2);
      }
    }
  }
  return triangles;
}

std::vector<Eigen::Vector3f> VertexNormals(const Scan& scan,
                                           const std::vector<Triangle>& triangles) {
  std::vector<Eigen::Vector3f> normals(scan.points.size(), Eigen::Vector3f::Zero());
  for (const Triangle& t : triangles) {
    const Eigen::Vector3d& a = scan.points[t[0]];
    const Eigen::Vector3f doubled_area =
        (scan.points[t[1]] - a).cross(scan.points[t[2]] - a).cast<float>();
    for (int corner : t) normals[corner] += doubled_area;
  }
  for (Eigen::Vector3f& normal : normals) {
    const float length = normal.norm();
    if (length > 0) normal /= length;
  }
  return normals;
}

SurfaceProbes SpreadProbes(const std::vector<Eigen::Vector3d>& points,
                           const std::vector<Triangle>& triangles, int max_count) {
  SurfaceProbes probes;
  double total = 0;
  for (const Triangle& t : triangles) {
    const double area =
        0.5 * (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]).norm();
    if (std::isfinite(area)) total += area;
  }
  if (!(total > 0)) return probes;
  const double area_per_probe = total / max_count;
  // Roberts' R2 sequence inside the triangles: even, and the same in every run.
  constexpr double kStepX = 0.7548776662466927, kStepY = 0.5698402909980532;
  double owed = 0.5 * area_per_probe, x = 0.5, y = 0.5;
  for (const Triangle& t : triangles) {
    const Eigen::Vector3d a = points[t[0]], ab = points[t[1]] - a, ac = points[t[2]] - a;
    const Eigen::Vector3d normal = ab.cross(ac);
    const double area = 0.5 * normal.norm();
    if (!std::isfinite(area)) continue;
    for (owed += area; owed >= area_per_probe; owed -= area_per_probe) {
      x = std::fmod(x + kStepX, 1.0);
      y = std::fmod(y + kStepY, 1.0);
      const bool beyond = x + y > 1;
      probes.points.push_back(a + (beyond ? 1 - x : x) * ab + (beyond ? 1 - y : y) * ac);
      probes.normals.push_back(normal.normalized().cast<float>());
    }
  }
  return probes;
}

}  // namespace roomtex
