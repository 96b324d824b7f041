#include "texture/colorize.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/sampling/two_walls.h"

namespace roomtex {
namespace {

class Colorize : public ::testing::Test {
 protected:
  Colorize() {
    // Exposures 0.6 .. 1.6, places around the scanner.
    const Eigen::Vector3d places[6] = {{-0.7, 0.2, 0.1}, {0.7, 0.1, 0},  {0, -0.5, 0.3},
                                       {0.3, 0.5, -0.1}, {-0.4, 0, 0.4}, {0.9, -0.3, 0.2}};
    for (int i = 0; i < 6; ++i) {
      photos_.push_back(scene_.View(places[i], "p" + std::to_string(i) + ".jpg"));
      const float exposure = 0.6f + 0.2f * static_cast<float>(i);
      scene_.Shoot(&photos_.back(), exposure, folder_.path(), exposure / 60);
    }
  }

  ColorizeResult Run(const std::vector<Scan>& scans, const ColorizeOptions& options = {},
                     int num_threads = 2) {
    Progress progress(true);
    return ColorizeScans(scans, photos_, options, num_threads, &progress);
  }

  // Mean and largest error of the coloured samples in linear light after one gain; samples nearer
  // to the board's outline than `margin` in the wall's shadow zone are left out.
  struct Error {
    double mean = 0, largest = 0;
    int count = 0, red_on_wall = 0, red_on_seen_wall = 0;
  };
  // Some photo really sees the point, and the surface around it for a pixel each way: what it mixes
  // with the board's colour shows neither.
  bool IsSeen(const Eigen::Vector3d& point) const {
    return std::any_of(photos_.begin(), photos_.end(), [&](const PhotoView& photo) {
      const Eigen::Vector3d ray = point - photo.Centre();
      const double pixel = ray.norm() / photo.camera.MeanFocalLength();
      for (const auto& [x, y] : {std::pair<int, int>(0, 0), {1, 1}, {1, -1}, {-1, 1}, {-1, -1}}) {
        const Eigen::Vector3d beside = point + pixel * Eigen::Vector3d(x, y, 0);
        if ((scene_.Hit(photo.Centre(), beside - photo.Centre()) - beside).norm() > 1e-6) {
          return false;
        }
      }
      return true;
    });
  }
  Error Measure(const Scan& scan, const ColorGrid& grid) const {
    const auto& linear = LinearFromSrgbByte();
    double want = 0, have = 0;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (grid.views[i] == 0) continue;
      want += scene_.color(scan.points[i])[1];
      have += linear[grid.rgb[i][1]];
    }
    const double gain = want / have;
    Error error;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (grid.views[i] == 0) continue;
      ++error.count;
      double largest = 0;
      for (int k = 0; k < 3; ++k) {
        largest = std::max(
            largest, std::abs(gain * linear[grid.rgb[i][k]] - scene_.color(scan.points[i])[k]));
      }
      error.mean += largest;
      error.largest = std::max(error.largest, largest);
      const bool is_red = linear[grid.rgb[i][0]] > 3 * linear[grid.rgb[i][1]];
      error.red_on_wall += is_red && scan.points[i].z() < -3;
      error.red_on_seen_wall += is_red && scan.points[i].z() < -3 && IsSeen(scan.points[i]);
    }
    error.mean /= error.count;
    return error;
  }

  TempFolder folder_;
  TwoWalls scene_;
  std::vector<PhotoView> photos_;
};

TEST_F(Colorize, DoesNotPaintTheWallWithTheBoardInFrontOfIt) {
  const Scan scan = scene_.MakeScan(200, 200);
  const ColorizeResult result = Run({scan});
  const Error error = Measure(scan, result.scans[0].samples);
  EXPECT_GT(error.count, 30000);
  EXPECT_EQ(error.red_on_wall, 0);
  EXPECT_LT(error.mean, 0.006);
  EXPECT_EQ(result.num_vertices, 40000u);
  EXPECT_EQ(static_cast<int>(result.num_colored), error.count);
}

