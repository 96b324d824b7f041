#pragma once
// Small motions on top of a pose: the exponential map of the rotations and the updates that
// Gauss-Newton steps make (Sola, Deray and Atchuthan 2018, "A micro Lie theory for state
// estimation in robotics", examples 4 and 5). Turns are rotation vectors w: axis times angle,
// radians.

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/similarity.h"

namespace roomtex {

// [v]x: CrossMatrix(v) * u = v x u.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v);

// exp(w), by Rodrigues' formula; exactly the identity for w = 0.
Eigen::Quaterniond RotationFromVector(const Eigen::Vector3d& w);

// The w of at most half a turn with exp(w) = rotation.
Eigen::Vector3d VectorFromRotation(const Eigen::Quaterniond& rotation);

// exp(w) as a matrix, and the left Jacobian L of the rotations at w: a further small turn e gives
// exp(w + L^-1 e) ~ exp(e) exp(w) (Sola et al., equations 144 and 145). Near w = 0 by series: both
// are smooth there.
struct RotationAndJacobian {
  Eigen::Matrix3d rotation, left_jacobian;
};
RotationAndJacobian RotationWithJacobian(const Eigen::Vector3d& w);

// x' = x + w x (x - t) + dt for small steps (w, dt), with t the pose's translation: the rotation is
// turned in the target frame, the translation shifted. Exact for any w.
Rigid Moved(const Rigid& target_from_source, const Eigen::Matrix<double, 6, 1>& turn_and_shift);

// x' = x + w x x + dt: as Moved(), but turned about the target's origin. Of a camera that is where
// it stands, wherever the origin of the scan lies.
Rigid MovedInPlace(const Rigid& target_from_source,
                   const Eigen::Matrix<double, 6, 1>& turn_and_shift);

// x' = x + dt + w x (x - pivot) + ds (x - pivot) for small steps (dt, w, ds); exact rotation, and
// the scale grows by exp(ds).
Similarity Moved(const Similarity& target_from_source, const Eigen::Vector3d& pivot,
                 const Eigen::Matrix<double, 7, 1>& shift_turn_growth);

}  // namespace roomtex
