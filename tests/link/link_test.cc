// All libraries in one program. That it links is most of the test; the rest runs what once had two
// definitions of one name, align's cells of a scan and texture's smoothed scan, side by side.

#include <gtest/gtest.h>

#include "align/surface/scan_surface.h"
#include "capture/simulation/simulated_room.h"
#include "texture/sampling/smoothed_scan.h"

namespace roomtex {
namespace {

TEST(Link, AlignAndTextureLookAtTheSameScanInOneProgram) {
  SimulatedRoomOptions options;
  options.num_photos = 1;
  options.scan_columns = 200;
  options.scan_rows = 75;
  const Scan scan = SimulatedRoom(options).MakeScan();
  const ScanSurface cells(scan, Eigen::Vector3d::Zero(), {}, 1);
  const SmoothedScan smoothed = MakeSmoothedScan(scan, {}, {}, 1);
  ASSERT_FALSE(cells.cells().empty());
  EXPECT_EQ(smoothed.points.size(), scan.points.size());
  // Both saw the noise of 2 mm, each in its own way.
  EXPECT_NEAR(cells.noise().At(2.5), options.range_noise, 0.001);
  EXPECT_NEAR(smoothed.range_noise, options.range_noise, 0.001);
}

}  // namespace
}  // namespace roomtex
