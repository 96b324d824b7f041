#include "building/building_solid.h"

#include <chrono>
#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "building/cell_arrangement.h"
#include "core/frames.h"

namespace roomtex {
namespace {

OutlineBuilding Building(const std::vector<Eigen::Vector2d>& footprint,
                         const std::vector<RoofPlane>& roof) {
  OutlineBuilding building;
  building.name = "a";
  building.ground = 1;
  building.footprint = footprint;
  building.roof = roof;
  return building;
}

RoofPlane Plane(double x, double y, double z, double slope_deg, double downhill_deg) {
  return {{x, y, z}, slope_deg, downhill_deg};
}

// Every edge belongs to two faces, once in each direction.
template <typename Faces>
void ExpectClosed(const Faces& faces, const std::string& what) {
  std::map<std::pair<int, int>, int> edges;
  for (const auto& corners : faces) {
    for (size_t i = 0; i < corners.size(); ++i) {
      ++edges[{corners[i], corners[(i + 1) % corners.size()]}];
    }
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1) << what;
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u) << what;
  }
}

void ExpectSolid(const OutlineBuilding& building, double volume, const std::string& what) {
  ASSERT_TRUE(building.Problems().empty()) << what << ": " << building.Problems()[0];
  const BuildingSolid solid = ExtrudeBuilding(building);
  std::vector<std::vector<int>> polygons;
  std::vector<Triangle> triangles;
  for (const SolidFace& face : solid.faces) {
    polygons.push_back(face.corners);
    const std::vector<Triangle> of_face = TrianglesOf(solid, face);
    EXPECT_EQ(of_face.size() + 2, face.corners.size()) << what;
    triangles.insert(triangles.end(), of_face.begin(), of_face.end());
    // Flat, and turned to where its kind looks.
    const auto corners = solid.CornersOf(face);
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < corners.size(); ++i) {
      normal += (corners[i] - corners[0]).cross(corners[(i + 1) % corners.size()] - corners[0]);
    }
    normal.normalize();
    for (const Eigen::Vector3d& corner : corners) {
      EXPECT_NEAR(normal.dot(corner - corners[0]), 0, 1e-6) << what;
    }
    const double z = face.kind == SolidFace::Kind::kGround ? -1
                     : face.kind == SolidFace::Kind::kRoof ? 1
                                                           : 0;
    if (z == 0) {
      EXPECT_NEAR(normal.z(), 0, 1e-9) << what;
    } else {
      EXPECT_GT(z * normal.z(), 0.01) << what;
    }
  }
  ExpectClosed(polygons, what);
  ExpectClosed(triangles, what + ", triangles");
  EXPECT_NEAR(solid.Volume(), volume, 1e-6 * volume) << what;
}

TEST(BuildingSolid, IsClosedAndHasTheVolumeOfTheBuilding) {
  const std::vector<Eigen::Vector2d> box = {{0, 0}, {8, 0}, {8, 6}, {0, 6}};
  const std::vector<Eigen::Vector2d> ell = {{0, 0}, {12, 0}, {12, 10}, {7, 10}, {7, 6}, {0, 6}};
  const double rise = DegFromRad(std::atan(0.5));
  ExpectSolid(Building(box, {Plane(0, 0, 5, 0, 0)}), 48 * 4, "flat");
  ExpectSolid(Building(ell, {Plane(0, 0, 5, 0, 0)}), (72 + 20) * 4, "L");
  ExpectSolid(Building(box, {Plane(0, 0, 5, rise, 180)}), 48 * 4 + 48 * 2, "shed");
  const std::vector<RoofPlane> gable = {Plane(0, 0, 5, rise, -90), Plane(0, 6, 5, rise, 90)};
  ExpectSolid(Building(box, gable), 48 * 4 + 0.5 * 6 * 1.5 * 8, "gable");
  std::vector<RoofPlane> hip = gable;
  hip.push_back(Plane(0, 0, 5, rise, 180));
  hip.push_back(Plane(8, 0, 5, rise, 0));
  // A gable 2 m long in the middle, a pyramid of the two ends.
  ExpectSolid(Building(box, hip), 48 * 4 + 0.5 * 6 * 1.5 * 2 + 36 * 1.5 / 3, "hip");
  // Over the L the ridge ends in the walls of the notch.
  const BuildingSolid over_ell =
      ExtrudeBuilding(Building(ell, {Plane(0, 0, 5, rise, -90), Plane(0, 10, 5, rise, 90)}));
  ExpectSolid(Building(ell, {Plane(0, 0, 5, rise, -90), Plane(0, 10, 5, rise, 90)}),
              over_ell.Volume(), "gable over L");
}

