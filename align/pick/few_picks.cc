#include "align/pick/few_picks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "core/three_point_pose.h"
#include "core/twist.h"

namespace roomtex {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

// Two poses are the same one: radians, metres.
constexpr double kSameRotation = 1e-4, kSamePosition = 1e-4;
// Starts that leave the other picks farther off than this share of the photo's diagonal lead
// nowhere.
constexpr double kMaxStartShare = 0.3;
constexpr size_t kMaxStarts = 6;

PointPairs Chosen(const PointPairs& pairs, const std::vector<int>& indices) {
  const int n = static_cast<int>(indices.size());
  PointPairs chosen{Eigen::Matrix2Xd(2, n), Eigen::Matrix3Xd(3, n)};
  for (int i = 0; i < n; ++i) {
    chosen.x_in_img.col(i) = pairs.x_in_img.col(indices[i]);
    chosen.x_in_scan.col(i) = pairs.x_in_scan.col(indices[i]);
  }
  return chosen;
}

bool IsSame(const Rigid& a, const Rigid& b) {
  return RotationAngle(a.rotation, b.rotation) < kSameRotation &&
         (a.TargetOriginInSource() - b.TargetOriginInSource()).norm() < kSamePosition;
}

void AddIfNew(const ViewPose& pose, std::vector<ViewPose>* poses) {
  const bool known = std::any_of(poses->begin(), poses->end(), [&](const ViewPose& other) {
    return IsSame(pose.cam_from_scan, other.cam_from_scan);
  });
  if (!known) poses->push_back(pose);
}

// Projections minus clicks of three picks; NaN where a point is not in the photo's field.
Vector6d Errors(const CameraProjection& projection, const PointPairs& pairs, const Rigid& pose) {
  Vector6d errors = Vector6d::Constant(std::numeric_limits<double>::quiet_NaN());
  for (int i = 0; i < 3; ++i) {
    const auto error = projection.ImgError(pose * pairs.x_in_scan.col(i), pairs.x_in_img.col(i));
    if (error) errors.segment<2>(2 * i) = *error;
  }
  return errors;
}

// Six equations, six unknowns: Newton's steps take away what the closed form leaves by rounding.
void Polish(const CameraProjection& projection, const PointPairs& pairs, Rigid* pose) {
  constexpr double kStep = 1e-6;
  Vector6d errors = Errors(projection, pairs, *pose);
  for (int i = 0; i < 10 && errors.norm() > 1e-9; ++i) {
    Matrix6d jacobian;
    for (int k = 0; k < 6; ++k) {
      const Vector6d step = kStep * Vector6d::Unit(k);
      jacobian.col(k) = (Errors(projection, pairs, MovedInPlace(*pose, step)) -
                         Errors(projection, pairs, MovedInPlace(*pose, -step))) /
                        (2 * kStep);
    }
    if (!jacobian.allFinite()) return;
    const Rigid next = MovedInPlace(*pose, -jacobian.fullPivLu().solve(errors));
    const Vector6d next_errors = Errors(projection, pairs, next);
    if (!(next_errors.norm() < errors.norm())) return;
    *pose = next;
    errors = next_errors;
  }
}

}  // namespace

std::vector<ViewPose> SolveThreePicks(const CameraProjection& projection, const PointPairs& pairs) {
  const Eigen::Vector3d centre = pairs.x_in_scan.rowwise().mean();
  std::array<Eigen::Vector3d, 3> points, rays;
  for (int i = 0; i < 3; ++i) {
    const auto ray = projection.RayFromImg(pairs.x_in_img.col(i));
    if (!ray) return {};
    rays[i] = *ray;
    points[i] = pairs.x_in_scan.col(i) - centre;
  }
  std::vector<ViewPose> poses;
  for (const Rigid& cam_from_centre : SolveThreePointPose(points, rays)) {
    ViewPose pose;
    pose.cam_from_scan = cam_from_centre;
    pose.cam_from_scan.translation -= cam_from_centre.rotation * centre;
    Polish(projection, pairs, &pose.cam_from_scan);
    pose.residual_px = PickResiduals(projection, pairs, pose.cam_from_scan);
    if (!pose.residual_px.allFinite()) continue;  // a point behind the camera
    pose.sum_px2 = pose.residual_px.squaredNorm();
    pose.rms_px = std::sqrt(pose.sum_px2 / 3);
    pose.covariance.setConstant(std::numeric_limits<double>::infinity());
    if (pose.rms_px < 1) AddIfNew(pose, &poses);
  }
  return poses;
}

std::vector<ViewPose> SolveFewPicks(const CameraProjection& projection, const PointPairs& pairs) {
  std::vector<ViewPose> poses = SolveViewPoses(projection, pairs);
  struct Start {
    double worst_px;
    Rigid cam_from_scan;
  };
  std::vector<Start> starts;
  const Camera& camera = projection.camera();
  const double max_px = kMaxStartShare * std::hypot(camera.width, camera.height);
  for (int i = 0; i < pairs.size(); ++i) {
    for (int j = i + 1; j < pairs.size(); ++j) {
      for (int k = j + 1; k < pairs.size(); ++k) {
        for (const ViewPose& pose : SolveThreePicks(projection, Chosen(pairs, {i, j, k}))) {
          const double worst_px = PickResiduals(projection, pairs, pose.cam_from_scan).maxCoeff();
          if (worst_px < max_px) starts.push_back({worst_px, pose.cam_from_scan});
        }
      }
    }
  }
  std::sort(starts.begin(), starts.end(),
            [](const Start& a, const Start& b) { return a.worst_px < b.worst_px; });
  if (starts.size() > kMaxStarts) starts.resize(kMaxStarts);
  for (const Start& start : starts) {
    for (const ViewPose& pose : SolveViewPoses(projection, pairs, start.cam_from_scan)) {
      AddIfNew(pose, &poses);
    }
  }
  std::stable_sort(poses.begin(), poses.end(),
                   [](const ViewPose& a, const ViewPose& b) { return a.sum_px2 < b.sum_px2; });
  return poses;
}

}  // namespace roomtex
