// What photos and the scan's intensity say of whether an alignment by picks is to be believed.

#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "align/judgement.h"
#include "align/trust/free_space.h"
#include "core/camera_model.h"
#include "tests/align/case_folder.h"
#include "tests/align/photographed_room.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::Not;

SimulatedRoomOptions SmallPhotos(int seed) {
  SimulatedRoomOptions options = CaseOptions(seed);
  options.photo_width = 720;
  options.photo_height = 480;
  return options;
}

// A depth camera's scan, its tracking off by 4 cm per coordinate, its ranges by 36 mm at 3 m.
SimulatedRoomOptions RoughScan(int seed) {
  SimulatedRoomOptions options = CaseOptions(seed);
  options.photo_width = 640;
  options.photo_height = 480;
  options.depth_camera = true;
  options.depth_drift = 0.04;
  options.range_noise = 0.004;
  options.scan_columns = 800;
  options.scan_rows = 340;
  return options;
}

// A room with the scan that a capture of another one is aligned to.
struct OtherRoom {
  explicit OtherRoom(const SimulatedRoomOptions& options) : room(options) {}

  const SimulatedRoom room;
  const std::vector<Scan> scans = {room.MakeScan(0)};
  const FreeSpace seen{scans, 1000000};
};

// A capture of one room, to be aligned to its scan or to that of another one.
struct Captured {
  explicit Captured(const SimulatedRoomOptions& options) : one(MakeCase(options, 6)), files(one) {
    WritePhotos(*one.room, image_path);
  }

  // With photos, to the scan of a room with the same walls, by picks of what lies there where the
  // photo has it.
  CommandResult AlignTo(const OtherRoom& other, const std::string& more = "") {
    const int photo = one.room->BestPhotoForPicks();
    const Rigid scan_from_cam = other.room.ScanFromRoom() * one.room->ScanFromRoom().Inverse() *
                                one.room->CamFromScan(photo).Inverse();
    const Camera& camera = one.room->camera();
    const CameraProjection projection(camera);
    std::vector<Pick> picks;
    for (const double x : {0.1, 0.5, 0.9}) {
      for (const double y : {0.15, 0.5, 0.85}) {
        const Eigen::Vector2d x_in_img(x * camera.width, y * camera.height);
        const Eigen::Vector3d ray = projection.CamFromImg(x_in_img)->homogeneous().normalized();
        const auto sight = other.seen.Look(scan_from_cam.translation, scan_from_cam.rotation * ray);
        if (!sight) continue;
        picks.push_back({one.room->PhotoName(photo), x_in_img, sight->x_in_scan,
                         2 + static_cast<long>(picks.size())});
      }
    }
    EXPECT_GE(picks.size(), 6u);
    CaseFolder wrong(one);
    WriteScan(other.scans[0], {}, wrong.scan_path);
    WritePicks(wrong.picks_path, picks);
    const CommandResult result = wrong.Align("--image_path " + image_path + more);
    report = Json::parse(ReadBytes(
        wrong.output_path + (std::filesystem::exists(wrong.output_path) ? "" : ".untrusted") +
        "/alignment.json"));
    return result;
  }
  CommandResult Align(const std::string& more) {
    const CommandResult result = files.Align(more);
    report = Json::parse(ReadBytes(files.output_path + "/alignment.json"));
    return result;
  }

  const SimulatedCase one;
  const CaseFolder files;
  const std::string image_path = files.folder / "photos";
  Json report;
};

double ShownShare(const Json& report) {
  return report["agreement"]["gradient_shift"]["shown_share"].get<double>();
}

// Picks and points fit, since walls and furniture are the same.
TEST(PhotoEvidence, TellsTheRoomFromAnotherOneOfItsPlan) {
  Captured captured(SmallPhotos(0));
  const CommandResult right = captured.Align("--image_path " + captured.image_path);
  EXPECT_EQ(right.exit_code, 0) << right.err;
  EXPECT_GT(ShownShare(captured.report), 0.4);
  EXPECT_THAT(captured.report["warnings"].dump(), Not(HasSubstr("another room")));

  const OtherRoom other(SmallPhotos(7));
  const CommandResult wrong = captured.AlignTo(other);
  EXPECT_EQ(wrong.exit_code, 4) << wrong.err;
  EXPECT_LT(ShownShare(captured.report), 0.2);
  EXPECT_THAT(wrong.err, HasSubstr("as photos of another room with the same walls and furniture"));
  const CommandResult told = captured.AlignTo(other, " --Trust.min_shown_share 0");
  EXPECT_EQ(told.exit_code, 0) << told.err;
}

