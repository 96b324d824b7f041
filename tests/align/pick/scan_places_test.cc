#include "align/pick/scan_places.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>

#include "align/pick/mesh_panorama.h"
#include "align/pick/scan_picture.h"
#include "core/frames.h"
#include "core/scan_mesh.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using Reason = ScanPlaces::Reason;

// A scanner in the middle of a box of 5 x 2.6 x 4 m, before a pillar in the corner to the right;
// RTPI's frame. Columns run to the viewer's right, or to the left.
constexpr int kColumns = 720, kRows = 240;
Scan BoxScan(bool to_the_left, bool full_turn = true) {
  Scan scan;
  scan.num_columns = kColumns;
  scan.num_rows = kRows;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const double turn = (full_turn ? 360.0 : 200.0) / kColumns;
      const double theta = RadFromDeg(turn * (to_the_left ? -column : column));
      const double phi = RadFromDeg(60 - 0.5 * row);
      const Eigen::Vector3d ray(std::sin(theta) * std::cos(phi), std::sin(phi),
                                -std::cos(theta) * std::cos(phi));
      double range = 1e9;
      const Eigen::Vector3d half(2.5, 1.3, 2.0);
      for (int k = 0; k < 3; ++k) range = std::min(range, half[k] / std::abs(ray[k]));
      // The pillar: a wall at z = -1 for x in 0.5 .. 1.
      const double to_pillar = -1 / ray.z();
      const double x = to_pillar * ray.x();
      if (to_pillar > 0 && x > 0.5 && x < 1) range = std::min(range, to_pillar);
      scan.points.push_back(range * ray);
      scan.intensity.push_back(static_cast<float>(100 + 50 * std::sin(9 * ray.x()) * ray.y()));
    }
  }
  return scan;
}

class BothSenses : public testing::TestWithParam<bool> {
 protected:
  const Scan scan_ = BoxScan(GetParam());
  const ScanPlaces places_{scan_};
};
INSTANTIATE_TEST_SUITE_P(Azimuth, BothSenses, testing::Bool());

TEST_P(BothSenses, ThePictureIsNeverMirrored) {
  EXPECT_EQ(places_.flipped(), GetParam());
  // Ahead of who looks along -z: +x is to the right.
  const auto middle = places_.PlaceOf({0.1, 0, -2}), right = places_.PlaceOf({0.4, 0, -2});
  ASSERT_TRUE(middle && right);
  EXPECT_GT(right->x(), middle->x());
  const auto above = places_.PlaceOf({0.1, 0.3, -2});
  ASSERT_TRUE(above);
  EXPECT_LT(above->y(), middle->y());
  EXPECT_NEAR(places_.aspect(), 1, 0.01);
  EXPECT_TRUE(places_.closed());
}

TEST_P(BothSenses, APlaceGivesAPointAndThePointThePlace) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> x(0, kColumns), y(0.5, kRows - 0.5);
  int num_points = 0;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector2d place(x(random), y(random));
    const ScanPlaces::Found found = places_.PointAt(place);
    if (found.reason != Reason::kNone) continue;
    ++num_points;
    EXPECT_NEAR(found.range, found.x_in_scan.norm(), 1e-12);
    for (const double off : {1.0, 0.98, 1.05}) {  // also in front of the surface and behind it
      const auto back = places_.PlaceOf(off * found.x_in_scan);
      ASSERT_TRUE(back);
      EXPECT_NEAR(back->x(), place.x(), 1e-5) << place.transpose();
      EXPECT_NEAR(back->y(), place.y(), 1e-5) << place.transpose();
    }
  }
  EXPECT_GT(num_points, 2600);
}

TEST_P(BothSenses, APointOfAWallLiesOnTheWall) {
  for (double x = -0.9; x < 0.4; x += 0.0371) {
    for (double y = -0.8; y < 0.8; y += 0.0733) {
      const auto place = places_.PlaceOf({x, y, -2});
      ASSERT_TRUE(place);
      const ScanPlaces::Found found = places_.PointAt(*place);
      ASSERT_EQ(found.reason, Reason::kNone);
      EXPECT_THAT(found.x_in_scan, IsNearMatrix(Eigen::Vector3d(x, y, -2), 1e-6));
    }
  }
}

TEST_P(BothSenses, AtADepthEdgeTheNearestSmoothPlaceIsOffered) {
  const auto edge = places_.PlaceOf({0.5, 0.1, -1});
  ASSERT_TRUE(edge);
  const ScanPlaces::Found found = places_.PointAt(*edge);
  EXPECT_EQ(found.reason, Reason::kDepthEdge);
  ASSERT_TRUE(found.snap);
  EXPECT_LT((found.snap->place - *edge).norm(), 4);
  const ScanPlaces::Found snapped = places_.PointAt(found.snap->place);
  EXPECT_EQ(snapped.reason, Reason::kNone);
  EXPECT_THAT(snapped.x_in_scan, IsNearMatrix(found.snap->x_in_scan, 1e-9));
}

