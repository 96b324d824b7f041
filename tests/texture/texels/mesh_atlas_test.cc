#include "texture/texels/mesh_atlas.h"

#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "core/frames.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/sampling/two_walls.h"
#include "texture/colorize.h"
#include "texture/output/textured_parts.h"
#include "texture/texels/mesh_charts.h"
#include "texture/texels/rectangle_packing.h"

namespace roomtex {
namespace {

Scan MeshOf(std::vector<Eigen::Vector3d> points, std::vector<Triangle> triangles) {
  Scan mesh;
  mesh.organised = false;
  mesh.num_columns = static_cast<int>(points.size());
  mesh.num_rows = 1;
  mesh.intensity.assign(points.size(), 1.0f);
  mesh.points = std::move(points);
  mesh.triangles = std::move(triangles);
  return mesh;
}

// A rectangle in the plane z, seen from +z: two triangles.
void AddRectangle(double x0, double y0, double x1, double y1, double z, Scan* mesh) {
  const int first = static_cast<int>(mesh->points.size());
  for (const auto& [x, y] : {std::pair{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}) {
    mesh->points.emplace_back(x, y, z);
    mesh->intensity.push_back(1);
  }
  mesh->triangles.push_back({first, first + 1, first + 2});
  mesh->triangles.push_back({first, first + 2, first + 3});
  mesh->num_columns = static_cast<int>(mesh->points.size());
}

Scan Box() {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 8; ++i)
    points.emplace_back(3.0 * (i & 1), 2.0 * (i >> 1 & 1), (i >> 2) * 1.0);
  return MeshOf(points, {{0, 2, 1},
                         {1, 2, 3},
                         {4, 5, 6},
                         {5, 7, 6},
                         {0, 1, 4},
                         {1, 5, 4},
                         {2, 6, 3},
                         {3, 6, 7},
                         {0, 4, 2},
                         {2, 4, 6},
                         {1, 3, 5},
                         {3, 7, 5}});
}

TEST(GrowCharts, MakesOneChartOfEveryFaceOfABox) {
  const Scan box = Box();
  const MeshCharts charts = GrowCharts(box.points, box.triangles, {});
  EXPECT_EQ(charts.normals.size(), 6u);
  for (size_t t = 0; t < 12; t += 2) EXPECT_EQ(charts.chart_of[t], charts.chart_of[t + 1]);
}

TEST(GrowCharts, KeepsToTheLargestExtent) {
  Scan strip = MeshOf({}, {});
  for (int i = 0; i <= 20; ++i) {
    strip.points.emplace_back(i, 0, 0);
    strip.points.emplace_back(i, 1, 0);
  }
  for (int i = 0; i < 20; ++i) {
    strip.triangles.push_back({2 * i, 2 * i + 2, 2 * i + 1});
    strip.triangles.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
  }
  ChartOptions options;
  options.max_extent = 5;
  const MeshCharts charts = GrowCharts(strip.points, strip.triangles, options);
  EXPECT_GE(charts.normals.size(), 4u);
  for (size_t c = 0; c < charts.normals.size(); ++c) {
    double low = 1e9, high = -1e9;
    for (size_t t = 0; t < strip.triangles.size(); ++t) {
      if (charts.chart_of[t] != static_cast<int>(c)) continue;
      for (const int corner : strip.triangles[t]) {
        low = std::min(low, strip.points[corner].x());
        high = std::max(high, strip.points[corner].x());
      }
    }
    EXPECT_LE(high - low, 5);
  }
}

// A wall of 50 x 50 quads of 4 mm with the noise of a scanner: its triangles point anywhere.
Scan NoisyWall() {
  Scan wall = MeshOf({}, {});
  unsigned state = 3;
  for (int i = 0; i < 51 * 51; ++i) {
    state = state * 1664525u + 1013904223u;
    const double noise = 0.006 * (static_cast<double>(state >> 8) / (1 << 24) - 0.5);
    wall.points.emplace_back(0.004 * (i % 51), 0.004 * (i / 51), noise);
  }
  for (int row = 0; row < 50; ++row) {
    for (int column = 0; column < 50; ++column) {
      const int a = row * 51 + column, b = a + 1, c = a + 51, d = a + 52;
      wall.triangles.push_back({a, b, c});
      wall.triangles.push_back({b, d, c});
    }
  }
  return wall;
}

TEST(GrowCharts, NoiseDoesNotTearAWallApart) {
  const Scan wall = NoisyWall();
  EXPECT_GT(GrowCharts(wall.points, wall.triangles, {}).normals.size(), 100u);
  ChartOptions options;
  options.smooth_below = 0.016;
  EXPECT_LE(GrowCharts(wall.points, wall.triangles, options).normals.size(), 3u);
  // Large triangles are left as they are.
  const Scan box = Box();
  EXPECT_EQ(GrowCharts(box.points, box.triangles, options).normals.size(), 6u);
}

TEST(LayOutAtlas, GivesUpWhereGuttersWouldFillThePages) {
  const Scan box = Box();
  AtlasOptions options;
  options.mode = "1";
  options.texel_mm = 100;  // 2200 texels, six charts with 8 texels around
  EXPECT_TRUE(LayOutAtlas(box.points, box.triangles, 0, 2200, options).empty());
  EXPECT_FALSE(LayOutAtlas(box.points, box.triangles, 0, 22000, options).empty());
}

TEST(GrowCharts, SurvivesAnyTriangles) {
  Scan mesh = Box();
  mesh.points.emplace_back(1, 1, 1);
  mesh.points.emplace_back(1e200, 0, 0);
  mesh.triangles.push_back({0, 0, 0});
  mesh.triangles.push_back({0, 1, 1});
  mesh.triangles.push_back({0, 1, 8});  // a third triangle on an edge
  mesh.triangles.push_back({0, 8, 1});  // and the same turned over
  mesh.triangles.push_back({0, 1, 9});  // its area is no number
  const MeshCharts charts = GrowCharts(mesh.points, mesh.triangles, {});
  EXPECT_EQ(charts.chart_of[12], -1);
  EXPECT_EQ(charts.chart_of[13], -1);
  EXPECT_GE(charts.chart_of[14], 0);
  EXPECT_TRUE(GrowCharts({}, {}, {}).normals.empty());
}

TEST(PackRectangles, NeverOverlapsAndStaysOnThePages) {
  std::vector<std::array<int, 2>> sizes;
  unsigned state = 7;
  double area = 0;
  for (int i = 0; i < 400; ++i) {
    state = state * 1664525u + 1013904223u;
    sizes.push_back(
        {8 + static_cast<int>(state >> 20) % 200, 8 + static_cast<int>(state >> 8) % 90});
    area += sizes.back()[0] * sizes.back()[1];
  }
  sizes.push_back({512, 512});
  const Packing packing = PackRectangles(sizes, 512);
  std::vector<std::vector<uint8_t>> pages(packing.num_pages, std::vector<uint8_t>(512 * 512, 0));
  for (size_t i = 0; i < sizes.size(); ++i) {
    const PackedRectangle& place = packing.places[i];
    ASSERT_TRUE(place.x >= 0 && place.y >= 0 && place.x + sizes[i][0] <= 512 &&
                place.y + sizes[i][1] <= 512);
    for (int y = 0; y < sizes[i][1]; ++y) {
      for (int x = 0; x < sizes[i][0]; ++x) {
        ASSERT_EQ(pages[place.page][(place.y + y) * 512 + place.x + x]++, 0);
      }
    }
  }
  EXPECT_LT(packing.num_pages, 1.3 * area / (512 * 512) + 3);
}

TEST(SpreadProbes, LieOnTheSurfaceInProportionToItsArea) {
  const Scan box = Box();  // faces of 6, 3 and 2 square metres
  const SurfaceProbes probes = SpreadProbes(box.points, box.triangles, 22000);
  EXPECT_NEAR(static_cast<double>(probes.points.size()), 22000, 5);
  int floor = 0;
  for (const Eigen::Vector3d& p : probes.points) {
    floor += std::abs(p.z()) < 1e-12;
    ASSERT_LE((p - Eigen::Vector3d(1.5, 1, 0.5))
                  .cwiseAbs()
                  .cwiseQuotient(Eigen::Vector3d(1.5, 1, 0.5))
                  .maxCoeff(),
              1 + 1e-12);
  }
  EXPECT_NEAR(floor, 6000, 20);
  EXPECT_TRUE(SpreadProbes(box.points, {{0, 0, 1}}, 100).points.empty());
}

TEST(LayOutAtlas, EveryTriangleHasItsOwnTexels) {
  Scan box = Box();
  box.triangles.push_back({0, 0, 1});
  AtlasOptions options;
  options.texel_mm = 10;
  const MeshAtlas atlas = LayOutAtlas(box.points, box.triangles, 0, 1e8, options);
  ASSERT_EQ(atlas.charts.size(), 6u);
  EXPECT_EQ(atlas.chart_of.back(), -1);
  int covered = 0;
  for (int page = 0; page < atlas.num_pages; ++page) {
    const std::vector<Rgb> colors(box.points.size(), Rgb{10, 20, 30});
    const AtlasTexels texels(box.points, box.triangles, atlas, colors, page);
    const TexelBlock block = texels.Rows(0, atlas.page_size);
    for (int i = 0; i < atlas.page_size * atlas.page_size; ++i) {
      const Eigen::Vector3d& p = block.points[i];
      if (!(p.x() == p.x())) continue;
      ++covered;
      // The chart of some face maps the point to this texel.
      double nearest = 1e9;
      for (const AtlasChart& chart : atlas.charts) {
        const Eigen::Vector2d at(i % atlas.page_size + 0.5, i / atlas.page_size + 0.5);
        nearest = std::min(nearest, (chart.InPage(p) - at).norm());
      }
      ASSERT_LT(nearest, 1e-6);
      ASSERT_EQ(block.unseen[i][1], 20);
    }
  }
  EXPECT_NEAR(covered, 220000, 3000);  // 22 square metres
}

TEST(LayOutAtlas, StaysWithinTheTexelsAndThePages) {
  const Scan box = Box();
  AtlasOptions options;
  options.texel_mm = 0.1;  // wants 2200 million texels
  options.max_page_size = 1024;
  const MeshAtlas atlas = LayOutAtlas(box.points, box.triangles, 0, 1e6, options);
  EXPECT_NEAR(atlas.texel_size, std::sqrt(22 / 1e6), 1e-6);
  EXPECT_LE(atlas.page_size, 1024);
  EXPECT_LE(atlas.num_pages, 4);
  // A face longer than a page gets larger texels.
  const MeshAtlas coarse = LayOutAtlas(box.points, box.triangles, 0, 1e8, options);
  for (size_t t = 0; t < box.triangles.size(); ++t) {
    const AtlasChart& chart = coarse.charts[coarse.chart_of[t]];
    for (const int corner : box.triangles[t]) {
      const Eigen::Vector2d at = chart.InPage(box.points[corner]);
      EXPECT_GE(at.minCoeff(), 7.99);
      EXPECT_LE(at.maxCoeff(), coarse.page_size - 7.99);
    }
  }
}

TEST(LayOutAtlas, LeavesFineMeshesToTheirVertices) {
  const Scan box = Box();
  AtlasOptions options;
  EXPECT_FALSE(LayOutAtlas(box.points, box.triangles, 0.01, 1e8, options).empty());
  EXPECT_TRUE(LayOutAtlas(box.points, box.triangles, 1.0, 1e8, options).empty());
  EXPECT_TRUE(LayOutAtlas(box.points, box.triangles, 0.5, 1e8, options).empty());
  options.decimated_to = 11;  // of 12: vertices go
  EXPECT_FALSE(LayOutAtlas(box.points, box.triangles, 0.5, 1e8, options).empty());
  options.decimated_to = 12;
  EXPECT_TRUE(LayOutAtlas(box.points, box.triangles, 0.5, 1e8, options).empty());
  options.mode = "1";
  EXPECT_FALSE(LayOutAtlas(box.points, box.triangles, 0.5, 1e8, options).empty());
  options.mode = "0";
  EXPECT_TRUE(LayOutAtlas(box.points, box.triangles, 0.01, 1e8, options).empty());
}

// A ramp that winds twice about an axis: seen from above it lies over itself.
TEST(LayOutAtlas, UnfoldsWhatLiesOverItself) {
  Scan ramp = MeshOf({}, {});
  constexpr int kSteps = 48;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = 4 * kPi * i / kSteps;
    for (const double radius : {1.0, 2.0}) {
      ramp.points.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0.05 * i);
    }
  }
  for (int i = 0; i < kSteps; ++i) {
    ramp.triangles.push_back({2 * i, 2 * i + 1, 2 * i + 2});
    ramp.triangles.push_back({2 * i + 2, 2 * i + 1, 2 * i + 3});
  }
  AtlasOptions options;
  options.texel_mm = 10;
  const MeshAtlas atlas = LayOutAtlas(ramp.points, ramp.triangles, 0, 1e8, options);
  double area = 0, covered = 0;
  for (size_t t = 0; t < ramp.triangles.size(); ++t) {
    const AtlasChart& chart = atlas.charts[atlas.chart_of[t]];
    const Eigen::Vector2d a = chart.InPage(ramp.points[ramp.triangles[t][0]]),
                          b = chart.InPage(ramp.points[ramp.triangles[t][1]]),
                          c = chart.InPage(ramp.points[ramp.triangles[t][2]]);
    area += 0.5 * std::abs((b - a).x() * (c - a).y() - (b - a).y() * (c - a).x());
  }
  for (int page = 0; page < atlas.num_pages; ++page) {
    const std::vector<Rgb> colors(ramp.points.size(), Rgb{0, 0, 0});
    const AtlasTexels texels(ramp.points, ramp.triangles, atlas, colors, page);
    for (const Eigen::Vector3d& p : texels.Rows(0, atlas.page_size).points)
      covered += p.x() == p.x();
  }
  EXPECT_NEAR(covered / area, 1, 0.02);  // no texel serves two places
}

