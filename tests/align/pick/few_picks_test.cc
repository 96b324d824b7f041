#include "align/pick/few_picks.h"

#include <gmock/gmock.h>

#include "tests/align/clicks/pick_maker.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

bool Holds(const std::vector<ViewPose>& poses, const Rigid& truth) {
  return std::any_of(poses.begin(), poses.end(), [&](const ViewPose& pose) {
    return RotationAngle(pose.cam_from_scan.rotation, truth.rotation) < 1e-5 &&
           (pose.cam_from_scan.TargetOriginInSource() - truth.TargetOriginInSource()).norm() < 1e-5;
  });
}

TEST(ThreePicks, GiveTheTruePoseAmongUpToFour) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    PickMaker maker(seed, static_cast<CameraModel>(seed % kNumCameraModels));
    const PointPairs pairs = maker.General(3);
    const std::vector<ViewPose> poses = SolveThreePicks(maker.projection, pairs);
    EXPECT_LE(poses.size(), 4u);
    EXPECT_TRUE(Holds(poses, maker.cam_from_scan)) << seed;
    for (const ViewPose& pose : poses) EXPECT_LT(pose.rms_px, 1e-3) << seed;
  }
}

TEST(FewPicks, FourAndFiveGiveTheTruePoseFirstOrAmongThoseThatFitAsWell) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    for (const int count : {4, 5}) {
      PickMaker maker(seed);
      const PointPairs pairs = seed % 2 == 0 ? maker.General(count) : maker.Coplanar(count, 0.5);
      const std::vector<ViewPose> poses = SolveFewPicks(maker.projection, pairs);
      ASSERT_FALSE(poses.empty()) << seed;
      EXPECT_TRUE(Holds(poses, maker.cam_from_scan)) << seed << " " << count;
      EXPECT_LT(poses[0].rms_px, 1e-4) << seed;
      EXPECT_TRUE(std::is_sorted(
          poses.begin(), poses.end(),
          [](const ViewPose& a, const ViewPose& b) { return a.sum_px2 < b.sum_px2; }));
    }
  }
}

TEST(FewPicks, NoiseOfAClickMovesThePoseALittle) {
  double worst = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    PickMaker maker(seed);
    const PointPairs pairs = maker.WithNoise(maker.General(5), 1.0);
    const std::vector<ViewPose> poses = SolveFewPicks(maker.projection, pairs);
    ASSERT_FALSE(poses.empty());
    double nearest = 1e9;
    for (const ViewPose& pose : poses) {
      nearest = std::min(nearest, (pose.cam_from_scan.TargetOriginInSource() -
                                   maker.cam_from_scan.TargetOriginInSource())
                                      .norm());
    }
    worst = std::max(worst, nearest);
  }
  EXPECT_LT(worst, 0.5);
}

}  // namespace
}  // namespace roomtex
