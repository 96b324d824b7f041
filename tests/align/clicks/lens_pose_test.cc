#include "align/clicks/lens_pose.h"

#include <gmock/gmock.h>

#include "tests/align/clicks/pick_maker.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

constexpr double kFocal = 1500, kRadial = -0.06;

// A camera as these solvers take lenses to be: the principal point in the middle.
PickMaker MakerWithLens(unsigned seed) {
  PickMaker maker(seed);
  maker.projection =
      CameraProjection({1, CameraModel::kSimpleRadial, 1936, 1288, {kFocal, 968, 644, kRadial}});
  return maker;
}
Camera Told(double focal) {
  return {1, CameraModel::kSimpleRadial, 1936, 1288, {focal, 968, 644, 0}};
}

double PositionError(const ViewPose& pose, const PickMaker& maker) {
  return (pose.cam_from_scan.TargetOriginInSource() - maker.cam_from_scan.TargetOriginInSource())
      .norm();
}

TEST(LensPose, EightExactPicksTellTheFocalLength) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    PickMaker maker = MakerWithLens(seed);
    const PointPairs pairs = maker.General(8);
    ASSERT_EQ(FindFocalProblem(pairs), "") << seed;
    const auto poses = LensPoseSolver(Told(1), FocalSource::kPicks).Solve(pairs, std::nullopt);
    ASSERT_FALSE(poses.empty()) << seed;
    // Only what is known of radial terms beforehand pulls.
    EXPECT_NEAR(poses[0].lens->params[0] / kFocal, 1, 0.01) << seed;
    EXPECT_LT(PositionError(poses[0], maker), 0.03) << seed;
  }
}

TEST(LensPose, ErrorsAgreeWithTheCovariance) {
  for (const bool by_exif : {false, true}) {
    double focal2 = 0;
    int within_two = 0;
    constexpr int kTrials = 30;
    for (unsigned seed = 0; seed < kTrials; ++seed) {
      PickMaker maker = MakerWithLens(seed);
      const PointPairs pairs = maker.WithNoise(maker.General(by_exif ? 6 : 9), 1.5);
      const double told = kFocal * std::exp(kExifFocalSigma * maker.Gaussian());
      const LensPoseSolver solver(Told(told), by_exif ? FocalSource::kExif : FocalSource::kPicks);
      const auto poses = solver.Solve(pairs, std::nullopt);
      ASSERT_FALSE(poses.empty()) << seed;
      within_two += PositionError(poses[0], maker) < 2 * poses[0].PositionSigma();
      const double focal_error = std::log(poses[0].lens->params[0] / kFocal);
      focal2 += std::pow(focal_error / poses[0].focal_sigma, 2) / kTrials;
    }
    EXPECT_GE(within_two, 0.9 * kTrials) << by_exif;
    EXPECT_GT(std::sqrt(focal2), 0.5) << by_exif;
    EXPECT_LT(std::sqrt(focal2), 1.4) << by_exif;
  }
}

TEST(LensPose, AFocalLengthOfExifIsMendedByThePicks) {
  double found = 0, believed = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    PickMaker maker = MakerWithLens(seed);
    const PointPairs pairs = maker.WithNoise(maker.General(8), 1.0);
    const Camera told = Told(1.04 * kFocal);
    found += PositionError(
        LensPoseSolver(told, FocalSource::kExif).Solve(pairs, std::nullopt).at(0), maker);
    believed += PositionError(SolveViewPoses(CameraProjection(told), pairs).at(0), maker);
  }
  EXPECT_LT(found, 0.5 * believed);
}

TEST(LensPose, AWrongPickIsFoundWithTheLens) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    PickMaker maker = MakerWithLens(seed);
    PointPairs pairs = maker.WithNoise(maker.General(10), 1.0);
    pairs.x_in_img.col(4) += Eigen::Vector2d(90, -60);
    const PickReview review =
        ReviewPicks(LensPoseSolver(Told(1), FocalSource::kPicks), pairs, PickReviewOptions());
    for (int i = 0; i < 10; ++i) EXPECT_EQ(review.used[i], i != 4) << seed;
    EXPECT_NEAR(review.pose().lens->params[0] / kFocal, 1, 0.1) << seed;
  }
}

TEST(LensPose, TooFewOrCoplanarPicksAreSaid) {
  PickMaker maker = MakerWithLens(1);
  EXPECT_THAT(FindFocalProblem(maker.General(7)), HasSubstr("7 picks do not tell it"));
  EXPECT_THAT(FindFocalProblem(maker.Coplanar(9, 0.4)), HasSubstr("one plane"));
}

TEST(LensPose, ACameraWithoutARadialTermGetsNone) {
  PickMaker maker = MakerWithLens(2);
  const Camera told{1, CameraModel::kSimplePinhole, 1936, 1288, {kFocal, 968, 644}};
  const auto poses = LensPoseSolver(told, FocalSource::kExif).Solve(maker.General(8), std::nullopt);
  ASSERT_FALSE(poses.empty());
  EXPECT_EQ(poses[0].lens->model, CameraModel::kSimplePinhole);
  EXPECT_EQ(poses[0].lens->params.size(), 3u);
  EXPECT_EQ(poses[0].radial_sigma, 0);
}

TEST(ClickSigma, IsTheUsualOneUntilResidualsSaySomething) {
  EXPECT_NEAR(ClickSigma(0, 0), kUsualClickSigma, 1e-12);
  EXPECT_NEAR(ClickSigma(9 * 400, 400), 3, 0.03);
  EXPECT_LT(ClickSigma(0, 6), kUsualClickSigma);
}

}  // namespace
}  // namespace roomtex