class ColorizeMesh : public ::testing::Test {
 protected:
  ColorizeMesh() {
    scene_.color = [](const Eigen::Vector3d& p) {
      if (p.z() > -3) return Eigen::Vector3f(0.6f, 0.05f, 0.05f);  // red board
      const auto wave = static_cast<float>(std::sin(50 * p.x()) * std::cos(40 * p.y()));
      return Eigen::Vector3f(0.3f + 0.1f * wave, 0.35f, 0.3f - 0.1f * wave);
    };
    const Eigen::Vector3d places[5] = {
        {-0.7, 0.2, 0.1}, {0.7, 0.1, 0}, {0, -0.5, 0.3}, {0.3, 0.5, -0.1}, {-0.4, 0, 0.4}};
    for (int i = 0; i < 5; ++i) {
      photos_.push_back(scene_.View(places[i], "p" + std::to_string(i) + ".jpg"));
      const float exposure = 0.6f + 0.2f * static_cast<float>(i);
      scene_.Shoot(&photos_.back(), exposure, folder_.path(), exposure / 60);
    }
    AddRectangle(-2, -1.5, 2, 1.5, scene_.wall_z, &mesh_);
    AddRectangle(-0.4, -0.4, 0.4, 0.4, scene_.board_z, &mesh_);
  }

