#include "align/trust/gradient_shift.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "core/frames.h"
#include "core/statistics.h"
#include "tests/align/trust/exposed_room.h"

namespace roomtex {
namespace {

TEST(Tally, GivesTheWilsonInterval) {
  Tally tally;
  for (int i = 0; i < 100; ++i) tally.Add(i < 10);
  EXPECT_NEAR(tally.Share(), 0.1, 1e-12);
  // Solutions p of |p - 0.1| = 1.96 sqrt(p (1 - p) / 100).
  for (const double p : {tally.Low(1.96), tally.High(1.96)}) {
    EXPECT_NEAR(std::abs(p - 0.1), 1.96 * std::sqrt(p * (1 - p) / 100), 1e-9);
  }
  EXPECT_LT(tally.Low(1.96), 0.1);
  EXPECT_GT(tally.High(1.96), 0.1);
  EXPECT_EQ(Tally().Low(2), 0);
  EXPECT_EQ(Tally().High(2), 1);
}

TEST(GradientShift, SupportsTheTruePosesWithAMedianShiftBelowAPixel) {
  const GradientAgreement right = Room(0).Judge(Similarity(), Room(0).photos);
  EXPECT_TRUE(right.supports);
  EXPECT_FALSE(right.contradicts);
  EXPECT_GT(right.shifts.at_pose.num, 150);
  EXPECT_GT(right.shifts.at_pose.Share(), 0.5);
  EXPECT_LT(right.shifts.elsewhere.Share(), 0.1);
  EXPECT_LT(right.shifts.far.Share(), 0.05);
  EXPECT_LT(right.median_shift_px, 1.0);
  EXPECT_EQ(right.shifts.num_unclear_photos, 0);
  EXPECT_EQ(right.shifts.corners.size(), static_cast<size_t>(right.shifts.clear.hits));
  EXPECT_EQ(right.shifts.corners.size() + right.shifts.corners_amiss.size(),
            static_cast<size_t>(right.shifts.clear.num));
}

// The patches of poses turned or moved by little are a statement about what a measurement at those
// poses would give: compare with one.
TEST(GradientShift, ForetellsWhatItMeasuresAtAPoseThatIsReallyTurned) {
  const GradientAgreement right = Room(0).Judge(Similarity(), Room(0).photos);
  ASSERT_EQ(right.shifts.turned.size(), 3u);
  ASSERT_EQ(right.shifts.moved.size(), 3u);
  GradientShifts really;
  const Exposed& one = Room(0);
  for (int photo = 0; photo < Exposed::kNumPhotos; ++photo) {
    Rigid turn;
    turn.rotation = Eigen::AngleAxisd(RadFromDeg(1), Eigen::Vector3d::UnitY());
    const ScanView view = one.viewer->Look(*one.lattice, one.room->camera(),
                                           turn * one.room->CamFromScan(photo), Exposed::kCell);
    really.Add(MeasureGradientShifts(view, one.photos[photo], *one.projection,
                                     one.viewer->sample_angle(), GradientShiftOptions()));
  }
  EXPECT_NEAR(really.at_pose.Share(), right.shifts.turned[1].Share(), 0.04);
}

// Each photo turned another way, as those of a model that drifts: no patch is where it should be,
// and those of one photo are off alike.
TEST(GradientShift, ShowsWhereThePatchesOfEachTurnedPhotoReallyAre) {
  const Exposed& one = Room(0);
  GradientShifts all;
  for (int photo = 0; photo < Exposed::kNumPhotos; ++photo) {
    SCOPED_TRACE(photo);
    Rigid turn;
    turn.rotation = Eigen::AngleAxisd(RadFromDeg(photo % 2 == 0 ? 1 : -1),
                                      Eigen::Vector3d::Unit(photo / 2 % 2));
    const ScanView view = one.viewer->Look(*one.lattice, one.room->camera(),
                                           turn * one.room->CamFromScan(photo), Exposed::kCell);
    const GradientShifts shifts =
        MeasureGradientShifts(view, one.photos[photo], *one.projection, one.viewer->sample_angle(),
                              GradientShiftOptions());
    EXPECT_LT(shifts.at_pose.Share(), 0.1);
    EXPECT_GT(static_cast<double>(shifts.shifted_alike.size()) / shifts.at_pose.num, 0.4);
    std::vector<double> distances;
    for (const FittingCorner& corner : shifts.shifted_alike) {
      const auto x_in_img = one.projection->ImgFromCam(turn.Inverse() * corner.x_in_cam);
      ASSERT_TRUE(x_in_img);
      distances.push_back((*x_in_img - corner.x_in_img).norm());
    }
    EXPECT_LT(Median(&distances), 1.5);
    all.Add(shifts);
  }
  ASSERT_TRUE(all.ShownShare());
  EXPECT_GT(*all.ShownShare(), 0.4);
}

TEST(GradientShift, ShowsNothingShiftedAlikeInAnotherRoom) {
  const Exposed& one = Room(0);
  GradientShifts all;
  for (int photo = 0; photo < Exposed::kNumPhotos; ++photo) {
    const ScanView view = Room(1).viewer->Look(*one.lattice, one.room->camera(),
                                               one.room->CamFromScan(photo), Exposed::kCell);
    const GradientShifts shifts =
        MeasureGradientShifts(view, one.photos[photo], *one.projection, one.viewer->sample_angle(),
                              GradientShiftOptions());
    all.Add(shifts);
  }
  ASSERT_GT(all.at_pose.num, 100);
  EXPECT_LT(static_cast<double>(all.shifted_alike.size()),
            0.1 * static_cast<double>(all.at_pose.num));
  ASSERT_TRUE(all.ShownShare());
  EXPECT_LT(*all.ShownShare(), 0.1);
}

TEST(GradientShift, TheShiftIsTheTurnOfTheCamera) {
  const Exposed& one = Room(0);
  Rigid turn;  // by less than the search reaches
  turn.rotation = Eigen::AngleAxisd(RadFromDeg(0.6), Eigen::Vector3d::UnitX());
  GradientShifts shifts;
  for (int photo = 0; photo < Exposed::kNumPhotos; ++photo) {
    const ScanView view = one.viewer->Look(*one.lattice, one.room->camera(),
                                           turn * one.room->CamFromScan(photo), Exposed::kCell);
    shifts.Add(MeasureGradientShifts(view, one.photos[photo], *one.projection,
                                     one.viewer->sample_angle(), GradientShiftOptions()));
  }
  EXPECT_NEAR(JudgeGradientShifts(shifts).median_shift_deg, 0.6, 0.1);
}

// The ten rooms are gradient_shift_rooms_test.cc, labelled slow.
TEST(GradientShift, IsNeverFalseOverThreeRooms) {
  const RoomVerdicts verdicts = JudgeRooms({1, 4, 6});
  EXPECT_EQ(verdicts.false_contradictions, 0);
  EXPECT_EQ(verdicts.false_supports, 0);
  EXPECT_EQ(verdicts.supports, 3);
  EXPECT_GE(verdicts.contradictions, 8);  // of 12
}

TEST(GradientShift, FindsNoCornersInNoise) {
  const Exposed& one = Room(0);
  ScanView view = one.viewer->Look(*one.lattice, one.room->camera(), one.room->CamFromScan(0), 1);
  cv::RNG random(1);
  random.fill(view.grey, cv::RNG::NORMAL, 120, 10);
  view.valid.setTo(255);
  view.depth.setTo(2);
  const GradientShifts shifts = MeasureGradientShifts(
      view, one.photos[0], *one.projection, one.viewer->sample_angle(), GradientShiftOptions());
  EXPECT_EQ(shifts.at_pose.num, 0);
  EXPECT_FALSE(JudgeGradientShifts(shifts).contradicts);
}

// Photos of the projected pattern: the scanner does not see the light of a projector.
TEST(GradientShift, DoesNotContradictUnderAProjectedPattern) {
  const Exposed& one = Room(0);
  cv::RNG random(1);
  std::vector<cv::Mat> patterned;
  for (const cv::Mat& photo : one.photos) {
    cv::Mat1f small(photo.rows / 6 + 1, photo.cols / 6 + 1), pattern;
    random.fill(small, cv::RNG::UNIFORM, 0.0, 1.0);
    cv::resize(small, pattern, photo.size(), 0, 0, cv::INTER_LINEAR);
    cv::Mat light, channels[] = {pattern, pattern, pattern}, bright;
    cv::merge(channels, 3, light);
    photo.convertTo(bright, CV_32F);
    cv::Mat result;
    cv::Mat(bright.mul(light)).convertTo(result, CV_8U);
    patterned.push_back(result);
  }
  const GradientAgreement judged = one.Judge(Similarity(), patterned);
  EXPECT_EQ(judged.shifts.num_unclear_photos, Exposed::kNumPhotos);
  EXPECT_FALSE(judged.contradicts);
  EXPECT_FALSE(judged.shifts.ShownShare());
}

// A bare room, of which photos have next to no contrast: corners that the scan's intensity has
// there are edges and noise.
TEST(GradientShift, ShowsNothingOfTheRoomByBarePhotos) {
  const Exposed& one = Room(0);
  EXPECT_GT(*one.Judge(Similarity(), one.photos).shifts.ShownShare(), 0.4);
  std::vector<cv::Mat> bare;
  for (const cv::Mat& photo : one.photos) {
    cv::Mat faint;
    photo.convertTo(faint, -1, 0.12, 110);
    bare.push_back(faint);
  }
  const GradientAgreement judged = one.Judge(Similarity(), bare);
  EXPECT_GT(judged.shifts.at_pose.num, 100);
  EXPECT_FALSE(judged.shifts.ShownShare());
}

TEST(GradientShifts, ShownShareIsWhatChanceDoesNotExplain) {
  GradientShifts shifts;
  GradientShifts::Alike& alike = shifts.alike_of_clear;
  EXPECT_FALSE(shifts.ShownShare());
  alike.patches = {99, 90};
  EXPECT_FALSE(shifts.ShownShare()) << "too few";
  alike.patches = {200, 60};
  EXPECT_DOUBLE_EQ(*shifts.ShownShare(), 0.3);
  alike.num_by_chance = 20;
  EXPECT_DOUBLE_EQ(*shifts.ShownShare(), 40.0 / 180);
  alike.num_by_chance = 80;
  EXPECT_EQ(*shifts.ShownShare(), 0);
  alike.num_by_chance = 200;
  EXPECT_FALSE(shifts.ShownShare()) << "all are alike by chance: nothing can be told";
  // Where clear photos have too few, those count that are nearly clear.
  shifts.alike_of_plain.patches = {300, 150};
  alike = {{99, 90}, 0};
  EXPECT_DOUBLE_EQ(*shifts.ShownShare(), 0.5);
  alike = {{100, 90}, 0};
  EXPECT_DOUBLE_EQ(*shifts.ShownShare(), 0.9);
}

TEST(GradientShift, SaysNothingOnFewPatches) {
  GradientShifts shifts;
  for (int i = 0; i < 60; ++i) shifts.clear.Add(false), shifts.at_pose.Add(false);
  EXPECT_FALSE(JudgeGradientShifts(shifts).contradicts);
  EXPECT_FALSE(JudgeGradientShifts(shifts).supports);
  for (int i = 0; i < 60; ++i) shifts.elsewhere.Add(false), shifts.far.Add(false);
  for (int i = 0; i < 240; ++i) shifts.clear.Add(false), shifts.at_pose.Add(false);
  const GradientAgreement judged = JudgeGradientShifts(shifts);
  EXPECT_TRUE(judged.contradicts);
  EXPECT_NE(judged.reason.find("of 300 corners"), std::string::npos) << judged.reason;
}

}  // namespace
}  // namespace roomtex
