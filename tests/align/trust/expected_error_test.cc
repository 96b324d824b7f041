#include "align/trust/expected_error.h"

#include <random>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

namespace roomtex {
namespace {

SimilarityFit FitWithCovariance() {
  SimilarityFit fit;
  fit.pivot = {1, -2, 0.5};
  Eigen::Matrix<double, 7, 7> root = Eigen::Matrix<double, 7, 7>::Random();
  root.topRows<3>() *= 1e-3;
  root.bottomRows<4>() *= 4e-4;
  fit.covariance = root * root.transpose();
  return fit;
}

// The definition of the seven numbers (similarity_fit.h), drawn at random.
TEST(ExpectedError, IsTheSpreadOfAPointThatMovesWithTheSimilarity) {
  const SimilarityFit fit = FitWithCovariance();
  const Eigen::Matrix<double, 7, 7> root = fit.covariance.llt().matrixL();
  const Eigen::Vector3d x(4, 1, -3);
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  constexpr int kNumDraws = 40000;
  double sum2 = 0;
  for (int draw = 0; draw < kNumDraws; ++draw) {
    Eigen::Matrix<double, 7, 1> z;
    for (int k = 0; k < 7; ++k) z[k] = normal(random);
    const Eigen::Matrix<double, 7, 1> d = root * z;
    const Eigen::Vector3d arm = x - fit.pivot;
    const Eigen::Vector3d moved = d.head<3>() + d.segment<3>(3).cross(arm) + d[6] * arm;
    sum2 += moved.squaredNorm();
  }
  const double sampled = std::sqrt(sum2 / kNumDraws);
  EXPECT_NEAR(PositionSigmaAt(fit, x), sampled, 0.02 * sampled);
}

TEST(ExpectedError, IsLargestAtTheCornerFarFromThePivot) {
  SimilarityFit fit = FitWithCovariance();
  fit.covariance.setIdentity();
  fit.covariance *= 1e-6;
  Scan scan;
  scan.points = {{0, 0, 0}, Scan::MissingPoint(), {5, 4, 3}};
  const ExpectedError error =
      PropagateError(fit, {{1, {1, -2, 0.5}}, {2, {2, -2, 0.5}}, {3, {1, 0, 0.5}}}, {scan});
  EXPECT_EQ(error.far_corner, Eigen::Vector3d(5, 4, 3));
  EXPECT_NEAR(error.at_far_corner, PositionSigmaAt(fit, {5, 4, 3}), 1e-15);
  EXPECT_GT(error.at_far_corner, error.at_cameras);
  EXPECT_NEAR(error.scale, 1e-3, 1e-12);
}

// What the model itself says of a photo counts where it is more than the similarity leaves open.
TEST(ExpectedError, OfAPhotoIsTheLargerOfItsOwnAndOfTheSimilarity) {
  const SimilarityFit fit = FitWithCovariance();
  CameraCentres centres;
  PoseCovariances covariances;
  for (uint32_t id = 1; id <= 4; ++id) {
    centres[id] = {-1.0 * id, -2, -3};
    if (id < 4)
      covariances[id] = (id == 2 ? 1e-2 : 1e-12) * Eigen::Matrix<double, 6, 6>::Identity();
  }
  const auto sigmas = FindPhotoSigmas(covariances, centres, fit, ShapeDisagreement());
  ASSERT_EQ(sigmas.size(), 4u);
  EXPECT_NEAR(sigmas.at(1).position, PositionSigmaAt(fit, {-1, -2, -3}), 1e-12);
  EXPECT_NEAR(sigmas.at(2).position, std::sqrt(3e-2), 1e-12);
  EXPECT_NEAR(sigmas.at(2).rotation, std::sqrt(3e-2), 1e-12);
  EXPECT_NEAR(sigmas.at(4).position, PositionSigmaAt(fit, {-4, -2, -3}), 1e-12);
}

TEST(ExpectedError, HoldsWhatModelAndScanDisagreeIn) {
  const SimilarityFit fit = FitWithCovariance();
  const CameraCentres centres = {{1, {-1, -2, -3}}, {2, {-2, -2, -3}}, {3, {-3, -2, -3}}};
  ShapeDisagreement disagreement;
  disagreement.rms = 0.03;
  disagreement.photos[1] = {0.04, 0.02};
  const auto sigmas = FindPhotoSigmas({}, centres, fit, disagreement);
  const double alone = PositionSigmaAt(fit, {-1, -2, -3});
  // Twice: what is seen, and as much that the fit has taken up.
  EXPECT_NEAR(sigmas.at(1).position, std::hypot(alone, 0.04, 0.04), 1e-12);
  EXPECT_GT(sigmas.at(1).rotation, std::hypot(0.02, 0.02));
  // A photo that sees nothing of the surface may be off like the room.
  EXPECT_NEAR(sigmas.at(2).position, std::hypot(PositionSigmaAt(fit, {-2, -2, -3}), 0.03, 0.04),
              1e-12);
  ExpectedError error;
  error.at_far_corner = 0.04;
  SetExpectedErrorAtCameras(sigmas, disagreement, &error);
  EXPECT_EQ(error.at_cameras, sigmas.at(3).position);
  EXPECT_NEAR(error.at_far_corner, 0.05, 1e-12);
  SetExpectedErrorAtCameras({}, disagreement, &error);
  EXPECT_EQ(error.at_cameras, sigmas.at(3).position);
}

// What fits where one photo looks was fitted there: it is no surer than the others.
TEST(ExpectedError, OfAPhotoThatSeesNoDisagreementHoldsThatOfTheOthers) {
  const SimilarityFit fit = FitWithCovariance();
  const CameraCentres centres = {{1, {-1, -2, -3}}, {2, {-1, -2, -3}}, {3, {-1, -2, -3}}};
  ShapeDisagreement disagreement;
  disagreement.rms = 0.03;
  disagreement.photos = {{1, {0, 0}}, {2, {0.04, 0.02}}, {3, {0.05, 0.03}}};
  const auto sigmas = FindPhotoSigmas({}, centres, fit, disagreement);
  EXPECT_NEAR(sigmas.at(1).position, std::hypot(PositionSigmaAt(fit, {-1, -2, -3}), 0.04), 1e-12);
  EXPECT_GT(sigmas.at(1).rotation, 0.02);
  EXPECT_LT(sigmas.at(1).position, sigmas.at(2).position);
}

TEST(ExpectedError, IsInfiniteWhereTheFitLeavesSomethingOpen) {
  SimilarityFit fit = FitWithCovariance();
  fit.covariance(0, 0) = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(std::isfinite(PositionSigmaAt(fit, {1, 2, 3})));
}

}  // namespace
}  // namespace roomtex
