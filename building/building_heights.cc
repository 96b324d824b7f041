#include "building/building_heights.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "core/frames.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"
#include "core/text.h"

namespace roomtex {
namespace {

// z = height + gradient . (x - centre), robustly.
struct HeightFit {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero(), gradient = Eigen::Vector2d::Zero();
  double height = 0, rms = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of height and gradient
  int num_points = 0;

  double HeightAt(const Eigen::Vector2d& x) const { return height + gradient.dot(x - centre); }
  double SigmaAt(const Eigen::Vector2d& x) const {
    const Eigen::Vector3d row(1, x.x() - centre.x(), x.y() - centre.y());
    return std::sqrt(std::max(0.0, row.dot(covariance * row)));
  }
};

// directions: the columns along which it may slope (2 x 0: level, 2 x 1, 2 x 2).
HeightFit FitHeights(const std::vector<Eigen::Vector3d>& points, const Eigen::Matrix2Xd& directions,
                     double floor_rms) {
  HeightFit fit;
  fit.num_points = static_cast<int>(points.size());
  for (const Eigen::Vector3d& x : points) fit.centre += x.head<2>();
  fit.centre /= static_cast<double>(points.size());
  const int free = static_cast<int>(directions.cols());
  std::vector<double> weights(points.size(), 1.0);
  for (int round = 0; round < 6; ++round) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(1 + free, 1 + free);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(1 + free);
    double sum = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      Eigen::VectorXd row(1 + free);
      row[0] = 1;
      row.tail(free) = directions.transpose() * (points[i].head<2>() - fit.centre);
      normal += weights[i] * row * row.transpose();
      right += weights[i] * points[i].z() * row;
      sum += weights[i];
    }
    normal.diagonal().array() += 1e-9 * sum;
    const Eigen::MatrixXd inverse = normal.inverse();
    const Eigen::VectorXd solution = inverse * right;
    fit.height = solution[0];
    fit.gradient = directions * solution.tail(free);
    std::vector<double> residuals;
    for (const Eigen::Vector3d& x : points) residuals.push_back(x.z() - fit.HeightAt(x.head<2>()));
    fit.rms = std::max(floor_rms, kSigmaPerMad * MedianAbsoluteDeviation(residuals, 0.0));
    for (size_t i = 0; i < residuals.size(); ++i) {
      const double root = TukeyRootWeight(residuals[i], 3 * fit.rms);
      weights[i] = std::max(1e-6, root * root);
    }
    Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(3, 1 + free);
    spread(0, 0) = 1;
    spread.bottomRightCorner(2, free) = directions;
    fit.covariance =
        fit.rms * fit.rms * kPointsPerIndependent * spread * inverse * spread.transpose();
  }
  return fit;
}

double DistanceToEdges(const std::vector<Eigen::Vector2d>& polygon, const Eigen::Vector2d& x) {
  double nearest = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double share = std::clamp((x - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (x - a - share * (b - a)).norm());
  }
  return nearest;
}

Eigen::AlignedBox2d BoxAround(const std::vector<Eigen::Vector2d>& polygon, double margin) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& corner : polygon) box.extend(corner);
  const Eigen::Vector2d more = Eigen::Vector2d::Constant(margin);
  return {box.min() - more, box.max() + more};
}

