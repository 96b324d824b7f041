#pragma once
// The pose of one photo from clicked points (resection; perspective-n-point): the seven steps of
// thesis 7.1.1. They are the DLT (Abdel-Aziz and Karara 1971; Hartley and Zisserman 2004, 7.1) and
// Levenberg-Marquardt on the reprojection error. For points on or near a plane the error can have
// two minima (Schweighofer and Pinz 2006, "Robust Pose Estimation from a Planar Target"), so both
// are looked for.

#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Points seen in one photo and in the scan; column i of both is pick i.
struct PointPairs {
  Eigen::Matrix2Xd x_in_img;   // pixels, distorted, as taken
  Eigen::Matrix3Xd x_in_scan;  // metres
  // How many times less its click noise is than that of a pick with weight 1; empty = all 1.
  Eigen::VectorXd weight = Eigen::VectorXd();

  double WeightOf(int index) const { return weight.size() > 0 ? weight[index] : 1; }
  double SumOfSquares(const Eigen::VectorXd& residual_px) const;  // each times its weight
  int size() const { return static_cast<int>(x_in_img.cols()); }
  PointPairs Without(int index) const;
  // As if the scan had been read with the other azimuth sense: x -> -x.
  PointPairs Mirrored() const;
};

// How the scan points lie: root mean square extents along the principal axes, metres, descending.
Eigen::Vector3d PrincipalExtents(const Eigen::Matrix3Xd& points);

// Scan points count as coplanar below this share of their largest extent: what lies between is
// noise of the scan and of the fingers, not depth that a pose could rest on.
inline constexpr double kCoplanarShare = 0.01;

// Pixels per coordinate, of a click, before its residuals are known (docs/pick.md: one to two).
inline constexpr double kUsualClickSigma = 1.5;
// What the residuals of a photo's picks and the usual noise of clicks say together about a click
// with weight 1 (standard deviation per coordinate): few small residuals say little, so that the
// usual noise counts as much as four of them; large ones are believed.
double ClickSigma(double sum_px2, int redundancy);

struct ViewPose {
  Rigid cam_from_scan;
  Eigen::VectorXd residual_px;  // distance between click and projection, one per pick
  double sum_px2 = 0;           // weighted sum of their squares
  double rms_px = 0;            // root of their weighted mean square
  // Standard deviation of a click with weight 1 per coordinate, from the residuals:
  // sqrt(sum_px2 / (2 n - 6)).
  double sigma_px = 0;
  // Covariance of (w, dt) with x_in_cam = exp(w) (R x_in_scan + t) + dt: inverse normal matrix of
  // the last step times sigma_px^2. rad^2, rad m, m^2. Infinite where the picks do not determine
  // the pose.
  Matrix6d covariance = Matrix6d::Zero();
  // Of a lens that was found with the pose (lens_pose.h): the camera, one standard deviation of its
  // focal length, as a share, and of its radial term. None and 0 where the lens was known.
  std::optional<Camera> lens;
  double focal_sigma = 0, radial_sigma = 0;

  // Standard deviation of the camera's position, metres (root of the trace), from the covariance.
  double PositionSigma() const;
};

// Every locally best pose that has all points in front of the camera, best first; empty if there is
// none. The start is the thesis': projection matrix by linear least squares on undistorted
// normalised coordinates, det R > 0, singular values set to one, T by linear least squares, then
// Levenberg-Marquardt on the six unknowns of the reprojection error in real (distorted) pixels,
// points in front. Departure: a second start is the homography of the best-fitting plane together
// with its reflected solution, since the projection matrix is not determined by coplanar picks and
// badly by nearly coplanar ones. `start`: one more pose to start from. pairs: at least 4, not
// collinear.
std::vector<ViewPose> SolveViewPoses(const CameraProjection& projection, const PointPairs& pairs,
                                     const std::optional<Rigid>& start = std::nullopt);

// Finds poses: with a lens that is known (below), or with the lens (lens_pose.h).
class PoseSolver {
 public:
  virtual ~PoseSolver() = default;
  virtual const Camera& camera() const = 0;
  // Equations that a solution takes, of two per pick.
  virtual int num_unknowns() const = 0;
  // As SolveViewPoses().
  virtual std::vector<ViewPose> Solve(const PointPairs& pairs,
                                      const std::optional<ViewPose>& start) const = 0;
  // As PickResiduals().
  virtual Eigen::VectorXd Residuals(const PointPairs& pairs, const ViewPose& pose) const = 0;
};

class ViewPoseSolver : public PoseSolver {
 public:
  // The projection must outlive it.
  explicit ViewPoseSolver(const CameraProjection& projection) : projection_(projection) {}

  const Camera& camera() const override { return projection_.camera(); }
  int num_unknowns() const override { return 6; }
  std::vector<ViewPose> Solve(const PointPairs& pairs,
                              const std::optional<ViewPose>& start) const override;
  Eigen::VectorXd Residuals(const PointPairs& pairs, const ViewPose& pose) const override;

 private:
  const CameraProjection& projection_;
};

// Distances in pixels between the clicks and the projections under a pose; infinite for points that
// are not in front of the camera or outside the valid field of its lens.
Eigen::VectorXd PickResiduals(const CameraProjection& projection, const PointPairs& pairs,
                              const Rigid& cam_from_scan);

// Thesis 7.1.1, step 7: the pose reflected about the plane n.x = d of the points (`scan`; n unit
// length). Points of the plane keep their place in the photo and change sides of the camera.
Rigid ReflectAboutPlane(const Rigid& cam_from_scan, const Eigen::Vector3d& normal, double offset);

}  // namespace roomtex
