#include "texture/sampling/visibility.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/texture/sampling/two_walls.h"
#include "texture/sampling/rasterizer.h"

namespace roomtex {
namespace {

TEST(Rasterizer, DrawsInverseDepthThatIsLinearInTheRaster) {
  cv::Mat1f map(20, 30, 0.0f);
  const auto w = [](float x, float y) { return 0.5f + 0.01f * x - 0.02f * y; };
  DrawTriangle({2, 1, w(2, 1)}, {28, 4, w(28, 4)}, {6, 19, w(6, 19)}, &map);
  int drawn = 0;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      if (map(y, x) == 0) continue;
      ++drawn;
      EXPECT_NEAR(map(y, x), w(x + 0.5f, y + 0.5f), 1e-4);
    }
  }
  const double area = 0.5 * std::abs((28 - 2) * (19 - 1) - (6 - 2) * (4 - 1));
  EXPECT_NEAR(drawn, area, 20);
}

TEST(Rasterizer, LeavesNoCrackBetweenTriangles) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> jitter(-0.4f, 0.4f);
  constexpr int kCells = 24;
  std::vector<RasterVertex> grid;
  for (int r = 0; r <= kCells; ++r) {
    for (int c = 0; c <= kCells; ++c) {
      grid.push_back({(static_cast<float>(c) - 2 + jitter(random)) * 2.7f,
                      (static_cast<float>(r) - 2 + jitter(random)) * 2.7f, 1});
    }
  }
  cv::Mat1f map(50, 50, 0.0f);
  for (int r = 0; r < kCells; ++r) {
    for (int c = 0; c < kCells; ++c) {
      const int i = r * (kCells + 1) + c;
      DrawTriangle(grid[i], grid[i + 1], grid[i + kCells + 1], &map);
      DrawTriangle(grid[i + 1], grid[i + kCells + 2], grid[i + kCells + 1], &map);
    }
  }
  EXPECT_EQ(cv::countNonZero(map), 50 * 50);
}

TEST(Rasterizer, CopesWithCornersFarOutsideAndFlatTriangles) {
  cv::Mat1f map(10, 10, 0.0f);
  DrawTriangle({-3e9f, -3e9f, 1}, {3e9f, -3e9f, 1}, {0, 3e9f, 1}, &map);
  EXPECT_EQ(cv::countNonZero(map), 100);
  map.setTo(0);
  DrawTriangle({2e9f, 1, 1}, {3e9f, 2, 1}, {2e9f, 3, 1}, &map);
  DrawTriangle({1, -2e9f, 1}, {2, -3e9f, 1}, {3, -2e9f, 1}, &map);
  DrawTriangle({5, 5.2f, 1}, {5, 5.2f, 1}, {5, 5.2f, 1}, &map);
  DrawTriangle({-5, 5.2f, 1}, {50, 5.2f, 1}, {20, 5.2f, 1}, &map);
  EXPECT_LE(cv::countNonZero(map), 10);
}

TEST(Rasterizer, NearerSurfaceWinsInAnyOrder) {
  cv::Mat1f first(8, 8, 0.0f), second(8, 8, 0.0f);
  const RasterVertex near_corners[3] = {{0, 0, 2}, {8, 0, 2}, {0, 8, 2}};
  const RasterVertex far_corners[3] = {{0, 0, 1}, {8, 0, 1}, {8, 8, 1}};
  DrawTriangle(near_corners[0], near_corners[1], near_corners[2], &first);
  DrawTriangle(far_corners[0], far_corners[1], far_corners[2], &first);
  DrawTriangle(far_corners[0], far_corners[1], far_corners[2], &second);
  DrawTriangle(near_corners[0], near_corners[1], near_corners[2], &second);
  EXPECT_EQ(cv::norm(first, second, cv::NORM_INF), 0);
  EXPECT_EQ(first(1, 1), 2);
}