TEST_F(Colorize, RecoversTheExposureWithAndWithoutExif) {
  const Scan scan = scene_.MakeScan(150, 150);
  for (const std::string mode : {"match", "exif"}) {
    ColorizeOptions options;
    options.exposure.mode = mode;
    const ColorizeResult result = Run({scan}, options);
    const double first = result.exposure.gains[0][0] * 0.6;
    for (int i = 1; i < 6; ++i) {
      EXPECT_NEAR(result.exposure.gains[i][0] * (0.6 + 0.2 * i) / first, 1, 0.02) << mode << i;
    }
    EXPECT_LT(result.disagreement.after, 0.25 * result.disagreement.before);
  }
  for (size_t i = 0; i < photos_.size(); ++i) {
    scene_.Shoot(&photos_[i], 0.6f + 0.2f * static_cast<float>(i), folder_.path(), 0);  // no EXIF
  }
  const ColorizeResult result = Run({scan});
  const double first = result.exposure.gains[0][0] * 0.6;
  for (int i = 1; i < 6; ++i) {
    EXPECT_NEAR(result.exposure.gains[i][0] * (0.6 + 0.2 * i) / first, 1, 0.03) << i;
  }
}

TEST_F(Colorize, IsTheSameForAnyNumberOfThreads) {
  const Scan scan = scene_.MakeScan(120, 100);
  const ColorizeResult one = Run({scan}, {}, 1), three = Run({scan}, {}, 3);
  EXPECT_EQ(one.scans[0].samples.rgb, three.scans[0].samples.rgb);
  EXPECT_EQ(one.scans[0].samples.views, three.scans[0].samples.views);
}

TEST_F(Colorize, KeepsFinePatternsAtFullContrast) {
  scene_.board_half = 0;
  scene_.color = [](const Eigen::Vector3d& p) {
    const auto wave = static_cast<float>(std::sin(60 * p.x()));  // about 6 samples a period
    return Eigen::Vector3f(0.3f + 0.2f * wave, 0.3f + 0.2f * wave, 0.3f);
  };
  for (PhotoView& photo : photos_) scene_.Shoot(&photo, 1, folder_.path(), 0.01);
  const Scan scan = scene_.MakeScan(240, 100);
  std::vector<Rgb> pictures[2];
  for (bool detail : {true, false}) {
    ColorizeOptions options;
    options.blend.detail = detail;
    const ColorizeResult result = Run({scan}, options);
    const ColorGrid& grid = result.scans[0].samples;
    double ab = 0, aa = 0, mean = 0;
    int count = 0;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      mean += LinearFromSrgbByte()[grid.rgb[i][0]] * (grid.views[i] > 0);
      count += grid.views[i] > 0;
    }
    mean /= count;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (grid.views[i] == 0) continue;
      const double truth = scene_.color(scan.points[i])[0] - 0.3;
      ab += truth * (LinearFromSrgbByte()[grid.rgb[i][0]] / mean * 0.3 - 0.3);
      aa += truth * truth;
    }
    EXPECT_NEAR(ab / aa, 1, 0.04) << detail;
    pictures[detail] = grid.rgb;
  }
  EXPECT_NE(pictures[0], pictures[1]);  // what `detail` says is done
}

TEST_F(Colorize, HidesOneScanBehindTheOther) {
  // The wall without the board in one scan, the board alone in another: photos see the board.
  TwoWalls wall = scene_;
  wall.board_half = 0;
  Scan first = wall.MakeScan(160, 160), second = scene_.MakeScan(160, 160);
  for (Eigen::Vector3d& p : second.points) {
    if (p.z() < -3) p = Scan::MissingPoint();
  }
  const ColorizeResult result = Run({first, second});
  ASSERT_EQ(result.scans.size(), 2u);
  const Error on_wall = Measure(first, result.scans[0].samples);
  EXPECT_EQ(on_wall.red_on_seen_wall, 0);
  // The board reaches up to one sample spacing beyond its last samples: what hides there cannot be
  // known.
  EXPECT_LT(on_wall.red_on_wall, 0.005 * on_wall.count);
  EXPECT_GT(Measure(second, result.scans[1].samples).count, 1000);
  EXPECT_LT(Measure(second, result.scans[1].samples).mean, 0.02);
}

