#pragma once
// What two views say about each other (thesis 6.1): fundamental matrix, homography, essential
// matrix and the poses that follow from them.
//
// All matrices act on rays (x/z, y/z, 1), i.e. K is applied first: with pixels u = K x the thesis'
// F is K_r^-T F K_l^-1, and its E = K_r^T F_pixels K_l is our F with its singular values corrected.
// This way lens distortion and two different cameras need no further care. Errors are in pixels
// nevertheless (view_rays.h).

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "colmap_ext/ransac.h"
#include "colmap_ext/view_rays.h"
#include "core/similarity.h"

namespace roomtex {

// Chi-square quantiles at 99 %: the squared error, in units of the keypoint noise's variance, that
// one in a hundred true matches exceeds.
inline constexpr double kChiSquare1 = 6.635;  // one constraint: epipolar line
inline constexpr double kChiSquare2 = 9.210;  // two: a position

// Squared distance to the epipolar constraint x_r^T F x_l = 0, px^2: the correction of both
// keypoints together, to first order (Sampson; Hartley and Zisserman 2004, eq. 11.9, with a
// covariance per keypoint).
double EpipolarError2(const Eigen::Matrix3d& right_f_left, const RayMatch& match);

// Squared distance of the match to x_r ~ H x_l, px^2: the transfer error over the noise that both
// keypoints bring into it, to first order. Infinite for points that H sends to infinity or through
// it.
double HomographyError2(const Eigen::Matrix3d& right_from_left, const RayMatch& match);

// Normalised 8-point algorithm (Hartley 1997): least squares over the given matches, rank 2
// enforced. None with fewer than 8.
std::optional<Eigen::Matrix3d> FitFundamental(const std::vector<RayMatch>& matches,
                                              const std::vector<int>& indices);
// The essential matrices that five matches allow, up to ten (Nister 2004, through OpenCV). Unlike F
// they are not left open by a plane: the five-point problem has two solutions there, both of them
// camera motions. Empty if the matches are degenerate.
std::vector<Eigen::Matrix3d> FitEssential(const std::vector<RayMatch>& matches,
                                          const std::vector<int>& five);
// Normalised DLT (Hartley and Zisserman 2004, algorithm 4.2). Signed so that points stay in front
// (x_r^T H x_l > 0). None with fewer than 4 or if degenerate.
std::optional<Eigen::Matrix3d> FitHomography(const std::vector<RayMatch>& matches,
                                             const std::vector<int>& indices);
// The rotation that takes the left rays to the right ones (least squares of unit vectors). None
// with fewer than 2.
std::optional<Eigen::Matrix3d> FitRotation(const std::vector<RayMatch>& matches,
                                           const std::vector<int>& indices);

// Inliers are positions in `matches`.
RansacResult EstimateFundamental(const std::vector<RayMatch>& matches,
                                 const RansacOptions& options);
RansacResult EstimateEssential(const std::vector<RayMatch>& matches, const RansacOptions& options);
// `among`: the matches to use, e.g. the inliers of F (thesis 6.1).
RansacResult EstimateHomography(const std::vector<RayMatch>& matches, const std::vector<int>& among,
                                const RansacOptions& options);
RansacResult EstimateRotation(const std::vector<RayMatch>& matches, const RansacOptions& options);

// Nearest matrix with singular values (1, 1, 0).
Eigen::Matrix3d EssentialFromFundamental(const Eigen::Matrix3d& right_f_left);
Eigen::Matrix3d EssentialFromPose(const Rigid& right_from_left);
// The four poses [U W V^T | +-u3], [U W^T V^T | +-u3]; unit baseline.
std::vector<Rigid> PosesFromEssential(const Eigen::Matrix3d& right_e_left);
// The poses of a plane's homography (up to four; Malis and Vargas 2007 through OpenCV); unit
// baseline. Empty for a pure rotation, which has none.
std::vector<Rigid> PosesFromHomography(const Eigen::Matrix3d& right_from_left);

// How many of the given matches lie in front of both views.
int CountInFront(const Rigid& right_from_left, const std::vector<RayMatch>& matches,
                 const std::vector<int>& indices);

}  // namespace roomtex
