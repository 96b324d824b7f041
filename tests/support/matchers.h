#pragma once
// Matchers with absolute tolerances; a NaN on either side always fails.

#include <Eigen/Core>
#include <gmock/gmock.h>

#include "core/similarity.h"

namespace roomtex {

// Largest absolute difference of two matrices of equal size is at most `tolerance`.
MATCHER_P2(IsNearMatrix, expected, tolerance, "is near the expected matrix") {
  if (arg.rows() != expected.rows() || arg.cols() != expected.cols()) {
    *result_listener << "sizes differ";
    return false;
  }
  const double difference = (arg - expected).cwiseAbs().maxCoeff();
  *result_listener << "largest difference " << difference;
  for (int i = 0; i < arg.rows(); ++i) {
    for (int j = 0; j < arg.cols(); ++j) {
      if (!(std::abs(arg(i, j) - expected(i, j)) <= tolerance)) return false;
    }
  }
  return true;
}

// Rotations differ by at most `radians`, translations by at most `metres`.
MATCHER_P3(IsNearRigid, expected, radians, metres, "is near the expected motion") {
  const double angle = RotationAngle(arg.rotation, expected.rotation);
  const double distance = (arg.translation - expected.translation).norm();
  *result_listener << "angle " << angle << ", distance " << distance;
  return angle <= radians && distance <= metres;
}

}  // namespace roomtex
