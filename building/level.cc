// Up, and the ground.

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "building/outline_proposal.h"
#include "core/decompositions.h"
#include "core/frames.h"
#include "core/robust_kernel.h"
#include "core/statistics.h"

namespace roomtex {
namespace {

double WeightOf(const PlaneSegment& segment) { return std::sqrt(segment.area); }

// Share of the surface that stands upright or lies level for this up.
double LevelShare(const std::vector<PlaneSegment>& segments, const Eigen::Vector3d& up) {
  const double sine = std::sin(RadFromDeg(10));
  double sum = 0, fitting = 0;
  for (const PlaneSegment& segment : segments) {
    const double along = std::abs(segment.plane.normal.dot(up));
    sum += WeightOf(segment);
    if (along < sine || along > std::cos(RadFromDeg(10))) fitting += WeightOf(segment);
  }
  return sum > 0 ? fitting / sum : 0;
}

// Without anything that says so: the plane that the rest stands on, and the rest is above it.
Eigen::Vector3d UpByPlanes(const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments) {
  double best = -1;
  Eigen::Vector3d up = cloud.up;
  for (const PlaneSegment& segment : segments) {
    double above = 0, below = 0;
    const double margin = 3 * PlaneTolerance(cloud);
    for (size_t i = 0; i < cloud.points.size(); i += 7) {
      const double d = segment.plane.SignedDistance(cloud.points[i]);
      (d > margin ? above : below) += std::abs(d) > margin ? 1 : 0;
    }
    const double one_sided = std::abs(above - below) / std::max(1.0, above + below);
    const double score = LevelShare(segments, segment.plane.normal) * one_sided * one_sided *
                         std::sqrt(segment.area);
    if (score <= best) continue;
    best = score;
    up = above > below ? segment.plane.normal : Eigen::Vector3d(-segment.plane.normal);
  }
  return up;
}

void MoveBoth(const Similarity& target_from_here, OutlineCloud* cloud,
              std::vector<PlaneSegment>* segments) {
  cloud->MoveTo(target_from_here);
  for (PlaneSegment& segment : *segments) {
    segment.plane.centre = target_from_here * segment.plane.centre;
    segment.plane.normal = target_from_here.rotation * segment.plane.normal;
    segment.plane.rms *= target_from_here.scale;
    segment.cell *= target_from_here.scale;
    segment.area *= target_from_here.scale * target_from_here.scale;
  }
}

}  // namespace

UpFinding Level(OutlineCloud* cloud, std::vector<PlaneSegment>* segments) {
  using UpSource = OutlineCloud::UpSource;
  static const char* const kNames[] = {"given", "geographic", "cameras", "file"};
  UpFinding finding;
  finding.source = kNames[static_cast<int>(cloud->up_source)];
  Eigen::Vector3d up = cloud->up.normalized();
  const bool fixed = cloud->up_source == UpSource::kGiven || cloud->up_source == UpSource::kEarth;
  constexpr double kEnough = 0.5;
  if (cloud->up_source == UpSource::kFile && LevelShare(*segments, up) < kEnough) {
    up = UpByPlanes(*cloud, *segments);
    finding.source = "planes";
  }
  const Eigen::Vector3d start = up;
  // How well each segment tells the direction of its normal: by its points across its height, and
  // no better than walls are built.
  const double built = RadFromDeg(0.1), ground = RadFromDeg(1.5), start_sigma = RadFromDeg(5);
  std::vector<double> sigmas;
  for (const PlaneSegment& segment : *segments) {
    double spread = 0;
    const double n = static_cast<double>(segment.points.size());
    for (const int i : segment.points) {
      const double d = start.dot(cloud->points[static_cast<size_t>(i)] - segment.plane.centre);
      spread += d * d / n;
    }
    const double tilt = segment.plane.rms / std::sqrt(std::max(1e-300, n / 6 * spread));
    sigmas.push_back(std::hypot(tilt, built));
  }
  double sum_weights = 0, sum_squares = 0;
  for (int round = 0; round < 20; ++round) {
    // Walls are upright, floors and ground nearly level; the start holds what both leave open.
    const double gate = RadFromDeg(round < 5 ? 8 : 3);
    Eigen::Matrix3d sum =
        (Eigen::Matrix3d::Identity() - start * start.transpose()) / (start_sigma * start_sigma);
    finding.num_walls = 0;
    sum_weights = sum_squares = 0;
    for (size_t s = 0; s < segments->size(); ++s) {
      const Eigen::Vector3d& n = (*segments)[s].plane.normal;
      const double along = n.dot(up);
      if (std::abs(along) < std::sin(RadFromDeg(15))) {
        if (std::abs(along) < gate) {
          ++finding.num_walls;
          sum_weights += 1 / (sigmas[s] * sigmas[s]);
          sum_squares += along * along / (sigmas[s] * sigmas[s]);
        }
        const double weight = CauchyWeight(along / (3 * sigmas[s]), 1 / (sigmas[s] * sigmas[s]));
        sum += weight * n * n.transpose();
      } else if (std::abs(along) > std::cos(RadFromDeg(15))) {
        const double area = std::min(1.0, (*segments)[s].area / (100 * cloud->step * cloud->step));
        sum += area / (ground * ground) * (Eigen::Matrix3d::Identity() - n * n.transpose());
      }
    }
    if (fixed) break;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(sum);
    const Eigen::Vector3d next = solver.eigenvectors().col(0);
    up = next.dot(start) < 0 ? Eigen::Vector3d(-next) : next;
  }
  finding.spread_deg = sum_weights > 0 ? DegFromRad(std::sqrt(sum_squares / sum_weights)) : 0;
  finding.trusted = fixed || (finding.source != "planes" && LevelShare(*segments, up) >= kEnough);

  cloud->up = up;
  // Upright as it was said; then what walls and ground know better, about the middle of the points:
  // about an origin as far as that of a map grid it would lift them by hundreds of metres.
  const Eigen::Quaterniond upright = RotationBetween(start, Eigen::Vector3d::UnitZ());
  MoveBoth({1, upright, Eigen::Vector3d::Zero()}, cloud, segments);
  const Eigen::Quaterniond finer = RotationBetween(upright * up, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d middle = MiddleOf(cloud->points);
  MoveBoth({1, finer, middle - finer * middle}, cloud, segments);
  finding.up_in_input =
      cloud->frame.outline_from_input.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  return finding;
}

void AdoptFrame(const Outline& outline, OutlineCloud* cloud, std::vector<PlaneSegment>* segments) {
  MoveBoth(outline.outline_from_input * cloud->frame.outline_from_input.Inverse(), cloud, segments);
  cloud->frame = outline;
  cloud->frame.buildings.clear();
}

GroundPlane FindGround(const OutlineCloud& cloud, const std::vector<PlaneSegment>& segments) {
  GroundPlane ground;
  double best = 0;
  const double margin = std::max(3 * PlaneTolerance(cloud), cloud.step / 4);
  for (const PlaneSegment& segment : segments) {
    const Eigen::Vector3d& n = segment.plane.normal;
    if (std::abs(n.z()) < std::cos(RadFromDeg(15))) continue;
    GroundPlane plane;
    plane.gradient = -n.head<2>() / n.z();
    plane.height = segment.plane.centre.z() - plane.gradient.dot(segment.plane.centre.head<2>());
    double on = 0, below = 0, above = 0;
    for (size_t i = 0; i < cloud.points.size(); i += 3) {
      const double d = cloud.points[i].z() - plane.HeightAt(cloud.points[i].head<2>());
      (std::abs(d) <= margin ? on : d < 0 ? below : above) += 1;
    }
    // Something lies on it, nearly nothing below.
    const double score = on + 0.2 * above - 3 * below;
    if (score <= best) continue;
    best = score;
    plane.found = true;
    ground = plane;
  }
  if (ground.found) return ground;
  std::vector<double> heights;
  for (const Eigen::Vector3d& point : cloud.points) heights.push_back(point.z());
  ground.height = Quantile(&heights, 0.02);
  return ground;
}

}  // namespace roomtex
