#include "colmap_ext/reduced_normal.h"

#include <random>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>
#include <gtest/gtest.h>

namespace roomtex {
namespace {

constexpr int kNumPoses = 5, kNumLenses = 2, kPose = 6, kLens = kMaxCameraParams, kNumPoints = 60;
constexpr int kNumUnknowns = kNumPoses * kPose + kNumLenses * kLens;

// The same equations in one matrix with the points still in it, and without them.
struct Equations {
  ReducedNormal normal{kNumUnknowns};
  Eigen::MatrixXd whole =
      Eigen::MatrixXd::Zero(kNumUnknowns + 3 * kNumPoints, kNumUnknowns + 3 * kNumPoints);
};

Equations MakeEquations() {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  const auto draw = [&](int columns) {
    return Eigen::MatrixXd(
        Eigen::MatrixXd::NullaryExpr(2, columns, [&] { return normal(random); }));
  };
  Equations equations;
  for (int point = 0; point < kNumPoints; ++point) {
    std::vector<NormalTerms> observations;
    for (int pose = 0; pose < kNumPoses; ++pose) {
      NormalTerms terms;
      terms.blocks = {{kPose * pose, draw(kPose)},
                      {kNumPoses * kPose + kLens * (pose % kNumLenses), draw(kLens)}};
      terms.by_point = draw(3);
      Eigen::MatrixXd row = Eigen::MatrixXd::Zero(2, equations.whole.cols());
      for (const auto& block : terms.blocks)
        row.middleCols(block.offset, block.by.cols()) = block.by;
      row.middleCols<3>(kNumUnknowns + 3 * point) = terms.by_point;
      equations.whole += row.transpose() * row;
      observations.push_back(terms);
    }
    equations.normal.AddPoint(observations, Eigen::Matrix3d::Zero());
  }
  return equations;
}

TEST(ReducedNormal, BlocksAreThoseOfTheWholeInverse) {
  const Equations equations = MakeEquations();
  const Eigen::MatrixXd inverse = equations.whole.inverse();
  const std::vector<UnknownBlock> blocks = {
      {kNumPoses * kPose + kLens, kLens}, {0, kPose}, {2 * kPose, kPose}, {3, 10}};
  const std::vector<Eigen::MatrixXd> covariances = equations.normal.Covariances(blocks);
  ASSERT_EQ(covariances.size(), blocks.size());
  for (size_t i = 0; i < blocks.size(); ++i) {
    const auto [offset, size] = blocks[i];
    const Eigen::MatrixXd expected = inverse.block(offset, offset, size, size);
    EXPECT_LT((covariances[i] - expected).norm(), 1e-9 * expected.norm()) << "block " << i;
  }
  const Eigen::MatrixXd columns = equations.normal.CovarianceColumns({blocks[0], blocks[2]});
  Eigen::MatrixXd expected(kNumUnknowns, kLens + kPose);
  expected << inverse.block(0, blocks[0].offset, kNumUnknowns, kLens),
      inverse.block(0, blocks[2].offset, kNumUnknowns, kPose);
  EXPECT_LT((columns - expected).norm(), 1e-9 * expected.norm());
}

TEST(ReducedNormal, SaysNothingWhereSomethingStaysOpen) {
  ReducedNormal normal(kPose + kLens);
  normal.AddInformation(0, Eigen::MatrixXd::Identity(kPose, kPose));
  EXPECT_TRUE(normal.Covariances({{0, kPose}}).empty());
  EXPECT_EQ(normal.CovarianceColumns({{0, kPose}}).size(), 0);
  normal.AddInformation(kPose, Eigen::MatrixXd::Identity(kLens, kLens));
  EXPECT_EQ(normal.Covariances({{0, kPose}}).size(), 1u);
}

}  // namespace
}  // namespace roomtex