// The floor lies where the ground around the footprint is lowest.
void FindFloor(const OutlineCloud& cloud, const GroundPlane& ground, OutlineBuilding* building,
               BuildingEvidence* evidence) {
  const Eigen::AlignedBox2d box = BoxAround(building->footprint, 3 * cloud.step);
  const double near_ground = std::max(2.5 * PlaneTolerance(cloud), 0.2 * cloud.step);
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3d& x : cloud.points) {
    if (!box.contains(Eigen::Vector2d(x.head<2>()))) continue;
    if (std::abs(x.z() - ground.HeightAt(x.head<2>())) > near_ground) continue;
    if (IsInside(building->footprint, x.head<2>())) continue;
    points.push_back(x);
  }
  evidence->num_ground_points = static_cast<int>(points.size());
  double lowest = std::numeric_limits<double>::infinity();
  if (points.size() < 20) {
    for (const Eigen::Vector2d& corner : building->footprint) {
      lowest = std::min(lowest, ground.HeightAt(corner));
    }
    evidence->ground_sigma = near_ground;
    building->ground = lowest;
    return;
  }
  const double floor_rms = PlaneTolerance(cloud) / 7;
  HeightFit fit = FitHeights(points, Eigen::Matrix2d::Identity(), floor_rms);
  // A slope that may as well be none is none.
  const Eigen::Vector2d size = BoxAround(building->footprint, 0).sizes();
  const double rise = fit.gradient.norm() * size.norm() / 2;
  const double rise_sigma =
      size.norm() / 2 * std::sqrt(std::max(fit.covariance(1, 1), fit.covariance(2, 2)));
  if (rise < std::max(3 * rise_sigma, 0.5 * fit.rms)) {
    fit = FitHeights(points, Eigen::Matrix2Xd(2, 0), floor_rms);
  }
  for (const Eigen::Vector2d& corner : building->footprint) {
    lowest = std::min(lowest, fit.HeightAt(corner));
    evidence->ground_sigma = std::max(evidence->ground_sigma, fit.SigmaAt(corner));
  }
  building->ground = lowest;
}

// A roof falls square to a wall, and lies level where it nearly does.
HeightFit FitRoofPlane(const std::vector<Eigen::Vector3d>& points,
                       const std::vector<Eigen::Vector2d>& footprint, double floor_rms) {
  const HeightFit fit = FitHeights(points, Eigen::Matrix2d::Identity(), floor_rms);
  const double slope = fit.gradient.norm();
  const double sigma = std::sqrt(std::max(fit.covariance(1, 1), fit.covariance(2, 2)));
  if (slope < std::max(3 * sigma, std::tan(RadFromDeg(0.7)))) {
    return FitHeights(points, Eigen::Matrix2Xd(2, 0), floor_rms);
  }
  const double allowed = std::clamp(3 * sigma / slope, RadFromDeg(1), RadFromDeg(6));
  double best = allowed;
  Eigen::Vector2d direction = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < footprint.size(); ++i) {
    const Eigen::Vector2d along =
        (footprint[(i + 1) % footprint.size()] - footprint[i]).normalized();
    const Eigen::Vector2d across(along.y(), -along.x());
    const double angle = std::acos(std::min(1.0, std::abs(across.dot(fit.gradient)) / slope));
    if (angle < best) best = angle, direction = across;
  }
  return direction.isZero() ? fit : FitHeights(points, Eigen::Matrix2Xd(direction), floor_rms);
}

// The highest points of the walls, where no roof was seen.
bool FlatRoofFromWalls(const OutlineCloud& cloud, const GroundPlane& ground,
                       OutlineBuilding* building, BuildingEvidence* evidence) {
  const double near = 2 * PlaneTolerance(cloud);
  const Eigen::AlignedBox2d box = BoxAround(building->footprint, near);
  std::vector<double> heights;
  for (const Eigen::Vector3d& x : cloud.points) {
    if (!box.contains(Eigen::Vector2d(x.head<2>()))) continue;
    if (x.z() - ground.HeightAt(x.head<2>()) < 0.3 * cloud.step) continue;
    if (DistanceToEdges(building->footprint, x.head<2>()) < near) heights.push_back(x.z());
  }
  if (heights.size() < 10) return false;
  const double top = Quantile(&heights, 0.985);
  evidence->roof_sigma = std::max(top - Quantile(&heights, 0.95), cloud.step / 10);
  building->roof = {RoofPlane::FromGradient(
      {building->footprint[0].x(), building->footprint[0].y(), top}, Eigen::Vector2d::Zero())};
  return true;
}

