// Alignments whose photos were not taken as they are told to be: lenses, rolling shutters.
#include <gmock/gmock.h>

#include "align/alignment.h"
#include "core/camera_formulas.h"
#include "core/frames.h"
#include "core/statistics.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

// What a mapper makes of the photos that holds a lens told too long by this factor.
SimulatedCase MappedWithLongLens(SimulatedCase one, double factor) {
  Camera& camera = one.model.cameras.begin()->second;
  for (size_t k = 0; k < 2; ++k) camera.params[k] *= factor;
  one.model = AdjustedByPhotos(one.model, 0.7);
  return one;
}

// A mapper that holds a wrong lens bends the model; the photos know the lens, and the scan knows it
// better.
TEST(Alignment, AWrongLensIsNoticedAndMended) {
  const SimulatedCase& right = MakeCase(0, 6);
  const double focal_length = right.model.cameras.begin()->second.MeanFocalLength();
  const SimulatedCase wrong = MappedWithLongLens(right, 1.03);
  const Alignment alignment = AlignCase(wrong);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  ASSERT_TRUE(alignment.lenses.mended);
  EXPECT_THAT(alignment.warnings, testing::Contains(HasSubstr("standard deviations")));
  ASSERT_TRUE(alignment.adjusted());
  EXPECT_TRUE(alignment.adjustment.freed);
  EXPECT_FALSE(alignment.adjustment.bend);
  const SparseModel& model = alignment.adjustment.bundle.model;
  EXPECT_NEAR(model.cameras.begin()->second.MeanFocalLength() / focal_length, 1, 0.001);
  EXPECT_LT(WorstPoseErrors(*wrong.room, model, Similarity()).position, 0.004);
  // Told to keep it, it is wrong, and not to be trusted.
  AlignmentOptions options;
  options.refine_intrinsics = RefineIntrinsics::kNever;
  const Alignment held = AlignCase(wrong, options);
  EXPECT_FALSE(held.lenses.mended);
  EXPECT_THAT(Reasons(held), HasSubstr("The lens as told is kept. --refine_intrinsics auto"));
  EXPECT_THAT(AlignCase(right, options).reasons, IsEmpty());
  // A right one stays as it is.
  const Alignment& usual = AlignedCase(0, 6);
  EXPECT_FALSE(usual.lenses.mended);
  ASSERT_EQ(usual.lenses.lenses.size(), 1u);
  EXPECT_FALSE(usual.lenses.lenses[0].used);
}

double MedianTurnError(const RollingShutter& found, const RowMotions& motions) {
  std::vector<double> off;
  for (const auto& [id, motion] : motions) {
    off.push_back(DegFromRad((found.motions.at(id).turn - motion.turn).norm()));
  }
  return Median(off);
}

TEST(Alignment, ARollingShutterIsFoundAndTakenOut) {
  RowMotions motions;
  const SimulatedCase one = WithRollingShutter(MakeCase(2, 6), 1, &motions);
  const Alignment alignment = AlignCase(one);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  ASSERT_TRUE(alignment.rolling_shutter);
  EXPECT_THAT(alignment.warnings, testing::Contains(HasSubstr("rolling shutter")));
  ASSERT_TRUE(alignment.adjusted());
  EXPECT_LT(WorstPoseErrors(*one.room, alignment.adjustment.bundle.model, Similarity()).position,
            0.006);
  // Turns of half a degree are found to a fifth (median).
  EXPECT_LT(MedianTurnError(*alignment.rolling_shutter, motions), 0.1);
  AlignmentOptions at_once;
  at_once.bundle.rolling_shutter = false;
  const Alignment rolled = AlignCase(one, at_once);
  EXPECT_FALSE(rolled.rolling_shutter);
  EXPECT_GT(WorstPoseErrors(*one.room, rolled.adjustment.bundle.model, Similarity()).position,
            0.012);
  // A quarter of what was off may stay, and is said.
  EXPECT_GT(alignment.expected_error.at_cameras, 0.2 * rolled.expected_error.at_cameras);
  EXPECT_LT(alignment.expected_error.at_cameras, 0.8 * rolled.expected_error.at_cameras);
  // Picks are told as they were made.
  EXPECT_EQ(alignment.start.picks[0].pick.x_in_img, one.picks[0].x_in_img);
  // Photos that were read at once have none.
  EXPECT_FALSE(AlignedCase(2, 6).rolling_shutter);
}

// Their rows lie along the longer side, from left to right.
TEST(Alignment, ARollingShutterOfUprightPhotosIsFound) {
  SimulatedRoomOptions options = CaseOptions(3);
  std::swap(options.photo_width, options.photo_height);
  RowMotions motions;
  const SimulatedCase one = WithRollingShutter(MakeCase(options, 6), 1, &motions);
  const Alignment alignment = AlignCase(one);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  ASSERT_TRUE(alignment.rolling_shutter);
  EXPECT_LT(WorstPoseErrors(*one.room, alignment.adjustment.bundle.model, Similarity()).position,
            0.008);
  EXPECT_LT(MedianTurnError(*alignment.rolling_shutter, motions), 0.12);
}