// Fisheyes that see behind themselves, and panoramas.
TEST(PhotoProjector, AgreesWithCamerasThatSeeAllAround) {
  const TwoWalls scene;
  PhotoView view = scene.View({0.3, -0.2, 0.5}, "a");
  for (const auto& [model, params] : std::vector<std::pair<CameraModel, std::vector<double>>>{
           {CameraModel::kFisheye, {170, 172, 320, 240}},
           {CameraModel::kOpenCvFisheye, {170, 172, 320, 240, 0.01, -0.002, 0, 0}},
           {CameraModel::kEucm, {120, 120, 320, 240, 0.65, 1.05}},
           {CameraModel::kSimpleDivision, {120, 320, 240, -0.25}},
           {CameraModel::kEquirectangular, {640, 480}}}) {
    view.camera.model = model;
    view.camera.params = params;
    const PhotoProjector projector(view);
    const CameraProjection exact(view.camera);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> coordinate(-5, 5);
    PointBlock block;
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 500; ++i) {
      points.emplace_back(coordinate(random), coordinate(random), coordinate(random));
      block.Add(points.back());
    }
    ProjectedBlock projected;
    projector.Project(block, &projected);
    int num_behind = 0;
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector3d in_cam = view.cam_from_scan * points[i];
      const auto expected = exact.ImgFromCam(in_cam);
      ASSERT_EQ(expected.has_value(), projected.depth[i] > 0) << i;
      if (!expected) continue;
      EXPECT_NEAR(projected.depth[i], in_cam.norm(), 1e-4);
      if (!exact.InImage(*expected)) continue;
      EXPECT_TRUE(projector.MaySee(points[i], 0));
      num_behind += in_cam.z() < 0;
      EXPECT_NEAR(projected.x[i], expected->x(), 5e-3) << CameraModelName(model);
      EXPECT_NEAR(projected.y[i], expected->y(), 5e-3) << CameraModelName(model);
    }
    EXPECT_GT(num_behind, 10) << CameraModelName(model);
  }
}

TEST(PhotoProjector, AgreesWithTheCameraModelAndTheFrustum) {
  const TwoWalls scene;
  PhotoView view = scene.View({0.3, -0.2, 0.5}, "a");
  view.cam_from_scan.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized())) *
      view.cam_from_scan.rotation;
  const PhotoProjector projector(view);
  const CameraProjection exact(view.camera);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> coordinate(-5, 5);
  PointBlock block;
  block.origin = {1000, 2000, 3000};  // georeferenced
  view.cam_from_scan.translation -= view.cam_from_scan.rotation * block.origin;
  const PhotoProjector far_projector(view);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 2000; ++i) {
    points.push_back(block.origin +
                     Eigen::Vector3d(coordinate(random), coordinate(random), coordinate(random)));
    block.Add(points.back());
  }
  ProjectedBlock projected;
  far_projector.Project(block, &projected);
  int in_image = 0;
  for (int i = 0; i < 2000; ++i) {
    const auto expected = exact.ImgFromCam(view.cam_from_scan * points[i]);
    ASSERT_EQ(expected.has_value(), projected.depth[i] > 0) << i;
    if (!expected || !exact.InImage(*expected)) continue;
    ++in_image;
    EXPECT_NEAR(projected.x[i], expected->x(), 2e-3);
    EXPECT_NEAR(projected.y[i], expected->y(), 2e-3);
    EXPECT_TRUE(far_projector.MaySee(points[i], 0));
  }
  EXPECT_GT(in_image, 50);
  EXPECT_FALSE(projector.MaySee(view.cam_from_scan.Inverse() * Eigen::Vector3d(0, 0, -3), 0.5));
}