  TempFolder folder_;
  TwoWalls scene_;
  std::vector<PhotoView> photos_;
  Scan mesh_ = MeshOf({}, {});
};

// Two walls of two triangles each: what the photos show is in the texture, at its place, and the
// board does not stand on the wall behind it.
TEST_F(ColorizeMesh, FourTrianglesShowWhatThePhotosShow) {
  Progress progress(true);
  const ColorizeResult result = ColorizeScans({mesh_}, photos_, {}, 2, &progress);
  const MeshAtlas& atlas = result.scans[0].atlas;
  ASSERT_EQ(atlas.charts.size(), 2u);
  ASSERT_EQ(static_cast<int>(atlas.pages.size()), atlas.num_pages);
  EXPECT_NEAR(atlas.texel_size, 4 / 520.0, 0.002);
  const double first = result.exposure.gains[0][0] * 0.6;
  for (int i = 1; i < 5; ++i) {
    EXPECT_NEAR(result.exposure.gains[i][0] * (0.6 + 0.2 * i) / first, 1, 0.02) << i;
  }
  const auto& linear = LinearFromSrgbByte();
  double want = 0, have = 0, error = 0, count = 0, red_on_wall = 0;
  for (const bool measure : {false, true}) {
    for (int page = 0; page < atlas.num_pages; ++page) {
      const AtlasTexels texels(mesh_.points, mesh_.triangles, atlas, result.scans[0].samples.rgb,
                               page);
      const TexelBlock block = texels.Rows(0, atlas.page_size);
      for (size_t i = 0; i < block.points.size(); ++i) {
        if (atlas.pages[page].views[i] == 0) continue;
        const Eigen::Vector3f truth = scene_.color(block.points[i]);
        const Rgb& rgb = atlas.pages[page].rgb[i];
        if (!measure) {
          want += truth[1];
          have += linear[rgb[1]];
          continue;
        }
        for (int k = 0; k < 3; ++k) error += std::pow(want / have * linear[rgb[k]] - truth[k], 2);
        count += 3;
        red_on_wall += linear[rgb[0]] > 3 * linear[rgb[1]] && block.points[i].z() < -3;
      }
    }
  }
  EXPECT_GT(-10 * std::log10(error / count), 33);
  EXPECT_GT(count / 3, 0.9 * atlas.num_texels);
  // Where the board's rim hides the wall from all photos but in the pixels that show both.
  EXPECT_LT(red_on_wall, 0.002 * atlas.num_texels);
}

