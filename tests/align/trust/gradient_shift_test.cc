#include "align/trust/gradient_shift.h"

#include <memory>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "capture/simulation/simulated_room.h"
#include "core/frames.h"

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

// Photos and scan of a simulated room.
struct Exposed {
  explicit Exposed(SimulatedRoomOptions options) {
    options.num_photos = kNumPhotos;
    options.photo_width = 720;
    options.photo_height = 480;
    options.scan_columns = 1400;
    options.scan_rows = 700;
    room = std::make_unique<SimulatedRoom>(options);
    scans = {room->MakeScan(0)};
    free_space = std::make_unique<FreeSpace>(scans, 300000);
    viewer = std::make_unique<ScanViewer>(scans, *free_space);
    projection = std::make_unique<CameraProjection>(room->camera());
    lattice = std::make_unique<RayLattice>(*projection, 3.0 * kCell);
    for (int photo = 0; photo < room->NumPhotos(); ++photo) {
      photos.push_back(room->RenderPhoto(photo));
    }
  }

  // At the true poses after the scan frame was moved by `wrong`; the photos may be another room's.
  GradientAgreement Judge(const Similarity& wrong, const std::vector<cv::Mat>& pictures) const {
    GradientShifts shifts;
    for (int photo = 0; photo < room->NumPhotos(); ++photo) {
      const ScanView view = viewer->Look(*lattice, room->camera(),
                                         CamFromScan(room->CamFromScan(photo), wrong), kCell);
      shifts.Add(MeasureGradientShifts(view, pictures[photo], *projection, viewer->sample_angle(),
                                       GradientShiftOptions()));
    }
    return JudgeGradientShifts(shifts);
  }

  static constexpr int kNumPhotos = 4, kCell = 1;
  std::unique_ptr<SimulatedRoom> room;
  std::vector<Scan> scans;
  std::unique_ptr<FreeSpace> free_space;
  std::unique_ptr<ScanViewer> viewer;
  std::unique_ptr<CameraProjection> projection;
  std::unique_ptr<RayLattice> lattice;
  std::vector<cv::Mat> photos;
};

const Exposed& Room(int seed) {
  static std::map<int, std::unique_ptr<Exposed>> rooms;
  auto& room = rooms[seed];
  if (room == nullptr) {
    SimulatedRoomOptions options;
    options.random_seed = seed;
    room = std::make_unique<Exposed>(options);
  }
  return *room;
}

Similarity Turned(double degrees, const Eigen::Vector3d& axis) {
  Similarity turned;
  turned.rotation = Eigen::AngleAxisd(RadFromDeg(degrees), axis.normalized());
  return turned;
}
Similarity Moved(const Eigen::Vector3d& by) {
  Similarity moved;
  moved.translation = by;
  return moved;
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

// Over ten rooms of different kinds: a right alignment never contradicts and a wrong one never
// supports.
TEST(GradientShift, IsNeverFalseOverTenRooms) {
  int false_contradictions = 0, false_supports = 0, supports = 0, contradictions = 0;
  for (int seed = 0; seed < 10; ++seed) {
    SimulatedRoomOptions options;
    options.random_seed = 100 + seed;
    options.shading = seed % 2 == 1;
    if (seed == 2) options.blur_px = 3;
    if (seed == 3) options.photo_noise = 8;
    if (seed == 4) options.furnished = false;
    if (seed == 5) options.bare_walls = true;
    if (seed == 6) options.camera_model = "OPENCV_FISHEYE";
    if (seed == 7) options.range_noise = 0.006;
    if (seed == 8) options.bend = 0.005;
    if (seed == 9) options.exposure_range_ev = 3;
    const Exposed one(options);
    const GradientAgreement right = one.Judge(Similarity(), one.photos);
    false_contradictions += right.contradicts;
    supports += right.supports;
    const Similarity wrongs[] = {Turned(3, {1, 2, 3}), Moved({0.15, -0.1, 0.09}),
                                 Turned(180, {0, 1, 0})};
    for (const Similarity& wrong : wrongs) {
      const GradientAgreement judged = one.Judge(wrong, one.photos);
      EXPECT_FALSE(judged.supports) << seed;
      false_supports += judged.supports;
      contradictions += judged.contradicts;
    }
    // A similar room: same size, same cameras' range, other walls and furniture.
    const GradientAgreement other = one.Judge(Similarity(), Room(0).photos);
    EXPECT_FALSE(other.supports) << seed;
    false_supports += other.supports;
    contradictions += other.contradicts;
  }
  EXPECT_EQ(false_contradictions, 0);
  EXPECT_EQ(false_supports, 0);
  EXPECT_GE(supports, 9);
  EXPECT_GE(contradictions, 25);  // of 40, with four small photos
  RecordProperty("supports_of_10", supports);
  RecordProperty("contradictions_of_40", contradictions);
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
