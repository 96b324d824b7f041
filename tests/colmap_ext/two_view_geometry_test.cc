#include "colmap_ext/two_view_geometry.h"

#include <numeric>

#include <Eigen/Dense>
#include <boost/math/distributions/chi_squared.hpp>
#include <gtest/gtest.h>

#include "tests/colmap_ext/simulated_views.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Scene = SimulatedViewsOptions::Scene;

SimulatedViewsOptions MakeOptions(Scene scene, double noise_px, double outlier_share, int seed) {
  SimulatedViewsOptions options;
  options.scene = scene;
  options.noise_px = noise_px;
  options.outlier_share = outlier_share;
  options.random_seed = seed;
  return options;
}

std::vector<RayMatch> FirstPair(const SimulatedViews& views) {
  return views.Matched().Matches(views.pairs[0]);
}

bool IsTrueMatch(const SimulatedViews& views, const RayMatch& match) {
  return views.point_of_keypoint.at(1)[match.left_row] ==
         views.point_of_keypoint.at(2)[match.right_row];
}

std::vector<int> AllOf(const std::vector<RayMatch>& matches) {
  std::vector<int> all(matches.size());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// Homography of the plane z = 0 of the simulated wall, from the true poses.
Eigen::Matrix3d TrueHomography(const SimulatedViews& views) {
  const auto plane_to_view = [&](uint32_t image_id) {
    const Rigid& pose = views.cam_from_scene.at(image_id);
    Eigen::Matrix3d h = pose.rotation.toRotationMatrix();
    h.col(2) = pose.translation;
    return h;
  };
  return plane_to_view(2) * plane_to_view(1).inverse();
}

TEST(TwoViewGeometry, FundamentalOfExactMatchesIsTheTrueEssential) {
  for (int seed = 0; seed < 5; ++seed) {
    SimulatedViewsOptions options = MakeOptions(Scene::kRoom, 0, 0, seed);
    options.distortion = options.two_cameras = true;
    const SimulatedViews views = SimulateViews(options);
    const std::vector<RayMatch> matches = FirstPair(views);
    ASSERT_GT(matches.size(), 50u);
    const auto f = FitFundamental(matches, AllOf(matches));
    ASSERT_TRUE(f);
    Eigen::Matrix3d truth = EssentialFromPose(views.TrueRelativePose(1, 2)).normalized();
    if (truth.cwiseProduct(*f).sum() < 0) truth = -truth;
    EXPECT_THAT(*f, IsNearMatrix(truth, 1e-5));  // keypoints are stored exactly, rays to 1e-9
  }
}

TEST(TwoViewGeometry, EssentialIsTheThesisProductOfTheFundamentalInPixels) {
  const SimulatedViews views = SimulateViews(MakeOptions(Scene::kRoom, 0.5, 0, 3));
  const std::vector<RayMatch> matches = FirstPair(views);
  const auto f = FitFundamental(matches, AllOf(matches));
  ASSERT_TRUE(f);
  const std::vector<double>& k = views.cameras.at(1).params;
  Eigen::Matrix3d calibration;
  calibration << k[0], 0, k[2], 0, k[1], k[3], 0, 0, 1;
  const Eigen::Matrix3d inverse = calibration.inverse();
  const Eigen::Matrix3d f_in_pixels = inverse.transpose() * *f * inverse;
  EXPECT_THAT(Eigen::Matrix3d(calibration.transpose() * f_in_pixels * calibration),
              IsNearMatrix(*f, 1e-9));
  for (const RayMatch& match : matches) {  // x_r^T F x_l in pixels is the same number as on rays
    const Eigen::Vector3d left = views.keypoints.at(1)[match.left_row].homogeneous();
    const Eigen::Vector3d right = views.keypoints.at(2)[match.right_row].homogeneous();
    EXPECT_NEAR(right.dot(f_in_pixels * left),
                match.right.Direction().dot(*f * match.left.Direction()), 1e-9);
  }
}

TEST(TwoViewGeometry, ErrorsOfTrueModelsFollowTheChiSquareOfTheNoise) {
  // E[chi-square] is the number of constraints: 1 for an epipolar line, 2 for a position.
  for (const bool distorted : {false, true}) {
    const double sigma = 0.8;
    SimulatedViewsOptions options = MakeOptions(Scene::kWall, sigma, 0, 1);
    options.num_points = 4000;
    options.distortion = options.two_cameras = distorted;
    const SimulatedViews views = SimulateViews(options);
    const std::vector<RayMatch> matches = FirstPair(views);
    const Eigen::Matrix3d essential = EssentialFromPose(views.TrueRelativePose(1, 2));
    const Eigen::Matrix3d homography = TrueHomography(views);
    double epipolar = 0, position = 0;
    for (const RayMatch& match : matches) {
      epipolar += EpipolarError2(essential, match) / (sigma * sigma);
      position += HomographyError2(homography, match) / (sigma * sigma);
    }
    ASSERT_GT(matches.size(), 1500u);
    EXPECT_NEAR(epipolar / static_cast<double>(matches.size()), 1.0, 0.12);
    EXPECT_NEAR(position / static_cast<double>(matches.size()), 2.0, 0.2);
  }
}

// To the digits that they are written with.
TEST(ChiSquare, QuantilesAreThoseOfTheDistribution) {
  EXPECT_NEAR(kChiSquare1, quantile(boost::math::chi_squared(1), 0.99), 5e-4);
  EXPECT_NEAR(kChiSquare2, quantile(boost::math::chi_squared(2), 0.99), 5e-4);
}

TEST(TwoViewGeometry, RansacFindsTheTrueMatchesAmongOutliers) {
  for (const double outliers : {0.0, 0.15, 0.3}) {
    const SimulatedViews views = SimulateViews(MakeOptions(Scene::kRoom, 0.7, outliers, 5));
    const std::vector<RayMatch> matches = FirstPair(views);
    RansacOptions ransac;
    ransac.max_error_px = std::sqrt(kChiSquare1) * 0.7;
    const RansacResult result = EstimateFundamental(matches, ransac);
    ASSERT_TRUE(result.success);
    int num_true = 0, num_found = 0, num_wrong = 0;
    for (const RayMatch& match : matches) num_true += IsTrueMatch(views, match);
    for (const int i : result.inliers) {
      (IsTrueMatch(views, matches[i]) ? num_found : num_wrong) += 1;
    }
    EXPECT_GE(num_found, 0.96 * num_true);
    EXPECT_LE(num_wrong,
              0.02 * static_cast<double>(matches.size()));  // close to the line by chance
  }
}

// On a plane eight points leave F open; five leave two essential matrices, one of them the truth.
TEST(TwoViewGeometry, FivePointsOfAWallHoldTheTrueEssential) {
  for (const Scene scene : {Scene::kRoom, Scene::kWall}) {
    for (int seed = 0; seed < 5; ++seed) {
      SimulatedViewsOptions options = MakeOptions(scene, 0, 0, seed);
      options.distortion = options.two_cameras = seed % 2 == 1;
      const SimulatedViews views = SimulateViews(options);
      const std::vector<RayMatch> matches = FirstPair(views);
      const int step = static_cast<int>(matches.size()) / 5;
      const std::vector<Eigen::Matrix3d> found =
          FitEssential(matches, {0, step, 2 * step, 3 * step, 4 * step});
      const Eigen::Matrix3d truth = EssentialFromPose(views.TrueRelativePose(1, 2)).normalized();
      double least = 10;
      for (const Eigen::Matrix3d& essential : found) {
        least = std::min({least, (essential - truth).norm(), (essential + truth).norm()});
      }
      EXPECT_LT(least, 1e-4) << "seed " << seed << ", " << found.size() << " solutions";
    }
  }
}

TEST(TwoViewGeometry, EssentialOfAWallObeysTheTrueMatches) {
  for (const double outliers : {0.0, 0.15, 0.3}) {
    const SimulatedViews views = SimulateViews(MakeOptions(Scene::kWall, 0.7, outliers, 5));
    const std::vector<RayMatch> matches = FirstPair(views);
    RansacOptions ransac;
    ransac.max_error_px = std::sqrt(kChiSquare1) * 0.7;
    const RansacResult result = EstimateEssential(matches, ransac);
    ASSERT_TRUE(result.success);
    EXPECT_THAT(result.model.jacobiSvd().singularValues().normalized(),
                IsNearMatrix(Eigen::Vector3d(1, 1, 0).normalized(), 1e-6));
    int num_true = 0, num_found = 0;
    for (const RayMatch& match : matches) num_true += IsTrueMatch(views, match);
    for (const int i : result.inliers) num_found += IsTrueMatch(views, matches[i]);
    EXPECT_GE(num_found, 0.93 * num_true);
  }
}

TEST(TwoViewGeometry, RansacRepeatsItself) {
  const std::vector<RayMatch> matches =
      FirstPair(SimulateViews(MakeOptions(Scene::kRoom, 0.7, 0.3, 2)));
  RansacOptions ransac;
  ransac.random_seed = 7;
  const RansacResult once = EstimateFundamental(matches, ransac);
  const RansacResult again = EstimateFundamental(matches, ransac);
  EXPECT_EQ(once.inliers, again.inliers);
  EXPECT_THAT(once.model, IsNearMatrix(again.model, 0.0));
}

TEST(TwoViewGeometry, RefusesTooFewMatches) {
  std::vector<RayMatch> matches = FirstPair(SimulateViews(MakeOptions(Scene::kRoom, 0, 0, 0)));
  matches.resize(7);
  EXPECT_FALSE(FitFundamental(matches, AllOf(matches)));
  EXPECT_FALSE(EstimateFundamental(matches, {}).success);
  matches.resize(3);
  EXPECT_FALSE(FitHomography(matches, AllOf(matches)));
}

TEST(TwoViewGeometry, EssentialHasSingularValuesOneOneZero) {
  const SimulatedViews views = SimulateViews(MakeOptions(Scene::kRoom, 1, 0, 4));
  const std::vector<RayMatch> matches = FirstPair(views);
  const Eigen::Matrix3d essential =
      EssentialFromFundamental(*FitFundamental(matches, AllOf(matches)));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential);
  EXPECT_THAT(svd.singularValues(), IsNearMatrix(Eigen::Vector3d(1, 1, 0), 1e-12));
}

