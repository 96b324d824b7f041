#include "align/start_verdict.h"

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/frames.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

using Kind = StartVerdict::Kind;

// A start that so many of a thousand rays agree with.
FittedStart Start(int num_agreeing, double rms) {
  FittedStart start;
  start.settled = true;
  start.rms = rms;
  start.sights.num_agreeing = num_agreeing;
  start.sights.num_short = 1000 - num_agreeing;
  return start;
}
FittedStart Asked(FittedStart start, long num_corners, long num_found, bool supports) {
  start.photos = GradientAgreement();
  start.photos->shifts.at_pose = start.photos->shifts.clear = {num_corners, num_found};
  start.photos->supports = supports;
  return start;
}

// Nothing is known of the surface that the points lie on.
StartVerdict Judge(const std::vector<FittedStart>& starts, int mirrored_agreeing,
                   bool hinted = false) {
  static const AlignmentInput input{
      MakeCase().model, Survey(MakeCase().scans), {}, "", MakeCase().azimuth};
  StartSearch search;
  search.starts = starts;
  search.mirrored = {Start(mirrored_agreeing, starts[0].rms)};
  return JudgeStarts(input, search, hinted, {});
}

constexpr double kDrifting = 0.02, kExact = 0.005;  // metres

// A room of about the same size with the same furniture fits far better than anything else, too.
TEST(StartVerdict, FaintSupportIsNotEnoughUnlessAUserSaysThatItIsThisRoom) {
  const FittedStart best = Asked(Start(820, kDrifting), 800, 200, true);
  const FittedStart second = Asked(Start(300, kDrifting), 800, 16, false);
  const StartVerdict verdict = Judge({best, second}, 300);
  EXPECT_EQ(verdict.kind, Kind::kUnconfirmed);
  EXPECT_GT(verdict.ratio, 2.5);
  EXPECT_GE(verdict.chance_wrong, 0.5);
  EXPECT_NE(verdict.reason.find("25.0 %"), std::string::npos) << verdict.reason;
  EXPECT_NE(verdict.reason.find("--near"), std::string::npos) << verdict.reason;
  EXPECT_EQ(Judge({best, second}, 300, true).kind, Kind::kTrusted);
  EXPECT_EQ(Judge({best, second}, 700, true).kind, Kind::kAmbiguous) << "as good as mirrored";
  const FittedStart clear = Asked(Start(820, kDrifting), 800, 400, true);
  EXPECT_EQ(Judge({clear, second}, 700).kind, Kind::kTrusted);
}

TEST(StartVerdict, WherePhotosAndScanLookAlikeNoRivalCounts) {
  FittedStart best = Asked(Start(820, kDrifting), 800, 120, true);
  const FittedStart second = Asked(Start(840, kDrifting), 800, 16, false);
  EXPECT_EQ(Judge({second, best}, 700).kind, Kind::kAmbiguous);
  best.looks_alike = true;
  const StartVerdict verdict = Judge({second, best}, 700);
  EXPECT_EQ(verdict.kind, Kind::kTrusted);
  EXPECT_EQ(verdict.best, 1);
  EXPECT_EQ(verdict.second, 0);
  EXPECT_EQ(verdict.chance_wrong, kChanceAlike);
  // The surface still has to be there.
  FittedStart off = Start(500, kDrifting);
  off.looks_alike = true;
  EXPECT_EQ(Judge({off}, 100).kind, Kind::kWeak);
  FittedStart moving = best;
  moving.settled = false;
  EXPECT_EQ(Judge({moving}, 100).kind, Kind::kWeak);
}

// Of a room a third of which was scanned: most rays end where nobody measured.
TEST(StartVerdict, PhotosThatConfirmItClearlyNeedLittleOfTheRoomScanned) {
  FittedStart best = Asked(Start(330, kExact), 800, 500, true);
  best.sights.num_short = 0;
  best.sights.num_unseen = 670;
  EXPECT_LT(best.sights.Score(), StartVerdictOptions().min_score);
  const StartVerdict verdict = Judge({best}, 300);
  EXPECT_EQ(verdict.kind, Kind::kTrusted);
  EXPECT_EQ(verdict.chance_wrong, kChanceClear);
  // Support that a similar room would have, too, or none.
  best = Asked(best, 800, 200, true);
  EXPECT_EQ(Judge({best}, 100).kind, Kind::kWeak);
  best.photos.reset();
  EXPECT_EQ(Judge({best}, 100).kind, Kind::kWeak);
  // Rays that end before any surface are no matter of what was scanned.
  FittedStart off = Asked(Start(250, kExact), 800, 500, true);
  EXPECT_EQ(Judge({off}, 100).kind, Kind::kWeak);
}

TEST(StartVerdict, FewCornersConfirmOnlyWhereMostOfThemFit) {
  const FittedStart second = Start(500, kExact);
  EXPECT_EQ(Judge({Asked(Start(970, kExact), 300, 120, true), second}, 600).kind, Kind::kTrusted);
  EXPECT_NE(Judge({Asked(Start(970, kExact), 70, 35, true), second}, 600).kind, Kind::kTrusted);
  EXPECT_EQ(Judge({Asked(Start(970, kExact), 70, 45, true), second}, 600).kind, Kind::kTrusted);
}

