#include "align/clicks/pick_review.h"

#include <gmock/gmock.h>

#include "tests/align/clicks/pick_maker.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

int NumUsed(const PickReview& review) {
  return static_cast<int>(std::count(review.used.begin(), review.used.end(), true));
}

TEST(PickReview, KeepsAllGoodPicks) {
  int left_out = 0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    PickMaker maker(seed);
    const PointPairs pairs = maker.WithNoise(maker.General(8), 1.5);
    const PickReview review = ReviewPicks(maker.projection, pairs, {});
    left_out += 8 - NumUsed(review);
    EXPECT_FALSE(review.exchanged.has_value()) << seed;
    EXPECT_FALSE(review.mirrored) << seed;
    // The pose was fitted to every pick, so without it the pick is farther away.
    for (int i = 0; i < 8; ++i) EXPECT_GE(review.leave_one_out_px[i], review.residual_px[i]);
  }
  EXPECT_LE(left_out, 2);  // one in a hundred, by max_chance
}

TEST(PickReview, NamesTheOneBadPickAmongSeven) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    PickMaker maker(seed);
    PointPairs pairs = maker.WithNoise(maker.General(7), 1.5);
    const int bad = static_cast<int>(seed % 7);
    pairs.x_in_img.col(bad) += Eigen::Vector2d(70, -70);
    const PickReview review = ReviewPicks(maker.projection, pairs, {});
    ASSERT_TRUE(review.HasPose()) << seed;
    EXPECT_FALSE(review.used[bad]) << seed;
    EXPECT_EQ(NumUsed(review), 6) << seed;
    EXPECT_GT(review.leave_one_out_px[bad], 60) << seed;
    EXPECT_LT(review.pose().rms_px, 5) << seed;
  }
}

TEST(PickReview, NamesABadScanPointAsWell) {
  PickMaker maker(3);
  PointPairs pairs = maker.WithNoise(maker.General(8), 1.5);
  pairs.x_in_scan.col(5) += Eigen::Vector3d(0.3, -0.2, 0.3);
  const PickReview review = ReviewPicks(maker.projection, pairs, {});
  EXPECT_FALSE(review.used[5]);
  EXPECT_EQ(NumUsed(review), 7);
}

TEST(PickReview, NamesTwoBadPicksAmongFourteen) {
  PickMaker maker(4);
  PointPairs pairs = maker.WithNoise(maker.General(14), 1.5);
  pairs.x_in_img.col(2) += Eigen::Vector2d(60, 0);
  pairs.x_in_img.col(9) += Eigen::Vector2d(0, 80);
  const PickReview review = ReviewPicks(maker.projection, pairs, {});
  EXPECT_FALSE(review.used[2]);
  EXPECT_FALSE(review.used[9]);
  EXPECT_EQ(NumUsed(review), 12);
}

TEST(PickReview, NamesTheOneBadPickAmongSix) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    PickMaker maker(seed);
    PointPairs pairs = maker.WithNoise(maker.General(6), 1.0);
    const int bad = static_cast<int>(seed % 6);
    pairs.x_in_img.col(bad) += Eigen::Vector2d(120, 90);
    const PickReview review = ReviewPicks(maker.projection, pairs, {});
    EXPECT_FALSE(review.used[bad]) << seed;
    EXPECT_EQ(NumUsed(review), 5) << seed;
    EXPECT_LT(review.pose().rms_px, 4) << seed;
  }
}

TEST(PickReview, KeepsSixOrdinaryPicks) {
  int left_out = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    PickMaker maker(seed);
    left_out +=
        6 - NumUsed(ReviewPicks(maker.projection, maker.WithNoise(maker.General(6), 1.5), {}));
  }
  EXPECT_LE(left_out, 4);  // one in a hundred, by max_chance
}

// A weight of 2 is half the click noise: as good as four clicks on the same point.
TEST(PickReview, AWeightOfTwoCountsLikeFourPicks) {
  PickMaker maker(5);
  PointPairs pairs = maker.WithNoise(maker.General(8), 1.5);
  pairs.weight = Eigen::VectorXd::Ones(8);
  pairs.weight[2] = 2;
  PointPairs repeated{Eigen::Matrix2Xd(2, 11), Eigen::Matrix3Xd(3, 11)};
  for (int i = 0; i < 11; ++i) {
    repeated.x_in_img.col(i) = pairs.x_in_img.col(i < 8 ? i : 2);
    repeated.x_in_scan.col(i) = pairs.x_in_scan.col(i < 8 ? i : 2);
  }
  const ViewPose weighted = SolveViewPoses(maker.projection, pairs).at(0);
  const ViewPose expected = SolveViewPoses(maker.projection, repeated).at(0);
  EXPECT_THAT(weighted.cam_from_scan, IsNearRigid(expected.cam_from_scan, 1e-8, 1e-8));
  EXPECT_NEAR(weighted.sum_px2, expected.sum_px2, 1e-6);
  EXPECT_NEAR(weighted.rms_px, expected.rms_px, 1e-6);
}

