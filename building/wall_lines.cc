#include "building/wall_lines.h"

#include <algorithm>
#include <cmath>

#include "core/frames.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

void FindStretches(const OutlineCloud& cloud, WallLine* wall) {
  std::vector<double> along;
  for (const Eigen::Vector2d& x : wall->points) along.push_back(wall->line.Direction().dot(x));
  std::sort(along.begin(), along.end());
  // Single points at the ends say little.
  const size_t skip = along.size() / 100;
  const double gap = std::max(5 * cloud.spacing, 1.5 * cloud.step);
  wall->stretches.clear();
  for (size_t i = skip; i + skip < along.size(); ++i) {
    if (wall->stretches.empty() || along[i] > wall->stretches.back().second + gap) {
      wall->stretches.emplace_back(along[i], along[i]);
    }
    wall->stretches.back().second = along[i];
  }
  // Points do not reach the very corner.
  for (auto& [low, high] : wall->stretches) {
    low -= std::min(cloud.spacing, 0.2 * cloud.step);
    high += std::min(cloud.spacing, 0.2 * cloud.step);
  }
}

// The angle between two lines, -45..45 degrees after quarter turns.
double QuarterTurnDifference(double a, double b) {
  double d = std::fmod(a - b, kPi / 2);
  if (d > kPi / 4) d -= kPi / 2;
  if (d < -kPi / 4) d += kPi / 2;
  return d;
}

double AngleOf(const WallLine& wall) {
  return std::atan2(wall.line.normal.y(), wall.line.normal.x());
}

double LengthOf(const WallLine& wall) {
  double length = 0;
  for (const auto& [low, high] : wall.stretches) length += high - low;
  return length;
}

void SetDirection(double angle, WallLine* wall) {
  const Eigen::Vector2d old = wall->line.normal;
  Eigen::Vector2d normal(std::cos(angle), std::sin(angle));
  if (normal.dot(old) < 0) normal = -normal;
  wall->line.normal = normal;
}

// Turns lines to the directions that most of the walls agree in.
void MakeRightAngles(const OutlineCloud& cloud, std::vector<WallLine>* walls) {
  std::vector<bool> done(walls->size(), false);
  for (;;) {
    // The longest wall that is left tells the direction of a family.
    size_t longest = walls->size();
    for (size_t i = 0; i < walls->size(); ++i) {
      if (done[i]) continue;
      if (longest == walls->size() || LengthOf((*walls)[i]) > LengthOf((*walls)[longest]))
        longest = i;
    }
    if (longest == walls->size()) return;
    double angle = AngleOf((*walls)[longest]);
    std::vector<size_t> family;
    for (int round = 0; round < 3; ++round) {
      family.clear();
      double sum = 0, weights = 0;
      for (size_t i = 0; i < walls->size(); ++i) {
        if (done[i]) continue;
        const WallLine& wall = (*walls)[i];
        const double d = QuarterTurnDifference(AngleOf(wall), angle);
        const double allowed = std::clamp(3 * wall.sigma_angle, RadFromDeg(0.4), RadFromDeg(3));
        if (std::abs(d) > allowed && i != longest) continue;
        family.push_back(i);
        const double weight = 1 / std::max(wall.sigma_angle * wall.sigma_angle, 1e-10);
        sum += weight * d;
        weights += weight;
      }
      angle += sum / weights;
    }
    for (const size_t i : family) {
      WallLine& wall = (*walls)[i];
      const double d = QuarterTurnDifference(AngleOf(wall), angle);
      SetDirection(AngleOf(wall) - d, &wall);
      FitWallLine(cloud, true, &wall);
      FindStretches(cloud, &wall);
      done[i] = true;
    }
  }
}

