#include "align/trust/sight_agreement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace roomtex {
namespace {

constexpr double kPlace = 1.0;        // metres
constexpr double kRangeShare = 0.01;  // of a ray's length: what a degree of turn leaves
constexpr double kUnseenWeight = 0.5;

}  // namespace

double SightAgreement::Share() const {
  return NumJudged() > 0 ? static_cast<double>(num_agreeing) / NumJudged() : 0;
}

double SightAgreement::ThroughShare() const {
  return NumJudged() > 0 ? static_cast<double>(num_through) / NumJudged() : 0;
}

double SightAgreement::Score() const {
  const double all = NumJudged() + kUnseenWeight * num_unseen;
  return all > 0 ? num_agreeing / all : 0;
}

SightAgreement CheckSights(const SearchCloud& cloud, const Similarity& scan_from_sparse,
                           const FreeSpace& free_space, double tolerance) {
  SightAgreement result;
  std::map<std::array<int, 3>, std::pair<int, int>> places;  // agreeing, judged
  for (const SearchCloud::Sight& sight : cloud.sights) {
    const SurfacePoint& point = cloud.points[sight.point];
    const Eigen::Vector3d centre = scan_from_sparse * cloud.centres[sight.photo];
    const Eigen::Vector3d x_in_scan = scan_from_sparse * point.x_in_sparse;
    const Eigen::Vector3d ray = x_in_scan - centre;
    const double range = ray.norm();
    const double own = 2 * scan_from_sparse.scale * std::sqrt(point.covariance.trace());
    const double limit = tolerance + kRangeShare * range + std::min(own, tolerance);
    if (!(range > limit)) continue;
    const auto seen = free_space.Look(centre, ray / range);
    if (!seen) {
      ++result.num_unseen;
      continue;
    }
    const double off = (seen->x_in_scan - centre).norm() - range;
    const bool agrees = std::abs(off) <= limit;
    (agrees ? result.num_agreeing : off > 0 ? result.num_short : result.num_through) += 1;
    const Eigen::Vector3i cell = (x_in_scan / kPlace).array().floor().cast<int>();
    auto& place = places[{cell.x(), cell.y(), cell.z()}];
    place.first += agrees;
    ++place.second;
  }
  for (const auto& [cell, counts] : places) {
    result.place_share += static_cast<double>(counts.first) / counts.second;
  }
  result.num_places = static_cast<int>(places.size());
  if (result.num_places > 0) result.place_share /= result.num_places;
  return result;
}

}  // namespace roomtex