double DistanceToBuilding(const OutlineBuilding& building, const Eigen::Vector3d& x) {
  const double wall = DistanceToEdges(building.footprint, x.head<2>());
  const double roof_height = building.RoofHeightAt(x.head<2>());
  if (!IsInside(building.footprint, x.head<2>())) {
    const double above = std::max(0.0, x.z() - roof_height);
    return std::hypot(wall, above);
  }
  return std::min(wall, std::abs(x.z() - roof_height));
}

}  // namespace

bool FindHeights(const OutlineCloud& cloud, const GroundPlane& ground,
                 const std::vector<PlaneSegment>& segments, const std::vector<int>& roof,
                 OutlineBuilding* building, BuildingEvidence* evidence) {
  FindFloor(cloud, ground, building, evidence);
  building->roof.clear();
  const double floor_rms = PlaneTolerance(cloud) / 7;
  const double area = PolygonArea(building->footprint);
  std::vector<std::pair<HeightFit, std::vector<Eigen::Vector3d>>> fits;
  for (const int s : roof) {
    std::vector<Eigen::Vector3d> points;
    for (const int i : segments[static_cast<size_t>(s)].points) {
      const Eigen::Vector3d& x = cloud.points[static_cast<size_t>(i)];
      if (IsInside(building->footprint, x.head<2>())) points.push_back(x);
    }
    // A small patch is a dormer, or the neighbour's.
    const double share = segments[static_cast<size_t>(s)].area *
                         static_cast<double>(points.size()) /
                         static_cast<double>(segments[static_cast<size_t>(s)].points.size());
    if (points.size() < 10 || share < 0.06 * area) continue;
    fits.emplace_back(FitRoofPlane(points, building->footprint, floor_rms), points);
  }
  // One level that was found in two pieces.
  for (size_t i = 0; i < fits.size(); ++i) {
    for (size_t j = i + 1; j < fits.size();) {
      const bool same =
          (fits[i].first.gradient - fits[j].first.gradient).norm() < std::tan(RadFromDeg(4)) &&
          std::abs(fits[i].first.HeightAt(fits[j].first.centre) - fits[j].first.height) <
              2 * PlaneTolerance(cloud);
      if (!same) {
        ++j;
        continue;
      }
      fits[i].second.insert(fits[i].second.end(), fits[j].second.begin(), fits[j].second.end());
      fits[i].first = FitRoofPlane(fits[i].second, building->footprint, floor_rms);
      fits.erase(fits.begin() + static_cast<std::ptrdiff_t>(j));
    }
  }
  double sum_squares = 0;
  int count = 0;
  for (const auto& [fit, points] : fits) {
    building->roof.push_back(
        RoofPlane::FromGradient({fit.centre.x(), fit.centre.y(), fit.height}, fit.gradient));
    sum_squares += fit.rms * fit.rms * fit.num_points;
    count += fit.num_points;
  }
  for (const auto& [fit, points] : fits) {
    for (const Eigen::Vector2d& corner : building->footprint) {
      if (fit.HeightAt(corner) > building->RoofHeightAt(corner) + 1e-9) continue;
      evidence->roof_sigma = std::max(evidence->roof_sigma, fit.SigmaAt(corner));
    }
  }
  evidence->num_roof_points = count;
  if (count == 0) return FlatRoofFromWalls(cloud, ground, building, evidence);
  evidence->roof_rms = std::sqrt(sum_squares / count);
  // How much of the footprint has points of the roof above it.
  const double side = std::max(2 * cloud.spacing, cloud.step / 2);
  std::vector<std::pair<int, int>> squares;
  for (const auto& [fit, points] : fits) {
    for (const Eigen::Vector3d& x : points) {
      squares.emplace_back(
          static_cast<int>(std::floor((x.x() - building->footprint[0].x()) / side)),
          static_cast<int>(std::floor((x.y() - building->footprint[0].y()) / side)));
    }
  }
  std::sort(squares.begin(), squares.end());
  squares.erase(std::unique(squares.begin(), squares.end()), squares.end());
  evidence->roof_covered = std::min(1.0, static_cast<double>(squares.size()) * side * side / area);
  return true;
}