// A dome of as many planes as a roof may have; with a line for each of the 1225 pairs it took two
// minutes.
TEST(BuildingSolid, OfManyRoofPlanesIsMadeAtOnce) {
  const std::vector<Eigen::Vector2d> box = {{-10, -10}, {10, -10}, {10, 10}, {-10, 10}};
  std::vector<RoofPlane> dome;
  for (int i = 0; i < 50; ++i) {
    // Tangents of a paraboloid, at places in a spiral.
    const double angle = 2.4 * i, r = 9.5 * std::sqrt((i + 0.5) / 50);
    const Eigen::Vector2d at(r * std::cos(angle), r * std::sin(angle));
    dome.push_back(
        RoofPlane::FromGradient({at.x(), at.y(), 15 - 0.05 * at.squaredNorm()}, -0.1 * at));
  }
  const OutlineBuilding building = Building(box, dome);
  const auto start = std::chrono::steady_clock::now();
  const BuildingSolid solid = ExtrudeBuilding(building);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
  constexpr int kSteps = 1000;
  double volume = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int k = 0; k < kSteps; ++k) {
      const Eigen::Vector2d x(-10 + 20 * (i + 0.5) / kSteps, -10 + 20 * (k + 0.5) / kSteps);
      volume += (building.RoofHeightAt(x) - building.ground) * 400 / (kSteps * kSteps);
    }
  }
  EXPECT_NEAR(solid.Volume(), volume, 1e-4 * volume);
  ExpectSolid(building, solid.Volume(), "dome");
}

TEST(BuildingSolid, IsTheSameWhereverTheBuildingStands) {
  const double rise = 30;
  for (const double turn_deg : {0.0, 17.3, 45.0, 200.0}) {
    const Eigen::Rotation2Dd turn(RadFromDeg(turn_deg));
    const Eigen::Vector2d at(5e5, 4e6);
    std::vector<Eigen::Vector2d> box;
    for (const Eigen::Vector2d& x : {Eigen::Vector2d(0, 0), Eigen::Vector2d(8, 0),
                                     Eigen::Vector2d(8, 6), Eigen::Vector2d(0, 6)}) {
      box.push_back(at + turn * x);
    }
    std::vector<RoofPlane> roof = {Plane(box[0].x(), box[0].y(), 5, rise, turn_deg - 90),
                                   Plane(box[2].x(), box[2].y(), 5, rise, turn_deg + 90)};
    const double ridge = 3 * std::tan(RadFromDeg(rise));
    const BuildingSolid solid = ExtrudeBuilding(Building(box, roof));
    EXPECT_EQ(solid.faces.size(), 7u);
    EXPECT_NEAR(solid.Volume(), 48 * 4 + 0.5 * 6 * ridge * 8, 1e-4);
  }
}

// As a traced contour has them; not convex, so that the lines of its edges cross each other nearly
// everywhere.
TEST(BuildingSolid, OfAThousandCornersIsMadeInNoTime) {
  std::vector<Eigen::Vector2d> footprint;
  constexpr int kCorners = 1000;
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 2 * kPi * i / kCorners, radius = 20 + 4 * std::sin(7 * angle) + i % 2;
    footprint.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  const OutlineBuilding flat = Building(footprint, {Plane(0, 0, 5, 0, 0)});
  const OutlineBuilding gable =
      Building(footprint, {Plane(0, 0, 20, 30, 17), Plane(0, 0, 20, 30, 197)});
  const auto begin = std::chrono::steady_clock::now();
  const BuildingSolid flat_solid = ExtrudeBuilding(flat), gable_solid = ExtrudeBuilding(gable);
  ExpectSolid(flat, 4 * PolygonArea(footprint), "flat");
  ExpectSolid(gable, gable_solid.Volume(), "gable");
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  EXPECT_LT(seconds.count(), 15);  // 56 each where every edge cut all others
  EXPECT_EQ(flat_solid.faces.size(), kCorners + 2u);
  EXPECT_EQ(flat_solid.vertices.size(), 2u * kCorners);
  EXPECT_EQ(gable_solid.faces.size(), kCorners + 3u);
}

TEST(CellArrangement, CellsFillTheBoxAndOutlinesEncloseTheirUnion) {
  std::vector<Line2> lines;
  for (int i = 0; i < 12; ++i) {
    const double angle = 0.7 * i;
    lines.push_back({{std::cos(angle), std::sin(angle)}, 0.3 * std::sin(3.1 * i)});
  }
  const Eigen::AlignedBox2d box(Eigen::Vector2d(-1, -1), Eigen::Vector2d(1, 1));
  const CellArrangement arrangement = ArrangeCells(box, lines, 1e-9);
  double total = 0, chosen = 0;
  std::vector<int> labels;
  for (size_t c = 0; c < arrangement.cells.size(); ++c) {
    const double area = arrangement.AreaOf(static_cast<int>(c));
    EXPECT_GT(area, 0);
    total += area;
    labels.push_back(c % 3 == 0 ? 0 : -1);
    if (c % 3 == 0) chosen += area;
  }
  EXPECT_NEAR(total, 4, 1e-9);
  double enclosed = 0;
  for (const auto& loop : OutlinesOf(arrangement, labels, 0)) {
    std::vector<Eigen::Vector2d> polygon;
    for (const int v : loop) polygon.push_back(arrangement.vertices[static_cast<size_t>(v)]);
    enclosed += PolygonArea(polygon);
  }
  EXPECT_NEAR(enclosed, chosen, 1e-9);
}

}  // namespace
}  // namespace roomtex
