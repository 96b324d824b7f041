#include "texture/texels/texel_pass.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"
#include "tests/texture/sampling/two_walls.h"
#include "texture/colorize.h"
#include "texture/sampling/single_holes.h"
#include "texture/texels/texture_grid.h"
#include "texture/texels/texture_scale.h"

namespace roomtex {
namespace {

constexpr double kHalfAngle = 0.5;

// Where the scanner's ray through a texel meets the scene: the texel's sample coordinates are
// ((c + 0.5) / scale - 0.5, ...).
Eigen::Vector3d TruePlace(const TwoWalls& scene, const Scan& scan, int scale, int column, int row) {
  const double c = (column + 0.5) / scale - 0.5, r = (row + 0.5) / scale - 0.5;
  const double azimuth = kHalfAngle * (2 * c / (scan.num_columns - 1) - 1);
  const double elevation = kHalfAngle * (1 - 2 * r / (scan.num_rows - 1));
  return scene.Hit(Eigen::Vector3d::Zero(),
                   {std::sin(azimuth) * std::cos(elevation), std::sin(elevation),
                    -std::cos(azimuth) * std::cos(elevation)});
}

class TexelPass : public ::testing::Test {
 protected:
  TexelPass() {
    scene_.color = [](const Eigen::Vector3d& p) {  // about two samples a period
      const auto wave = static_cast<float>(std::sin(50 * p.x()) * std::cos(40 * p.y()));
      return Eigen::Vector3f(0.3f + 0.2f * wave, 0.3f, 0.3f - 0.2f * wave);
    };
    scene_.board_half = 0;
  }
  void Shoot() {
    const Eigen::Vector3d places[3] = {{-0.5, 0.2, 0.1}, {0.6, 0.1, 0}, {0, -0.3, 0.3}};
    for (int i = 0; i < 3; ++i) {
      photos_.push_back(scene_.View(places[i], "p" + std::to_string(i) + ".jpg"));
      scene_.Shoot(&photos_.back(), 0.8f + 0.2f * static_cast<float>(i), folder_.path(), 0.01);
    }
  }
  ColorizeResult Run(const Scan& scan, int scale) {
    ColorizeOptions options;
    options.texture_scale = scale;
    Progress progress(true);
    return ColorizeScans({scan}, photos_, options, 2, &progress);
  }

