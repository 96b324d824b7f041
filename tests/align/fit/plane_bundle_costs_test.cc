#include "align/fit/plane_bundle_costs.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/dynamic_autodiff_cost_function.h>
#include <ceres/numeric_diff_cost_function.h>
#include <ceres/rotation.h>
#include <gmock/gmock.h>

#include "core/camera_formulas.h"
#include "tests/align/clicks/pick_maker.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

// Residuals and Jacobians (one per parameter block, by rows) of a cost.
struct Evaluation {
  Eigen::VectorXd residuals;
  std::vector<Eigen::MatrixXd> jacobians;
};
Evaluation Evaluate(const ceres::CostFunction& cost, const std::vector<const double*>& parameters) {
  using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Evaluation result;
  result.residuals.setConstant(cost.num_residuals(), NAN);
  std::vector<RowMatrix> by_rows;
  std::vector<double*> pointers;
  for (const int size : cost.parameter_block_sizes()) {
    by_rows.push_back(RowMatrix::Constant(cost.num_residuals(), size, NAN));
  }
  for (RowMatrix& one : by_rows) pointers.push_back(one.data());
  EXPECT_TRUE(cost.Evaluate(parameters.data(), result.residuals.data(), pointers.data()));
  for (const RowMatrix& one : by_rows) result.jacobians.push_back(one);
  return result;
}

struct OneRowPlaneCost {
  template <typename T>
  bool operator()(const T* q, T* residual) const {
    residual[0] = T(0);
    for (int i = 0; i < 3; ++i) residual[0] += T(beta * normal[i]) * (q[i] - T(point[i]));
    return true;
  }
  double beta;
  Eigen::Vector3d point, normal;
};

struct ThesisPlaneCost {
  template <typename T>
  bool operator()(const T* q, T* residuals) const {
    OneRowPlaneCost{beta / std::sqrt(2.0), point, normal}(q, residuals);
    residuals[1] = residuals[0];
    return true;
  }
  double beta;
  Eigen::Vector3d point, normal;
};

TEST(PlaneCost, HasTheDerivativesOfAutomaticAndNumericDifferences) {
  const Eigen::Vector3d point(1, -2, 0.5), normal = Eigen::Vector3d(0.3, -0.7, 0.4).normalized();
  const Eigen::Vector3d q(0.7, 0.2, -1.1);
  const PlaneCost cost(730, point, normal);
  const ceres::AutoDiffCostFunction<ThesisPlaneCost, 2, 3> automatic(
      new ThesisPlaneCost{730, point, normal});
  const ceres::NumericDiffCostFunction<ThesisPlaneCost, ceres::CENTRAL, 2, 3> numeric(
      new ThesisPlaneCost{730, point, normal});
  const Evaluation own = Evaluate(cost, {q.data()});
  for (const ceres::CostFunction* other :
       std::initializer_list<const ceres::CostFunction*>{&automatic, &numeric}) {
    const Evaluation theirs = Evaluate(*other, {q.data()});
    EXPECT_THAT(own.residuals, IsNearMatrix(theirs.residuals, 1e-9));
    EXPECT_THAT(own.jacobians[0], IsNearMatrix(theirs.jacobians[0], 1e-5));
  }
}

TEST(PlaneCost, HasTheCostAndGradientOfOneRow) {
  const Eigen::Vector3d point(1, -2, 0.5), normal = Eigen::Vector3d(0.3, -0.7, 0.4).normalized();
  const Eigen::Vector3d q(0.7, 0.2, -1.1);
  const Evaluation two = Evaluate(PlaneCost(730, point, normal), {q.data()});
  const Evaluation one = Evaluate(
      ceres::AutoDiffCostFunction<OneRowPlaneCost, 1, 3>(new OneRowPlaneCost{730, point, normal}),
      {q.data()});
  EXPECT_NEAR(two.residuals.squaredNorm(), one.residuals.squaredNorm(), 1e-6);
  EXPECT_NEAR(two.residuals.squaredNorm(), std::pow(730 * normal.dot(q - point), 2), 1e-6);
  EXPECT_THAT(Eigen::MatrixXd(two.jacobians[0].transpose() * two.residuals),
              IsNearMatrix(Eigen::MatrixXd(one.jacobians[0].transpose() * one.residuals), 1e-6));
  EXPECT_THAT(Eigen::MatrixXd(two.jacobians[0].transpose() * two.jacobians[0]),
              IsNearMatrix(Eigen::MatrixXd(one.jacobians[0].transpose() * one.jacobians[0]), 1e-6));
}

