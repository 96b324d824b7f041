// Detail of one photo where photos disagree, through the whole way of colouring: a wall with a fine
// pattern, photos that stand where they are said to, or a quarter of a period beside it.

#include "texture/sampling/photo_choice.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/photo.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/sampling/two_walls.h"
#include "texture/colorize.h"

namespace roomtex {
namespace {

class PhotoChoiceTest : public ::testing::Test {
 protected:
  PhotoChoiceTest() {
    scene_.board_half = 0;
    scan_ = scene_.MakeScan(160, 120, 0.3);
    scene_.color = [](const Eigen::Vector3d& p) {
      const auto wave = static_cast<float>(std::sin(40 * p.x()) * std::cos(40 * p.y()));
      const auto broad = static_cast<float>(0.1 * std::sin(3 * p.x()));
      return Eigen::Vector3f(0.3f + 0.15f * wave + broad, 0.3f + 0.15f * wave, 0.3f);
    };
  }

  // Photos that lie about where they stand: by off[i] metres to the right.
  void Shoot(const std::vector<double>& off) {
    photos_.clear();
    for (size_t i = 0; i < off.size(); ++i) {
      const Eigen::Vector3d place(0.3 * static_cast<double>(i) - 0.6, 0.1, 0);
      photos_.push_back(scene_.View(place, "p" + std::to_string(i) + ".jpg"));
      scene_.Shoot(&photos_.back(), 1, folder_.path(), 0.01);
      photos_.back().cam_from_scan.translation.x() -= off[i];
    }
  }

  ColorizeResult Run(const std::string& mode, int num_threads = 2, int scale = 1,
                     double memory_mb = 2000) const {
    ColorizeOptions options;
    options.registration.mode = "none";  // it would bring them together
    options.blend.mode = mode;
    options.texture_scale = scale;
    options.texture_memory_mb = memory_mb;
    Progress progress(true);
    return ColorizeScans({scan_}, photos_, options, num_threads, &progress);
  }

  // Standard deviation of green, which has no broad pattern, over the truth's.
  double Contrast(const ColorGrid& grid) const {
    double sum = 0, square = 0, count = 0, true_square = 0;
    for (size_t i = 0; i < grid.rgb.size(); ++i) {
      if (grid.views[i] < 4) continue;
      const double green = LinearFromSrgbByte()[grid.rgb[i][1]];
      const double wave = scene_.color(scan_.points[i])[1] - 0.3;
      sum += green;
      square += green * green;
      true_square += wave * wave;
      ++count;
    }
    return std::sqrt((square / count - sum / count * sum / count) * count / true_square);
  }

  TempFolder folder_;
  TwoWalls scene_;
  Scan scan_;
  std::vector<PhotoView> photos_;
};

TEST_F(PhotoChoiceTest, KeepsTheContrastThatTheMeanLoses) {
  Shoot({0, 0.04, -0.04, 0.02, -0.03});
  const double average = Contrast(Run("average").scans[0].samples);
  EXPECT_LT(average, 0.75);
  for (const std::string mode : {"auto", "select"}) {
    EXPECT_GT(Contrast(Run(mode).scans[0].samples), average + 0.15) << mode;
  }
}

TEST_F(PhotoChoiceTest, ChangesNothingWherePhotosAgree) {
  Shoot({0, 0, 0, 0, 0});
  const ColorGrid average = Run("average").scans[0].samples, chosen = Run("auto").scans[0].samples;
  EXPECT_EQ(average.views, chosen.views);
  EXPECT_EQ(average.rgb, chosen.rgb);
}

TEST_F(PhotoChoiceTest, NeitherThreadsNorBandsShow) {
  Shoot({0, 0.04, -0.04, 0.02, -0.03});
  const ColorizeResult one = Run("auto", 1, 2), three = Run("auto", 3, 2, 1);
  EXPECT_EQ(one.scans[0].samples.rgb, three.scans[0].samples.rgb);
  EXPECT_EQ(one.scans[0].texture.rgb, three.scans[0].texture.rgb);
  EXPECT_NE(one.scans[0].texture.rgb, Run("average", 2, 2).scans[0].texture.rgb);
}

TEST_F(PhotoChoiceTest, OnePhotoOrOneThatSeesNothingIsNoProblem) {
  Shoot({0});
  const ColorizeResult selected = Run("select");
  EXPECT_GT(selected.num_colored, 10000u);
  EXPECT_EQ(selected.scans[0].samples.rgb, Run("average").scans[0].samples.rgb);
  photos_[0].cam_from_scan.rotation =
      Eigen::Quaterniond(0, 0, 0, 1) * photos_[0].cam_from_scan.rotation;
  photos_[0].cam_from_scan.translation = Eigen::Vector3d(0, 0, -100);
  const ColorizeResult blind = Run("select");
  EXPECT_EQ(blind.num_colored, 0u);
  EXPECT_EQ(blind.num_vertices, selected.num_vertices);
}

TEST_F(PhotoChoiceTest, DetailOfTheDominantPhotoGoesWithout) {
  Shoot({0, 0.04, -0.04});
  ColorizeOptions options;
  options.blend.detail = true;
  Progress progress(true);
  options.blend.mode = "average";
  const ColorizeResult thesis = ColorizeScans({scan_}, photos_, options, 2, &progress);
  options.blend.mode = "select";
  const ColorizeResult both = ColorizeScans({scan_}, photos_, options, 2, &progress);
  EXPECT_GT(both.num_colored, 10000u);
  EXPECT_EQ(thesis.scans[0].samples.rgb, both.scans[0].samples.rgb);
  // Either of the two alone changes the colours.
  const ColorGrid average = Run("average").scans[0].samples;
  EXPECT_NE(thesis.scans[0].samples.rgb, average.rgb);
  EXPECT_NE(Run("select").scans[0].samples.rgb, average.rgb);
}

}  // namespace
}  // namespace roomtex
