#include "align/clicks/view_pose.h"

#include <gtest/gtest.h>

#include "tests/align/clicks/pick_maker.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

// (w, dt) of found = exp(w) true + dt, in the camera's frame: the unknowns of ViewPose::covariance.
Eigen::Matrix<double, 6, 1> PoseError(const Rigid& found, const Rigid& truth) {
  const Eigen::AngleAxisd turn(found.rotation * truth.rotation.conjugate());
  Eigen::Matrix<double, 6, 1> error;
  error << turn.angle() * turn.axis(), found.translation - turn * truth.translation;
  return error;
}

class EveryCameraModel : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(All, EveryCameraModel, testing::Range(0, kNumCameraModels));

TEST_P(EveryCameraModel, GivesTheExactPoseFromExactGeneralPicks) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    PickMaker maker(seed, static_cast<CameraModel>(GetParam()));
    const auto poses = SolveViewPoses(maker.projection, maker.General(6));
    ASSERT_FALSE(poses.empty()) << seed;
    EXPECT_THAT(poses[0].cam_from_scan, IsNearRigid(maker.cam_from_scan, 1e-7, 1e-7)) << seed;
    EXPECT_LT(poses[0].rms_px, 1e-5);
  }
}

TEST_P(EveryCameraModel, GivesTheExactPoseFromExactCoplanarPicks) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    PickMaker maker(100 + seed, static_cast<CameraModel>(GetParam()));
    const auto poses = SolveViewPoses(maker.projection, maker.Coplanar(6, 0.1 * seed));
    ASSERT_FALSE(poses.empty()) << seed;
    EXPECT_THAT(poses[0].cam_from_scan, IsNearRigid(maker.cam_from_scan, 1e-6, 1e-6)) << seed;
  }
}

TEST(ViewPose, IsExactForPicksJustOffOnePlane) {
  // The projection matrix is hardly determined here.
  for (unsigned seed = 0; seed < 20; ++seed) {
    PickMaker maker(seed);
    PointPairs pairs = maker.Coplanar(8, 0.5);
    const Eigen::Vector3d ahead =
        maker.cam_from_scan.rotation.conjugate() * Eigen::Vector3d(0, 0, 1);
    for (int i = 0; i < pairs.size(); ++i) {
      pairs.x_in_scan.col(i) += maker.Uniform(-0.01, 0.01) * ahead;
      pairs.x_in_img.col(i) =
          maker.projection.ImgFromCam(maker.cam_from_scan * pairs.x_in_scan.col(i)).value();
    }
    const auto poses = SolveViewPoses(maker.projection, pairs);
    ASSERT_FALSE(poses.empty()) << seed;
    EXPECT_THAT(poses[0].cam_from_scan, IsNearRigid(maker.cam_from_scan, 1e-6, 1e-6)) << seed;
  }
}

TEST(ViewPose, FindsTheGlobalMinimumForNoisyPicks) {
  // No worse than what Levenberg-Marquardt reaches from the truth.
  for (unsigned seed = 0; seed < 200; ++seed) {
    PickMaker maker(seed);
    const PointPairs pairs =
        maker.WithNoise(seed % 2 == 0 ? maker.General(6) : maker.Coplanar(6, 0.7), 6.0);
    const auto poses = SolveViewPoses(maker.projection, pairs);
    const auto from_truth = SolveViewPoses(maker.projection, pairs, maker.cam_from_scan);
    ASSERT_FALSE(poses.empty()) << seed;
    EXPECT_LE(poses[0].sum_px2, from_truth[0].sum_px2 * (1 + 1e-6)) << seed;
  }
}

TEST(ViewPose, ErrorsOfNoisyPicksAgreeWithTheCovariance) {
  // e^T C^-1 e / 6 with C scaled by the true noise follows chi^2_6 / 6: mean 1, standard deviation
  // of the mean over 200 seeds 0.041.
  constexpr double kNoise = 1.5;
  constexpr int kSeeds = 200;
  double sum = 0, variance_sum = 0;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    PickMaker maker(seed);
    const auto poses = SolveViewPoses(maker.projection, maker.WithNoise(maker.General(8), kNoise));
    ASSERT_FALSE(poses.empty());
    const ViewPose& pose = poses[0];
    const Matrix6d covariance =
        pose.covariance * (kNoise * kNoise) / (pose.sigma_px * pose.sigma_px);
    const auto error = PoseError(pose.cam_from_scan, maker.cam_from_scan);
    sum += error.dot(covariance.inverse() * error) / 6;
    variance_sum += pose.sigma_px * pose.sigma_px;
  }
  EXPECT_NEAR(sum / kSeeds, 1.0, 0.17);
  // sigma_px^2 is an unbiased estimate; its standard deviation over the mean of 200 is 3.2 %.
  EXPECT_NEAR(variance_sum / kSeeds, kNoise * kNoise, 0.13 * kNoise * kNoise);
}