void AddWallEvidence(const OutlineCloud& cloud, const GroundPlane& ground,
                     const std::vector<WallLine>& lines, const OutlineBuilding& building,
                     BuildingEvidence* evidence) {
  const size_t n = building.footprint.size();
  const double near = PlaneTolerance(cloud);
  const Eigen::AlignedBox2d box = BoxAround(building.footprint, near);
  std::vector<std::vector<double>> along(n), across(n);
  for (const Eigen::Vector3d& x : cloud.points) {
    if (!box.contains(Eigen::Vector2d(x.head<2>()))) continue;
    if (x.z() - ground.HeightAt(x.head<2>()) < 0.15 * cloud.step) continue;
    if (x.z() > building.RoofHeightAt(x.head<2>()) + near) continue;
    for (size_t i = 0; i < n; ++i) {
      const Eigen::Vector2d &a = building.footprint[i], &b = building.footprint[(i + 1) % n];
      const Line2 line = Line2::Through(a, b);
      const double d = line.SignedDistance(x.head<2>()), s = line.Direction().dot(x.head<2>() - a);
      if (std::abs(d) > near || s < 0 || s > (b - a).norm()) continue;
      // The roof, seen from above, lies along the wall as well.
      if (IsInside(building.footprint, x.head<2>()) &&
          std::abs(x.z() - building.RoofHeightAt(x.head<2>())) < near && std::abs(d) > near / 2) {
        continue;
      }
      along[i].push_back(s);
      across[i].push_back(d);
    }
  }
  const double bridge = std::max(5 * cloud.spacing, 1.5 * cloud.step);
  for (size_t i = 0; i < n; ++i) {
    BuildingEvidence::Wall wall;
    wall.length = (building.footprint[(i + 1) % n] - building.footprint[i]).norm();
    wall.num_points = static_cast<int>(along[i].size());
    wall.sigma_offset = 0.25 * cloud.step;
    wall.sigma_angle = RadFromDeg(1);
    wall.middle = wall.length / 2;
    const bool inferred = !lines.empty() && lines[i].inferred;
    if (wall.num_points >= 6 && !inferred) {
      wall.rms = kSigmaPerMad * MedianAbsoluteDeviation(across[i], 0.0);
      const double independent = std::max(1.0, wall.num_points / kPointsPerIndependent);
      wall.sigma_offset = std::max(wall.rms, near / 7) / std::sqrt(independent);
      std::sort(along[i].begin(), along[i].end());
      double covered = 0, mean = 0, spread = 0;
      for (size_t k = 0; k + 1 < along[i].size(); ++k) {
        const double gap = along[i][k + 1] - along[i][k];
        if (gap <= bridge) covered += gap;
      }
      for (const double s : along[i]) mean += s / wall.num_points;
      for (const double s : along[i]) spread += (s - mean) * (s - mean) / wall.num_points;
      wall.covered = std::min(1.0, covered / wall.length);
      wall.middle = mean;
      wall.sigma_angle = wall.sigma_offset / std::max(std::sqrt(spread), 0.1 * wall.length);
    }
    if (!lines.empty() && !inferred && !lines[i].points.empty()) {
      wall.sigma_offset = lines[i].sigma_offset;
      wall.sigma_angle = lines[i].sigma_angle;
      wall.middle = lines[i].middle - lines[i].line.Direction().dot(building.footprint[i]);
      // The line may run the other way.
      const Eigen::Vector2d d = building.footprint[(i + 1) % n] - building.footprint[i];
      if (lines[i].line.Direction().dot(d) < 0) wall.middle = -wall.middle;
    }
    evidence->walls.push_back(wall);
  }
  for (size_t i = 0; i < n; ++i) {
    // Two uncertain lines cross in an uncertain corner.
    const size_t before = (i + n - 1) % n;
    const auto line_sigma = [&](size_t wall_index, double at) {
      const BuildingEvidence::Wall& wall = evidence->walls[wall_index];
      return std::hypot(wall.sigma_offset, wall.sigma_angle * (at - wall.middle));
    };
    const double one = line_sigma(before, evidence->walls[before].length), two = line_sigma(i, 0);
    const Eigen::Vector2d u = building.footprint[i] - building.footprint[before];
    const Eigen::Vector2d v = building.footprint[(i + 1) % n] - building.footprint[i];
    const double sine =
        std::abs(u.x() * v.y() - u.y() * v.x()) / std::max(1e-300, u.norm() * v.norm());
    evidence->corner_sigma.push_back(std::hypot(one, two) / std::max(sine, 0.05));
  }
}

