#include "texture/view/view_chunks.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "core/ray_caster.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/view/view_scene.h"

namespace roomtex {
namespace {

// A wall with waves, large enough for several chunks, on several texture pages.
class ViewChunksOfAWall : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    const TempFolder folder;
    TwoWalls scene;
    scene.board_half = 0;
    Scan scan = scene.MakeScan(500, 360, 0.7);
    for (Eigen::Vector3d& p : scan.points)
      p *= 1 + 0.03 * std::sin(3 * p.x()) * std::cos(4 * p.y());
    WriteViewFolder(scan, folder.path(), 256);
    model_ = new ViewModel(ReadViewModel(folder.path()));
    ViewChunkOptions options;
    options.max_triangles = 30000;
    chunks_ = new ViewChunks(*model_, options, 2);
  }
  static void TearDownTestSuite() {
    delete chunks_;
    delete model_;
  }
  static inline ViewModel* model_ = nullptr;
  static inline ViewChunks* chunks_ = nullptr;
};

using Corners = std::array<std::array<float, 3>, 3>;
Corners CornersOf(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  return {{{a.x(), a.y(), a.z()}, {b.x(), b.y(), b.z()}, {c.x(), c.y(), c.z()}}};
}
// Begins with the smallest corner: the same triangle turned round is the same.
Corners InOrder(Corners corners) {
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return corners;
}

TEST_F(ViewChunksOfAWall, HoldEveryTriangleOfTheMeshExactlyOnce) {
  ASSERT_GT(chunks_->chunks().size(), 8u);
  ASSERT_GT(model_->images.size(), 1u);
  std::multiset<std::pair<int, Corners>> sent, expected;
  for (size_t c = 0; c < chunks_->chunks().size(); ++c) {
    const ViewChunk& chunk = chunks_->chunks()[c];
    const ViewChunks::Mesh mesh = chunks_->Read(static_cast<int>(c));
    ASSERT_EQ(mesh.points.size(), static_cast<size_t>(chunk.num_vertices));
    ASSERT_EQ(mesh.corners.size(), 3 * chunk.num_triangles);
    EXPECT_LE(chunk.num_triangles, 30000u);
    for (size_t i = 0; i < mesh.corners.size(); i += 3) {
      sent.insert({chunk.page,
                   InOrder(CornersOf(mesh.points[mesh.corners[i]], mesh.points[mesh.corners[i + 1]],
                                     mesh.points[mesh.corners[i + 2]]))});
    }
    EXPECT_EQ(chunks_->Make(static_cast<int>(c), ViewChunks::kFull)->corners, mesh.corners);
  }
  for (size_t t = 0; t < model_->triangles.size(); ++t) {
    const Triangle& corners = model_->triangles[t];
    expected.insert({model_->page_of_triangle[t],
                     InOrder(CornersOf(model_->points[corners[0]], model_->points[corners[1]],
                                       model_->points[corners[2]]))});
  }
  EXPECT_TRUE(sent == expected);
}

// However many threads cut it, whatever the order on disk.
TEST_F(ViewChunksOfAWall, AreTheSameForAnyNumberOfThreads) {
  ViewChunkOptions options;
  options.max_triangles = 30000;
  const ViewChunks alone(*model_, options, 1);
  ASSERT_EQ(alone.chunks().size(), chunks_->chunks().size());
  for (int c = 0; c < static_cast<int>(alone.chunks().size()); ++c) {
    for (const auto level : {ViewChunks::kCoarse, ViewChunks::kFull}) {
      ASSERT_EQ(alone.Encode(c, level), chunks_->Encode(c, level));
    }
  }
}

// Edges with one triangle only, between points of the model.
std::set<std::pair<uint32_t, uint32_t>> Border(const ViewChunks::Geometry& geometry) {
  std::map<std::pair<uint32_t, uint32_t>, int> times;
  for (size_t i = 0; i < geometry.corners.size(); ++i) {
    uint32_t a = geometry.points[geometry.corners[i]];
    uint32_t b = geometry.points[geometry.corners[i % 3 == 2 ? i - 2 : i + 1]];
    if (a > b) std::swap(a, b);
    ++times[{a, b}];
  }
  std::set<std::pair<uint32_t, uint32_t>> border;
  for (const auto& [edge, count] : times) {
    if (count == 1) border.insert(edge);
  }
  return border;
}

