#include "align/trust/open_directions.h"

#include <gmock/gmock.h>

#include "tests/align/simulated_alignment.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

// The scan of which only samples on these planes of the room are left (axis, coordinate in `room`),
// with picks on them in the photo that sees the most of them.
SimulatedCase OnlyWalls(const std::vector<std::pair<int, double>>& walls) {
  SimulatedCase one = MakeCase(0);
  const Rigid room_from_scan = one.room->ScanFromRoom().Inverse();
  const auto on_wall = [&](const Eigen::Vector3d& x_in_scan) {
    const Eigen::Vector3d x = room_from_scan * x_in_scan;
    return std::any_of(walls.begin(), walls.end(), [&](const std::pair<int, double>& wall) {
      return std::abs(x[wall.first] - wall.second) < 0.01;
    });
  };
  for (Eigen::Vector3d& x : one.scans[0].points) {
    if (!on_wall(x)) x = Scan::MissingPoint();
  }
  one.picks.clear();
  for (int photo = 0; photo < one.room->NumPhotos(); ++photo) {
    std::vector<Pick> picks;
    for (const Pick& pick : PicksOfPhoto(*one.room, photo, 40)) {
      if (on_wall(pick.x_in_scan) && picks.size() < 12) picks.push_back(pick);
    }
    if (picks.size() > one.picks.size()) one.picks = picks;
  }
  EXPECT_GE(one.picks.size(), 7u);
  return one;
}

double LargestCosine(const std::vector<Eigen::Vector3d>& directions, const Eigen::Vector3d& d) {
  double largest = 0;
  for (const Eigen::Vector3d& direction : directions) {
    largest = std::max(largest, std::abs(direction.dot(d)));
  }
  return largest;
}

TEST(OpenDirections, AFurnishedRoomLeavesNothingOpen) {
  const Alignment& alignment = AlignedCase();
  EXPECT_TRUE(alignment.open.None());
  EXPECT_EQ(alignment.open.num_facings, 3);
  EXPECT_EQ(alignment.open.Sentence(OpenDirections::HeldBy::kPicks), "");
}

TEST(OpenDirections, OneWallLeavesSlidingTurningAndScaleToThePicks) {
  const SimulatedCase one = OnlyWalls({{1, 4.0}});
  const Alignment alignment = AlignCase(one);
  ASSERT_TRUE(alignment.fit.refined);
  EXPECT_EQ(alignment.open.num_facings, 1);
  const Eigen::Matrix3d axes = one.room->ScanFromRoom().rotation.toRotationMatrix();  // columns
  // Along the wall, and about its normal. The distance to it follows the scale.
  EXPECT_EQ(alignment.open.slides.size(), 3u);
  ASSERT_EQ(alignment.open.turns.size(), 1u);
  EXPECT_GT(LargestCosine(alignment.open.turns, axes.col(1)), 0.999);
  EXPECT_TRUE(alignment.open.scale);
  EXPECT_THAT(alignment.warnings, Contains(HasSubstr("one wall, or walls opposite each other")));
  EXPECT_THAT(alignment.warnings, Contains(HasSubstr("there the picks alone hold it, to")));
  // Without any, nobody says how well they hold it.
  EXPECT_THAT(alignment.open.Sentence(OpenDirections::HeldBy::kNothing),
              AllOf(HasSubstr("nothing holds it"), Not(HasSubstr("mm"))));
  // The truth lies within what is said of it.
  EXPECT_GT(alignment.open.slide_sigma, 0.001);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse).position,
            4 * alignment.open.slide_sigma);
}

TEST(OpenDirections, TwoParallelWallsFixTheScaleButNotSliding) {
  const SimulatedCase one = OnlyWalls({{1, 0.0}, {1, 4.0}});
  const Alignment alignment = AlignCase(one);
  ASSERT_TRUE(alignment.fit.refined);
  EXPECT_EQ(alignment.open.num_facings, 1);
  EXPECT_FALSE(alignment.open.scale);
  const Eigen::Matrix3d axes = one.room->ScanFromRoom().rotation.toRotationMatrix();
  ASSERT_EQ(alignment.open.slides.size(), 2u);
  EXPECT_LT(LargestCosine(alignment.open.slides, axes.col(1)), 0.02);
  ASSERT_EQ(alignment.open.turns.size(), 1u);
  EXPECT_GT(LargestCosine(alignment.open.turns, axes.col(1)), 0.999);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse).position,
            4 * alignment.open.slide_sigma);
}

TEST(OpenDirections, ACornerOfTwoWallsLeavesOneDirectionOpen) {
  const SimulatedCase one = OnlyWalls({{1, 4.0}, {0, 5.0}});
  const Alignment alignment = AlignCase(one);
  ASSERT_TRUE(alignment.fit.refined);
  EXPECT_EQ(alignment.open.num_facings, 2);
  const Eigen::Matrix3d axes = one.room->ScanFromRoom().rotation.toRotationMatrix();
  EXPECT_GT(LargestCosine(alignment.open.slides, axes.col(2)), 0.8);
  EXPECT_THAT(alignment.warnings, Contains(HasSubstr("faces two ways only")));
}

// Without picks the model slides along parallel walls, or finds nothing to settle on.
TEST(OpenDirections, WhatNoPicksHoldIsNotTrusted) {
  SimulatedCase parallel = OnlyWalls({{1, 0.0}, {1, 4.0}}),
                corner = OnlyWalls({{1, 4.0}, {0, 5.0}});
  parallel.picks.clear();
  corner.picks.clear();
  const Alignment slid = AlignCaseFrom(parallel.room->ScanFromSparse(), 0.05, parallel);
  EXPECT_TRUE(slid.fit.refined);
  EXPECT_THAT(slid.reasons, Contains(HasSubstr("there are no picks to hold it")));
  EXPECT_FALSE(slid.adjusted());
  const Alignment lost = AlignCaseFrom(corner.room->ScanFromSparse(), 0.05, corner);
  EXPECT_THAT(lost.reasons, Contains(HasSubstr("from what the start gives")));
  EXPECT_FALSE(lost.adjusted());
}

// Corners that photos show take the place of picks; what they hold no better than 10 cm is nowhere.
TEST(OpenDirections, WhatPhotosHoldBadlyIsNotTrusted) {
  SimulatedCase corner = OnlyWalls({{1, 0.0}, {1, 4.0}, {0, 5.0}});
  const auto align = [&](double weight) {
    for (Pick& pick : corner.picks) pick.weight = weight;
    const SurveyedScans surveyed(corner.scans);
    const AlignmentInput input{corner.model, surveyed, corner.picks, "", corner.azimuth};
    AlignmentStart start =
        StartFromSimilarity(corner.model, corner.picks, corner.room->ScanFromSparse(), 0.05);
    start.num_corners = static_cast<int>(corner.picks.size());
    Progress quiet(true);
    return AlignToScan(input, start, AlignmentOptions(), &quiet);
  };
  const Alignment held = align(1);
  EXPECT_THAT(held.reasons, Not(Contains(HasSubstr("alone hold it"))));
  EXPECT_LT(held.expected_error.at_cameras, 0.03);
  const Alignment hardly = align(0.01);
  EXPECT_GT(hardly.expected_error.at_cameras, 0.1);
  EXPECT_THAT(hardly.reasons, Contains(HasSubstr("alone hold it")));
}

TEST(OpenDirections, AFitWithoutSolutionSaysNothing) {
  EXPECT_TRUE(FindOpenDirections(SimilarityFit(), {0, 0, 0}).None());
}

}  // namespace
}  // namespace roomtex