TEST(PhotoEvidence, OverrulesPointsThatARoughScanLeavesFloating) {
  Captured captured(RoughScan(27));
  const CommandResult alone = captured.Align("");
  EXPECT_EQ(alone.exit_code, 4) << alone.err;
  EXPECT_THAT(alone.err, HasSubstr("Give --image_path"));
  const CommandResult shown = captured.Align("--image_path " + captured.image_path);
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_THAT(captured.report["warnings"].dump(), HasSubstr("It is believed all the same"));
  const double off =
      WorstPoseErrors(*captured.one.room, ReadSparseModel(captured.files.output_path), Similarity())
          .position;
  EXPECT_LT(1000 * off, 3 * captured.report["expected_error"]["at_cameras_mm"].get<double>());

  EXPECT_EQ(captured.AlignTo(OtherRoom(RoughScan(28))).exit_code, 4);
}

// A depth camera that drifts has hardly any point within 5 cm of its scan in a large room: that is
// no coarse scan, but photos know the room all the same.
TEST(PhotoEvidence, OverrulesThatHardlyAnyPointLiesOnTheSurface) {
  const Captured captured(SmallPhotos(0));
  const SimulatedCase& one = captured.one;
  const Alignment alignment = AlignCase(one);
  ASSERT_TRUE(alignment.reasons.empty());
  // Three points of four come 20 cm nearer to a photo.
  SparseModel floating = one.model;
  const double metre = 1 / alignment.scan_from_sparse.scale;
  for (auto& [id, point] : floating.points) {
    if (id % 4 == 0) continue;
    const SparseImage& photo = floating.images.at(point.track[0].image_id);
    const Eigen::Vector3d centre = photo.cam_from_model.TargetOriginInSource();
    point.x_in_model += 0.2 * metre * (centre - point.x_in_model).normalized();
  }
  const AlignmentOptions options;
  AlignmentFit fit = alignment.fit;
  fit.points = FindSurfacePoints(floating, options.fit.min_track, 0.7);
  AlignmentInput input{floating, Survey(one.scans), one.picks, "picks.csv", one.azimuth};
  const auto judge = [&] {
    Judgement judgement = JudgeFit(input, alignment.start, fit, options);
    EXPECT_LT(judgement.placement.SurfaceShare(), 0.3);
    EXPECT_THAT(judgement.doubt.reason, HasSubstr("float in empty space"));
    OverruleByPhotos(input, fit, options.trust, &judgement);
    return judgement;
  };
  EXPECT_THAT(judge().reasons, testing::ElementsAre(HasSubstr("Give --image_path")));
  input.image_path = captured.image_path;
  const Judgement shown = judge();
  EXPECT_THAT(shown.reasons, testing::IsEmpty());
  EXPECT_THAT(shown.warnings, testing::Contains(HasSubstr("It is believed all the same")));
  EXPECT_FALSE(shown.follows_surface);
}

// Too few corners to say how far each photo is off: 91 of a depth camera's scan of a large room,
// and 82 of a coarse one.
TEST(PhotoEvidence, FewCornersOverruleFloatingPointsOnlyWhereMostAreInPlace) {
  GradientShifts shifts;
  shifts.elsewhere = {60, 3};
  shifts.far = {120, 0};
  const auto overrules = [&](long num, long in_place, bool differs) {
    shifts.at_pose = {num, in_place};
    return Overrules(JudgeGradientShifts(shifts), differs, TrustOptions());
  };
  EXPECT_TRUE(overrules(91, 83, true));
  EXPECT_FALSE(overrules(82, 46, true)) << "as in another room of the plan";
  EXPECT_TRUE(overrules(82, 46, false)) << "points are merely few";
  EXPECT_FALSE(overrules(20, 18, true));
  // Where it can be said, that decides.
  shifts.alike_of_clear.patches = {200, 70};
  EXPECT_FALSE(overrules(200, 170, true));
  shifts.alike_of_clear.patches = {200, 90};
  EXPECT_TRUE(overrules(200, 90, true));
}

}  // namespace
}  // namespace roomtex
