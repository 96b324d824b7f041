#include "dense/supplement.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/frames.h"
#include "dense/dense.h"
#include "dense/open_space.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// Photos 30 cm beside each other, 3 m in front of a wall that the scan does not have: it has the
// one 6 m away, behind it.
class ConfirmDepthTest : public testing::Test {
 protected:
  ConfirmDepthTest() {
    Scan scan;
    scan.points = {{-9, -9, 6}, {9, -9, 6}, {-9, 9, 6}, {9, 9, 6}, {0, 0, 0}};
    scan.triangles = {{0, 1, 2}, {1, 3, 2}};
    scan.organised = false;
    scan.num_columns = 5;
    scan.num_rows = 1;
    space_ = std::make_unique<ScanSpace>(std::vector<Scan>{scan}, 1);
    for (int i = 0; i < 3; ++i) {
      StereoView view;
      view.camera.model = CameraModel::kPinhole;
      view.camera.width = 64;
      view.camera.height = 48;
      view.camera.params = {60, 60, 32, 24};
      view.cam_from_scan.translation = {-0.3 * i, 0, 0};
      views_.push_back(view);
    }
  }
  static cv::Mat1f Everywhere(float value) { return cv::Mat1f(48, 64, value); }

  // Support in the middle of the first photo, which finds 3 m.
  int Support(float score, const std::vector<float>& depths_of_others,
              double min_pair_correlation = 0.85) const {
    const DepthEstimate estimate{
        Everywhere(3), {Everywhere(0), Everywhere(0), Everywhere(-1)}, Everywhere(score), {}, 0};
    std::vector<DepthOfView> others;
    for (size_t i = 0; i < depths_of_others.size(); ++i) {
      others.push_back({&views_[i + 1], Everywhere(depths_of_others[i])});
    }
    SupplementOptions options;
    options.min_pair_correlation = min_pair_correlation;
    const ConfirmedDepth confirmed =
        ConfirmDepth(views_[0], estimate, Everywhere(0), others, *space_, options, 1);
    EXPECT_EQ(confirmed.is_new(24, 32) != 0, confirmed.support(24, 32) > 0);
    return confirmed.support(24, 32);
  }

  std::unique_ptr<ScanSpace> space_;
  std::vector<StereoView> views_;
};

TEST_F(ConfirmDepthTest, ThreePhotosAreEnough) {
  EXPECT_EQ(Support(0.75f, {3, 3}), 3);
  EXPECT_EQ(Support(0.75f, {3.01f, 2.99f}), 3);
  EXPECT_EQ(Support(0.75f, {3.05f, 2.95f}), 0);
}

TEST_F(ConfirmDepthTest, TwoAreEnoughWhereTheyCorrelateWell) {
  EXPECT_EQ(Support(0.9f, {3}), 2);
  EXPECT_EQ(Support(0.8f, {3}), 0);
  EXPECT_EQ(Support(0.9f, {3, 0}), 2);  // the third knows nothing
  EXPECT_EQ(Support(0.9f, {0, 0}), 0);
  EXPECT_EQ(Support(1, {3}, 1), 0);  // never
}

TEST_F(ConfirmDepthTest, WhatAnotherPhotoSeesThroughIsNot) {
  EXPECT_EQ(Support(0.9f, {3, 4}), 0);
  EXPECT_EQ(Support(0.9f, {3, 2}), 2);  // something stands before it
}

// Copies, and photos of one burst, are one witness.
TEST_F(ConfirmDepthTest, CopiesOfAPhotoCountOnce) {
  const StereoView other_place = views_[2];
  views_[2] = views_[1];
  EXPECT_EQ(Support(0.75f, {3, 3}), 0);
  EXPECT_EQ(Support(0.9f, {3, 3}), 2);
  views_[2].cam_from_scan.translation.x() += 0.05;  // 1 degree
  EXPECT_EQ(Support(0.75f, {3, 3}), 0);
  // A copy of the photo itself.
  views_[2] = other_place;
  views_[1] = views_[0];
  EXPECT_EQ(Support(0.75f, {3, 3}), 0);
}

TEST_F(ConfirmDepthTest, NeighboursAreTakenFromDifferentPlaces) {
  views_[1].cam_from_scan.translation.x() = -0.9;
  views_[2].cam_from_scan.translation.x() = -1.8;
  views_.push_back(views_[1]);
  FindNeighbours(*space_, 12, &views_);
  EXPECT_EQ(views_[0].neighbours.size(), 2u);
  EXPECT_EQ(views_[1].neighbours.size(), 2u);  // not its own copy
}

