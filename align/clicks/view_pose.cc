#include "align/clicks/view_pose.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include "colmap_ext/solver_log.h"
#include "core/balanced_inverse.h"
#include "core/camera_formulas.h"
#include "core/decompositions.h"

namespace roomtex {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMinViewDepth = 1e-6;  // metres in front of the camera
constexpr double kUsualResiduals = 4;   // what kUsualClickSigma counts as, beside real ones

// The viewing rays of the clicks that have any, with their scan points.
struct NormalisedPairs {
  Eigen::Matrix3Xd ray;  // CameraProjection::RayFromImg
  Eigen::Matrix3Xd x_in_scan;
  bool is_perspective = true;

  int size() const { return static_cast<int>(ray.cols()); }
  // Two vectors across the ray; of (x, y, 1) those that give the equations of thesis 7.1.1.
  std::array<Eigen::Vector3d, 2> Across(int i) const {
    const Eigen::Vector3d r = ray.col(i);
    if (is_perspective) return {Eigen::Vector3d(1, 0, -r.x()), Eigen::Vector3d(0, 1, -r.y())};
    const Eigen::Vector3d first = r.unitOrthogonal();
    return {first, r.cross(first)};
  }
  // The point (`cam`) can be what click i shows.
  bool IsAhead(int i, const Eigen::Vector3d& x_in_cam) const {
    return is_perspective ? x_in_cam.z() > kMinViewDepth : ray.col(i).dot(x_in_cam) > kMinViewDepth;
  }
};

NormalisedPairs Normalise(const CameraProjection& projection, const PointPairs& pairs) {
  NormalisedPairs result{Eigen::Matrix3Xd(3, pairs.size()), Eigen::Matrix3Xd(3, pairs.size()),
                         projection.camera().IsPerspective()};
  int count = 0;
  for (int i = 0; i < pairs.size(); ++i) {
    const auto ray = projection.RayFromImg(pairs.x_in_img.col(i));
    if (!ray) continue;
    result.ray.col(count) = *ray;
    result.x_in_scan.col(count) = pairs.x_in_scan.col(i);
    ++count;
  }
  result.ray.conservativeResize(3, count);
  result.x_in_scan.conservativeResize(3, count);
  return result;
}

struct Frame {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes =
      Eigen::Matrix3d::Identity();                    // columns, by descending extent, right-handed
  Eigen::Vector3d extents = Eigen::Vector3d::Zero();  // RMS, metres
};

Frame PrincipalFrame(const Eigen::Matrix3Xd& points) {
  Frame frame;
  if (points.cols() == 0) return frame;
  frame.centre = points.rowwise().mean();
  const Eigen::Matrix3Xd centred = points.colwise() - frame.centre;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(
      Eigen::Matrix3d(centred * centred.transpose() / static_cast<double>(points.cols())));
  for (int i = 0; i < 3; ++i) {
    frame.axes.col(i) = solver.eigenvectors().col(2 - i);
    frame.extents[i] = std::sqrt(std::max(0.0, solver.eigenvalues()[2 - i]));
  }
  if (frame.axes.determinant() < 0) frame.axes.col(2) *= -1;
  return frame;
}

Eigen::Quaterniond NearestRotation(const Eigen::Matrix3d& matrix) {
  // Thesis step 4: all singular values set to one.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
  return Eigen::Quaterniond(
             Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose()))
      .normalized();
}

// Thesis step 5: T for a given R, linear in the equations x z = X_x + T_x, y z = X_y + T_y.
Eigen::Vector3d BestTranslation(const NormalisedPairs& pairs, const Eigen::Quaterniond& rotation) {
  const int n = pairs.size();
  Eigen::MatrixXd a(2 * n, 3);
  Eigen::VectorXd b(2 * n);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d p = rotation * pairs.x_in_scan.col(i);
    const auto across = pairs.Across(i);
    for (int k = 0; k < 2; ++k) {
      a.row(2 * i + k) = across[k].transpose();
      b[2 * i + k] = -across[k].dot(p);
    }
  }
  return a.colPivHouseholderQr().solve(b);
}

// Thesis steps 2 to 5. None if the projection matrix is not determined (coplanar picks).
std::optional<Rigid> PoseFromProjectionMatrix(const NormalisedPairs& pairs, const Frame& frame) {
  const int n = pairs.size();
  const double size = frame.extents.norm();
  if (n < 6 || !(frame.extents[2] > 1e-6 * size)) return std::nullopt;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * n, 12);
  for (int i = 0; i < n; ++i) {
    Eigen::Vector4d p;
    p << (pairs.x_in_scan.col(i) - frame.centre) / size, 1;
    const auto across = pairs.Across(i);
    for (int k = 0; k < 6; ++k) {
      a.block<1, 4>(2 * i + k / 3, 4 * (k % 3)) = across[k / 3][k % 3] * p.transpose();
    }
  }
  const Eigen::VectorXd p = RightSingularVectors(a).col(11);
  Eigen::Matrix3d m;
  m << p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10];
  if (m.determinant() < 0) m = -m;  // step 3: det R > 0
  if (!(m.norm() > 0)) return std::nullopt;
  const Eigen::Quaterniond rotation = NearestRotation(m);
  return Rigid{rotation, BestTranslation(pairs, rotation)};
}