class TwoWallsVisibility : public ::testing::Test {
 protected:
  // Colours the sight of every sample from a camera.
  std::vector<Sight> LookFrom(const Eigen::Vector3d& centre, const OcclusionOptions& options) {
    scan_ = scene_.MakeScan(240, 240);
    const SmoothedScan surface = MakeSmoothedScan(scan_, {}, {}, 1);
    const PhotoView view = scene_.View(centre, "a");
    const PhotoProjector projector(view);
    const PhotoVisibility visibility(projector, {MakeOccluderTiles(scan_, surface)},
                                     surface.angular_spacing, options);
    std::vector<Sight> sights(scan_.points.size(), Sight::kHidden);
    truth_.assign(scan_.points.size(), false);
    const CameraProjection exact(view.camera);
    for (size_t i = 0; i < scan_.points.size(); ++i) {
      const Eigen::Vector3d in_cam = view.cam_from_scan * scan_.points[i];
      const auto position = exact.ImgFromCam(in_cam);
      if (!position || !exact.InImage(*position)) continue;
      sights[i] =
          visibility.Look(static_cast<float>(position->x()), static_cast<float>(position->y()),
                          static_cast<float>(in_cam.z()));
      const Eigen::Vector3d hit = scene_.Hit(centre, scan_.points[i] - centre);
      truth_[i] = (hit - scan_.points[i]).norm() < 1e-6;
    }
    return sights;
  }

  TwoWalls scene_;
  Scan scan_;
  std::vector<bool> truth_;  // really visible
};

TEST_F(TwoWallsVisibility, HidesTheWallBehindTheBoard) {
  const std::vector<Sight> sights = LookFrom({0.6, 0.1, 0.2}, OcclusionOptions());
  int clear = 0, wrongly_clear = 0, wrongly_hidden = 0, seen = 0;
  for (size_t i = 0; i < sights.size(); ++i) {
    seen += truth_[i];
    clear += sights[i] == Sight::kClear;
    wrongly_clear += sights[i] == Sight::kClear && !truth_[i];
    wrongly_hidden += sights[i] == Sight::kHidden && truth_[i];
  }
  EXPECT_GT(clear, 20000);
  EXPECT_EQ(wrongly_clear, 0);
  EXPECT_LE(wrongly_hidden, seen / 500);
}

TEST_F(TwoWallsVisibility, DistrustsABandBesideTheBoard) {
  OcclusionOptions options;
  options.shadows = false;
  options.boundary_px = 8;
  const std::vector<Sight> sights = LookFrom({0.3, 0, 0}, options);
  const PhotoView view = scene_.View({0.3, 0, 0}, "a");
  const CameraProjection exact(view.camera);
  int beside = 0, far_away = 0;
  for (size_t i = 0; i < sights.size(); ++i) {
    if (sights[i] == Sight::kHidden) continue;
    const Eigen::Vector3d in_cam = view.cam_from_scan * scan_.points[i];
    const Eigen::Vector2d at = *exact.ImgFromCam(in_cam);
    // Distance in the photo from the right edge of the board, at its height.
    const Eigen::Vector2d edge = *exact.ImgFromCam(
        view.cam_from_scan * Eigen::Vector3d(scene_.board_half, 0, scene_.board_z));
    if (std::abs(at.y() - edge.y()) > 60) continue;
    const double distance = std::abs(at.x() - edge.x());
    if (distance < 5) {
      ++beside;
      EXPECT_EQ(sights[i], Sight::kBoundary);
    } else if (at.x() > edge.x() + 60 && at.x() < 540) {
      ++far_away;
      EXPECT_EQ(sights[i], Sight::kClear);
    }
  }
  EXPECT_GT(beside, 100);
  EXPECT_GT(far_away, 100);
}

