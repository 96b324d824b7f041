#include "align/start_verdict.h"

#include <gtest/gtest.h>

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
StartVerdict Judge(const std::vector<FittedStart>& starts, int mirrored_agreeing) {
  static const AlignmentInput input{
      MakeCase().model, Survey(MakeCase().scans), {}, "", MakeCase().azimuth};
  StartSearch search;
  search.starts = starts;
  search.mirrored = {Start(mirrored_agreeing, starts[0].rms)};
  return JudgeStarts(input, search, false, {});
}

constexpr double kDrifting = 0.02, kExact = 0.005;  // metres

TEST(StartVerdict, APlaceThatPhotosDenyCountsLessAgainstOneThatTheySupportFaintly) {
  const FittedStart best = Asked(Start(820, kDrifting), 800, 200, true);
  const FittedStart second =
      Start(550, kDrifting);  // of which 1.65 times is more than the best has
  EXPECT_EQ(Judge({best, Asked(second, 800, 16, false)}, 470).kind, Kind::kTrusted);
  EXPECT_EQ(Judge({best, second}, 470).kind, Kind::kAmbiguous) << "nobody asked";
  EXPECT_EQ(Judge({best, Asked(Start(650, kDrifting), 800, 16, false)}, 470).kind, Kind::kAmbiguous)
      << "too near all the same";
  EXPECT_EQ(Judge({best, Asked(second, 800, 16, false)}, 550).kind, Kind::kAmbiguous)
      << "no photo can be asked about the mirror image";
  const FittedStart few = Asked(Start(820, kDrifting), 800, 120, true);
  EXPECT_EQ(Judge({few, Asked(second, 800, 16, false)}, 470).kind, Kind::kAmbiguous)
      << "as a room of the same plan has them";
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
  EXPECT_EQ(verdict.chance_wrong, kChanceFaint);
  // The surface still has to be there.
  FittedStart off = Start(500, kDrifting);
  off.looks_alike = true;
  EXPECT_EQ(Judge({off}, 100).kind, Kind::kWeak);
  FittedStart moving = best;
  moving.settled = false;
  EXPECT_EQ(Judge({moving}, 100).kind, Kind::kWeak);
}

TEST(StartVerdict, FewCornersConfirmOnlyWhereMostOfThemFit) {
  const FittedStart second = Start(500, kExact);
  EXPECT_EQ(Judge({Asked(Start(970, kExact), 300, 120, true), second}, 600).kind, Kind::kTrusted);
  EXPECT_NE(Judge({Asked(Start(970, kExact), 70, 35, true), second}, 600).kind, Kind::kTrusted);
  EXPECT_EQ(Judge({Asked(Start(970, kExact), 70, 45, true), second}, 600).kind, Kind::kTrusted);
}

}  // namespace
}  // namespace roomtex
