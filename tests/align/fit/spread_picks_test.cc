#include "align/fit/spread_picks.h"

#include <random>

#include <gmock/gmock.h>

#include "align/fit/ray_similarity.h"
#include "align/trust/expected_error.h"
#include "core/frames.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

// `per_photo` picks in each of `num_photos` photos all around the room.
std::vector<Pick> Spread(const SimulatedRoom& room, int num_photos, int per_photo, int first) {
  std::vector<Pick> picks;
  for (int k = 0; k < num_photos; ++k) {
    const int photo = (first + k * room.NumPhotos() / num_photos) % room.NumPhotos();
    const long line = 2 + static_cast<long>(picks.size());
    for (const Pick& pick : PicksOfPhoto(room, photo, per_photo, line)) picks.push_back(pick);
  }
  return picks;
}

TEST(RaySimilarity, IsExactForExactRays) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto any = [&] {
    return Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
  };
  for (int trial = 0; trial < 50; ++trial) {
    const Similarity truth{
        0.3 + uniform(random) * 0.2,
        Eigen::Quaterniond(uniform(random), uniform(random), uniform(random), uniform(random))
            .normalized(),
        {12, -40, 5}};
    RaysToScan rays{Eigen::Matrix3Xd(3, 6), Eigen::Matrix3Xd(3, 6), Eigen::Matrix3Xd(3, 6)};
    for (int i = 0; i < 6; ++i) {
      if (i % 2 == 0) rays.origins.col(i) = 2 * any();
      if (i % 2 == 1) rays.origins.col(i) = rays.origins.col(i - 1);  // two picks in a photo
      const Eigen::Vector3d x_in_sparse = rays.origins.col(i) + 4 * any();
      rays.directions.col(i) = (x_in_sparse - rays.origins.col(i)).normalized();
      rays.x_in_scan.col(i) = truth * x_in_sparse;
    }
    const std::vector<Similarity> found = SolveRaySimilarities(rays);
    ASSERT_FALSE(found.empty()) << trial;
    EXPECT_NEAR(found[0].scale / truth.scale, 1, 1e-6) << trial;
    EXPECT_LT(RotationAngle(found[0].rotation, truth.rotation), 1e-6) << trial;
    EXPECT_LT((found[0].translation - truth.translation).norm(), 1e-5) << trial;
  }
}

TEST(RaySimilarity, OnePlaceOfAllRaysLeavesTheScaleOpen) {
  RaysToScan rays{Eigen::Matrix3Xd::Ones(3, 6), Eigen::Matrix3Xd::Random(3, 6),
                  Eigen::Matrix3Xd::Random(3, 6)};
  rays.directions.colwise().normalize();
  EXPECT_THAT(SolveRaySimilarities(rays), IsEmpty());
}

TEST(SpreadPicks, AreSixInTwoPhotosOrMore) {
  const std::vector<Pick> picks = Spread(*MakeCase().room, 3, 2, 0);
  EXPECT_TRUE(AreSpreadPicks(picks));
  EXPECT_FALSE(AreSpreadPicks({picks.begin(), picks.begin() + 5}));
  EXPECT_FALSE(AreSpreadPicks(PicksOfPhoto(*MakeCase().room, 0, 8)));
  std::vector<Pick> off = picks;
  off[3].weight = 0;
  EXPECT_FALSE(AreSpreadPicks(off));
}

TEST(SpreadPicks, PlaceTheModelAsExactlyAsTheySay) {
  const SimulatedCase& one = MakeCase();
  for (const auto& [num_photos, per_photo] : {std::pair(2, 3), {3, 2}, {6, 1}}) {
    for (int first = 0; first < 8; first += 2) {
      const std::vector<Pick> picks = Spread(*one.room, num_photos, per_photo, first);
      const SpreadPickFit fit = FitSpreadPicks(one.model, picks, {}, {});
      ASSERT_TRUE(fit.HasFit()) << num_photos << " " << first;
      EXPECT_LT(fit.rms_px[0], 3.5);
      EXPECT_FALSE(fit.mirrored);
      for (const Pick& pick : picks) {
        const Rigid& cam_from_sparse = one.model.FindImage(pick.image_name)->cam_from_model;
        const Eigen::Vector3d x_in_sparse = cam_from_sparse.TargetOriginInSource();
        const Eigen::Vector3d found = fit.fits[0].scan_from_sparse * x_in_sparse;
        const double off = (one.room->ScanFromSparse() * x_in_sparse - found).norm();
        EXPECT_LT(off, 0.02) << num_photos << " " << first;
        EXPECT_LT(off, 3 * PositionSigmaAt(fit.fits[0], found)) << num_photos << " " << first;
      }
    }
  }
}

TEST(SpreadPicks, AWrongOneIsFoundByLeavingItOut) {
  const SimulatedCase& one = MakeCase();
  for (const auto& [num_photos, off_px] : {std::pair(3, 120.0), {4, 25.0}, {4, 200.0}}) {
    for (int first = 0; first < 4; ++first) {
      std::vector<Pick> picks = Spread(*one.room, num_photos, 2, first);
      const int bad = (2 * first + 1) % static_cast<int>(picks.size());
      picks[bad].x_in_img += off_px * Eigen::Vector2d(std::cos(first), std::sin(first));
      const SpreadPickFit fit = FitSpreadPicks(one.model, picks, {}, {});
      for (int i = 0; i < static_cast<int>(picks.size()); ++i) {
        EXPECT_EQ(fit.used[i], i != bad) << num_photos << " " << first;
      }
      EXPECT_NEAR(fit.leave_one_out_px[bad], off_px, 15);
    }
  }
}

TEST(SpreadPicks, AMirroredScanIsSeen) {
  const SimulatedCase& one = MakeCase();
  std::vector<Pick> picks = Spread(*one.room, 3, 2, 1);
  for (Pick& pick : picks) pick.x_in_scan.x() *= -1;
  EXPECT_TRUE(FitSpreadPicks(one.model, picks, {}, {}).mirrored);
}

TEST(SpreadPicks, OnALineTheyAreRefused) {
  const SimulatedCase& one = MakeCase();
  std::vector<Pick> picks = Spread(*one.room, 3, 2, 1);
  for (size_t i = 0; i < picks.size(); ++i) picks[i].x_in_scan = {0.1 * i, 0.2 * i, -0.3 * i};
  const SpreadPickFit fit = FitSpreadPicks(one.model, picks, {}, {});
  EXPECT_FALSE(fit.HasFit());
  EXPECT_THAT(fit.layout_problem, HasSubstr("one straight line"));
}

TEST(SpreadPicks, AlignTheModelLikeSixInOnePhoto) {
  SimulatedCase one = MakeCase();
  one.picks = Spread(*one.room, 3, 2, 1);
  const Alignment alignment = AlignCase(one);
  EXPECT_THAT(alignment.reasons, IsEmpty());
  EXPECT_EQ(alignment.start.image_name, "");
  EXPECT_LT(alignment.start.scale_off, 0.01);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse).position, 0.002);
  // Clicked in other photos than they say.
  std::swap(one.picks[0].image_name, one.picks[2].image_name);
  std::swap(one.picks[1].image_name, one.picks[3].image_name);
  try {
    EXPECT_THAT(AlignCase(one).reasons, testing::Not(IsEmpty()));
  } catch (const Contradiction&) {  // or it has no alignment at all
  }
}

}  // namespace
}  // namespace roomtex