TEST_P(BothSenses, WhereNothingWasMeasuredNothingIsPicked) {
  Scan scan = scan_;
  const ScanPlaces whole(scan);
  for (int row = 100; row < 140; ++row) {
    for (int column = 300; column < 340; ++column) {
      scan.points[whole.SampleAt(column, row)] = Scan::MissingPoint();
    }
  }
  const ScanPlaces places(scan);
  const ScanPlaces::Found found = places.PointAt({302.4, 120.5});
  EXPECT_EQ(found.reason, Reason::kMissing);
  ASSERT_TRUE(found.snap);
  EXPECT_LT(found.snap->place.x(), 300);
  EXPECT_GT(found.snap->place.x(), 296);
  EXPECT_EQ(places.PointAt(found.snap->place).reason, Reason::kNone);
  // A point in the hole is drawn about there.
  const auto place = places.PlaceOf(scan_.points[places.SampleAt(302, 110)]);
  ASSERT_TRUE(place);
  EXPECT_LT((*place - Eigen::Vector2d(302.5, 110.5)).norm(), 1.5);
}

TEST_P(BothSenses, OutsideThePictureIsSaid) {
  for (const Eigen::Vector2d& place :
       {Eigen::Vector2d(-0.1, 5), Eigen::Vector2d(5, -1e-9), Eigen::Vector2d(kColumns + 0.1, 5),
        Eigen::Vector2d(5, kRows + 1), Eigen::Vector2d(1e300, 5), Eigen::Vector2d(NAN, 5)}) {
    EXPECT_EQ(places_.PointAt(place).reason, Reason::kOutside) << place.transpose();
    EXPECT_FALSE(places_.PointAt(place).snap);
  }
  EXPECT_FALSE(places_.PlaceOf({0, -5, 0}));  // straight down: the scanner did not look there
  EXPECT_FALSE(places_.PlaceOf(Eigen::Vector3d::Zero()));
  EXPECT_FALSE(places_.PlaceOf({NAN, 0, 0}));
}

TEST_P(BothSenses, TheSeamOfAFullTurnIsCrossed) {
  for (const double x : {0.0, 0.1, 0.49, kColumns - 0.3, kColumns - 0.01}) {
    const ScanPlaces::Found found = places_.PointAt({x, 120.3});
    ASSERT_EQ(found.reason, Reason::kNone) << x;
    EXPECT_NEAR(found.x_in_scan.z(), -2, 1e-3);  // the wall, not a mean over the room
    const auto place = places_.PlaceOf(found.x_in_scan);
    ASSERT_TRUE(place);
    const double apart = std::abs(place->x() - x);
    EXPECT_LT(std::min(apart, kColumns - apart), 1e-5) << x;
  }
}

TEST(ScanPlaces, APartOfATurnIsNotClosed) {
  const Scan scan = BoxScan(false, false);
  const ScanPlaces places(scan);
  EXPECT_FALSE(places.closed());
  EXPECT_EQ(places.PointAt({0.1, 100.5}).reason, Reason::kNone);  // half a sample of border
  EXPECT_NEAR(places.aspect(), 0.5 / (200.0 / 720), 0.01);
}

TEST(ScanPlaces, AScanThatWasMovedGivesTheSamePlaces) {
  const Scan scan = BoxScan(false);
  Scan moved = scan;
  const Rigid motion{Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {100, -20, 3}};
  for (Eigen::Vector3d& point : moved.points) point = motion * point;
  moved.scan_from_station = motion * scan.scan_from_station;
  const ScanPlaces places(scan), moved_places(moved);
  EXPECT_EQ(moved_places.flipped(), places.flipped());
  for (double x = 3.3; x < kColumns; x += 37.7) {
    const auto place = moved_places.PlaceOf(motion * places.PointAt({x, 70.2}).x_in_scan);
    ASSERT_TRUE(place);
    EXPECT_THAT(*place, IsNearMatrix(Eigen::Vector2d(x, 70.2), 1e-5));
  }
}

TEST(ScanPlaces, AnEmptyScanHasNoPlaces) {
  Scan scan;
  scan.num_columns = 4;
  scan.num_rows = 3;
  scan.points.assign(12, Scan::MissingPoint());
  scan.intensity.assign(12, 0);
  const ScanPlaces places(scan);
  EXPECT_EQ(places.PointAt({1, 1}).reason, Reason::kMissing);
  EXPECT_FALSE(places.PointAt({1, 1}).snap);
  EXPECT_FALSE(places.PlaceOf({1, 0, 0}));
  for (const std::string& name : ScanPictureNames()) {
    EXPECT_EQ(DrawScanPicture(places, name).size(), cv::Size(4, 3)) << name;
  }
}

TEST_P(BothSenses, TheContentIsWhereTheSamplesAre) {
  EXPECT_THAT(places_.Content(), testing::ElementsAre(0, 0, kColumns, kRows));
  Scan part = scan_;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const bool measured = row >= 40 && row < 200 && column >= 100 && column < 400;
      const bool stray = row == 5 && column < 20;
      if (!measured && !stray) part.points[part.Index(column, row)] = Scan::MissingPoint();
    }
  }
  const ScanPlaces places(part);
  const int left = places.flipped() ? kColumns - 400 : 100;
  EXPECT_THAT(places.Content(), testing::ElementsAre(left, 40, left + 300, 200));
}