TEST_F(ViewChunksOfAWall, LevelsFitWithoutCracks) {
  for (size_t c = 0; c < chunks_->chunks().size(); ++c) {
    const auto full = Border(*chunks_->Make(static_cast<int>(c), ViewChunks::kFull));
    ASSERT_FALSE(full.empty());
    EXPECT_EQ(Border(*chunks_->Make(static_cast<int>(c), ViewChunks::kMiddle)), full);
    EXPECT_EQ(Border(*chunks_->Make(static_cast<int>(c), ViewChunks::kCoarse)), full);
  }
}

TEST_F(ViewChunksOfAWall, CoarseLevelsAreSmallAndNear) {
  const ViewChunkOptions options;
  for (const auto& [level, share, tolerance] :
       {std::tuple{ViewChunks::kCoarse, 0.13, options.coarse_error},
        std::tuple{ViewChunks::kMiddle, 0.3, options.middle_error}}) {
    std::vector<Eigen::Vector3d> points;
    std::vector<Triangle> triangles;
    for (size_t c = 0; c < chunks_->chunks().size(); ++c) {
      const auto geometry = chunks_->Make(static_cast<int>(c), level);
      EXPECT_LE(geometry->error, 1.01 * tolerance);
      const int first = static_cast<int>(points.size());
      const ViewChunks::Mesh mesh = chunks_->Read(static_cast<int>(c));
      for (const uint16_t point : geometry->points) {
        points.push_back(model_->origin + mesh.points[point].cast<double>());
      }
      for (size_t i = 0; i < geometry->corners.size(); i += 3) {
        triangles.push_back({first + geometry->corners[i], first + geometry->corners[i + 1],
                             first + geometry->corners[i + 2]});
      }
    }
    EXPECT_LT(static_cast<double>(triangles.size()),
              share * static_cast<double>(model_->triangles.size()));
    // Along the rays of the scanner.
    const RayCaster caster(points, triangles);
    double farthest = 0;
    int num_missed = 0;
    for (size_t i = 0; i < model_->points.size(); i += 7) {
      const Eigen::Vector3d p = model_->InScan(i);
      const auto hit = caster.Cast(Eigen::Vector3d::Zero(), p.normalized());
      if (!hit) {
        ++num_missed;
        continue;
      }
      farthest = std::max(farthest, std::abs(hit->distance - p.norm()));
    }
    // A ray through a vertex of the border may pass beside it.
    EXPECT_LT(num_missed, 500);
    EXPECT_LT(farthest, 6 * tolerance);
  }
}

TEST_F(ViewChunksOfAWall, EncodingHoldsPointsTextureAndCorners) {
  const int chunk = 3;
  const auto geometry = chunks_->Make(chunk, ViewChunks::kCoarse);
  const std::string bytes = chunks_->Encode(chunk, ViewChunks::kCoarse);
  const size_t n = geometry->points.size(), m = geometry->corners.size();
  ASSERT_EQ(bytes.size(), 16 + 20 * n + 2 * m);
  uint32_t header[4];
  std::memcpy(header, bytes.data(), 16);
  EXPECT_EQ(bytes.substr(0, 4), "RTC1");
  EXPECT_EQ(header[1], n);
  EXPECT_EQ(header[2], m);
  EXPECT_EQ(header[3], 1u);
  for (size_t i = 0; i < n; i += 97) {
    float position[3];
    uint16_t uv[2];
    int8_t normal[4];
    std::memcpy(position, &bytes[16 + 12 * i], 12);
    std::memcpy(uv, &bytes[16 + 12 * n + 4 * i], 4);
    std::memcpy(normal, &bytes[16 + 16 * n + 4 * i], 4);
    // The point of the model that stands there, by its place.
    const auto found = std::find_if(
        model_->points.begin(), model_->points.end(),
        [&position](const Eigen::Vector3f& p) { return p == Eigen::Vector3f(position); });
    ASSERT_NE(found, model_->points.end());
    const auto point = static_cast<size_t>(found - model_->points.begin());
    EXPECT_EQ(*found, chunks_->Read(chunk).points[geometry->points[i]]);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(normal[k] / 127.0, model_->normals[point][k], 0.005);
    EXPECT_NEAR(uv[0] / 65535.0, model_->uv[point].x(), 1e-5);
    EXPECT_NEAR(uv[1] / 65535.0, model_->uv[point].y(), 1e-5);
  }
  EXPECT_EQ(std::memcmp(&bytes[16 + 20 * n], geometry->corners.data(), 2 * m), 0);
}

}  // namespace
}  // namespace roomtex
