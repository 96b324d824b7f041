#include "align/fit/plane_association.h"

#include <cmath>
#include <vector>

#include <gmock/gmock.h>

#include "tests/support/matchers.h"

namespace roomtex {
namespace {

// Samples of a 2 x 2 m board, 1 cm apart, in the plane z = `z` around the origin, seen from above.
void AddBoard(double z, Scan* scan) {
  for (int i = 0; i < 200; ++i) {
    for (int k = 0; k < 200; ++k) scan->points.emplace_back(0.01 * i - 1, 0.01 * k - 1, z);
  }
}

Scan EmptyScan() {
  Scan scan;
  scan.scan_from_station.translation = {0, 0, 3};
  return scan;
}

void Finish(Scan* scan) {
  scan->num_columns = static_cast<int>(scan->points.size());
  scan->num_rows = 1;
  scan->intensity.assign(scan->points.size(), 0);
}

// A plane through `point` of 2 x 2 m.
ScanPlane Board(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                const Eigen::Vector3d& u) {
  ScanPlane plane;
  plane.point = point;
  plane.normal = normal;
  plane.u = u;
  plane.v = normal.cross(u);
  plane.rms = 0.002;
  plane.cell_size = 0.1;
  plane.min_cell = {-10, -10};
  plane.covered.setOnes(20, 20);
  return plane;
}
ScanPlane Floor(double z) {
  return Board({0, 0, z}, Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX());
}

// Uncertain by 1 mm in every direction, seen from above.
SurfacePoint PointAt(const Eigen::Vector3d& x, uint64_t id = 7) {
  SurfacePoint point;
  point.x_in_sparse = x;
  point.covariance = 1e-6 * Eigen::Matrix3d::Identity();
  point.to_cameras = Eigen::Vector3d(0.2, 0, 0.9);
  point.point3d_id = id;
  point.num_observations = 3;
  return point;
}

class PlaneAssociation : public testing::Test {
 protected:
  PlaneAssociation() {
    Scan scan = EmptyScan();
    AddBoard(0, &scan);
    Finish(&scan);
    scans_ = {scan};
  }

  std::vector<SurfaceConstraint> Associate(const std::vector<SurfacePoint>& points,
                                           const std::vector<ScanPlane>& planes) const {
    return AssociateWithSurface(points, planes, ScanPatches(scans_, ScanPatchOptions()), options_);
  }

  std::vector<Scan> scans_;
  PlaneAssociationOptions options_;
};

// Nobody but the surface says that the two belong together, and a point that is known to 3 cm may
// lie on any.
TEST_F(PlaneAssociation, TakesPointsOfTwoPhotosThatAreKnownToACentimetre) {
  SurfacePoint exact = PointAt({0.1, 0.2, 0.004}, 1), rough = PointAt({0.3, 0.2, 0.004}, 2),
               rough_of_three = PointAt({0.3, 0.3, 0.004}, 3);
  exact.covariance = std::pow(0.008, 2) * Eigen::Matrix3d::Identity();
  rough.covariance = rough_of_three.covariance = std::pow(0.03, 2) * Eigen::Matrix3d::Identity();
  exact.num_observations = rough.num_observations = 2;
  rough_of_three.num_observations = 3;
  // What is unknown along the floor does not matter.
  SurfacePoint along = PointAt({0.2, 0.2, 0.004}, 4);
  along.num_observations = 2;
  along.covariance(0, 0) = std::pow(0.1, 2);
  std::vector<uint64_t> ids;
  for (const SurfaceConstraint& c : Associate({exact, rough, rough_of_three, along}, {Floor(0)})) {
    ids.push_back(c.point3d_id);
  }
  EXPECT_THAT(ids, testing::ElementsAre(1, 3, 4));
}

TEST_F(PlaneAssociation, TakesPointsNearThePlaneWithinTheirUncertainty) {
  // Standard deviation of the distance: hypot(1 mm of the point, 1 mm of the surface).
  const auto found =
      Associate({PointAt({0.1, 0.2, 0.004}, 1), PointAt({0.1, 0.2, 0.006}, 2),
                 PointAt({0.3, 0.2, -0.004}, 3), PointAt({0.3, 0.2, 0}, 4),
                 PointAt({0.3, 0.3, 0}, 5), PointAt({0.3, 0.4, 0}, 6), PointAt({0.3, 0.5, 0}, 7)},
                {Floor(0)});
  ASSERT_EQ(found.size(), 6u);
  EXPECT_EQ(found[0].point3d_id, 1u);
  EXPECT_EQ(found[1].point3d_id, 3u);
  EXPECT_EQ(found[2].point3d_id, 4u);
  EXPECT_EQ(found[0].plane, 0);
  EXPECT_FALSE(found[0].on_patch);
  EXPECT_NEAR(found[0].sigma, 0.001, 1e-6);
  EXPECT_NEAR(found[0].Distance({5, 5, 0.25}), 0.25, 1e-12);
}

TEST_F(PlaneAssociation, AnUncertainPointMayBeFartherOff) {
  SurfacePoint point = PointAt({0.1, 0.2, 0.02});
  EXPECT_TRUE(Associate({point, PointAt({0, 0, 0}), PointAt({0, 0, 0})}, {Floor(0)}).size() == 2);
  point.covariance(2, 2) = 1e-4;
  EXPECT_TRUE(Associate({point, PointAt({0, 0, 0}), PointAt({0, 0, 0})}, {Floor(0)}).size() == 3);
  // Uncertain across, not along the normal.
  point.covariance = Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();
  EXPECT_TRUE(Associate({point, PointAt({0, 0, 0}), PointAt({0, 0, 0})}, {Floor(0)}).size() == 2);
}

TEST_F(PlaneAssociation, TheGateWidensWhereAllPointsAreOffAndNeverBeyondTheLimit) {
  options_.surface = false;
  std::vector<SurfacePoint> points;
  for (int i = 0; i < 20; ++i) points.push_back(PointAt({0.04 * i, 0, 0.02 + 0.001 * i}, i));
  EXPECT_EQ(Associate(points, {Floor(0)}).size(), 20u);
  points.push_back(PointAt({0, 0.1, 0.11}, 99));
  EXPECT_EQ(Associate(points, {Floor(0)}).size(), 20u);
  options_.max_distance = 0.03;
  EXPECT_EQ(Associate(points, {Floor(0)}).size(), 11u);
}

TEST_F(PlaneAssociation, ThePlaneMustHaveSamplesThere) {
  options_.surface = false;
  EXPECT_EQ(Associate({PointAt({0.95, 0, 0})}, {Floor(0)}).size(), 1u);
  EXPECT_EQ(Associate({PointAt({1.5, 0, 0})}, {Floor(0)}).size(), 0u);
}

TEST_F(PlaneAssociation, ThePlaneMustFaceTheCameras) {
  SurfacePoint from_below = PointAt({0.1, 0.2, 0});
  from_below.to_cameras *= -1;
  EXPECT_THAT(Associate({from_below}, {Floor(0)}), testing::IsEmpty());
  SurfacePoint flat = PointAt({0.1, 0.2, 0});
  flat.to_cameras = {0.99, 0, 0.1};
  EXPECT_THAT(Associate({flat}, {Floor(0)}), testing::IsEmpty());
}

TEST_F(PlaneAssociation, AThinBoardHasTwoSides) {
  options_.surface = false;
  ScanPlane below = Floor(-0.002);
  below.normal *= -1;
  SurfacePoint from_below = PointAt({0.1, 0.2, -0.0005});
  from_below.to_cameras *= -1;
  const auto found = Associate({from_below, PointAt({0.1, 0.2, -0.0015})}, {Floor(0), below});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].plane, 1);
  EXPECT_EQ(found[1].plane, 0);
}

