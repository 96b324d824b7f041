#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/photo.h"
#include "importers/e57_images.h"
#include "tests/texture/colored_room.h"
#include "texture/output/write_e57.h"
#include "texture/sampling/photo_mask.h"

namespace roomtex {
namespace {

class TransparentPhotosTest : public ColoredRoomTest {
 protected:
  static void SetUpTestSuite() { Make(Options()); }
};

// Masks of programs that cut things out: black, mostly, where nothing is to be seen.
TEST_F(TransparentPhotosTest, GiveNoColourWhereTheyAreTransparent) {
  const ColorizeResult whole = Colorize(Photos(0, 0), "none");
  std::vector<PhotoView> photos = Photos(0, 0);
  for (size_t i = 0; i < photos.size(); i += 2) {
    const cv::Mat photo = ReadPhoto(photos[i].path);
    std::vector<cv::Mat> channels(4);
    cv::Mat seen = photo.clone();
    seen.colRange(0, photo.cols / 2).setTo(cv::Scalar::all(0));
    cv::split(seen, channels);
    channels.resize(4);
    channels[3] = cv::Mat(photo.size(), CV_8U, cv::Scalar(255));
    channels[3].colRange(0, photo.cols / 2).setTo(0);
    cv::Mat cut;
    cv::merge(channels, cut);
    photos[i].path = *folder_ / ("cut_" + std::to_string(i) + ".png");
    ASSERT_TRUE(cv::imwrite(photos[i].path, cut));
    photos[i].transparent = MaskOfTransparency(ReadTransparency(photos[i].path, photos[i].pixels));
    ASSERT_TRUE(photos[i].transparent);
    EXPECT_NEAR(photos[i].transparent->Share(), 0.5, 0.05);
  }
  const ColorizeResult cut = Colorize(photos, "none");
  EXPECT_GT(Psnr(cut), Psnr(whole) - 1);
  const ColorGrid &now = cut.scans[0].samples, &before = whole.scans[0].samples;
  size_t num_seen = 0, num_black = 0;
  for (size_t i = 0; i < now.rgb.size(); ++i) {
    if (now.views[i] == 0 || before.views[i] == 0) continue;
    ++num_seen;
    num_black += now.rgb[i][1] + 40 < before.rgb[i][1];
  }
  EXPECT_GT(num_seen, now.rgb.size() / 2);
  EXPECT_LT(num_black, num_seen / 500);
  EXPECT_FALSE(MaskOfTransparency(ReadTransparency(photos[1].path, photos[1].pixels)));
}

// Undistorted with their pictures.
TEST_F(TransparentPhotosTest, AreTransparentInAnE57) {
  std::vector<PhotoView> photos = Photos(0, 0);
  photos.resize(1);
  cv::Mat4b cut(photos[0].camera.height, photos[0].camera.width, {90, 90, 90, 255});
  cut.colRange(0, cut.cols / 2).setTo(0);
  photos[0].path = *folder_ / "half.png";
  photos[0].camera.model = CameraModel::kSimpleRadial;
  photos[0].camera.params = {1.0 * cut.cols, 0.5 * cut.cols, 0.5 * cut.rows, -0.05};
  ASSERT_TRUE(cv::imwrite(photos[0].path, cut));
  WriteColoredE57({}, {}, &photos, *folder_ / "half.e57");
  Progress quiet(true);
  const E57Photos written = ExtractE57Images(*folder_ / "half.e57", *folder_ / "half", {}, &quiet);
  ASSERT_EQ(written.photos.size(), 1u);
  const cv::Mat picture =
      cv::imread(*folder_ / ("half/" + written.photos[0].file), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(picture.type(), CV_8UC4);
  EXPECT_EQ(picture.at<cv::Vec4b>(cut.rows / 2, cut.cols / 2 - 3)[3], 0);
  EXPECT_EQ(picture.at<cv::Vec4b>(cut.rows / 2, cut.cols / 2 + 3), cv::Vec4b(90, 90, 90, 255));
}

}  // namespace
}  // namespace roomtex
