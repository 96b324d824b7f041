#include "core/three_point_pose.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace roomtex {
namespace {

constexpr double kCollinear = 1e-6;  // sine of the angle between two sides
constexpr double kSameRay = 1e-12;   // 1 - cosine
// Imaginary part of a root over its size: of two poses that nearly are one a root is exact to half
// the digits.
constexpr double kNearlyReal = 1e-4;
constexpr double kVanishing = 1e-14;  // of the largest coefficient
constexpr double kExact = 1e-9;       // of the sides' squares
constexpr double kSame = 1e-7;        // of the distances
constexpr int kNewtonSteps = 8;

// Sides and angles of the tetrahedron of the camera and the points: of each side, that between its
// ends i and (i + 1) % 3.
struct Tetrahedron {
  Eigen::Vector3d squares;  // of the sides
  Eigen::Vector3d cosines;  // of the angles between the rays
};

// Of c[4] x^4 + ... + c[0], those that are real or nearly so. Where the camera and the points are
// symmetric the first terms vanish, and with them roots that are infinite.
std::vector<double> RealRoots(const std::array<double, 5>& c) {
  double largest = 0;
  for (const double one : c) largest = std::max(largest, std::abs(one));
  int degree = 4;
  while (degree > 0 && !(std::abs(c[degree]) > kVanishing * largest)) --degree;
  std::vector<double> roots;
  if (degree == 0) return roots;
  using Companion = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 4, 4>;
  Companion companion = Companion::Zero(degree, degree);
  companion.diagonal<-1>().setOnes();
  for (int k = 0; k < degree; ++k) companion(k, degree - 1) = -c[k] / c[degree];
  const Eigen::EigenSolver<Companion> solver(companion, false);
  for (const auto& root : solver.eigenvalues()) {
    if (std::abs(root.imag()) <= kNearlyReal * std::abs(root)) roots.push_back(root.real());
  }
  return roots;
}

// Squares of the sides that the distances make, less those that they should.
Eigen::Vector3d Misfit(const Tetrahedron& t, const Eigen::Vector3d& distances) {
  Eigen::Vector3d misfit;
  for (int i = 0; i < 3; ++i) {
    const double a = distances[i], b = distances[(i + 1) % 3];
    misfit[i] = a * a + b * b - 2 * a * b * t.cosines[i] - t.squares[i];
  }
  return misfit;
}

std::optional<Eigen::Vector3d> Polished(const Tetrahedron& t, Eigen::Vector3d distances) {
  const double tolerance = kExact * t.squares.maxCoeff();
  for (int step = 0; step < kNewtonSteps; ++step) {
    const Eigen::Vector3d misfit = Misfit(t, distances);
    if (!misfit.allFinite()) return std::nullopt;
    if (misfit.cwiseAbs().maxCoeff() <= 1e-6 * tolerance) break;
    Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      jacobian(i, i) = 2 * (distances[i] - distances[j] * t.cosines[i]);
      jacobian(i, j) = 2 * (distances[j] - distances[i] * t.cosines[i]);
    }
    distances -= jacobian.partialPivLu().solve(misfit);
  }
  const bool is_exact = distances.allFinite() && distances.minCoeff() > 0 &&
                        Misfit(t, distances).cwiseAbs().maxCoeff() <= tolerance;
  return is_exact ? std::make_optional(distances) : std::nullopt;
}

// Distances of the points along their rays. In units of the first: u of the second, v of the third.
std::vector<Eigen::Vector3d> SolveDistances(const Tetrahedron& t) {
  const double c2 = t.squares[0], a2 = t.squares[1], b2 = t.squares[2];
  const double cos_c = t.cosines[0], cos_a = t.cosines[1], cos_b = t.cosines[2];
  const double p = (a2 - c2) / b2, q = (a2 + c2) / b2;
  const std::array<double, 5> quartic = {
      (1 + p) * (1 + p) - 4 * a2 / b2 * cos_c * cos_c,
      4 * (-p * (1 + p) * cos_b + 2 * a2 / b2 * cos_c * cos_c * cos_b - (1 - q) * cos_a * cos_c),
      2 * (p * p - 1 + 2 * p * p * cos_b * cos_b + 2 * (b2 - c2) / b2 * cos_a * cos_a -
           4 * q * cos_a * cos_b * cos_c + 2 * (b2 - a2) / b2 * cos_c * cos_c),
      4 * (p * (1 - p) * cos_b - (1 - q) * cos_a * cos_c + 2 * c2 / b2 * cos_a * cos_a * cos_b),
      (p - 1) * (p - 1) - 4 * c2 / b2 * cos_a * cos_a};
  std::vector<Eigen::Vector3d> all;
  for (const double v : RealRoots(quartic)) {
    const double square = 1 + v * v - 2 * v * cos_b;
    if (!(v > 0) || !(square > 0)) continue;
    const double first = std::sqrt(b2 / square);
    // Of the two distances that leave the side to the first point right, the one (mostly) that
    // leaves that to the third one right, too.
    const double root = std::sqrt(std::max(0.0, cos_c * cos_c - 1 + c2 / (first * first)));
    for (const double u : {cos_c + root, cos_c - root}) {
      const auto distances = Polished(t, first * Eigen::Vector3d(1, u, v));
      if (!distances) continue;
      const bool is_new = std::all_of(all.begin(), all.end(), [&](const Eigen::Vector3d& other) {
        return (*distances - other).norm() > kSame * other.norm();
      });
      if (is_new) all.push_back(*distances);
    }
  }
  return all;
}

// Columns: along the first side, across the plane of the three, and across both.
Eigen::Matrix3d FrameOf(const std::array<Eigen::Vector3d, 3>& points) {
  Eigen::Matrix3d frame;
  frame.col(0) = (points[1] - points[0]).normalized();
  frame.col(1) = frame.col(0).cross(points[2] - points[0]).normalized();
  frame.col(2) = frame.col(0).cross(frame.col(1));
  return frame;
}

}  // namespace

std::vector<Rigid> SolveThreePointPose(const std::array<Eigen::Vector3d, 3>& points,
                                       const std::array<Eigen::Vector3d, 3>& rays) {
  std::array<Eigen::Vector3d, 3> units;
  for (int i = 0; i < 3; ++i) units[i] = rays[i].normalized();
  Tetrahedron t;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    t.squares[i] = (points[j] - points[i]).squaredNorm();
    t.cosines[i] = units[i].dot(units[j]);
    if (!(1 - t.cosines[i] > kSameRay)) return {};
  }
  const double doubled_area = (points[1] - points[0]).cross(points[2] - points[0]).norm();
  if (!(doubled_area > kCollinear * t.squares.maxCoeff())) return {};
  const Eigen::Matrix3d frame = FrameOf(points);
  std::vector<Rigid> poses;
  for (const Eigen::Vector3d& distances : SolveDistances(t)) {
    std::array<Eigen::Vector3d, 3> seen;
    for (int i = 0; i < 3; ++i) seen[i] = distances[i] * units[i];
    const Eigen::Matrix3d turn = FrameOf(seen) * frame.transpose();
    Rigid pose;
    pose.rotation = Eigen::Quaterniond(turn).normalized();
    pose.translation = (seen[0] + seen[1] + seen[2]) / 3 -
                       pose.rotation * ((points[0] + points[1] + points[2]) / 3);
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace roomtex
