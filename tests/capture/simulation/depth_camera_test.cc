#include "capture/simulation/depth_camera.h"

#include <cmath>
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

TEST(DepthCamera, DriftsAsFarAsAskedAndSmoothly) {
  SimulatedRoomOptions options = DepthCameraRoom();
  double sum = 0, largest_step = 0;
  size_t count = 0;
  for (int seed = 0; seed < 3; ++seed) {
    options.random_seed = seed;
    options.depth_drift = 0;
    const Scan straight = SimulatedRoom(options).MakeScan();
    options.depth_drift = 0.03;
    const Scan drifted = SimulatedRoom(options).MakeScan();
    for (int column = 0; column < straight.num_columns; ++column) {
      for (int row = 0; row < straight.num_rows; ++row) {
        const int i = straight.Index(column, row);
        if (straight.IsMissing(i)) continue;
        const Eigen::Vector3d drift = drifted.points[i] - straight.points[i];
        sum += drift.squaredNorm();
        ++count;
        const int next = row + 1 < straight.num_rows ? straight.Index(column, row + 1) : i;
        const Eigen::Vector3d away = straight.points[next] - straight.points[i];
        if (straight.IsMissing(next) || away.norm() > 0.05) continue;
        largest_step =
            std::max(largest_step, (drifted.points[next] - straight.points[next] - drift).norm());
      }
    }
  }
  // Shift and turn add up, the turn by range / 2.5 m.
  const double rms = std::sqrt(sum / static_cast<double>(count));
  EXPECT_GT(rms, 0.03);
  EXPECT_LT(rms, 0.03 * 2.5);
  EXPECT_LT(largest_step, 0.01);
}

}  // namespace
}  // namespace roomtex