void AddExplained(const OutlineCloud& cloud, const GroundPlane& ground,
                  const OutlineBuilding& building, BuildingEvidence* evidence) {
  const double near = 2 * PlaneTolerance(cloud);
  const Eigen::AlignedBox2d box = BoxAround(building.footprint, near);
  int on = 0, all = 0;
  for (const Eigen::Vector3d& x : cloud.points) {
    if (!box.contains(Eigen::Vector2d(x.head<2>()))) continue;
    if (x.z() - ground.HeightAt(x.head<2>()) < 0.3 * cloud.step) continue;
    const double distance = DistanceToBuilding(building, x);
    if (!IsInside(building.footprint, x.head<2>()) && distance > near) continue;
    ++all;
    on += distance <= near;
  }
  evidence->num_points = all;
  evidence->explained = all > 0 ? static_cast<double>(on) / all : 0;
}

double ExplainedShare(const OutlineCloud& cloud, const GroundPlane& ground,
                      const std::vector<OutlineBuilding>& buildings) {
  const double near = 2 * PlaneTolerance(cloud);
  std::vector<Eigen::AlignedBox2d> boxes;
  for (const OutlineBuilding& building : buildings) {
    boxes.push_back(BoxAround(building.footprint, near));
  }
  double on = 0, all = 0;
  for (const Eigen::Vector3d& x : cloud.points) {
    if (x.z() - ground.HeightAt(x.head<2>()) < 0.3 * cloud.step) continue;
    all += 1;
    for (size_t b = 0; b < buildings.size(); ++b) {
      if (!boxes[b].contains(Eigen::Vector2d(x.head<2>()))) continue;
      if (DistanceToBuilding(buildings[b], x) > near) continue;
      on += 1;
      break;
    }
  }
  return all > 0 ? on / all : 0;
}

std::vector<std::string> FindDoubts(const OutlineCloud& cloud, const BuildingEvidence& evidence) {
  double length = 0, covered = 0;
  int bare = 0;
  for (const BuildingEvidence::Wall& wall : evidence.walls) {
    length += wall.length;
    covered += wall.length * wall.covered;
    bare += wall.covered < 0.3 && wall.length > 0.5 * cloud.step;
  }
  std::vector<std::string> doubts;
  if (bare > 0) {
    doubts.push_back(std::to_string(bare) + " of " + std::to_string(evidence.walls.size()) +
                     " walls have no points: they are where others end");
  } else if (covered < 0.6 * length) {
    doubts.push_back("points lie on only " + Percent(covered / length) + " of its walls' length");
  }
  if (evidence.num_roof_points == 0) {
    doubts.push_back("no points on its roof: taken as flat, as high as the walls' points");
  } else if (evidence.roof_covered < 0.35) {
    doubts.push_back("points of the roof lie above only " + Percent(evidence.roof_covered) +
                     " of it");
  }
  if (evidence.num_ground_points < 20) {
    doubts.push_back("no points on the ground around it: its floor is the scene's lowest");
  }
  if (evidence.explained < 0.6) {
    doubts.push_back("only " + Percent(evidence.explained) +
                     " of the points inside and on it lie on its walls and roof");
  }
  return doubts;
}

}  // namespace roomtex
