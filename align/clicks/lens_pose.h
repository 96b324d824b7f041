#pragma once
// The pose of one photo together with its lens, where that is not known exactly: focal length and
// one radial term (SIMPLE_RADIAL), the principal point near the middle of the photo. Resection with
// unknown focal length (PnPf; Bujnak, Kukelova and Pajdla 2008); here the start is a search over
// the focal length with view_pose.h at each, and the answer the most probable one (maximum a
// posteriori) of clicks and what is known of the lens beforehand.

#include <limits>
#include <string>

#include "align/clicks/pick_review.h"

namespace roomtex {

enum class FocalSource {
  kGiven,  // the camera is as it is
  kExif,   // the photo's EXIF: whole millimetres, equivalents: good to some percent
  kPicks,  // nobody says: the picks alone
};
// "params", "exif", "picks": as reports have it.
const char* FocalSourceName(FocalSource source);

// One standard deviation of what EXIF says, as a share, and of the radial term k that a lens has.
inline constexpr double kExifFocalSigma = 0.03;
inline constexpr double kRadialSigma = 0.1;
// How far the principal point lies from the middle, as a share of the photo's longer side.
inline constexpr double kPrincipalSigma = 0.01;
// The fewest picks that tell a focal length that nobody knows.
inline constexpr int kMinPicksForFocal = 8;

// Why these picks do not tell the focal length: too few, or on one plane; without a full stop, ""
// if they do.
std::string FindFocalProblem(const PointPairs& pairs);

// Poses with a lens. camera: SIMPLE_RADIAL or SIMPLE_PINHOLE, with the focal length that EXIF says
// (of kPicks it is not looked at). ViewPose::lens is what was found; the covariance is that of the
// pose with a lens as uncertain as it is.
class LensPoseSolver : public PoseSolver {
 public:
  LensPoseSolver(const Camera& camera, FocalSource source);

  const Camera& camera() const override { return camera_; }
  int num_unknowns() const override;
  std::vector<ViewPose> Solve(const PointPairs& pairs,
                              const std::optional<ViewPose>& start) const override;
  Eigen::VectorXd Residuals(const PointPairs& pairs, const ViewPose& pose) const override;

 private:
  std::vector<ViewPose> Starts(const PointPairs& pairs, const std::optional<ViewPose>& start) const;
  std::optional<ViewPose> Refine(const PointPairs& pairs, const ViewPose& start) const;
  bool HasRadial() const { return camera_.model == CameraModel::kSimpleRadial; }

  const Camera camera_;
  const FocalSource source_;
};

}  // namespace roomtex