TEST_F(PlaneAssociation, APointOnTheEdgeOfTwoPlanesIsLeftOut) {
  options_.surface = false;
  const ScanPlane wall = Board({-1, 0, 1}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY());
  SurfacePoint edge = PointAt({-0.998, 0, 0.002}), floor = PointAt({-0.9, 0, 0.002}, 8);
  edge.to_cameras = floor.to_cameras = Eigen::Vector3d(0.7, 0, 0.7);
  const auto found = Associate({edge, floor}, {Floor(0), wall});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].point3d_id, 8u);
  EXPECT_EQ(found[0].plane, 0);
}

TEST_F(PlaneAssociation, PatchesHoldWhatLiesOnNoPlaneUnlessTurnedOff) {
  const SurfacePoint point = PointAt({0.1, 0.2, 0.001});
  const auto found = Associate({point}, {});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].plane, -1);
  EXPECT_TRUE(found[0].on_patch);
  EXPECT_THAT(found[0].normal, IsNearMatrix(Eigen::Vector3d(0, 0, 1), 1e-9));
  options_.surface = false;
  EXPECT_THAT(Associate({point}, {}), testing::IsEmpty());
}

TEST_F(PlaneAssociation, APatchMustBeNear) {
  EXPECT_EQ(Associate({PointAt({1.02, 0, 0})}, {}).size(), 1u);
  EXPECT_EQ(Associate({PointAt({1.15, 0, 0})}, {}).size(), 0u);
}

TEST_F(PlaneAssociation, AThinPictureOnTheWallIsAnotherSurface) {
  // A sheet 4 mm above the board, too thin for a plane of its own.
  for (Eigen::Vector3d& x : scans_[0].points) {
    if (std::abs(x.x()) < 0.24 && std::abs(x.y()) < 0.24) x.z() = 0.004;
  }
  const auto found =
      Associate({PointAt({0.05, 0.05, 0.0035}, 1), PointAt({0.7, 0.7, 0.001}, 2)}, {Floor(0)});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_TRUE(found[0].on_patch);
  EXPECT_EQ(found[0].plane, 0);
  EXPECT_NEAR(found[0].Distance({0, 0, 0.004}), 0, 1e-9);
  EXPECT_FALSE(found[1].on_patch);
}

TEST_F(PlaneAssociation, ABentWallCountsLess) {
  for (Eigen::Vector3d& x : scans_[0].points) x.z() = 0.01 * (x.x() * x.x() - 1.0 / 3);
  ScanPlane plane = Floor(0);
  plane.rms = 0.003;
  options_.surface = false;
  const auto found = Associate({PointAt({0.1, 0.1, -0.003})}, {plane});
  ASSERT_EQ(found.size(), 1u);
  // Root mean square of x^2 - 1/3 over -1 .. 1: 0.298.
  EXPECT_NEAR(found[0].sigma, std::hypot(0.00298, 0.001), 2e-4);
}

}  // namespace
}  // namespace roomtex