bool SameLine(const OutlineCloud& cloud, const WallLine& a, const WallLine& b) {
  const double cosine = a.line.normal.dot(b.line.normal);
  if (std::abs(cosine) < std::cos(RadFromDeg(4))) return false;
  if (a.oriented && b.oriented && cosine < 0) return false;
  // Both where the other one is, and no step between them.
  const double limit = std::max(2.5 * (a.rms + b.rms) / 2, cloud.step / 15);
  const auto off = [limit](const WallLine& line, const WallLine& other) {
    const Eigen::Vector2d middle =
        other.line.normal * other.line.offset + other.line.Direction() * other.middle;
    return std::abs(line.line.SignedDistance(middle)) > limit;
  };
  return !off(a, b) && !off(b, a);
}

double OverlapOf(const WallLine& a, const WallLine& b) {
  // Each counts its stretches along its own direction, from a foot of its own: far from the origin
  // of the coordinates, lines that are hardly turned count from feet that lie metres apart.
  const Eigen::Vector2d foot = b.line.normal * b.line.offset;
  const auto along_a = [&](double along_b) {
    return a.line.Direction().dot(foot + along_b * b.line.Direction());
  };
  double overlap = 0;
  for (const auto& [low, high] : a.stretches) {
    for (const auto& [first, second] : b.stretches) {
      const auto [from, to] = std::minmax({along_a(first), along_a(second)});
      overlap += std::max(0.0, std::min(high, to) - std::max(low, from));
    }
  }
  return overlap;
}

// A row of windows or of sills: nearly parallel to a longer wall, close to it, and beside it.
bool IsReliefOf(const OutlineCloud& cloud, const WallLine& wall, const WallLine& small) {
  if (std::abs(wall.line.normal.dot(small.line.normal)) < std::cos(RadFromDeg(10))) return false;
  if (wall.oriented && small.oriented && wall.line.normal.dot(small.line.normal) < 0) return false;
  const Eigen::Vector2d middle =
      small.line.normal * small.line.offset + small.line.Direction() * small.middle;
  return std::abs(wall.line.SignedDistance(middle)) < 0.25 * cloud.step &&
         OverlapOf(wall, small) > 0.5 * LengthOf(small) && small.points.size() < wall.points.size();
}

}  // namespace

SegmentRole RoleOf(const OutlineCloud& cloud, const GroundPlane& ground,
                   const PlaneSegment& segment) {
  std::vector<double> heights;
  for (const int i : segment.points) {
    const Eigen::Vector3d& x = cloud.points[static_cast<size_t>(i)];
    heights.push_back(x.z() - ground.HeightAt(x.head<2>()));
  }
  const double low = Quantile(&heights, 0.02), high = Quantile(&heights, 0.98);
  const double along = std::abs(segment.plane.normal.z());
  if (along < std::sin(RadFromDeg(8))) {
    const bool is_wall = high > 1.2 * cloud.step && high - low > 0.7 * cloud.step;
    return is_wall ? SegmentRole::kWall : SegmentRole::kOther;
  }
  const bool is_roof = along > std::cos(RadFromDeg(72)) && Median(&heights) > 1.2 * cloud.step &&
                       low > 0.5 * cloud.step && segment.area > 2 * cloud.step * cloud.step;
  return is_roof ? SegmentRole::kRoof : SegmentRole::kOther;
}

double WallLine::CoveredShare(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  double from = line.Direction().dot(a), to = line.Direction().dot(b);
  if (from > to) std::swap(from, to);
  double covered = 0;
  for (const auto& [low, high] : stretches) {
    covered += std::max(0.0, std::min(high, to) - std::max(low, from));
  }
  return to > from ? covered / (to - from) : 0;
}