TEST_P(BothSenses, PicturesShowTheSameRoom) {
  const Scan other = BoxScan(!GetParam());
  const ScanPlaces other_places(other);
  for (const std::string& name : ScanPictureNames()) {
    const cv::Mat3b picture = DrawScanPicture(places_, name);
    const cv::Mat3b other_picture = DrawScanPicture(other_places, name);
    int difference = 0;
    for (double x = -0.9; x < 0.4; x += 0.05) {
      for (double y = -0.8; y < 0.8; y += 0.05) {
        const Eigen::Vector2d a = *places_.PlaceOf({x, y, -2});
        const Eigen::Vector2d b = *other_places.PlaceOf({x, y, -2});
        const cv::Vec3b left = picture(static_cast<int>(a.y()), static_cast<int>(a.x()));
        const cv::Vec3b right = other_picture(static_cast<int>(b.y()), static_cast<int>(b.x()));
        difference = std::max(difference, std::abs(left[0] - right[0]));
      }
    }
    EXPECT_LE(difference, 12) << name;
  }
  EXPECT_TRUE(DrawScanPicture(places_, "photo").empty());
}

TEST(ScanPicture, MissingSamplesAreBlueAndShadingTellsWallsApart) {
  Scan scan = BoxScan(false);
  scan.points[scan.Index(50, 60)] = Scan::MissingPoint();
  const ScanPlaces places(scan);
  for (const std::string& name : ScanPictureNames()) {
    const cv::Vec3b blue = cv::Mat3b(DrawScanPicture(places, name))(60, 50);
    EXPECT_GT(blue[0], blue[2] + 30) << name;
  }
  const cv::Mat3b shaded = DrawScanPicture(places, "shaded");
  const auto grey = [&](const Eigen::Vector3d& point) {
    const Eigen::Vector2d place = *places.PlaceOf(point);
    return int{shaded(static_cast<int>(place.y()), static_cast<int>(place.x()))[0]};
  };
  // On both sides of the corner between two walls.
  EXPECT_GT(std::abs(grey({-2.3, 0.2, -2}) - grey({-2.5, 0.2, -1.8})), 15);
  EXPECT_LT(grey({0.5, 0.1, -1}), 20);  // the pillar's rim
}

TEST(ScanPicture, WithoutIntensitiesOnlyTheShadingShowsSomething) {
  Scan scan = BoxScan(false);
  EXPECT_EQ(ScanPicturesOf(scan), ScanPictureNames());
  for (float& intensity : scan.intensity) intensity = 7;
  EXPECT_EQ(ScanPicturesOf(scan), std::vector<std::string>{"shaded"});
}

TEST(MeshPanorama, HasAsManyColumnsAsTheMeshCanFill) {
  Scan mesh;
  for (const auto& [vertices, columns] : {std::pair{10, 2048}, {1900000, 3072}, {20000000, 4096}}) {
    mesh.points.resize(vertices);
    EXPECT_EQ(PanoramaColumns(mesh), columns);
  }
}

TEST(MeshPanorama, ShowsTheMeshFromInsideInItsOwnFrame) {
  Scan scan = BoxScan(false);
  scan.up = Eigen::Vector3d::UnitY();
  Scan mesh = scan;
  mesh.organised = false;
  mesh.num_columns = static_cast<int>(scan.points.size());
  mesh.num_rows = 1;
  mesh.triangles = BuildScanMesh(scan, ScanMeshOptions());
  const RayCaster caster(mesh.points, mesh.triangles);
  const Scan panorama = PanoramaOfMesh(mesh, caster, 512, 2);
  const ScanPlaces places(panorama);
  EXPECT_FALSE(places.flipped());
  EXPECT_TRUE(places.closed());
  EXPECT_NEAR(places.aspect(), 1, 0.02);
  const auto place = places.PlaceOf({-0.5, 0.4, -2});
  ASSERT_TRUE(place);
  const ScanPlaces::Found found = places.PointAt(*place);
  ASSERT_EQ(found.reason, Reason::kNone);
  EXPECT_THAT(found.x_in_scan, IsNearMatrix(Eigen::Vector3d(-0.5, 0.4, -2), 2e-3));
  const auto right = places.PlaceOf({-0.4, 0.4, -2});
  ASSERT_TRUE(right);
  EXPECT_GT(right->x(), place->x());
  // One and two threads: the same.
  const Scan again = PanoramaOfMesh(mesh, caster, 512, 1);
  for (size_t i = 0; i < panorama.points.size(); ++i) {
    if (panorama.IsMissing(static_cast<int>(i))) continue;
    ASSERT_EQ(panorama.points[i], again.points[i]);
  }
}

}  // namespace
}  // namespace roomtex
