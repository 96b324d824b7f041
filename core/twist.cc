#include "core/twist.h"

#include <cmath>

namespace roomtex {

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d cross;
  cross << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return cross;
}

Eigen::Quaterniond RotationFromVector(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (!(angle > 0)) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle));
}

Eigen::Vector3d VectorFromRotation(const Eigen::Quaterniond& rotation) {
  const double sine = rotation.vec().norm();
  if (!(sine > 0)) return Eigen::Vector3d::Zero();
  // Of the two quaternions of a rotation the one of the smaller angle.
  const double angle = 2 * std::atan2(sine, std::abs(rotation.w()));
  return (rotation.w() < 0 ? -angle : angle) / sine * rotation.vec();
}

RotationAndJacobian RotationWithJacobian(const Eigen::Vector3d& w) {
  const double angle2 = w.squaredNorm();
  double a = 1 - angle2 / 6, b = 0.5 - angle2 / 24, c = 1.0 / 6 - angle2 / 120;
  if (angle2 > 1e-6) {
    const double angle = std::sqrt(angle2);
    a = std::sin(angle) / angle;
    b = (1 - std::cos(angle)) / angle2;
    c = (1 - a) / angle2;
  }
  const Eigen::Matrix3d cross = CrossMatrix(w), cross2 = cross * cross;
  return {Eigen::Matrix3d::Identity() + a * cross + b * cross2,
          Eigen::Matrix3d::Identity() + b * cross + c * cross2};
}

Rigid Moved(const Rigid& target_from_source, const Eigen::Matrix<double, 6, 1>& turn_and_shift) {
  const Eigen::Vector3d w = turn_and_shift.head<3>();
  Rigid moved = target_from_source;
  // Where nothing turns the rotation keeps its last bit.
  if (w.norm() > 0) moved.rotation = (RotationFromVector(w) * moved.rotation).normalized();
  moved.translation += turn_and_shift.tail<3>();
  return moved;
}

Rigid MovedInPlace(const Rigid& target_from_source,
                   const Eigen::Matrix<double, 6, 1>& turn_and_shift) {
  Rigid moved = Moved(target_from_source, turn_and_shift);
  const Eigen::Vector3d w = turn_and_shift.head<3>();
  if (w.norm() > 0) {
    moved.translation =
        RotationFromVector(w) * target_from_source.translation + turn_and_shift.tail<3>();
  }
  return moved;
}

Similarity Moved(const Similarity& target_from_source, const Eigen::Vector3d& pivot,
                 const Eigen::Matrix<double, 7, 1>& shift_turn_growth) {
  const Eigen::Quaterniond turn = RotationFromVector(shift_turn_growth.segment<3>(3));
  const double growth = std::exp(shift_turn_growth[6]);
  return {target_from_source.scale * growth, (turn * target_from_source.rotation).normalized(),
          pivot + growth * (turn * (target_from_source.translation - pivot)) +
              shift_turn_growth.head<3>()};
}

}  // namespace roomtex