void FitWallLine(const OutlineCloud& cloud, bool fixed_direction, WallLine* wall) {
  const double floor_rms = PlaneTolerance(cloud) / 7;
  std::vector<double> weights(wall->points.size(), 1.0);
  for (int round = 0; round < 6; ++round) {
    double sum = 0;
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    for (size_t i = 0; i < wall->points.size(); ++i) {
      centre += weights[i] * wall->points[i];
      sum += weights[i];
    }
    centre /= sum;
    double xx = 0, xy = 0, yy = 0;
    for (size_t i = 0; i < wall->points.size(); ++i) {
      const Eigen::Vector2d d = wall->points[i] - centre;
      xx += weights[i] * d.x() * d.x();
      xy += weights[i] * d.x() * d.y();
      yy += weights[i] * d.y() * d.y();
    }
    if (!fixed_direction) {
      // The direction of the largest spread, and the normal at its right.
      SetDirection(0.5 * std::atan2(2 * xy, xx - yy) - kPi / 2, wall);
    }
    const Eigen::Vector2d n = wall->line.normal, u = wall->line.Direction();
    wall->line.offset = n.dot(centre);
    wall->middle = u.dot(centre);
    std::vector<double> residuals;
    for (const Eigen::Vector2d& x : wall->points) residuals.push_back(wall->line.SignedDistance(x));
    const double scale =
        std::max(floor_rms, kSigmaPerMad * MedianAbsoluteDeviation(residuals, 0.0));
    for (size_t i = 0; i < residuals.size(); ++i) {
      const double root = TukeyRootWeight(residuals[i], 3 * scale);
      weights[i] = std::max(1e-6, root * root);
    }
    const double independent = std::max(2.0, sum / kPointsPerIndependent);
    const double spread = std::sqrt(
        std::max(1e-12, (u.x() * u.x() * xx + 2 * u.x() * u.y() * xy + u.y() * u.y() * yy) / sum));
    wall->rms = scale;
    wall->sigma_offset = scale / std::sqrt(independent);
    wall->sigma_angle = wall->sigma_offset / spread;
  }
}

std::vector<WallLine> FindWallLines(const OutlineCloud& cloud, const GroundPlane& ground,
                                    const std::vector<PlaneSegment>& segments,
                                    const std::vector<int>& group, bool right_angles) {
  std::vector<WallLine> walls;
  for (const int s : group) {
    const PlaneSegment& segment = segments[static_cast<size_t>(s)];
    if (RoleOf(cloud, ground, segment) != SegmentRole::kWall) continue;
    WallLine wall;
    wall.line.normal = segment.plane.normal.head<2>().normalized();
    wall.oriented = segment.oriented;
    for (const int i : segment.points) {
      wall.points.push_back(cloud.points[static_cast<size_t>(i)].head<2>());
    }
    FitWallLine(cloud, false, &wall);
    FindStretches(cloud, &wall);
    if (LengthOf(wall) < 0.6 * cloud.step) continue;
    walls.push_back(std::move(wall));
  }
  // The longest first takes in what lies along it.
  std::stable_sort(walls.begin(), walls.end(),
                   [](const WallLine& a, const WallLine& b) { return LengthOf(a) > LengthOf(b); });
  for (size_t i = 0; i < walls.size(); ++i) {
    for (size_t j = i + 1; j < walls.size();) {
      if (!SameLine(cloud, walls[i], walls[j])) {
        ++j;
        continue;
      }
      walls[i].points.insert(walls[i].points.end(), walls[j].points.begin(), walls[j].points.end());
      walls[i].oriented = walls[i].oriented || walls[j].oriented;
      walls.erase(walls.begin() + static_cast<std::ptrdiff_t>(j));
      FitWallLine(cloud, false, &walls[i]);
      FindStretches(cloud, &walls[i]);
    }
  }
  for (size_t i = 0; i < walls.size(); ++i) {
    const bool is_relief = std::any_of(walls.begin(), walls.end(), [&](const WallLine& wall) {
      return &wall != &walls[i] && IsReliefOf(cloud, wall, walls[i]);
    });
    if (!is_relief) continue;
    walls.erase(walls.begin() + static_cast<std::ptrdiff_t>(i));
    --i;
  }
  if (right_angles) MakeRightAngles(cloud, &walls);
  return walls;
}

}  // namespace roomtex