TEST_F(Colorize, ThingsOfOnePhotoThatAreNotInTheScanAreLeftOut) {
  scene_.board_half = 0;  // every view counts in full
  for (size_t i = 0; i < photos_.size(); ++i) {
    scene_.Shoot(&photos_[i], 0.6f + 0.2f * static_cast<float>(i), folder_.path(), 0.01);
  }
  const Scan scan = scene_.MakeScan(150, 150);
  // Somebody stands in front of photo 2.
  cv::Mat photo = ReadPhoto(photos_[2].path);
  photo(cv::Rect(200, 100, 150, 380)).setTo(cv::Scalar(10, 200, 10));
  cv::imwrite(photos_[2].path, photo);
  ColorizeOptions options;
  options.blend.min_agreement = 0;  // so much green that the whole photo would be left out
  const ColorizeResult result = Run({scan}, options);
  const ColorGrid& grid = result.scans[0].samples;
  int green = 0;
  for (size_t i = 0; i < grid.rgb.size(); ++i) {
    green += grid.views[i] >= 3 && grid.rgb[i][1] > grid.rgb[i][0] + 60;
  }
  EXPECT_EQ(green, 0);
}

TEST_F(Colorize, TextureOfALargerScaleShowsThePatternBetweenTheSamples) {
  scene_.board_half = 0;
  const Scan scan = scene_.MakeScan(40, 40);
  ColorizeOptions options;
  options.texture_scale = 3;
  const ColorizeResult result = Run({scan}, options);
  const ColorGrid &texture = result.scans[0].texture, &samples = result.scans[0].samples;
  ASSERT_EQ(texture.num_columns, 120);
  ASSERT_EQ(texture.num_rows, 120);
  // The middle texel of three lies on the sample.
  for (int row = 5; row < 35; ++row) {
    for (int column = 5; column < 35; ++column) {
      const auto& texel = texture.rgb[(3 * row + 1) * 120 + 3 * column + 1];
      const auto& sample = samples.rgb[row * 40 + column];
      for (int k = 0; k < 3; ++k) ASSERT_NEAR(texel[k], sample[k], 6) << column << " " << row;
    }
  }
}

TEST_F(Colorize, WhatNoPhotoSeesIsGreyAlsoWithoutIntensity) {
  photos_.resize(1);
  Scan scan = scene_.MakeScan(200, 150);
  scan.intensity.assign(scan.points.size(), 0.0f);
  scan.points[scan.Index(7, 7)] = Scan::MissingPoint();
  for (const float intensity : {0.0f, 0.5f}) {
    for (size_t i = 0; i < scan.points.size(); ++i) {
      scan.intensity[i] = scan.IsMissing(static_cast<int>(i)) ? 0 : intensity;
    }
    const ColorGrid grid = Run({scan}).scans[0].samples;
    size_t num_unseen = 0;
    for (size_t i = 0; i < grid.rgb.size(); ++i) {
      if (grid.views[i] > 0 || scan.IsMissing(static_cast<int>(i))) continue;
      ++num_unseen;
      ASSERT_EQ(grid.rgb[i], (Rgb{128, 128, 128}));
    }
    EXPECT_GT(num_unseen, 100u);
  }
}

TEST_F(Colorize, NamesThePhotoThatCannotBeRead) {
  const Scan scan = scene_.MakeScan(30, 30);
  WriteBytes(photos_[1].path, "not a photo");
  EXPECT_INPUT_ERROR(Run({scan}), "p1.jpg");
}

// A missing sample in the board must not be a peephole onto the wall behind it.
TEST_F(Colorize, SingleMissingSamplesAreNoPeepholes) {
  Scan scan = scene_.MakeScan(200, 200);
  for (size_t i = 0; i < scan.points.size(); i += 7) {
    if (!scan.IsMissing(static_cast<int>(i)) && scan.points[i].z() > -3) {
      scan.points[i] = Scan::MissingPoint();
    }
  }
  EXPECT_EQ(Measure(scan, Run({scan}).scans[0].samples).red_on_wall, 0);
}

}  // namespace
}  // namespace roomtex