// A grid of azimuths and elevations around a station, `range` metres away where it is seen.
template <typename Range>
Scan MakeGrid(const Eigen::Vector3d& station, const Range& range) {
  Scan scan;
  scan.num_columns = 180;
  scan.num_rows = 90;
  scan.up = Eigen::Vector3d::UnitZ();
  scan.scan_from_station.translation = station;
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      const double azimuth = RadFromDeg(179 - 2 * column), elevation = RadFromDeg(89 - 2 * row);
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      const double length = range(direction);
      scan.points.push_back(length > 0 ? (station + length * direction).eval()
                                       : Scan::MissingPoint());
    }
  }
  scan.intensity.assign(scan.points.size(), 0);
  return scan;
}

// Where one station has no echo (a black table), what another one sees farther off in that
// direction does not make the way there empty.
TEST(ScanSpace, WithoutAnEchoOfItsOwnAStationSawNothingEmpty) {
  const Scan one = MakeGrid({0, 0, 0}, [](const Eigen::Vector3d& direction) {
    return direction.x() > std::cos(RadFromDeg(20)) ? 0.0 : 3.0;
  });
  // A patch of wall at x = 6, seen from beside.
  const Eigen::Vector3d beside(5, 4, 0);
  const Scan two = MakeGrid(beside, [&](const Eigen::Vector3d& direction) {
    const double length = 1 / direction.x();
    const Eigen::Vector3d there = beside + length * direction;
    return length > 0 && std::abs(there.y()) < 1 && std::abs(there.z()) < 1 ? length : 0.0;
  });
  for (const auto& scans : {std::vector<Scan>{one}, {one, two}}) {
    const ScanSpace space(scans, 1);
    EXPECT_FALSE(space.IsSeenEmpty({2, 0, 0}, 0.025)) << scans.size();
    EXPECT_FALSE(space.IsSeenEmpty({4, 0, 0}, 0.025)) << scans.size();
    EXPECT_TRUE(space.IsSeenEmpty({-2, 0, 0}, 0.025)) << scans.size();
    EXPECT_FALSE(space.IsSeenEmpty({-4, 0, 0}, 0.025)) << scans.size();
  }
  EXPECT_TRUE(ScanSpace({one, two}, 1).IsSeenEmpty({5.5, 2, 0}, 0.025));
}

TEST(OpenSpace, HoldsThingsSmallerThanARoom) {
  Scan scan;
  scan.points = {{-0.05, -0.05, 0.15}, {0.05, -0.05, 0.15}, {0, 0.05, 0.15}};
  scan.triangles = {{0, 1, 2}};
  scan.organised = false;
  scan.num_columns = 3;
  scan.num_rows = 1;
  const ScanSpace space({scan}, 1);
  StereoPicture picture;
  picture.camera.model = CameraModel::kPinhole;
  picture.camera.width = 64;
  picture.camera.height = 48;
  picture.camera.params = {60, 60, 32, 24};
  picture.grey = cv::Mat1b(48, 64, uint8_t{0});
  const OpenSpace open(space, picture, 0.01, 1);
  EXPECT_GT(open.last(), open.first());
  EXPECT_GE(open.Bin(1 / 0.15f), 0);
}

TEST(DenseOptions, PromisesNoMorePhotosThanAreAsked) {
  DenseOptions options;
  EXPECT_EQ(options.MaxNeighbours(), 12);
  options.patch_match.num_sources = 20;
  EXPECT_EQ(options.MaxNeighbours(), 20);
  options.fusion.min_support = 13;
  EXPECT_TRUE(options.Problems().empty());
  options.fusion.min_support = 14;
  EXPECT_EQ(options.Problems().size(), 1u);
}

TEST(MakeDense, SaysWhenTheDiskIsTooSmallBeforeItBegins) {
  DensePhoto photo;
  photo.name = photo.path = "huge.jpg";
  photo.camera.model = CameraModel::kPinhole;
  photo.camera.width = photo.camera.height = 8000000;
  photo.camera.params = {8e6, 8e6, 4e6, 4e6};
  DenseOptions options;
  options.pinhole.max_image_size = 0;
  const TempFolder folder;
  Progress progress(true);
  std::vector<PhotoLeftOut> left_out;
  EXPECT_INPUT_ERROR(
      MakeDense({Scan()}, {photo}, options, folder.path(), 0, 1, &progress, &left_out),
      "finding depth in 1 photos takes 2688000.0 GB of the disk");
}

}  // namespace
}  // namespace roomtex