TEST(TwoViewGeometry, OneOfTheFourPosesIsTrueAndOnlyItHasThePointsInFront) {
  for (int seed = 0; seed < 5; ++seed) {
    const SimulatedViews views = SimulateViews(MakeOptions(Scene::kRoom, 0, 0, seed));
    const std::vector<RayMatch> matches = FirstPair(views);
    Rigid truth = views.TrueRelativePose(1, 2);
    truth.translation.normalize();
    const std::vector<Rigid> poses = PosesFromEssential(EssentialFromPose(truth));
    ASSERT_EQ(poses.size(), 4u);
    int num_true = 0;
    for (const Rigid& pose : poses) {
      EXPECT_NEAR(pose.rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
      EXPECT_NEAR(pose.translation.norm(), 1.0, 1e-12);
      const int in_front = CountInFront(pose, matches, AllOf(matches));
      const bool is_true = RotationAngle(pose.rotation, truth.rotation) < 1e-6 &&
                           (pose.translation - truth.translation).norm() < 1e-6;
      num_true += is_true;
      if (is_true) {
        EXPECT_EQ(in_front, static_cast<int>(matches.size()));
      } else {
        EXPECT_LT(in_front, 0.2 * static_cast<double>(matches.size()));
      }
    }
    EXPECT_EQ(num_true, 1);
  }
}

TEST(TwoViewGeometry, HomographyOfAWallIsFoundAndItsPosesHoldTheTrueOne) {
  for (int seed = 0; seed < 10; ++seed) {
    SimulatedViewsOptions options = MakeOptions(Scene::kWall, 0, 0, seed);
    options.distortion = seed % 2 == 1;
    const SimulatedViews views = SimulateViews(options);
    const std::vector<RayMatch> matches = FirstPair(views);
    const auto h = FitHomography(matches, AllOf(matches));
    ASSERT_TRUE(h);
    Eigen::Matrix3d truth = TrueHomography(views).normalized();
    if (truth.cwiseProduct(*h).sum() < 0) truth = -truth;
    EXPECT_THAT(*h, IsNearMatrix(truth, 1e-6));
    Rigid pose_truth = views.TrueRelativePose(1, 2);
    pose_truth.translation.normalize();
    double nearest = 1e9;
    for (const Rigid& pose : PosesFromHomography(*h)) {
      nearest = std::min(nearest, RotationAngle(pose.rotation, pose_truth.rotation) +
                                      (pose.translation - pose_truth.translation).norm());
    }
    EXPECT_LT(nearest, 1e-4);
  }
}

TEST(TwoViewGeometry, RefusesTheHomographyOfALine) {
  std::vector<RayMatch> matches(6);
  for (int i = 0; i < 6; ++i) {
    matches[i].left.x = {0.1 * i, 0.05 * i};
    matches[i].right.x = {0.1 * i + 0.02, 0.05 * i};
  }
  EXPECT_FALSE(FitHomography(matches, AllOf(matches)));
}

TEST(TwoViewGeometry, RotationOfATurningCameraIsFound) {
  SimulatedViewsOptions options = MakeOptions(Scene::kRoom, 0, 0, 1);
  options.only_turn = true;
  const SimulatedViews views = SimulateViews(options);
  const std::vector<RayMatch> matches = FirstPair(views);
  const auto rotation = FitRotation(matches, AllOf(matches));
  ASSERT_TRUE(rotation);
  EXPECT_THAT(*rotation,
              IsNearMatrix(views.TrueRelativePose(1, 2).rotation.toRotationMatrix(), 1e-8));
  EXPECT_NEAR(MedianParallax(matches), 0.0, 1e-7);
}

TEST(Triangulation, FindsTheTruePointAndItsAngle) {
  const SimulatedViews views = SimulateViews(MakeOptions(Scene::kRoom, 0, 0, 6));
  const Rigid& left = views.cam_from_scene.at(1);
  const Rigid right_from_left = views.TrueRelativePose(1, 2);
  ASSERT_GT(FirstPair(views).size(), 50u);
  for (const RayMatch& match : FirstPair(views)) {
    const int index = views.point_of_keypoint.at(1)[match.left_row];
    const Eigen::Vector3d truth = left * views.points_in_scene[index];
    const auto point = TriangulatePair(right_from_left, match.left.x, match.right.x);
    ASSERT_TRUE(point);
    EXPECT_THAT(PointInLeft(*point), IsNearMatrix(truth, 1e-6));
    const Eigen::Vector3d to_right = truth - right_from_left.TargetOriginInSource();
    EXPECT_NEAR(TriangulationAngle(right_from_left, *point),
                std::acos(truth.normalized().dot(to_right.normalized())), 1e-6);
    const auto projected = ProjectPoint(right_from_left, *point);
    ASSERT_TRUE(projected);
    EXPECT_THAT(*projected, IsNearMatrix(match.right.x, 1e-7));
  }
}

TEST(Triangulation, TellsPointsBehind) {
  Rigid right_from_left;
  right_from_left.translation = {-1, 0, 0};
  // Rays that part before the cameras meet behind them.
  const auto point = TriangulatePair(right_from_left, {-0.1, 0}, {0.1, 0});
  ASSERT_TRUE(point);
  EXPECT_LT(point->z(), 0);
  EXPECT_FALSE(ProjectPoint(right_from_left, *point));
}

TEST(ViewRays, PixelErrorIsThePixelDistanceThroughTheLens) {
  SimulatedViewsOptions options;
  options.distortion = true;
  const Camera camera = SimulatedCamera(1, options);
  const CameraProjection projection(camera);
  const Eigen::Vector2d keypoint(812.5, 120.25);
  const Ray ray = RaysFromKeypoints(projection, {keypoint})[0];
  ASSERT_TRUE(ray.valid);
  const Eigen::Vector2d moved = keypoint + Eigen::Vector2d(0.3, -0.2);
  const auto y = projection.CamFromImg(moved);
  ASSERT_TRUE(y);
  EXPECT_THAT(ray.PixelError(*y), IsNearMatrix(Eigen::Vector2d(0.3, -0.2), 2e-3));
  EXPECT_THAT(Eigen::Matrix2d(ray.img_from_ray * ray.ray_from_img),
              IsNearMatrix(Eigen::Matrix2d::Identity(), 1e-12));
}

}  // namespace
}  // namespace roomtex
