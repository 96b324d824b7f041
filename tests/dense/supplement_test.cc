#include "dense/supplement.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace roomtex
