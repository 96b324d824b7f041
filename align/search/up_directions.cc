#include "align/search/up_directions.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "core/frames.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

constexpr int kBins = 96;             // of heights, over four times the extent of the points
constexpr size_t kHeapPoints = 1500;  // that planes are looked for with
constexpr size_t kMostPlanes = 3;
// Photos alone say which way is up if half of them are held within this of level, and if their x
// axes spread about the vertical: all in one direction they leave it open.
const double kHeldLevel = RadFromDeg(5.0);
constexpr double kLeastSpread = 0.03, kLeastSpreadRatio = 8;
// Photos are not held upside down: other directions than this far from what they have above are no
// up, if they agree about what is above at all.
const double kUpright = RadFromDeg(65.0);
constexpr double kAgreeAbout = 0.3;
// Directions of a scan's surface: that of its file is believed within this if so much of the
// surface faces that way, and those up to kMaxTilt from it are preferred to others.
const double kFacing = RadFromDeg(5.0), kMaxTilt = RadFromDeg(40.0);
constexpr double kLeastFacing = 0.06, kWorthALook = 0.5;

using Directions = std::vector<Eigen::Vector3d>;

// How much the heights of the points along a direction heap up: large across floors, ceilings and
// table tops. The histogram of a projection, for a direction, is the idea of the Hough transform
// (Hough 1962; Vosselman 1999 for planes in laser data).
class Heaping {
 public:
  explicit Heaping(Directions points) : points_(std::move(points)) {
    for (const Eigen::Vector3d& x : points_) {
      middle_ += x / static_cast<double>(points_.size());
    }
    std::vector<double> distances;
    for (const Eigen::Vector3d& x : points_) distances.push_back((x - middle_).norm());
    extent_ = Median(&distances);
  }

  double Along(const Eigen::Vector3d& direction) const {
    double counts[kBins + 1] = {};
    for (const Eigen::Vector3d& x : points_) {
      const double at = (0.5 + 0.25 * direction.dot(x - middle_) / extent_) * kBins;
      if (!(at >= 0 && at < kBins)) continue;
      const int bin = static_cast<int>(at);
      // Shared between two bins, so that the measure changes smoothly.
      counts[bin] += 1 - (at - bin);
      counts[bin + 1] += at - bin;
    }
    double sum = 0;
    for (const double count : counts) sum += count * count;
    return sum;
  }

 private:
  Directions points_;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  double extent_ = 0;
};

// Directions around `axis`, up to `reach` radians off, in rings.
Directions Around(const Eigen::Vector3d& axis, double reach, double step) {
  const Eigen::Vector3d u = axis.unitOrthogonal(), v = axis.cross(u);
  Directions directions = {axis};
  for (double angle = step; angle <= reach; angle += step) {
    const int count = std::max(6, static_cast<int>(2 * kPi * std::sin(angle) / step));
    for (int i = 0; i < count; ++i) {
      const double turn = 2 * kPi * i / count;
      directions.emplace_back(std::cos(angle) * axis +
                              std::sin(angle) * (std::cos(turn) * u + std::sin(turn) * v));
    }
  }
  return directions;
}

Eigen::Vector3d BestAround(const Heaping& heaping, const Eigen::Vector3d& axis, double reach,
                           double step) {
  Eigen::Vector3d best = axis;
  double most = -1;
  for (const Eigen::Vector3d& direction : Around(axis, reach, step)) {
    const double along = heaping.Along(direction);
    if (along <= most) continue;
    most = along;
    best = direction;
  }
  return best;
}

Eigen::Vector3d Refined(const Heaping& heaping, const Eigen::Vector3d& up, double reach) {
  const Eigen::Vector3d coarse = BestAround(heaping, up, reach, RadFromDeg(1.5));
  return BestAround(heaping, coarse, RadFromDeg(1.2), RadFromDeg(0.4)).normalized();
}

bool IsNearAny(const Directions& directions, const Eigen::Vector3d& d, double angle) {
  return std::any_of(directions.begin(), directions.end(),
                     [&](const Eigen::Vector3d& other) { return AngleBetween(other, d) < angle; });
}