// The same projection, differentiated by Ceres.
struct AutomaticReprojection {
  template <typename T>
  bool operator()(T const* const* parameters, T* residuals) const {
    const T* const pose = parameters[0];
    T offset[3], started[3], p[3];
    for (int i = 0; i < 3; ++i) offset[i] = parameters[1][i] - pose[3 + i];
    for (int i = 0; i < 3; ++i) {
      started[i] = T(0);
      for (int k = 0; k < 3; ++k) started[i] += T(start(i, k)) * offset[k];
    }
    ceres::AngleAxisRotatePoint(pose, started, p);
    T x, y;
    camera_formulas::ImgError(model, parameters[2], p[0], p[1], p[2], x_in_img, &x, &y);
    residuals[0] = T(weight) * x;
    residuals[1] = T(weight) * y;
    return true;
  }
  CameraModel model;
  Eigen::Matrix3d start;
  Eigen::Vector2d x_in_img;
  double weight;
};

TEST(ReprojectionCost, HasTheDerivativesOfAutomaticDifferencesForEveryCamera) {
  for (int id = 0; id < kNumCameraModels; ++id) {
    PickMaker maker(id, static_cast<CameraModel>(id));
    const Camera camera = maker.projection.camera();
    const PointPairs pairs = maker.General(20);
    PoseParameters pose(maker.cam_from_scan);
    // Also away from the pose it started from.
    for (const double turn : {0.0, 1e-5, 0.02, 0.4}) {
      for (int k = 0; k < 3; ++k) pose.values[k] = turn * (k - 0.7);
      const int num_params = static_cast<int>(camera.params.size());
      ceres::DynamicAutoDiffCostFunction<AutomaticReprojection> automatic(
          new AutomaticReprojection{camera.model, pose.start_matrix, pairs.x_in_img.col(0), 0.6});
      automatic.AddParameterBlock(6);
      automatic.AddParameterBlock(3);
      automatic.AddParameterBlock(num_params);
      automatic.SetNumResiduals(2);
      const ReprojectionCost cost(pose, camera, pairs.x_in_img.col(0), 0.6, true);
      const Eigen::Vector3d point = pairs.x_in_scan.col(0);
      if (camera.IsPerspective() && (pose.CamFromScan() * point).z() < 0.5) continue;
      const std::vector<const double*> parameters{pose.values, point.data(), camera.params.data()};
      const Evaluation own = Evaluate(cost, parameters), theirs = Evaluate(automatic, parameters);
      EXPECT_THAT(own.residuals, IsNearMatrix(theirs.residuals, 1e-6)) << id;
      for (int block = 0; block < 3; ++block) {
        const double size = 1 + theirs.jacobians[block].cwiseAbs().maxCoeff();
        EXPECT_THAT(own.jacobians[block], IsNearMatrix(theirs.jacobians[block], 1e-8 * size))
            << CameraModelName(camera.model) << ", block " << block << ", turn " << turn;
      }
      // With the intrinsics held, the other blocks are the same.
      const Evaluation held =
          Evaluate(ReprojectionCost(pose, camera, pairs.x_in_img.col(0), 0.6, false),
                   {pose.values, point.data()});
      EXPECT_EQ(held.jacobians.size(), 2u);
      EXPECT_THAT(held.jacobians[0], IsNearMatrix(own.jacobians[0], 0.0));
    }
  }
}

// Derivatives by everything of a camera that moves while its rows are read.
TEST(ReprojectionCost, HasTheNumericDerivativesOfARollingShutter) {
  for (const CameraModel model : {CameraModel::kOpenCv, CameraModel::kFisheye}) {
    PickMaker maker(7, model);
    Camera camera = maker.projection.camera();
    const PointPairs pairs = maker.General(6);
    PoseParameters pose(maker.cam_from_scan);
    for (int i = 0; i < pairs.size(); ++i) {
      const ReprojectionCost cost(pose, camera, pairs.x_in_img.col(i), 1, true, Rigid(), true);
      Eigen::Vector3d point = pairs.x_in_scan.col(i);
      double motion[6] = {0.01, -0.006, 0.008, 0.02, 0.01, -0.03};
      const std::vector<std::pair<double*, int>> blocks{
          {pose.values, 6},
          {point.data(), 3},
          {camera.params.data(), static_cast<int>(camera.params.size())},
          {motion, 6}};
      const std::vector<const double*> parameters{pose.values, point.data(), camera.params.data(),
                                                  motion};
      const Evaluation own = Evaluate(cost, parameters);
      for (size_t block = 0; block < blocks.size(); ++block) {
        for (int k = 0; k < blocks[block].second; ++k) {
          double& value = blocks[block].first[k];
          const double before = value, step = 1e-6 * (1 + std::abs(before));
          value = before + step;
          const Eigen::VectorXd more = Evaluate(cost, parameters).residuals;
          value = before - step;
          const Eigen::VectorXd numeric =
              (more - Evaluate(cost, parameters).residuals) / (2 * step);
          value = before;
          const double size = 1 + numeric.norm();
          EXPECT_THAT(Eigen::VectorXd(own.jacobians[block].col(k)),
                      IsNearMatrix(numeric, 1e-5 * size))
              << CameraModelName(model) << ", block " << block << ", parameter " << k;
        }
      }
    }
  }
}

