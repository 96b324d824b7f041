// Genuine and awkward E57 files, when they lie beside the repository.

#include <filesystem>

#include <gmock/gmock.h>

#include "core/error.h"
#include "importers/e57.h"
#include "importers/scan_reader.h"
#include "tests/support/folders.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::SizeIs;

class E57Data : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(Path("pumpA"))) GTEST_SKIP() << "no files at " << folder_;
  }
  std::string Path(const std::string& name) const { return folder_ + "/" + name + ".e57"; }
  std::vector<Scan> Read(const std::string& name) {
    notes_.clear();
    return ReadE57(Path(name), "", {}, &notes_);
  }
  std::string folder_ = DataFolder("e57");
  std::vector<std::string> notes_;
};

TEST_F(E57Data, APumpInItsGrid) {
  const Scan scan = Read("pumpA")[0];
  ASSERT_EQ(scan.num_columns, 345);
  ASSERT_EQ(scan.num_rows, 1074);
  EXPECT_EQ(static_cast<int>(scan.points.size()) - scan.NumMissing(), 155201);
  EXPECT_EQ(scan.name, "pumpA");
  // As the file says in its cartesianBounds, intensityLimits and sphericalBounds.
  const Bounds bounds = FindBounds(scan);
  EXPECT_THAT(bounds.min, IsNearMatrix(Eigen::Vector3d(-2.903764, -5.301103, -1.899705), 1.5e-6));
  EXPECT_THAT(bounds.max, IsNearMatrix(Eigen::Vector3d(1.721604, -0.792647, 1.843003), 1.5e-6));
  double above = 0, below = 0;
  for (int i = 0; i < static_cast<int>(scan.points.size()); ++i) {
    if (scan.IsMissing(i)) continue;
    ASSERT_GE(scan.intensity[i], 0);
    ASSERT_LE(scan.intensity[i], 1);
    const double row = i / scan.num_columns, elevation = std::asin(scan.points[i].normalized().z());
    (row < 537 ? above : below) += elevation;
    // Rows are evenly spaced, the highest on top.
    ASSERT_NEAR(elevation, 0.481 - row * (0.481 + 0.785) / 1073, 0.02);
  }
  EXPECT_GT(above, below);
}

TEST_F(E57Data, ABunnyInIntegersAndInFloats) {
  const Scan integers = Read("bunnyInt19")[0], floats = Read("bunnyFloat")[0];
  ASSERT_THAT(integers.points, SizeIs(30571));
  ASSERT_THAT(floats.points, SizeIs(30571));
  for (size_t i = 0; i < integers.points.size(); ++i) {
    ASSERT_THAT(integers.points[i], IsNearMatrix(floats.points[i], 1e-6));
  }
}

TEST_F(E57Data, OddFilesAreRead) {
  EXPECT_THAT(Read("tiny_pc_and_images")[0].points, SizeIs(2));
  EXPECT_THAT(Read("no_images_tag")[0].points, SizeIs(153));
  EXPECT_THAT(Read("with_extension")[0].points, SizeIs(1));
  EXPECT_THAT(Read("no_ext_namespace")[0].points[0], IsNearMatrix(Eigen::Vector3d(1, 2, 3), 0));
  EXPECT_THAT(Read("float_intensity_without_limits")[0].points[0],
              IsNearMatrix(Eigen::Vector3d(1, 1, 1), 0));
  EXPECT_FALSE(Read("invalid_state_single").empty());
  const std::vector<Scan> two = Read("two_scans_moved");
  ASSERT_THAT(two, SizeIs(2));
  EXPECT_EQ(two[1].name, "A4 - Cloud");
  EXPECT_THAT(two[1].points, SizeIs(4));
  EXPECT_NEAR(FindBounds(two[1]).min.x(), -44.119438171386719, 1e-6);
  // Every other one of its 360 points is marked as invalid.
  const Scan spherical = Read("tiny_spherical")[0];
  ASSERT_THAT(spherical.points, SizeIs(180));
  EXPECT_EQ(spherical.num_left_out, 180);
  for (const Eigen::Vector3d& point : spherical.points) EXPECT_NEAR(point.norm(), 1, 1e-12);
}

TEST_F(E57Data, FilesWithoutAScanAndBrokenOnesGetASentence) {
  EXPECT_INPUT_ERROR(Read("corrupt_crc"), "byte 33792: the checksum of page 33 (of 34, from 0)");
  EXPECT_INPUT_ERROR(Read("empty"), "holds no scan");
  EXPECT_INPUT_ERROR(Read("pinhole_with_distortion"), "holds no scan");
  EXPECT_INPUT_ERROR(Read("zero_points"), "no scan in it holds a measured point");
  // All its ranges are 0.
  EXPECT_INPUT_ERROR(Read("zero_bit_field"), "no scan in it holds a measured point");
  E57Options options;
  options.check = false;
  EXPECT_THAT(ReadE57(Path("corrupt_crc"), "", options, nullptr)[0].points, SizeIs(2090));
}

}  // namespace
}  // namespace roomtex
