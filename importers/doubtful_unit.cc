#include "importers/doubtful_unit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "core/statistics.h"
#include "importers/length_unit.h"

namespace roomtex {
namespace {

constexpr double kHighestRoom = 80;
constexpr double kHighestTripod = 30;
constexpr double kLargestSite = 1000;
constexpr size_t kLookedAt = 100000;  // points; evenly among all

std::vector<Eigen::Vector3d> SomePoints(const Scan& scan) {
  std::vector<Eigen::Vector3d> points;
  const size_t every = scan.points.size() / kLookedAt + 1;
  for (size_t i = 0; i < scan.points.size(); i += every) {
    if (!scan.IsMissing(static_cast<int>(i))) points.push_back(scan.points[i]);
  }
  return points;
}

// Where the middle 98 % lie along an axis: stray points say nothing.
struct Extent {
  double from = 0, to = 0;

  double length() const { return to - from; }
  // Where a value lies, 0 at one end and 1 at the other.
  double Share(double value) const { return length() > 0 ? (value - from) / length() : 0; }
};

Extent ExtentAlong(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& axis) {
  std::vector<double> places;
  places.reserve(points.size());
  for (const Eigen::Vector3d& point : points) places.push_back(point.dot(axis));
  Extent extent;
  extent.from = Quantile(&places, 0.01);
  extent.to = Quantile(&places, 0.99);
  return extent;
}

struct Size {
  Extent up;
  // Of the places on a map of the scan, the share that has points both near the top and near the
  // bottom: a room's floor with its ceiling, and walls.
  double closed = 0;
};

Size SizeOf(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& up) {
  constexpr int kCells = 16;  // along each side of the map
  constexpr double kNear = 0.15;
  const Eigen::Vector3d across = up.unitOrthogonal();
  const std::array<Eigen::Vector3d, 2> sides = {across, up.cross(across)};
  Size size;
  size.up = ExtentAlong(points, up);
  const std::array<Extent, 2> map = {ExtentAlong(points, sides[0]), ExtentAlong(points, sides[1])};
  std::array<unsigned char, static_cast<size_t>(kCells) * kCells> found{};
  for (const Eigen::Vector3d& point : points) {
    std::array<int, 2> cell;
    for (int k = 0; k < 2; ++k) {
      const double share = std::clamp(map[k].Share(point.dot(sides[k])), 0.0, 1.0);
      cell[k] = std::min(static_cast<int>(share * kCells), kCells - 1);
    }
    const double height = size.up.Share(point.dot(up));
    found[static_cast<size_t>(cell[0]) * kCells + cell[1]] |= height < kNear       ? 1
                                                              : height > 1 - kNear ? 2
                                                                                   : 4;
  }
  const auto occupied = found.size() - std::count(found.begin(), found.end(), 0);
  const auto both =
      std::count_if(found.begin(), found.end(), [](unsigned char bits) { return (bits & 3) == 3; });
  if (occupied > 0) size.closed = static_cast<double>(both) / static_cast<double>(occupied);
  return size;
}

// Of a grid's station above what it saw below itself; 0 where it did not look down.
double HeightOfStation(const Scan& scan, const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> heights;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d offset = point - scan.Station();
    const double below = -offset.dot(scan.up);
    if (below > 0.5 * offset.norm()) heights.push_back(below);  // 30 degrees and more
  }
  return heights.size() * 20 < points.size() ? 0 : Median(&heights);
}

// The unit in which a length is nearest to what is usual, by ratio.
std::string NearestUnit(double length, double usual) {
  std::string nearest;
  double smallest = std::numeric_limits<double>::infinity();
  for (const char* unit : {"millimeters", "centimeters", "inches"}) {
    const double apart = std::abs(std::log(length * *MetersPerUnit(unit) / usual));
    if (apart < smallest) smallest = apart, nearest = unit;
  }
  return nearest;
}

}  // namespace

std::string LikelierUnit(const Scan& scan) {
  constexpr double kClosed = 0.15;
  constexpr double kUsualRoom = 2.7, kUsualTripod = 1.5, kUsualLength = 10;
  const std::vector<Eigen::Vector3d> points = SomePoints(scan);
  if (points.empty()) return "";
  const double station = scan.organised ? HeightOfStation(scan, points) : 0;
  if (station > kHighestTripod) return NearestUnit(station, kUsualTripod);
  const Size size = SizeOf(points, scan.up);
  if (size.up.length() > kHighestRoom && size.closed >= kClosed) {
    return NearestUnit(size.up.length(), kUsualRoom);
  }
  const Bounds bounds = FindBounds(scan);
  const double longest = (bounds.max - bounds.min).maxCoeff();
  return longest > kLargestSite ? NearestUnit(longest, kUsualLength) : "";
}

}  // namespace roomtex
