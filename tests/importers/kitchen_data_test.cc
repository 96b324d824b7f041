// The real kitchen, when its data lies beside the repository.

#include <filesystem>

#include <gtest/gtest.h>

#include "importers/rtpi.h"
#include "importers/scan_reader.h"
#include "tests/support/folders.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

const std::string kKitchen = DataFolder("kitchen");

TEST(Kitchen, RtpiAndPtxGiveTheSameRoom) {
  const std::string folder = kKitchen;
  if (!std::filesystem::exists(folder + "/scan.rtpi")) GTEST_SKIP() << "no kitchen at " << folder;
  ScanReaderOptions options;
  options.azimuth = "counterclockwise";
  const Scan rtpi = ReadScan(folder + "/scan.rtpi", options);
  const Scan ptx = ReadScan(folder + "/scan.ptx", {});
  EXPECT_EQ(rtpi.num_columns, 801);
  EXPECT_EQ(rtpi.num_rows, 401);
  ASSERT_EQ(ptx.num_columns, 801);
  ASSERT_EQ(ptx.num_rows, 401);
  EXPECT_THAT(rtpi.up, IsNearMatrix(ptx.up, 0));
  for (int i = 0; i < 801 * 401; ++i) {
    ASSERT_EQ(rtpi.IsMissing(i), ptx.IsMissing(i)) << i;
    if (rtpi.IsMissing(i)) continue;
    ASSERT_THAT(rtpi.points[i], IsNearMatrix(ptx.points[i], 1e-4)) << i;
    ASSERT_NEAR(rtpi.intensity[i] / 255, ptx.intensity[i], 1e-4) << i;
  }
}

}  // namespace
}  // namespace roomtex