// The pose that the homography between the plane through the points and the photo gives.
std::optional<Rigid> PoseFromPlane(const NormalisedPairs& pairs, const Frame& frame) {
  const int n = pairs.size();
  const double size = frame.extents.norm();
  if (n < 4 || !(frame.extents[1] > 1e-9 * size)) return std::nullopt;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * n, 9);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d local =
        frame.axes.transpose() * (pairs.x_in_scan.col(i) - frame.centre) / size;
    const Eigen::RowVector3d p(local.x(), local.y(), 1);
    const auto across = pairs.Across(i);
    for (int k = 0; k < 6; ++k) {
      a.block<1, 3>(2 * i + k / 3, 3 * (k % 3)) = across[k / 3][k % 3] * p;
    }
  }
  const Eigen::VectorXd h = RightSingularVectors(a).col(8);
  double ahead = h[8];  // the centre of the points is in front
  if (!pairs.is_perspective) {
    ahead = 0;
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector3d local =
          frame.axes.transpose() * (pairs.x_in_scan.col(i) - frame.centre) / size;
      const Eigen::Vector3d p(local.x(), local.y(), 1);
      const Eigen::Vector3d seen(h.head<3>().dot(p), h.segment<3>(3).dot(p), h.tail<3>().dot(p));
      ahead += pairs.ray.col(i).dot(seen.normalized());
    }
  }
  const double sign = ahead < 0 ? -1 : 1;
  Eigen::Matrix3d m;
  m.col(0) = sign * Eigen::Vector3d(h[0], h[3], h[6]);
  m.col(1) = sign * Eigen::Vector3d(h[1], h[4], h[7]);
  const double scale = std::sqrt(m.col(0).norm() * m.col(1).norm());
  if (!(scale > 0)) return std::nullopt;
  m.col(2) = m.col(0).cross(m.col(1)) / scale;
  const Eigen::Quaterniond rotation =
      NearestRotation(Eigen::Matrix3d(m / scale * frame.axes.transpose()));
  return Rigid{rotation, BestTranslation(pairs, rotation)};
}

// The other solution that nearly coplanar points have when perspective is weak: their plane
// mirrored about the line of sight to their centre.
Rigid ReflectedAlongSight(const NormalisedPairs& pairs, const Frame& frame, const Rigid& pose) {
  const Eigen::Vector3d sight = (pose * frame.centre).normalized();
  const Eigen::Matrix3d mirror_in_cam = Eigen::Matrix3d::Identity() - 2 * sight * sight.transpose();
  const Eigen::Vector3d normal = frame.axes.col(2);
  const Eigen::Matrix3d mirror_in_scan =
      Eigen::Matrix3d::Identity() - 2 * normal * normal.transpose();
  const Eigen::Quaterniond rotation(
      Eigen::Matrix3d(mirror_in_cam * pose.rotation.toRotationMatrix() * mirror_in_scan));
  return {rotation.normalized(), BestTranslation(pairs, rotation.normalized())};
}

// Reprojection error in pixels; parameters (w, dt) with x_in_cam = exp(w) (R x_in_scan + t) + dt, R
// and t those of the start: turned about the camera, wherever the origin of the scan lies.
struct PickCost {
  template <typename T>
  bool operator()(const T* const pose, T* residual) const {
    const T at_start[3] = {T(start_point.x()), T(start_point.y()), T(start_point.z())};
    T p[3];
    ceres::AngleAxisRotatePoint(pose, at_start, p);
    for (int i = 0; i < 3; ++i) p[i] += pose[3 + i];
    T params[kMaxCameraParams], x, y;
    for (size_t i = 0; i < camera->params.size(); ++i) params[i] = T(camera->params[i]);
    if (camera_formulas::IsPerspective(camera->model)) {
      if (p[2] < T(kMinViewDepth)) return false;
      for (int i = 0; i < 2; ++i) p[i] = p[i] / p[2];
      p[2] = T(1);
    }
    camera_formulas::ImgError(camera->model, params, p[0], p[1], p[2], x_in_img, &x, &y);
    residual[0] = weight * x;
    residual[1] = weight * y;
    return true;
  }
  const Camera* camera;
  Eigen::Vector2d x_in_img;
  Eigen::Vector3d start_point;  // `cam`, as the start has it
  double weight;
};

