// A room of 4 x 3 x 2.5 metres, y up, turned by 20 degrees; one of its walls is on no photo.

#include "workflow/room_coverage.h"

#include <cmath>
#include <cstdio>
#include <cstring>

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/frames.h"
#include "tests/support/temp_folder.h"
#include "workflow/room_plan.h"

namespace roomtex {
namespace {

constexpr double kWidth = 4, kDepth = 3, kHeight = 2.5, kTurn = 20;  // metres, degrees

Eigen::Vector3d InScan(double x, double y, double z) {
  const double a = RadFromDeg(kTurn);
  return {std::cos(a) * x - std::sin(a) * y, z, -(std::sin(a) * x + std::cos(a) * y)};
}

// The wall at x = kWidth is not seen, the others by two photos.
std::vector<EvidencePoint> Room() {
  std::vector<EvidencePoint> points;
  const auto add = [&](double x, double y, double z, int views) {
    EvidencePoint point;
    point.x_in_scan = InScan(x, y, z);
    point.views = static_cast<uint8_t>(views);
    point.disagreement = views > 1 ? 5.f : NAN;
    points.push_back(point);
  };
  constexpr double kStep = 0.03;
  for (double x = 0; x <= kWidth; x += kStep) {
    for (double y = 0; y <= kDepth; y += kStep) {
      add(x, y, 0, 2);
      add(x, y, kHeight, 2);
    }
    for (double z = 0; z <= kHeight; z += kStep) {
      add(x, 0, z, 2);
      add(x, kDepth, z, 2);
    }
  }
  for (double y = 0; y <= kDepth; y += kStep) {
    for (double z = 0; z <= kHeight; z += kStep) {
      add(0, y, z, 2);
      add(kWidth, y, z, 0);
    }
  }
  return points;
}

Json Walls() {
  const Eigen::Vector3d along = InScan(1, 0, 0), across = InScan(0, 1, 0);
  return {{{"normal", ToJson(along)}, {"area_m2", 7}},
          {{"normal", ToJson(across)}, {"area_m2", 10}},
          {{"normal", {0, 1, 0}}, {"area_m2", 12}}};
}

PlanFrame Frame() { return MakePlanFrame(Room(), Eigen::Vector3d::UnitY(), Walls()); }

PlanCamera CameraAt(double x, double y, const PlanFrame& frame) {
  PlanCamera camera;
  camera.name = "a.jpg";
  camera.centre = frame.InPlan(InScan(x, y, 1.4));
  camera.forward = frame.plan_from_scan * (InScan(-1, 0, 0) - InScan(0, 0, 0));
  camera.half_view = 0.6;
  return camera;
}

TEST(MakePlanFrame, LiesAlongTheWallsWithZUp) {
  const PlanFrame frame = Frame();
  EXPECT_NEAR(frame.plan_from_scan.determinant(), 1, 1e-9);
  Eigen::Vector3d size = frame.Size();
  if (size.x() < size.y()) std::swap(size.x(), size.y());
  EXPECT_NEAR(size.x(), kWidth, 0.3);
  EXPECT_NEAR(size.y(), kDepth, 0.3);
  EXPECT_NEAR(size.z(), kHeight, 0.3);
  EXPECT_NEAR(frame.InPlan(InScan(1, 1, 1.2)).z() - frame.InPlan(InScan(3, 2, 0.2)).z(), 1, 1e-9);
}

TEST(MeasureCoverage, CountsWhatNoPhotoSaw) {
  const PlanFrame frame = Frame();
  const RoomCoverage coverage = MeasureCoverage(Room(), frame, {CameraAt(2, 1.5, frame)});
  EXPECT_GT(coverage.floor, 0.95);
  EXPECT_GT(coverage.ceiling, 0.95);
  const double walls = 2 * (kWidth + kDepth);
  EXPECT_NEAR(coverage.walls, 1 - kDepth / walls, 0.05);
  EXPECT_NEAR(coverage.unseen_m2, kDepth * kHeight, 0.3 * kDepth * kHeight);
}

TEST(MeasureCoverage, SendsToWhereTheUnseenWallIsInSight) {
  const PlanFrame frame = Frame();
  const RoomCoverage coverage = MeasureCoverage(Room(), frame, {CameraAt(2, 1.5, frame)});
  ASSERT_FALSE(coverage.places.empty());
  const ViewingPlace& place = coverage.places[0];
  const Eigen::Vector3d to_wall = (frame.plan_from_scan * InScan(1, 0, 0)).normalized();
  EXPECT_GT(place.forward.dot(to_wall), 0.7);
  EXPECT_GT(place.area_m2, 2);
  EXPECT_LT(place.area_m2, 1.5 * kDepth * kHeight);
  EXPECT_EQ(place.nearest_photo, "a.jpg");
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(place.centre[axis], 0);
    EXPECT_LT(place.centre[axis], frame.Size()[axis]);
  }
}

// A table of 0.8 m over the half of the room that would be the best place.
TEST(MeasureCoverage, SendsNobodyOntoATable) {
  std::vector<EvidencePoint> points = Room();
  for (double x = 0.8; x <= 2.2; x += 0.03) {
    for (double y = 0; y <= kDepth; y += 0.03) {
      EvidencePoint point;
      point.x_in_scan = InScan(x, y, 0.8);
      point.views = 2;
      points.push_back(point);
    }
  }
  const PlanFrame frame = Frame();
  const RoomCoverage coverage = MeasureCoverage(points, frame, {CameraAt(1.5, 1.5, frame)});
  ASSERT_FALSE(coverage.places.empty());
  const Eigen::Vector3d along = (frame.plan_from_scan * InScan(1, 0, 0)).normalized();
  const double from_wall = (coverage.places[0].centre - frame.InPlan(InScan(0, 0, 0))).dot(along);
  EXPECT_TRUE(from_wall < 0.7 || from_wall > 2.3) << from_wall;
}

TEST(MeasureCoverage, SendsNowhereWhereEverythingIsSeen) {
  std::vector<EvidencePoint> points = Room();
  for (EvidencePoint& point : points) point.views = 1;
  const PlanFrame frame = Frame();
  const RoomCoverage coverage = MeasureCoverage(points, frame, {CameraAt(2, 1.5, frame)});
  EXPECT_TRUE(coverage.places.empty());
  EXPECT_DOUBLE_EQ(coverage.all, 1);
  EXPECT_DOUBLE_EQ(coverage.unseen_m2, 0);
}

TEST(DrawPlan, ReachesToCamerasBesideTheRoom) {
  const PlanFrame frame = MakePlanFrame(Room(), Eigen::Vector3d::UnitY(), Json());
  PlanCamera camera;
  camera.name = "a.jpg";
  camera.forward = {0, -1, 0};
  const auto draw = [&](const Eigen::Vector3d& centre) {
    camera.centre = centre;
    return DrawPlan(Room(), frame, {camera}, {}, PlanShows::kCoverage);
  };
  const auto size = [](const std::string& svg) {
    Eigen::Vector2d box(0, 0);
    const size_t at = svg.find("viewBox=\"0 0 ");
    EXPECT_EQ(std::sscanf(svg.c_str() + at, "viewBox=\"0 0 %lf %lf", &box.x(), &box.y()), 2);
    return box;
  };
  const Eigen::Vector2d room = size(draw(frame.Size() / 2));
  const Eigen::Vector3d above(1, frame.Size().y() + 2, 1.5), left(-1.5, 1, 1.5), lost(1, 40, 1.5);
  EXPECT_NEAR(size(draw(above)).y(), room.y() + 200, 2);
  EXPECT_NEAR(size(draw(left)).x(), room.x() + 150, 2);
  EXPECT_EQ(size(draw(lost)), room);
  for (const Eigen::Vector3d& centre : {above, left}) {
    const std::string svg = draw(centre);
    Eigen::Vector2d x(-1, -1);
    const size_t at = svg.find("<path d=\"M", svg.find("class=\"camera\""));
    ASSERT_EQ(std::sscanf(svg.c_str() + at, "<path d=\"M%lf,%lf", &x.x(), &x.y()), 2);
    EXPECT_TRUE(x.x() > 0 && x.y() > 0 && x.x() < size(svg).x() && x.y() < size(svg).y());
  }
}

TEST(DrawPlan, ShowsEveryCameraAndPlace) {
  const PlanFrame frame = Frame();
  PlanCamera camera = CameraAt(2, 1.5, frame);
  camera.name = "<a>.jpg";
  const RoomCoverage coverage = MeasureCoverage(Room(), frame, {camera});
  const std::string svg =
      DrawPlan(Room(), frame, {camera, camera}, coverage.places, PlanShows::kCoverage);
  EXPECT_NE(svg.find("<title>&lt;a&gt;.jpg</title>"), std::string::npos);
  EXPECT_NE(svg.find(">2</text>"), std::string::npos);
  EXPECT_NE(svg.find(">A</text>"), std::string::npos);
  EXPECT_NE(svg.find("data:image/png;base64,"), std::string::npos);
}

TEST(ReadEvidencePoints, ReadsPointsAndRefusesWhatIsNone) {
  const TempFolder folder;
  const std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment c\nelement vertex 2\nproperty float x\n"
      "property float y\nproperty float z\nproperty float intensity\nproperty uchar views\n"
      "property float disagreement\nend_header\n";
  std::string bytes;
  for (int i = 0; i < 2; ++i) {
    const float values[4] = {1.f + static_cast<float>(i), 2, 3, 0.5f}, disagreement = 7;
    bytes.append(reinterpret_cast<const char*>(values), 16);
    bytes += static_cast<char>(4 + i);
    bytes.append(reinterpret_cast<const char*>(&disagreement), 4);
  }
  WriteBytes(folder / "evidence.ply", header + bytes);
  const auto points = ReadEvidencePoints(folder / "evidence.ply");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].x_in_scan, Eigen::Vector3d(2, 2, 3));
  EXPECT_EQ(points[1].views, 5);
  EXPECT_EQ(points[1].disagreement, 7);
  WriteBytes(folder / "cut.ply", header + bytes.substr(0, 30));
  EXPECT_INPUT_ERROR(ReadEvidencePoints(folder / "cut.ply"), "is cut off");
  // Large coordinates are doubles; what stands beside them is not theirs.
  const double far[3] = {691000.125, 5334000.25, 519.5};
  const float disagreement = 3;
  bytes = std::string(1, '\x02') + std::string(reinterpret_cast<const char*>(&disagreement), 4) +
          std::string(reinterpret_cast<const char*>(far), 24);
  const std::string far_header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uchar views\n"
      "property float disagreement\nproperty double x\nproperty double y\nproperty double z\n"
      "end_header\n";
  WriteBytes(folder / "far.ply", far_header + bytes);
  EXPECT_EQ(ReadEvidencePoints(folder / "far.ply").at(0).x_in_scan, Eigen::Vector3d(far));
  WriteBytes(folder / "other.ply",
             far_header.substr(0, far_header.find("property double y")) + "end_header\n" + bytes);
  EXPECT_INPUT_ERROR(ReadEvidencePoints(folder / "other.ply"), "is no evidence.ply");
  WriteBytes(folder / "other.ply", "ply\nformat ascii 1.0\nend_header\n");
  EXPECT_INPUT_ERROR(ReadEvidencePoints(folder / "other.ply"), "is no evidence.ply");
  EXPECT_INPUT_ERROR(ReadEvidencePoints(folder / "none.ply"), "does not exist");
}

}  // namespace
}  // namespace roomtex
