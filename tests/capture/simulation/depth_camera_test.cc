#include "capture/simulation/depth_camera.h"

#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "capture/simulation/simulated_room.h"
#include "core/statistics.h"
#include "tests/capture/simulation/small_room.h"

namespace roomtex {
namespace {

SimulatedRoomOptions DepthCameraRoom() {
  SimulatedRoomOptions options = SmallRoom();
  options.depth_camera = true;
  options.depth_drift = 0;
  return options;
}

double MissingShare(const SimulatedRoomOptions& options) {
  const Scan scan = SimulatedRoom(options).MakeScan();
  return static_cast<double>(scan.NumMissing()) / static_cast<double>(scan.points.size());
}

TEST(DepthCamera, IsNoisierWithTheSquareOfTheRange) {
  const SimulatedRoom room(DepthCameraRoom());
  const Scan scan = room.MakeScan();
  const TrueSamples truth = room.MakeTrueSamples();
  const Rigid scan_from_room = room.ScanFromRoom();
  std::vector<double> near, far;  // in units of range^2
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const double range = (scan_from_room * truth.points[i]).norm();
    const double error = std::abs(scan.points[i].norm() - range) / (range * range);
    (range < 2 ? near : far).push_back(error);
  }
  ASSERT_GT(near.size(), 5000u);
  ASSERT_GT(far.size(), 5000u);
  // Steps and the footprint on slanted surfaces add a little.
  EXPECT_NEAR(kSigmaPerMad * Median(&near), 0.002, 0.0005);
  EXPECT_NEAR(kSigmaPerMad * Median(&far), 0.002, 0.0005);
}

TEST(DepthCamera, HasHolesAndMixedSamplesOnEdgesOnly) {
  SimulatedRoomOptions options = DepthCameraRoom();
  options.furnished = false;
  options.bare_walls = true;
  const double empty = MissingShare(options);
  EXPECT_LT(empty, 0.05);
  options = DepthCameraRoom();
  EXPECT_GT(MissingShare(options), empty + 0.03);
  const SimulatedRoom room(options);
  const Scan scan = room.MakeScan();
  const TrueSamples truth = room.MakeTrueSamples();
  int num_mixed = 0;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const double range = (room.ScanFromRoom() * truth.points[i]).norm();
    num_mixed += std::abs(scan.points[i].norm() - range) > 0.1;
  }
  const double share = num_mixed / static_cast<double>(scan.points.size());
  EXPECT_GT(share, 0.005);
  EXPECT_LT(share, 0.08);
}

// Bare walls and no noise: all that is left is the disparity in whole steps.
TEST(DepthCamera, MeasuresInSteps) {
  SimulatedRoomOptions options = DepthCameraRoom();
  options.furnished = false;
  options.bare_walls = true;
  options.range_noise = 0;
  const SimulatedRoom room(options);
  const Scan scan = room.MakeScan();
  const TrueSamples truth = room.MakeTrueSamples();
  std::set<long> steps;
  std::vector<double> off;  // in steps
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const double disparity = 1 / (0.0015 * scan.points[i].norm());
    ASSERT_NEAR(disparity, std::round(disparity), 1e-6);
    steps.insert(std::lround(disparity));
    const double range = (room.ScanFromRoom() * truth.points[i]).norm();
    off.push_back(std::abs(1 / (0.0015 * range) - disparity));
  }
  ASSERT_GT(off.size(), 50000u);
  EXPECT_LT(steps.size(), 500u);
  EXPECT_NEAR(Median(&off), 0.25, 0.02);  // even between two steps
}

// Of neighbouring samples, rms.
double DifferenceOfCells(const SimulatedRoomOptions& options) {
  const TrueSamples truth = SimulatedRoom(options).MakeTrueSamples();
  double squares = 0, count = 0;
  for (size_t i = 1; i < truth.points.size(); ++i) {
    if (!((truth.points[i] - truth.points[i - 1]).norm() < 0.05)) continue;
    squares += (truth.cell_colors[i] - truth.cell_colors[i - 1]).squaredNorm();
    ++count;
  }
  return std::sqrt(squares / count);
}

// The drift shows another place of the surface, not a larger one.
TEST(DepthCamera, ColorsOfCellsAreAsDetailedWhereItDrifts) {
  SimulatedRoomOptions options = DepthCameraRoom();
  options.scan_columns = 800;
  options.scan_rows = 340;
  const double straight = DifferenceOfCells(options);
  options.depth_drift = 0.05;
  EXPECT_NEAR(DifferenceOfCells(options) / straight, 1, 0.04);
}

TEST(DepthCamera, DriftsAsFarAsAskedOnItsGrid) {
  SimulatedRoomOptions options = DepthCameraRoom();
  std::vector<double> drifts;
  for (int seed = 0; seed < 3; ++seed) {
    options.random_seed = seed;
    options.depth_drift = 0;
    const Scan straight = SimulatedRoom(options).MakeScan();
    options.depth_drift = 0.03;
    const Scan drifted = SimulatedRoom(options).MakeScan();
    for (size_t i = 0; i < straight.points.size(); ++i) {
      const int k = static_cast<int>(i);
      if (straight.IsMissing(k) || drifted.IsMissing(k)) continue;
      EXPECT_LT(straight.points[i].normalized().cross(drifted.points[i].normalized()).norm(), 1e-9);
      drifts.push_back(std::abs(drifted.points[i].norm() - straight.points[i].norm()));
    }
  }
  // Shift and turn add up, and slanted surfaces show more of both.
  const double rms = kSigmaPerMad * Median(&drifts);
  EXPECT_GT(rms, 0.02);
  EXPECT_LT(rms, 0.07);
}

}  // namespace
}  // namespace roomtex