class PoseProblem {
 public:
  PoseProblem(const CameraProjection& projection, const PointPairs& pairs, const Rigid& start)
      : start_(start) {
    for (int i = 0; i < pairs.size(); ++i) {
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<PickCost, 2, 6>(new PickCost{
                                    &projection.camera(), pairs.x_in_img.col(i),
                                    start * pairs.x_in_scan.col(i), pairs.WeightOf(i)}),
                                nullptr, parameters_);
    }
  }

  bool Solve() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-14;
    options.gradient_tolerance = 1e-14;
    options.parameter_tolerance = 1e-12;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    SilenceCeres();
    ceres::Solve(options, &problem_, &summary);
    return summary.IsSolutionUsable();
  }

  Rigid Pose() const {
    Eigen::Quaterniond turn;
    double wxyz[4];
    // Not RotationFromVector(): the counterpart of the cost's ceres::AngleAxisRotatePoint().
    ceres::AngleAxisToQuaternion(parameters_, wxyz);
    turn = Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
    return {(turn * start_.rotation).normalized(),
            turn * start_.translation + Eigen::Map<const Eigen::Vector3d>(parameters_ + 3)};
  }

  // Normal matrix; valid when the problem was made at the pose itself (w = 0).
  Matrix6d NormalMatrix() {
    ceres::CRSMatrix jacobian;
    if (!problem_.Evaluate({}, nullptr, nullptr, nullptr, &jacobian)) return Matrix6d::Zero();
    Matrix6d normal = Matrix6d::Zero();
    for (int row = 0; row < jacobian.num_rows; ++row) {
      Eigen::Matrix<double, 6, 1> j = Eigen::Matrix<double, 6, 1>::Zero();
      for (int k = jacobian.rows[row]; k < jacobian.rows[row + 1]; ++k) {
        j[jacobian.cols[k]] = jacobian.values[k];
      }
      normal += j * j.transpose();
    }
    return normal;
  }

 private:
  Rigid start_;
  double parameters_[6] = {0, 0, 0, 0, 0, 0};
  ceres::Problem problem_;
};

// Infinite where the picks leave something open.
Matrix6d InverseNormal(const Matrix6d& normal) {
  return BalancedInverse(normal, 1e-13).value_or(Matrix6d::Constant(kInfinity));
}

// Thesis steps 6 and 7, from one start. None if no point lies in front, or the solution leaves the
// lens' field.
std::optional<ViewPose> Refine(const CameraProjection& projection, const PointPairs& pairs,
                               const NormalisedPairs& normalised, const Frame& frame, Rigid start) {
  const Eigen::Matrix3Xd& points =
      normalised.is_perspective ? pairs.x_in_scan : normalised.x_in_scan;
  const auto num_in_front = [&](const Rigid& pose) {
    int count = 0;
    for (int i = 0; i < points.cols(); ++i) count += normalised.IsAhead(i, pose * points.col(i));
    return count;
  };
  if (num_in_front(start) == 0) {
    const Eigen::Vector3d normal = frame.axes.col(2);
    start = ReflectAboutPlane(start, normal, normal.dot(frame.centre));
  }
  if (num_in_front(start) < points.cols()) return std::nullopt;
  PoseProblem problem(projection, pairs, start);
  if (!problem.Solve()) return std::nullopt;
  ViewPose result;
  result.cam_from_scan = problem.Pose();
  result.residual_px = PickResiduals(projection, pairs, result.cam_from_scan);
  result.sum_px2 = pairs.SumOfSquares(result.residual_px);
  if (!std::isfinite(result.sum_px2)) return std::nullopt;
  const double sum_of_weights = pairs.SumOfSquares(Eigen::VectorXd::Ones(pairs.size()));
  result.rms_px = std::sqrt(result.sum_px2 / sum_of_weights);
  result.sigma_px = std::sqrt(result.sum_px2 / std::max(1, 2 * pairs.size() - 6));
  return result;
}

}  // namespace

PointPairs PointPairs::Without(int index) const {
  PointPairs rest{Eigen::Matrix2Xd(2, size() - 1), Eigen::Matrix3Xd(3, size() - 1)};
  rest.x_in_img << x_in_img.leftCols(index), x_in_img.rightCols(size() - 1 - index);
  rest.x_in_scan << x_in_scan.leftCols(index), x_in_scan.rightCols(size() - 1 - index);
  if (weight.size() == 0) return rest;
  rest.weight.resize(size() - 1);
  rest.weight << weight.head(index), weight.tail(size() - 1 - index);
  return rest;
}