// The middle of the photos is the same in a room that is alike from both ends; what one photo would
// see is not.
TEST(StartVerdict, TwoPlacesAreToldByAPhotoAndTheTurnBetweenThem) {
  const SparseModel& model = MakeCase().model;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& [id, image] : model.images) {
    middle +=
        image.cam_from_model.TargetOriginInSource() / static_cast<double>(model.images.size());
  }
  FittedStart best = Start(900, kExact), rival = Start(850, kExact);
  rival.scan_from_sparse.rotation = Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitY());
  rival.scan_from_sparse.translation = middle - rival.scan_from_sparse.rotation * middle;
  const std::string reason = Judge({best, rival}, 500).reason;
  EXPECT_NE(reason.find("180 degrees apart: photo_0"), std::string::npos) << reason;
  std::vector<std::string> places;
  for (size_t at = reason.find("at ("); at != std::string::npos; at = reason.find("at (", at + 1)) {
    places.push_back(reason.substr(at, reason.find(')', at) - at));
  }
  ASSERT_EQ(places.size(), 2u) << reason;
  EXPECT_NE(places[0], places[1]);
}

// What a hint does: places that it contradicts are gone, and a user has said that it is this room.
TEST(StartVerdict, AHintIsAdvisedWhereItDecidesAndOnlyThere) {
  const FittedStart best = Start(900, kExact), weak = Start(500, kExact),
                    rival = Start(850, kExact);
  const auto denied = [](const FittedStart& start) { return Asked(start, 400, 8, false); };
  struct Case {
    Kind kind;
    std::vector<FittedStart> starts;
    int mirrored;
    bool decides;
  };
  for (const Case& one : std::vector<Case>{{Kind::kUnconfirmed, {best, weak}, 500, true},
                                           {Kind::kAmbiguous, {best, rival}, 500, true},
                                           {Kind::kAmbiguous, {best, rival}, 800, false},
                                           {Kind::kAmbiguous, {best, weak}, 800, false},
                                           {Kind::kAmbiguous, {denied(best), rival}, 500, false},
                                           {Kind::kByPhotos, {denied(best), weak}, 500, false},
                                           {Kind::kWeak, {weak}, 100, false},
                                           {Kind::kMirrored, {Start(700, kExact)}, 950, false}}) {
    const StartVerdict verdict = Judge(one.starts, one.mirrored);
    SCOPED_TRACE(verdict.reason);
    EXPECT_EQ(verdict.kind, one.kind);
    EXPECT_EQ(verdict.hint_decides, one.decides);
    const StartVerdict hinted = Judge({one.starts[0]}, one.mirrored, true);
    EXPECT_EQ(hinted.kind == Kind::kTrusted, one.decides);
    EXPECT_EQ(Judge(one.starts, one.mirrored, true).hint_decides,
              one.decides && one.kind == Kind::kAmbiguous)
        << "one that tells them apart";
    EXPECT_EQ(verdict.reason.find("--near") != std::string::npos, one.decides);
  }
}

// One wall is its own mirror image: what lies on nothing else must fit as well as a right model.
TEST(StartVerdict, AMirrorImageOnOneWallAloneIsBelievedOnlyWhereItFitsAsTheRoomDoes) {
  const AlignmentInput input{
      MakeCase().model, Survey(MakeCase().scans), {}, "", MakeCase().azimuth};
  const auto judge = [&](int mirrored_agreeing, double min_cosine) {
    StartSearch search;
    search.starts = {Start(600, kExact)};
    search.mirrored = {Start(mirrored_agreeing, kExact)};
    const std::vector<ScanPatch>& patches = input.surveyed.patches().patches();
    for (const ScanPatch& patch : patches) {
      if (std::abs(patch.normal.dot(patches[0].normal)) < min_cosine) continue;
      SurfacePoint point;
      point.x_in_sparse = {-patch.point.x(), patch.point.y(), patch.point.z()};
      search.cloud.points.push_back(point);
    }
    return JudgeStarts(input, search, false, {}).kind;
  };
  constexpr double kThatWall = 0.99, kAllWalls = 0;
  EXPECT_EQ(judge(800, kAllWalls), Kind::kMirrored);
  EXPECT_NE(judge(800, kThatWall), Kind::kMirrored);
  EXPECT_EQ(judge(950, kThatWall), Kind::kMirrored);
}

// Of answers by geometry and a hint nobody has counted how many are wrong.
TEST(StartVerdict, SaysWhereItsChanceWasCounted) {
  const FittedStart second = Start(300, kExact);
  const FittedStart clear = Asked(Start(900, kExact), 800, 400, true);
  EXPECT_TRUE(Judge({clear, second}, 300).chance_counted);
  EXPECT_FALSE(Judge({Start(900, kExact), second}, 300, true).chance_counted);
  EXPECT_FALSE(Judge({Start(900, kExact), second}, 300).chance_counted);
}

}  // namespace
}  // namespace roomtex
