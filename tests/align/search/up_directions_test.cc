#include "align/search/up_directions.h"

#include <gtest/gtest.h>

#include "core/frames.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

// Up of the simulated room, in its sparse model.
Eigen::Vector3d TrueUp(const SimulatedCase& one) {
  return one.room->ScanFromSparse().rotation.conjugate() * one.scans[0].up;
}

double NearestDeg(const UpDirections& found, const Eigen::Vector3d& up) {
  double nearest = 180;
  for (const Eigen::Vector3d& one : found.ups) {
    nearest = std::min(nearest, DegFromRad(AngleBetween(one, up)));
  }
  return nearest;
}

Scan Tilted(Scan scan, double angle) {
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 0, 0.4).normalized()));
  for (Eigen::Vector3d& x : scan.points) x = tilt * x;
  return scan;
}

TEST(ModelUps, LevelPhotosLeaveNoDoubt) {
  const SimulatedCase& one = MakeCase();
  const UpDirections found = FindModelUps(MakeSearchCloud(one.model, 0.7, 4000));
  EXPECT_TRUE(found.known);
  ASSERT_EQ(found.ups.size(), 1u);
  EXPECT_LT(NearestDeg(found, TrueUp(one)), 2);
}

TEST(ModelUps, OfPhotosHeldInAllWaysThePlanesTell) {
  const SimulatedCase& one = MakeCase();
  SearchCloud cloud = MakeSearchCloud(one.model, 0.7, 4000);
  for (size_t i = 0; i < cloud.right.size(); ++i) {
    const Eigen::Quaterniond roll(Eigen::AngleAxisd(
        2.4 * static_cast<double>(i), cloud.right[i].cross(cloud.down[i]).normalized()));
    cloud.right[i] = roll * cloud.right[i];
    cloud.down[i] = roll * cloud.down[i];
  }
  const UpDirections found = FindModelUps(cloud);
  EXPECT_FALSE(found.known);
  EXPECT_LT(NearestDeg(found, TrueUp(one)), 3);
}

TEST(ModelUps, OfTheMirrorImageAreMirrored) {
  const SearchCloud cloud = MakeSearchCloud(MakeCase().model, 0.7, 4000);
  const Eigen::Vector3d up = FindModelUps(cloud).ups[0];
  const Eigen::Vector3d mirrored = FindModelUps(Mirrored(cloud)).ups[0];
  EXPECT_LT(DegFromRad(AngleBetween(mirrored, {-up.x(), up.y(), up.z()})), 1);
}

TEST(ScanUps, ALevelScanIsBelieved) {
  const std::vector<Scan>& scans = MakeCase().scans;
  const UpDirections found = FindScanUps(scans, Survey(scans).patches());
  EXPECT_TRUE(found.known);
  EXPECT_EQ(found.ups[0], scans[0].up);
}

TEST(ScanUps, ATiltedScanHasItsFloorsUp) {
  const double tilt = RadFromDeg(26.0);
  const std::vector<Scan> scans = {Tilted(MakeCase().scans[0], tilt)};
  const UpDirections found = FindScanUps(scans, Survey(scans).patches());
  EXPECT_FALSE(found.known);
  const Eigen::Vector3d up =
      Eigen::AngleAxisd(tilt, Eigen::Vector3d(1, 0, 0.4).normalized()) * scans[0].up;
  EXPECT_LT(NearestDeg(found, up), 1.5);
}

// Nothing in it is level; what the scanner says stays possible.
TEST(ScanUps, OfAFacadeThatOfTheScannerIsAmongThem) {
  const SimulatedCase& one = MakeCase();
  std::vector<Scan> scans = {one.scans[0]};
  const auto room_from_scan = one.room->ScanFromRoom().Inverse();
  for (Eigen::Vector3d& x : scans[0].points) {
    if (!((room_from_scan * x).y() < 0.05)) x = Scan::MissingPoint();
  }
  const UpDirections found = FindScanUps(scans, Survey(scans).patches());
  EXPECT_FALSE(found.known);
  EXPECT_LT(NearestDeg(found, scans[0].up), 0.1);
}

}  // namespace
}  // namespace roomtex
