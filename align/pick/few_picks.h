#pragma once
// Poses from fewer picks than the thesis asks for (7.1.1): three to five leave several that fit,
// and the sparse model has to say which it is (pose_choice.h).

#include <vector>

#include "align/clicks/view_pose.h"

namespace roomtex {

// Every pose that sees three picks exactly where they were clicked, with the points in front of the
// camera (three_point_pose.h); up to four, in no order of merit.
// pairs: 3, not collinear. Residuals are rounding, covariances infinite.
std::vector<ViewPose> SolveThreePicks(const CameraProjection& projection, const PointPairs& pairs);

// SolveViewPoses() for 4 or 5 picks, started from every pose of every three of them as well: the
// linear start needs six. Best first.
std::vector<ViewPose> SolveFewPicks(const CameraProjection& projection, const PointPairs& pairs);

}  // namespace roomtex