  TempFolder folder_;
  TwoWalls scene_;
  std::vector<PhotoView> photos_;
};

TEST_F(TexelPass, TexelsLieOnTheSurfaceBetweenTheSamples) {
  const Scan scan = scene_.MakeScan(60, 50, kHalfAngle);
  SmoothedScanOptions as_measured;
  as_measured.reduce_range_noise = false;
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, as_measured, 1);
  ColorGrid colors;
  colors.rgb.assign(scan.points.size(), {1, 2, 3});
  for (int scale : {2, 3, 5}) {
    const ScanTexels texels(scan, surface, colors, scale);
    const TexelBlock block = texels.Rows(0, texels.num_rows());
    for (int row = 0; row < texels.num_rows(); ++row) {
      for (int column = 0; column < texels.num_columns(); ++column) {
        const size_t i = static_cast<size_t>(row) * texels.num_columns() + column;
        // A ray's place on the wall is not quite bilinear in its angles, 17 mrad between samples;
        // beyond the outermost samples the surface goes on straight.
        const bool inside = std::min(row, column) >= scale && row < texels.num_rows() - scale &&
                            column < texels.num_columns() - scale;
        ASSERT_LT((block.points[i] - TruePlace(scene_, scan, scale, column, row)).norm(),
                  inside ? 1e-3 : 5e-3)
            << scale << " " << column << " " << row;
        ASSERT_GT(block.normals[i].z(), 0.99);
        ASSERT_EQ(block.unseen[i][1], 2);
      }
    }
  }
}

TEST_F(TexelPass, SurfaceEndsHalfWayToADepthJump) {
  scene_.board_half = 0.4;
  const Scan scan = scene_.MakeScan(60, 60, kHalfAngle);
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
  ColorGrid colors;
  colors.rgb.assign(scan.points.size(), {0, 0, 0});
  const ScanTexels texels(scan, surface, colors, 4);
  const TexelBlock block = texels.Rows(0, texels.num_rows());
  for (int row = 0; row < texels.num_rows(); ++row) {
    for (int column = 0; column < texels.num_columns(); ++column) {
      const size_t i = static_cast<size_t>(row) * texels.num_columns() + column;
      const double z = scan.points[scan.Index(column / 4, row / 4)].z();
      ASSERT_NEAR(block.points[i].z(), z, 0.02) << column << " " << row;
    }
  }
}

TEST_F(TexelPass, ShowsWhatLiesBetweenTheSamples) {
  Shoot();
  const Scan scan = scene_.MakeScan(60, 60, kHalfAngle);
  const auto& linear = LinearFromSrgbByte();
  for (int scale : {1, 4}) {
    const ColorizeResult result = Run(scan, scale);
    const ColorGrid& grid = scale > 1 ? result.scans[0].texture : result.scans[0].samples;
    // Against the truth at four texels a sample; gain from the mean of the even green.
    double green = 0, error = 0, count = 0;
    for (size_t i = 0; i < grid.rgb.size(); ++i) green += linear[grid.rgb[i][1]];
    const double gain = 0.3 / (green / static_cast<double>(grid.rgb.size()));
    for (int row = 8; row < 232; ++row) {
      for (int column = 8; column < 232; ++column) {
        const int cell = (row * scale / 4) * grid.num_columns + column * scale / 4;
        if (grid.views[cell] == 0) continue;
        const Eigen::Vector3f truth = scene_.color(TruePlace(scene_, scan, 4, column, row));
        for (int k = 0; k < 3; ++k) {
          error += std::pow(gain * linear[grid.rgb[cell][k]] - truth[k], 2);
        }
        count += 3;
      }
    }
    const double psnr = -10 * std::log10(error / count);
    EXPECT_GT(count, 100000);
    if (scale == 1) {
      EXPECT_LT(psnr, 25);  // one colour a sample cannot show it
    } else {
      EXPECT_GT(psnr, 38);
    }
  }
}

TEST_F(TexelPass, SingleMissingSamplesAreNoPinholes) {
  Shoot();
  Scan scan = scene_.MakeScan(60, 60, kHalfAngle);
  const Scan whole = scan;
  const std::vector<int> lost = {scan.Index(30, 30), scan.Index(20, 40)};
  const std::vector<int> gap = {scan.Index(40, 20), scan.Index(41, 20)};
  for (const int i : lost) scan.points[i] = Scan::MissingPoint();
  for (const int i : gap) scan.points[i] = Scan::MissingPoint();
  scan.points[scan.Index(0, 30)] = Scan::MissingPoint();  // at the border
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
  EXPECT_EQ(FindSingleHoles(scan, surface.links), lost);
  const ColorizeResult result = Run(scan, 4);
  // As much surface as without the holes, all of it turned to the scanner.
  const auto area = [](const Scan& of, const std::vector<Triangle>& triangles) {
    double sum = 0;
    for (const auto& [a, b, c] : triangles) {
      const Eigen::Vector3d normal =
          (of.points[b] - of.points[a]).cross(of.points[c] - of.points[a]);
      EXPECT_GT(normal.dot(of.Station() - of.points[a]), 0);
      sum += 0.5 * normal.norm();
    }
    return sum;
  };
  const double cell = area(whole, surface.triangles) / (59 * 59);
  EXPECT_GT(area(scan, result.scans[0].triangles), area(scan, surface.triangles) + 3 * cell * 0.9);
  const ColorGrid& texture = result.scans[0].texture;
  for (const int i : lost) {
    const int column = i % 60, row = i / 60;
    for (int y = 4 * row; y < 4 * row + 4; ++y) {
      for (int x = 4 * column; x < 4 * column + 4; ++x) {
        const Eigen::Vector3f truth = scene_.color(TruePlace(scene_, scan, 4, x, y));
        const Rgb& rgb = texture.rgb[y * 240 + x];
        const auto& linear = LinearFromSrgbByte();
        EXPECT_GT(texture.views[y * 240 + x], 0);
        EXPECT_NEAR(linear[rgb[0]] / linear[rgb[1]], truth[0] / truth[1], 0.12);
      }
    }
  }
  EXPECT_EQ(texture.rgb[(4 * 20 + 1) * 240 + 4 * 40 + 1], (Rgb{0, 0, 0}));
}

TEST_F(TexelPass, SamplesDoNotDependOnTheScale) {
  Shoot();
  const Scan scan = scene_.MakeScan(50, 40, kHalfAngle);
  EXPECT_EQ(Run(scan, 1).scans[0].samples.rgb, Run(scan, 3).scans[0].samples.rgb);
  EXPECT_TRUE(Run(scan, 1).scans[0].texture.rgb.empty());
}

TEST_F(TexelPass, BandsDoNotShow) {
  Shoot();
  const Scan scan = scene_.MakeScan(50, 120, kHalfAngle);
  const SmoothedScan surface = MakeSmoothedScan(scan, {}, {}, 1);
  ColorGrid colors;
  colors.rgb.assign(scan.points.size(), {9, 9, 9});
  const ScanTexels source(scan, surface, colors, 2);
  PhotoPassInput scene;
  scene.occluders.push_back(MakeOccluderTiles(scan, surface));
  scene.angular_spacing = surface.angular_spacing;
  TexelPassOptions options;
  const std::vector<Eigen::Vector3f> gains(photos_.size(), Eigen::Vector3f::Ones());
  Progress progress(true);
  const ColorGrid whole = ColorizeTexels(source, photos_, gains, options, 2, &scene, &progress);
  EXPECT_EQ(NumBands(source, options), 1);
  options.max_bytes = 1;
  EXPECT_GT(NumBands(source, options), 1);
  const ColorGrid banded = ColorizeTexels(source, photos_, gains, options, 2, &scene, &progress);
  EXPECT_EQ(whole.num_rows, banded.num_rows);
  EXPECT_EQ(whole.rgb, banded.rgb);
  EXPECT_EQ(whole.views, banded.views);
}

TEST(TextureScale, FollowsThePhotosAsFarAsMemoryAllows) {
  Scan scan;
  scan.num_columns = 2000;
  scan.num_rows = 1000;
  scan.points.resize(2000000, Eigen::Vector3d::Zero());
  const BlendOptions blend;
  EXPECT_EQ(ChooseTextureScale({scan}, 0, blend, 2e9), 1);
  EXPECT_EQ(ChooseTextureScale({scan}, 0.7, blend, 2e9), 1);
  EXPECT_EQ(ChooseTextureScale({scan}, 2.4, blend, 2e9), 3);
  EXPECT_EQ(ChooseTextureScale({scan}, 30, blend, 2e9), kMaxAutoScale);
  EXPECT_EQ(ChooseTextureScale({scan}, 30, blend, 4e8), 2);
  EXPECT_EQ(ChooseTextureScale({scan, scan}, 30, blend, 1e12), 3);  // kMaxAutoTexels
  EXPECT_EQ(ChooseTextureScale({scan}, 30, blend, 1e8), 1);
  scan.organised = false;
  EXPECT_EQ(ChooseTextureScale({scan}, 30, blend, 2e9), 1);
}

}  // namespace
}  // namespace roomtex
