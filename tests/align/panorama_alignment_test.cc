// Panoramas all around instead of photos.

#include <cmath>

#include <gmock/gmock.h>

#include "align/alignment.h"
#include "core/frames.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

using testing::IsEmpty;

SimulatedRoomOptions PanoramaOptions(int seed) {
  SimulatedRoomOptions options = CaseOptions(seed);
  options.camera_model = "EQUIRECTANGULAR";
  options.photo_width = 4096;
  options.photo_height = 2048;
  options.num_photos = 6;
  return options;
}

TEST(PanoramaAlignment, SixPicksAndTheSurfaceGiveMillimetres) {
  for (int seed = 0; seed < 2; ++seed) {
    const SimulatedCase one = MakeCase(PanoramaOptions(seed), 6);
    const Alignment alignment = AlignCase(one);
    EXPECT_THAT(alignment.reasons, IsEmpty());
    EXPECT_TRUE(alignment.adjusted());
    const PoseErrors from_picks =
        WorstPoseErrors(*one.room, one.model, alignment.start.scan_from_sparse);
    EXPECT_LT(from_picks.position, 0.06) << seed;
    const PoseErrors refined = WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse);
    EXPECT_LT(refined.position, 0.003) << seed;
    EXPECT_LT(refined.rotation, RadFromDeg(0.05)) << seed;
    const PoseErrors adjusted =
        WorstPoseErrors(*one.room, alignment.adjustment.bundle.model, Similarity());
    EXPECT_LT(adjusted.position, 0.003) << seed;
    RecordProperty("picks_mm_" + std::to_string(seed), std::to_string(1000 * from_picks.position));
    RecordProperty("surface_mm_" + std::to_string(seed), std::to_string(1000 * refined.position));
    RecordProperty("adjusted_mm_" + std::to_string(seed), std::to_string(1000 * adjusted.position));
    // Click noise is 1.5 pixels.
    EXPECT_LT(alignment.refined_pick_rms_px, 4);
  }
}

TEST(PanoramaAlignment, OneWrongPickOfEightIsNamedAndLeftOut) {
  SimulatedCase one = MakeCase(PanoramaOptions(0), 8);
  one.picks[2].x_in_img.x() += one.picks[2].x_in_img.x() < 2048 ? 60 : -60;
  const Alignment alignment = AlignCase(one);
  EXPECT_FALSE(alignment.start.picks[2].used);
  EXPECT_THAT(alignment.reasons, IsEmpty());
}

// Behind the plane of the camera, where most of a panorama lies.
TEST(PanoramaAlignment, PicksOfSeveralCountWhereverTheyAre) {
  SimulatedCase one = MakeCase(PanoramaOptions(0), 6);
  one.picks.clear();
  for (int photo = 0; photo < one.room->NumPhotos(); ++photo) {
    int taken = 0;
    for (Pick pick : PicksOfPhoto(*one.room, photo, 8)) {
      const bool is_behind = std::abs(pick.x_in_img.x() - 2048) > 1024;
      if (!is_behind || taken == 2) continue;
      pick.line = 2 + static_cast<long>(one.picks.size());
      one.picks.push_back(pick);
      ++taken;
    }
  }
  ASSERT_GE(one.picks.size(), 6u);
  const Alignment alignment = AlignCase(one);
  EXPECT_THAT(alignment.reasons, IsEmpty());
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.start.scan_from_sparse).position, 0.06);
}

}  // namespace
}  // namespace roomtex