// Scans in map grids, and about the middle of the Earth.
TEST(ViewPose, IsTheSameWhereverTheOriginOfTheScanLies) {
  const Eigen::Vector3d offset(4.1e6, -5.6e5, 4.8e6);
  for (unsigned seed = 0; seed < 30; ++seed) {
    PickMaker maker(500 + seed);
    const PointPairs near = maker.WithNoise(maker.General(6), 1.5);
    PointPairs far = near;
    far.x_in_scan.colwise() += offset;
    const auto here = SolveViewPoses(maker.projection, near);
    const auto there = SolveViewPoses(maker.projection, far);
    ASSERT_FALSE(here.empty() || there.empty()) << seed;
    Rigid moved = there[0].cam_from_scan;
    moved.translation += moved.rotation * offset;
    EXPECT_THAT(moved, IsNearRigid(here[0].cam_from_scan, 1e-5, 1e-5)) << seed;
    EXPECT_NEAR(there[0].sum_px2, here[0].sum_px2, 1e-4 * here[0].sum_px2) << seed;
    EXPECT_NEAR(there[0].PositionSigma(), here[0].PositionSigma(), 0.01 * here[0].PositionSigma());
  }
}

TEST(ViewPose, PositionSigmaIsThatOfTheCameraCentre) {
  constexpr int kSeeds = 200;
  double error2 = 0, sigma2 = 0;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    PickMaker maker(300 + seed);
    const auto poses = SolveViewPoses(maker.projection, maker.WithNoise(maker.General(12), 1.0));
    ASSERT_FALSE(poses.empty());
    error2 +=
        (poses[0].cam_from_scan.TargetOriginInSource() - maker.cam_from_scan.TargetOriginInSource())
            .squaredNorm();
    sigma2 += poses[0].PositionSigma() * poses[0].PositionSigma();
  }
  EXPECT_NEAR(error2 / sigma2, 1.0, 0.3);
}

TEST(ViewPose, CoplanarPicksWithWeakPerspectiveHaveASecondSolution) {
  // Points within a few degrees of each other: the tilted plane and its mirror image fit about
  // equally.
  PickMaker maker(5, CameraModel::kPinhole);
  PointPairs pairs{Eigen::Matrix2Xd(2, 8), Eigen::Matrix3Xd(3, 8)};
  const Eigen::Vector3d u(std::cos(0.6), 0, std::sin(0.6)), v(0, 1, 0);
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d p =
        Eigen::Vector3d(0, 0, 5) + maker.Uniform(-0.4, 0.4) * u + maker.Uniform(-0.4, 0.4) * v;
    pairs.x_in_scan.col(i) = maker.cam_from_scan.Inverse() * p;
    pairs.x_in_img.col(i) = maker.projection.ImgFromCam(p).value();
  }
  const auto poses = SolveViewPoses(maker.projection, pairs);
  ASSERT_GE(poses.size(), 2u);
  EXPECT_THAT(poses[0].cam_from_scan, IsNearRigid(maker.cam_from_scan, 1e-6, 1e-6));
  EXPECT_GT(RotationAngle(poses[1].cam_from_scan.rotation, maker.cam_from_scan.rotation), 0.5);
  EXPECT_LT(poses[1].rms_px, 15);
}

TEST(ViewPose, ReflectionKeepsThePhotoAndChangesTheSide) {
  PickMaker maker(7);
  const PointPairs pairs = maker.Coplanar(6, 0.3);
  const Eigen::Vector3d a = pairs.x_in_scan.col(0);
  const Eigen::Vector3d normal =
      (pairs.x_in_scan.col(1) - a).cross(pairs.x_in_scan.col(2) - a).normalized();
  const Rigid reflected = ReflectAboutPlane(maker.cam_from_scan, normal, normal.dot(a));
  EXPECT_NEAR(reflected.rotation.norm(), 1, 1e-12);
  for (int i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d before = maker.cam_from_scan * pairs.x_in_scan.col(i);
    const Eigen::Vector3d after = reflected * pairs.x_in_scan.col(i);
    EXPECT_THAT(after, IsNearMatrix(Eigen::Vector3d(-before), 1e-9));
  }
  // Its own inverse.
  EXPECT_THAT(ReflectAboutPlane(reflected, normal, normal.dot(a)),
              IsNearRigid(maker.cam_from_scan, 1e-7, 1e-9));
}

TEST(ViewPose, StartingBehindThePicksItReflectsToTheFront) {
  PickMaker maker(8);
  const PointPairs pairs = maker.Coplanar(7, 0.4);
  const Eigen::Vector3d a = pairs.x_in_scan.col(0);
  const Eigen::Vector3d normal =
      (pairs.x_in_scan.col(1) - a).cross(pairs.x_in_scan.col(2) - a).normalized();
  const Rigid behind = ReflectAboutPlane(maker.cam_from_scan, normal, normal.dot(a));
  const auto poses = SolveViewPoses(maker.projection, pairs, behind);
  ASSERT_FALSE(poses.empty());
  EXPECT_THAT(poses[0].cam_from_scan, IsNearRigid(maker.cam_from_scan, 1e-6, 1e-6));
}

TEST(ViewPose, MovesWithTheScan) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    PickMaker maker(seed), other(1000 + seed);
    const PointPairs pairs = maker.WithNoise(maker.General(7), 1.5);
    const Rigid moved_from_scan = other.cam_from_scan;
    PointPairs moved = pairs;
    for (int i = 0; i < pairs.size(); ++i) {
      moved.x_in_scan.col(i) = moved_from_scan * pairs.x_in_scan.col(i);
    }
    const auto before = SolveViewPoses(maker.projection, pairs);
    const auto after = SolveViewPoses(maker.projection, moved);
    ASSERT_FALSE(before.empty() || after.empty());
    EXPECT_THAT(after[0].cam_from_scan * moved_from_scan,
                IsNearRigid(before[0].cam_from_scan, 1e-6, 1e-6));
  }
}

}  // namespace
}  // namespace roomtex