TEST_F(TwoWallsVisibility, AHoleInTheScanHidesNothing) {
  scene_.board_half = 0;
  scan_ = scene_.MakeScan(200, 200);
  for (int row = 80; row < 120; ++row) {
    for (int column = 80; column < 120; ++column) {
      if (row != 100 || column != 100)
        scan_.points[scan_.Index(column, row)] = Scan::MissingPoint();
    }
  }
  const SmoothedScan surface = MakeSmoothedScan(scan_, {}, {}, 1);
  const PhotoView view = scene_.View({0, 0, 0}, "a");
  const PhotoProjector projector(view);
  const PhotoVisibility visibility(projector, {MakeOccluderTiles(scan_, surface)},
                                   surface.angular_spacing, OcclusionOptions());
  const int island = scan_.Index(100, 100);
  const Eigen::Vector3d in_cam = view.cam_from_scan * scan_.points[island];
  const Eigen::Vector2d at = *projector.camera().ImgFromCam(in_cam);
  EXPECT_NE(visibility.Look(static_cast<float>(at.x()), static_cast<float>(at.y()),
                            static_cast<float>(in_cam.z())),
            Sight::kHidden);
}

// A wall of two triangles that reaches behind the camera, with a lens that bends lines.
TEST(PhotoVisibility, DrawsTrianglesThatReachBehindTheCamera) {
  Scan mesh;
  mesh.organised = false;
  mesh.points = {{-50, -1, -50}, {50, -1, -50}, {50, -1, 50}, {-50, -1, 50}};  // floor, y = -1
  mesh.intensity.assign(4, 0);
  mesh.num_columns = 4;
  mesh.num_rows = 1;
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  const SmoothedScan surface = MakeSmoothedScan(mesh, {}, {}, 1);
  const TwoWalls scene;
  PhotoView view = scene.View({0, 0, 0}, "a");
  const PhotoProjector projector(view);
  DepthMap map(view.camera.width, view.camera.height, 1.0);
  map.Draw(projector, MakeOccluderTiles(mesh, surface).surface);
  const CameraProjection exact(view.camera);
  for (int y : {300, 350, 420, 479}) {
    for (int x : {0, 100, 320, 500, 639}) {
      const Eigen::Vector2d ray =
          *exact.CamFromImg({x + 0.5, y + 0.5});  // y down: the floor is at +1
      EXPECT_NEAR(map.inverse_depth()(y, x), ray.y(), 1e-3) << x << " " << y;
    }
  }
  EXPECT_EQ(map.inverse_depth()(100, 320), 0);
}

TEST(FacesCamera, IsTheNormalTest) {
  EXPECT_TRUE(FacesCamera({0, 0, 1}, {0, 0.6f, 0.8f}));
  EXPECT_FALSE(FacesCamera({0, 0, -1}, {0, 0.6f, 0.8f}));
  EXPECT_FALSE(FacesCamera({1, 0, 0}, {0, 0, 1}));
  EXPECT_TRUE(FacesCamera({1, 0, 0}, {0, 0, 0}));
}

TEST(DepthBoundaries, AreWhereDepthJumpsNotWhereAPlaneIsSteep) {
  cv::Mat1f map(40, 60);
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) map(y, x) = 0.05f + 0.02f * static_cast<float>(x);
  }
  EXPECT_EQ(cv::countNonZero(BoundaryMask(DepthBoundaries(map, 0.02, 3), 2)), 0);
  map.colRange(30, 60) *= 0.5f;
  const cv::Mat1b edges = BoundaryMask(DepthBoundaries(map, 0.02, 3), 2);
  EXPECT_EQ(edges(20, 30), 255);
  EXPECT_EQ(edges(20, 27), 255);  // columns 29 and 30 and 2 pixels more
  EXPECT_EQ(edges(20, 26), 0);
  EXPECT_EQ(edges(20, 33), 0);
}

TEST(DepthBoundaries, AreAroundLargeHolesOnly) {
  cv::Mat1f map(60, 60, 0.5f);
  map(cv::Rect(10, 10, 4, 4)).setTo(0);
  map(cv::Rect(30, 30, 20, 20)).setTo(0);
  const cv::Mat1b edges = DepthBoundaries(map, 0.02, 3);
  EXPECT_EQ(cv::countNonZero(edges(cv::Rect(0, 0, 25, 25))), 0);
  EXPECT_EQ(edges(40, 29), 255);
  EXPECT_EQ(edges(40, 28), 0);
}

}  // namespace
}  // namespace roomtex