double ClickSigma(double sum_px2, int redundancy) {
  const double all = kUsualResiduals + std::max(0, redundancy);
  const double together =
      std::sqrt((kUsualResiduals * kUsualClickSigma * kUsualClickSigma + sum_px2) / all);
  return redundancy > 0 ? std::max(together, std::sqrt(sum_px2 / redundancy)) : together;
}

double PointPairs::SumOfSquares(const Eigen::VectorXd& residual_px) const {
  return weight.size() == 0 ? residual_px.squaredNorm()
                            : residual_px.cwiseProduct(weight).squaredNorm();
}

PointPairs PointPairs::Mirrored() const {
  PointPairs mirrored = *this;
  mirrored.x_in_scan.row(0) *= -1;
  return mirrored;
}

Eigen::Vector3d PrincipalExtents(const Eigen::Matrix3Xd& points) {
  return PrincipalFrame(points).extents;
}

double ViewPose::PositionSigma() const {
  // w turns the camera where it stands: its place moves by -R^T dt.
  if (!covariance.allFinite()) return kInfinity;
  return std::sqrt(covariance.bottomRightCorner<3, 3>().trace());
}

std::vector<ViewPose> SolveViewPoses(const CameraProjection& projection, const PointPairs& pairs,
                                     const std::optional<Rigid>& start) {
  const NormalisedPairs normalised = Normalise(projection, pairs);
  const Frame frame = PrincipalFrame(normalised.x_in_scan);
  std::vector<Rigid> starts;
  if (start) starts.push_back(*start);
  for (const auto& linear :
       {PoseFromProjectionMatrix(normalised, frame), PoseFromPlane(normalised, frame)}) {
    if (!linear) continue;
    starts.push_back(*linear);
    starts.push_back(ReflectedAlongSight(normalised, frame, *linear));
  }
  std::vector<ViewPose> found;
  for (const Rigid& one : starts) {
    const auto refined = Refine(projection, pairs, normalised, frame, one);
    if (!refined) continue;
    // The reflected solution of the refined pose is a better start than that of the rough one.
    found.push_back(*refined);
    const auto reflected = Refine(projection, pairs, normalised, frame,
                                  ReflectedAlongSight(normalised, frame, refined->cam_from_scan));
    if (reflected) found.push_back(*reflected);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const ViewPose& a, const ViewPose& b) { return a.sum_px2 < b.sum_px2; });
  std::vector<ViewPose> distinct;
  for (ViewPose& pose : found) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const ViewPose& other) {
      return RotationAngle(pose.cam_from_scan.rotation, other.cam_from_scan.rotation) < 2e-3;
    });
    if (known) continue;
    pose.covariance =
        pose.sigma_px * pose.sigma_px *
        InverseNormal(PoseProblem(projection, pairs, pose.cam_from_scan).NormalMatrix());
    if (!pose.covariance.allFinite()) pose.covariance.setConstant(kInfinity);
    distinct.push_back(pose);
  }
  return distinct;
}

std::vector<ViewPose> ViewPoseSolver::Solve(const PointPairs& pairs,
                                            const std::optional<ViewPose>& start) const {
  return SolveViewPoses(projection_, pairs,
                        start ? std::optional<Rigid>(start->cam_from_scan) : std::nullopt);
}

Eigen::VectorXd ViewPoseSolver::Residuals(const PointPairs& pairs, const ViewPose& pose) const {
  return PickResiduals(projection_, pairs, pose.cam_from_scan);
}

Eigen::VectorXd PickResiduals(const CameraProjection& projection, const PointPairs& pairs,
                              const Rigid& cam_from_scan) {
  Eigen::VectorXd residual_px(pairs.size());
  for (int i = 0; i < pairs.size(); ++i) {
    const auto error =
        projection.ImgError(cam_from_scan * pairs.x_in_scan.col(i), pairs.x_in_img.col(i));
    residual_px[i] = error ? error->norm() : kInfinity;
  }
  return residual_px;
}

Rigid ReflectAboutPlane(const Rigid& cam_from_scan, const Eigen::Vector3d& normal, double offset) {
  // Points of the plane are their own mirror images S x = x - 2 n (n.x - d), so -(R S x + t)
  // projects them to the same place, on the other side of the camera; -R S is a rotation again.
  const Eigen::Matrix3d r = cam_from_scan.rotation.toRotationMatrix();
  const Eigen::Matrix3d mirrored =
      -r * (Eigen::Matrix3d::Identity() - 2 * normal * normal.transpose());
  return {Eigen::Quaterniond(mirrored).normalized(),
          -(cam_from_scan.translation + 2 * offset * (r * normal))};
}

}  // namespace roomtex
