#pragma once
// Poses of a camera that sees three known points: P3P.

#include <array>
#include <vector>

#include <Eigen/Core>

#include "core/similarity.h"

namespace roomtex {

// Every pose cam_from_target that sees the three `points` exactly along the `rays` (of any length,
// `cam`), each in front: up to four, in no order of merit; none where the points are collinear, two
// rays are one, or none exists. Distances along the rays by Grunert's quartic (1841; Haralick et
// al. 1994, "Review and Analysis of Solutions of the Three Point Perspective Pose Estimation
// Problem", eq. 9), then to the last digit by Newton's method. By hand: a
// fourth of the time of cv::solveP3P, which orders what it finds by cv::projectPoints.
std::vector<Rigid> SolveThreePointPose(const std::array<Eigen::Vector3d, 3>& points,
                                       const std::array<Eigen::Vector3d, 3>& rays);

}  // namespace roomtex