// At the truth noise of keypoints pulls a motion and a lens nowhere. The row of the keypoint, in
// place of the one that sees the point, would have its noise in the derivatives: cameras would nod
// as far as that makes the noise look smaller (here by 12 standard deviations).
TEST(ReprojectionCost, NoiseOfKeypointsNodsNoCameraWithARollingShutter) {
  constexpr double kNoisePx = 10;
  PickMaker maker(11, CameraModel::kOpenCv);
  const Camera camera = maker.projection.camera();
  const PointPairs still = maker.General(200000);
  const RowMotion motion{{0.01, -0.006, 0.008}, {0.02, 0.01, -0.03}};
  PointPairs pairs = still;
  for (int i = 0; i < pairs.size(); ++i) {
    pairs.x_in_img.col(i) =
        ImgFromMovingCam(maker.projection, motion, maker.cam_from_scan * pairs.x_in_scan.col(i))
            .value();
  }
  pairs = maker.WithNoise(pairs, kNoisePx);
  PoseParameters pose(maker.cam_from_scan);
  double moved[6];
  Eigen::Map<Eigen::Vector3d>{moved} = motion.turn;
  Eigen::Map<Eigen::Vector3d>{moved + 3} = motion.move;
  std::vector<Eigen::VectorXd> pulls(4), squares(4);
  for (int i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d point = pairs.x_in_scan.col(i);
    const ReprojectionCost cost(pose, camera, pairs.x_in_img.col(i), 1, true, Rigid(), true);
    const Evaluation one = Evaluate(cost, {pose.values, point.data(), camera.params.data(), moved});
    for (size_t block = 0; block < one.jacobians.size(); ++block) {
      if (block == 1) continue;  // each point's own
      const Eigen::MatrixXd& by = one.jacobians[block];
      if (i == 0) pulls[block] = squares[block] = Eigen::VectorXd::Zero(by.cols());
      pulls[block] += by.transpose() * one.residuals;
      squares[block] += kNoisePx * kNoisePx * by.colwise().squaredNorm().transpose();
    }
  }
  for (const size_t block : {0, 2, 3}) {
    for (int k = 0; k < pulls[block].size(); ++k) {
      EXPECT_LT(std::abs(pulls[block][k]), 4 * std::sqrt(squares[block][k]))
          << "block " << block << ", parameter " << k;
    }
  }
}

// Derivatives by the pose of the rig, for a camera that stands and looks elsewhere in it.
TEST(ReprojectionCost, HasTheNumericDerivativesByThePoseOfARig) {
  for (const CameraModel model :
       {CameraModel::kOpenCv, CameraModel::kFisheye, CameraModel::kEquirectangular}) {
    PickMaker maker(7, model);
    const Camera camera = maker.projection.camera();
    const PointPairs pairs = maker.General(6);
    const Rigid cam_from_rig{
        Eigen::Quaterniond(Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, -1).normalized())),
        Eigen::Vector3d(0.2, -0.1, 0.05)};
    PoseParameters pose(cam_from_rig.Inverse() * maker.cam_from_scan);
    for (int i = 0; i < pairs.size(); ++i) {
      const ReprojectionCost cost(pose, camera, pairs.x_in_img.col(i), 1, false, cam_from_rig);
      const Eigen::Vector3d point = pairs.x_in_scan.col(i);
      const Evaluation own = Evaluate(cost, {pose.values, point.data()});
      EXPECT_LT(own.residuals.norm(), 1e-6);
      for (int k = 0; k < 6; ++k) {
        PoseParameters more = pose, less = pose;
        more.values[k] += 1e-6;
        less.values[k] -= 1e-6;
        const Eigen::VectorXd numeric = (Evaluate(cost, {more.values, point.data()}).residuals -
                                         Evaluate(cost, {less.values, point.data()}).residuals) /
                                        2e-6;
        EXPECT_THAT(Eigen::VectorXd(own.jacobians[0].col(k)), IsNearMatrix(numeric, 1e-2));
      }
    }
  }
}

TEST(ReprojectionCost, AgreesWithTheProjectionAndRefusesPointsBehind) {
  PickMaker maker(3);
  const PointPairs pairs = maker.General(20);
  PoseParameters pose(maker.cam_from_scan);
  EXPECT_THAT(pose.CamFromScan(), IsNearRigid(maker.cam_from_scan, 1e-7, 1e-12));
  const Camera camera = maker.projection.camera();
  for (int i = 0; i < pairs.size(); ++i) {
    const ReprojectionCost cost(pose, camera, pairs.x_in_img.col(i), 1, false);
    const Eigen::Vector3d point = pairs.x_in_scan.col(i);
    EXPECT_LT(Evaluate(cost, {pose.values, point.data()}).residuals.norm(), 1e-6);
    const Eigen::Vector3d behind =
        2 * maker.cam_from_scan.TargetOriginInSource() - pairs.x_in_scan.col(i);
    const double* const parameters[] = {pose.values, behind.data()};
    Eigen::Vector2d residual;
    EXPECT_FALSE(cost.Evaluate(parameters, residual.data(), nullptr));
  }
}

}  // namespace
}  // namespace roomtex