// Too little to be found by itself, the motion of photos bends a sparse model, too: the straight
// scan is not to blame.
TEST(Alignment, ASmallRollingShutterIsNoBentScan) {
  for (const int seed : {0, 2}) {
    RowMotions motions;
    const SimulatedCase one = WithRollingShutter(MakeCase(seed, 6), 1, &motions, 0.25);
    AlignmentOptions at_once;
    at_once.bundle.rolling_shutter = false;
    EXPECT_TRUE(AlignCase(one, at_once).adjustment.bend) << seed;
    const Alignment alignment = AlignCase(one);
    EXPECT_TRUE(alignment.rolling_shutter) << seed;
    ASSERT_TRUE(alignment.adjusted()) << seed;
    EXPECT_FALSE(alignment.adjustment.bend) << seed;
    EXPECT_LT(WorstPoseErrors(*one.room, alignment.adjustment.bundle.model, Similarity()).position,
              0.005)
        << seed;
    // Nor does it need a bend to be looked for.
    AlignmentOptions straight;
    straight.bundle.bend = false;
    const Alignment unbent = AlignCase(one, straight);
    EXPECT_TRUE(unbent.rolling_shutter) << seed;
    ASSERT_TRUE(unbent.adjusted()) << seed;
    EXPECT_LT(WorstPoseErrors(*one.room, unbent.adjustment.bundle.model, Similarity()).position,
              0.005)
        << seed;
  }
}

// Told wrong and never to be refined, a focal length down the rows that is another than across them
// is no hand that nods alike in all photos.
TEST(Alignment, AWrongLensIsNoRollingShutter) {
  SimulatedCase one = MakeCase(2, 6);
  for (auto& [id, camera] : one.model.cameras) {
    ASSERT_FALSE(camera_formulas::HasOneFocalLength(camera.model));
    camera.params[1] *= 1.03;
  }
  one.model = AdjustedByPhotos(one.model, KeypointNoise(one.model));
  AlignmentOptions options;
  options.refine_intrinsics = RefineIntrinsics::kNever;
  EXPECT_FALSE(AlignCase(one, options).rolling_shutter);
}

// What a lens does not explain is a hand, however alike it moves.
TEST(Alignment, AHandThatNodsAlikeInAllPhotosIsARollingShutter) {
  RowMotions motions;
  const SimulatedCase one = WithRollingShutter(MakeCase(2, 6), 1, &motions, 1, 0.7);
  const Alignment alignment = AlignCase(one);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  ASSERT_TRUE(alignment.rolling_shutter);
  ASSERT_TRUE(alignment.adjusted());
  EXPECT_LT(WorstPoseErrors(*one.room, alignment.adjustment.bundle.model, Similarity()).position,
            0.01);
}

// Photos alone cannot mend the lens of a rig; they notice it, and the scan mends it.
TEST(Alignment, AWrongLensOfARigIsMendedByTheScan) {
  const SimulatedCase& right = MakeCase(0, 6);
  const double focal_length = right.model.cameras.begin()->second.MeanFocalLength();
  SimulatedCase wrong = MappedWithLongLens(right, 1.01);
  for (auto& [id, image] : wrong.model.images) image.frame_id = id;
  const Alignment alignment = AlignCase(wrong);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  EXPECT_FALSE(alignment.lenses.mended);
  EXPECT_THAT(alignment.warnings, testing::Contains(HasSubstr("The lens found is used")));
  ASSERT_TRUE(alignment.adjusted());
  EXPECT_TRUE(alignment.adjustment.freed);
  const SparseModel& model = alignment.adjustment.bundle.model;
  EXPECT_NEAR(model.cameras.begin()->second.MeanFocalLength() / focal_length, 1, 0.001);
  EXPECT_LT(WorstPoseErrors(*wrong.room, model, Similarity()).position, 0.004);
  AlignmentOptions options;
  options.refine_intrinsics = RefineIntrinsics::kNever;
  EXPECT_THAT(Reasons(AlignCase(wrong, options)), HasSubstr("The lens as told is kept"));
}

// The scan of a depth camera whose tracking drifts by centimetres lies about as near to the model
// of either lens: the photos, which are sure, are believed.
TEST(Alignment, AScanThatDriftsDoesNotOutvoteThePhotosAboutTheirLens) {
  SimulatedRoomOptions room = CaseOptions(1);
  room.depth_camera = true;
  const SimulatedCase right = MakeCase(room, 6);
  const double focal_length = right.model.cameras.begin()->second.MeanFocalLength();
  const SimulatedCase wrong = MappedWithLongLens(right, 1.02);
  const Alignment alignment = AlignCase(wrong);
  EXPECT_GT(alignment.disagreement.rms, 0.015);
  ASSERT_TRUE(alignment.lenses.mended) << testing::PrintToString(alignment.warnings);
  EXPECT_NEAR(alignment.lenses.lenses[0].found.MeanFocalLength() / focal_length, 1, 0.003);
  AlignmentOptions options;
  options.refine_intrinsics = RefineIntrinsics::kNever;
  const Alignment held = AlignCase(wrong, options);
  EXPECT_LT(
      WorstPoseErrors(*wrong.room, *alignment.lenses.mended, alignment.scan_from_sparse).position,
      0.7 * WorstPoseErrors(*wrong.room, wrong.model, held.scan_from_sparse).position);
}

}  // namespace
}  // namespace roomtex