TEST_F(ColorizeMesh, IsTheSameForAnyNumberOfThreads) {
  Progress progress(true);
  ColorizeOptions options;
  options.atlas.texel_mm = 20;
  const ColorizeResult one = ColorizeScans({mesh_}, photos_, options, 1, &progress);
  const ColorizeResult three = ColorizeScans({mesh_}, photos_, options, 3, &progress);
  ASSERT_EQ(one.scans[0].atlas.pages.size(), 1u);
  EXPECT_EQ(one.scans[0].atlas.pages[0].rgb, three.scans[0].atlas.pages[0].rgb);
}

TEST_F(ColorizeMesh, PartsFindTheirColorsAlsoNextToTheirBorders) {
  // A board with a neighbour of another colour on the page: no texel that filtering may touch is
  // black or the neighbour's.
  Progress progress(true);
  const ColorizeResult result = ColorizeScans({mesh_}, photos_, {}, 2, &progress);
  const ColoredScan& colored = result.scans[0];
  size_t num_corners = 0;
  for (const TexturedPart& part : MakeTexturedParts(mesh_, colored, 4096)) {
    num_corners += part.corners.size();
    const cv::Mat3b image = PartImage(mesh_, colored, part);
    for (size_t v = 0; v < part.vertices.size(); ++v) {
      if (mesh_.points[part.vertices[v]].z() < -3) continue;
      const auto x = static_cast<int>(part.uv[v].x() * static_cast<float>(part.width));
      const auto y = static_cast<int>(part.uv[v].y() * static_cast<float>(part.height));
      for (int dy = -6; dy <= 6; ++dy) {
        for (int dx = -6; dx <= 6; ++dx) {
          const cv::Vec3b c = image(y + dy, x + dx);
          ASSERT_GT(c[2], 2 * c[1]) << dx << " " << dy;
        }
      }
    }
  }
  EXPECT_EQ(num_corners, 3 * mesh_.triangles.size());
}

}  // namespace
}  // namespace roomtex