// Across the planes that hold most points; the sign is open.
Directions AcrossPlanes(const Heaping& heaping) {
  std::vector<std::pair<double, Eigen::Vector3d>> found;
  for (const Eigen::Vector3d& direction :
       Around(Eigen::Vector3d::UnitZ(), kPi / 2, RadFromDeg(4.0))) {
    found.emplace_back(heaping.Along(direction), direction);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  Directions planes;
  for (const auto& [along, direction] : found) {
    if (planes.size() == kMostPlanes) break;
    if (IsNearAny(planes, direction, RadFromDeg(20.0))) continue;
    if (IsNearAny(planes, -direction, RadFromDeg(20.0))) continue;
    planes.push_back(direction);
  }
  for (Eigen::Vector3d& plane : planes) plane = Refined(heaping, plane, RadFromDeg(4.0));
  return planes;
}

struct Held {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  bool level = false;
  Eigen::Vector3d above = Eigen::Vector3d::Zero();  // mean over the photos; short if they disagree
};

// The direction that the cameras' x axes are all across.
Held UpOfPhotos(const SearchCloud& cloud) {
  Held held;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  const double share = 1.0 / static_cast<double>(cloud.right.size());
  for (size_t i = 0; i < cloud.right.size(); ++i) {
    sum += share * cloud.right[i] * cloud.right[i].transpose();
    held.above -= share * cloud.down[i];
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum);
  held.up = solver.eigenvectors().col(0);
  if (held.up.dot(held.above) < 0) held.up *= -1;
  std::vector<double> tilts;
  for (const Eigen::Vector3d& right : cloud.right) {
    tilts.push_back(std::abs(std::asin(std::clamp(right.dot(held.up), -1.0, 1.0))));
  }
  const Eigen::Vector3d variances = solver.eigenvalues();
  held.level = variances[1] > kLeastSpread && variances[1] > kLeastSpreadRatio * variances[0] &&
               Median(tilts) < kHeldLevel && held.above.norm() > kAgreeAbout;
  return held;
}

// Share of the surface that faces along a direction, or against it.
double FacingShare(const ScanPatches& surface, const Eigen::Vector3d& direction) {
  const double limit = std::cos(kFacing);
  size_t count = 0;
  for (const ScanPatch& patch : surface.patches()) {
    count += std::abs(patch.normal.dot(direction)) > limit;
  }
  return static_cast<double>(count) /
         static_cast<double>(std::max<size_t>(surface.patches().size(), 1));
}

// Mean of the normals that face along a direction, to either side.
Eigen::Vector3d MeanFacing(const ScanPatches& surface, const Eigen::Vector3d& direction) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const ScanPatch& patch : surface.patches()) {
    const double along = patch.normal.dot(direction);
    if (std::abs(along) > std::cos(kFacing)) sum += along > 0 ? patch.normal : -patch.normal;
  }
  return sum.norm() > 0 ? sum.normalized() : direction;
}

}  // namespace

UpDirections FindModelUps(const SearchCloud& cloud) {
  UpDirections found;
  if (cloud.points.empty() || cloud.centres.empty()) return found;
  Directions points;
  for (const SurfacePoint& point : Thinned(cloud, kHeapPoints).points) {
    points.push_back(point.x_in_sparse);
  }
  const Heaping heaping(std::move(points));
  const Held held = UpOfPhotos(cloud);
  found.known = held.level;
  if (held.level) {
    found.ups = {Refined(heaping, held.up, RadFromDeg(7.0))};
    return found;
  }
  const bool upright = held.above.norm() > kAgreeAbout;
  for (const Eigen::Vector3d& across : AcrossPlanes(heaping)) {
    for (const Eigen::Vector3d& up : {across, Eigen::Vector3d(-across)}) {
      if (!upright || AngleBetween(up, held.above) < kUpright) found.ups.push_back(up);
    }
  }
  if (found.ups.empty()) found.ups = {Refined(heaping, held.up, RadFromDeg(7.0))};
  return found;
}

UpDirections FindScanUps(const std::vector<Scan>& scans, const ScanPatches& surface) {
  UpDirections found;
  const Eigen::Vector3d told = scans[0].up;
  if (scans[0].organised && FacingShare(surface, told) > kLeastFacing) {
    found.ups = {told};
    found.known = true;
    return found;
  }
  std::vector<std::pair<double, Eigen::Vector3d>> facing;
  for (const Eigen::Vector3d& direction : Around(told, kPi / 2, RadFromDeg(4.0))) {
    facing.emplace_back(FacingShare(surface, direction), direction);
  }
  std::stable_sort(facing.begin(), facing.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  for (const auto& [share, direction] : facing) {
    if (share < kWorthALook * facing[0].first || found.ups.size() == kMostPlanes) break;
    if (IsNearAny(found.ups, direction, RadFromDeg(20.0))) continue;
    if (IsNearAny(found.ups, -direction, RadFromDeg(20.0))) continue;
    found.ups.push_back(MeanFacing(surface, direction));
  }
  if (!scans[0].organised) {
    // A mesh does not say which of its axes points up, nor which way round.
    const Directions axes = found.ups;
    for (const Eigen::Vector3d& axis : axes) found.ups.push_back(-axis);
    return found;
  }
  // Scanners are set up nearly level.
  for (const Eigen::Vector3d& up : found.ups) {
    if (!(AngleBetween(up, told) < kMaxTilt)) continue;
    found.ups = {Eigen::Vector3d(up)};
    return found;
  }
  // A facade or a shaft shows hardly anything that is level: what the scanner says may be true.
  if (!scans[0].up_is_assumed) found.ups.push_back(told);
  return found;
}

}  // namespace roomtex