TEST(PickReview, AHeavyPickPullsThePoseAndALightOneDoesNot) {
  PickMaker maker(8);
  PointPairs pairs = maker.WithNoise(maker.General(8), 1.0);
  pairs.x_in_img.col(4) += Eigen::Vector2d(12, -9);
  const auto residual = [&](double weight) {
    pairs.weight = Eigen::VectorXd::Ones(8);
    pairs.weight[4] = weight;
    return SolveViewPoses(maker.projection, pairs).at(0).residual_px[4];
  };
  EXPECT_GT(residual(0.01), residual(1));
  EXPECT_GT(residual(1), residual(20));
  EXPECT_LT(residual(100), 0.01);
}

TEST(PickReview, NamesExchangedPicks) {
  for (const int count : {6, 9}) {
    for (unsigned seed = 0; seed < 10; ++seed) {
      PickMaker maker(seed);
      PointPairs pairs = maker.WithNoise(maker.General(count), 1.5);
      const int a = static_cast<int>(seed) % count, b = (a + 3) % count;
      pairs.x_in_img.col(a).swap(pairs.x_in_img.col(b));
      const PickReview review = ReviewPicks(maker.projection, pairs, {});
      ASSERT_TRUE(review.exchanged.has_value()) << count << " " << seed;
      EXPECT_EQ(review.exchanged->first, std::min(a, b));
      EXPECT_EQ(review.exchanged->second, std::max(a, b));
    }
  }
}

TEST(PickReview, RecognisesAMirroredScan) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    PickMaker maker(seed);
    const PointPairs pairs = maker.WithNoise(maker.General(8), 1.5).Mirrored();
    const PickReview review = ReviewPicks(maker.projection, pairs, {});
    EXPECT_TRUE(review.mirrored) << seed;
    EXPECT_LT(review.mirrored_rms_px, 5) << seed;
    EXPECT_GT(review.RmsPx(), 10) << seed;
  }
}

TEST(PickReview, CoplanarPicksDoNotTellWhetherTheScanIsMirrored) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    PickMaker maker(seed);
    const PointPairs pairs = maker.WithNoise(maker.Coplanar(8, 0.6), 1.5);
    EXPECT_FALSE(ReviewPicks(maker.projection, pairs, {}).mirrored) << seed;
    EXPECT_FALSE(ReviewPicks(maker.projection, pairs.Mirrored(), {}).mirrored) << seed;
  }
}

TEST(PickLayout, RefusesPicksOnALineWithTheNumbers) {
  PickMaker maker(1);
  PointPairs pairs = maker.General(7);
  for (int i = 0; i < 7; ++i)
    pairs.x_in_scan.col(i) = Eigen::Vector3d(0.3 * i, 1, 2 + 0.001 * (i % 2));
  const std::string problem = FindLayoutProblem(pairs, maker.projection.camera(), {});
  EXPECT_THAT(problem, HasSubstr("one straight line: 1.800 m long, none farther than 0.001 m"));
}

TEST(PickLayout, RefusesAllButOneOnALine) {
  PickMaker maker(1);
  PointPairs pairs = maker.General(6);
  for (int i = 0; i < 5; ++i) pairs.x_in_scan.col(i) = Eigen::Vector3d(0.3 * i, 1, 2);
  pairs.x_in_scan.col(5) = Eigen::Vector3d(0.5, 2, 3);
  EXPECT_THAT(FindLayoutProblem(pairs, maker.projection.camera(), {}),
              HasSubstr("all picks but one"));
}

TEST(PickLayout, RefusesPicksOnOneSpotOfThePhoto) {
  PickMaker maker(1);
  PointPairs pairs = maker.General(8);
  for (int i = 0; i < 8; ++i) pairs.x_in_img.col(i) = Eigen::Vector2d(500 + i, 400 - 2 * i);
  EXPECT_THAT(FindLayoutProblem(pairs, maker.projection.camera(), {}), HasSubstr("one spot"));
}

TEST(PickLayout, RefusesTheSamePointAgainAndAgain) {
  PickMaker maker(1);
  PointPairs pairs = maker.General(6);
  pairs.x_in_scan.colwise() = Eigen::Vector3d(1, 2, 3);
  EXPECT_THAT(FindLayoutProblem(pairs, maker.projection.camera(), {}), HasSubstr("straight line"));
}

TEST(PickLayout, AcceptsGeneralAndCoplanarPicks) {
  PickMaker maker(2);
  EXPECT_EQ(FindLayoutProblem(maker.General(6), maker.projection.camera(), {}), "");
  EXPECT_EQ(FindLayoutProblem(maker.Coplanar(6, 0.4), maker.projection.camera(), {}), "");
}

}  // namespace
}  // namespace roomtex
