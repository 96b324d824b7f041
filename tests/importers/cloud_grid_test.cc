#include "importers/cloud_grid.h"

#include <random>

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/frames.h"
#include "importers/e57_writer.h"
#include "importers/scan_reader.h"
#include "tests/importers/e57_bytes.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// A box around a station, as a scanner of even steps sees it.
struct BoxScanner {
  Rigid pose{Eigen::Quaterniond(0.9, 0, 0, 0.43).normalized(), {100, -20, 3}};
  double first_azimuth = 0.3, azimuth_step = 2 * kPi / 400, elevation_step = 0.0131;
  int num_columns = 400, num_rows = 120;
  double noise = 0;  // metres, of each coordinate

  Scan Cloud(bool shuffled = true) const {
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    std::vector<std::pair<Eigen::Vector3d, float>> points;
    for (int column = 0; column < num_columns; ++column) {
      for (int row = 0; row < num_rows; ++row) {
        if (random() % 10 == 0) continue;  // no return
        const double azimuth = first_azimuth + azimuth_step * column;
        const double elevation = 0.9 - elevation_step * row;
        const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                        std::cos(elevation) * std::sin(azimuth),
                                        std::sin(elevation));
        const double range =
            1 / (direction.cwiseAbs().cwiseQuotient(Eigen::Vector3d(4, 3, 1.5))).maxCoeff();
        const Eigen::Vector3d error(normal(random), normal(random), normal(random));
        points.emplace_back(pose * (range * direction + noise * error),
                            static_cast<float>(column * 1000 + row));
      }
    }
    if (shuffled) std::shuffle(points.begin(), points.end(), random);
    Scan scan;
    scan.organised = false;
    scan.scan_from_station = pose;
    scan.up = Eigen::Vector3d::UnitZ();
    for (const auto& [point, intensity] : points) {
      scan.points.push_back(point);
      scan.intensity.push_back(intensity);
    }
    scan.num_columns = static_cast<int>(points.size());
    scan.num_rows = 1;
    return scan;
  }
};

// Points must stand in their own cells; the first column may be any of a full turn.
void ExpectItsGrid(const BoxScanner& scanner, const Scan& cloud, const std::optional<Scan>& grid) {
  ASSERT_TRUE(grid.has_value());
  ASSERT_EQ(grid->kind(), Scan::Kind::kGrid);
  EXPECT_EQ(grid->num_columns, scanner.num_columns);
  EXPECT_EQ(grid->num_rows, scanner.num_rows);
  ASSERT_EQ(grid->points.size() - static_cast<size_t>(grid->NumMissing()), cloud.points.size());
  std::set<int> shifts;
  for (int row = 0; row < grid->num_rows; ++row) {
    for (int column = 0; column < grid->num_columns; ++column) {
      const int cell = grid->Index(column, row);
      if (grid->IsMissing(cell)) continue;
      const int mark = static_cast<int>(grid->intensity[static_cast<size_t>(cell)]);
      ASSERT_EQ(mark % 1000, row);
      shifts.insert((column - mark / 1000 + scanner.num_columns) % scanner.num_columns);
    }
  }
  EXPECT_EQ(shifts.size(), 1u);
}

TEST(CloudGrid, IsFoundInAnyOrderOfThePoints) {
  for (const bool shuffled : {false, true}) {
    const BoxScanner scanner;
    const Scan cloud = scanner.Cloud(shuffled);
    ExpectItsGrid(scanner, cloud, GridFromCloud(cloud));
  }
}

TEST(CloudGrid, IsFoundOverTheSeamAndInAPartOfATurn) {
  BoxScanner scanner;
  scanner.first_azimuth = 2.4;  // over 180 degrees
  scanner.azimuth_step = 0.00917;
  scanner.num_columns = 150;
  const Scan cloud = scanner.Cloud();
  ExpectItsGrid(scanner, cloud, GridFromCloud(cloud));
}

TEST(CloudGrid, ToleratesRoundedCoordinates) {
  BoxScanner scanner;
  scanner.noise = 0.001;  // a step is 16 mm at 1 m
  const Scan cloud = scanner.Cloud();
  const std::optional<Scan> grid = GridFromCloud(cloud);
  ASSERT_TRUE(grid.has_value());
  EXPECT_EQ(grid->num_columns, scanner.num_columns);
  EXPECT_EQ(grid->num_rows, scanner.num_rows);
  EXPECT_GT(grid->points.size() - static_cast<size_t>(grid->NumMissing()),
            0.999 * static_cast<double>(cloud.points.size()));
}

TEST(CloudGrid, IsNotSeenWhereThereIsNone) {
  const BoxScanner scanner;
  Scan elsewhere = scanner.Cloud();
  elsewhere.scan_from_station.translation.x() += 0.5;  // the scanner did not stand there
  EXPECT_FALSE(GridFromCloud(elsewhere).has_value());
  Scan random = elsewhere;
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> uniform(-3, 3);
  for (Eigen::Vector3d& point : random.points) {
    point = random.Station() +
            Eigen::Vector3d(uniform(generator), uniform(generator), uniform(generator));
  }
  EXPECT_FALSE(GridFromCloud(random).has_value());
  Scan two = scanner.Cloud();
  BoxScanner other;
  other.pose.translation = {101, -20, 3};
  const Scan more = other.Cloud();
  two.points.insert(two.points.end(), more.points.begin(), more.points.end());
  two.intensity.insert(two.intensity.end(), more.intensity.begin(), more.intensity.end());
  EXPECT_FALSE(GridFromCloud(two).has_value());
  // Thinned at random: on the lines, and next to nobody.
  Scan thinned = scanner.Cloud();
  thinned.points.resize(thinned.points.size() / 5);
  thinned.intensity.resize(thinned.points.size());
  EXPECT_FALSE(GridFromCloud(thinned).has_value());
  Scan few = scanner.Cloud();
  few.points.resize(20);
  few.intensity.resize(20);
  EXPECT_FALSE(GridFromCloud(few).has_value());
}

TEST(CloudGrid, ACloudInAnE57GetsItsGridBack) {
  const BoxScanner scanner;
  const Scan cloud = scanner.Cloud();
  const Rigid station_from_scan = cloud.scan_from_station.Inverse();
  std::string streams[3];
  for (const Eigen::Vector3d& point : cloud.points) {
    const Eigen::Vector3f x = (station_from_scan * point).cast<float>();
    for (int i = 0; i < 3; ++i) streams[i] += Bytes(x[i]);
  }
  E57Bytes file;
  const uint64_t offset = file.AddPoints({streams[0], streams[1], streams[2]});
  TempFolder folder;
  WriteBytes(folder / "cloud.e57",
             file.Finish(E57Xml(ScanXml(offset, cloud.points.size(), SinglesXml()))));
  const ScanFile read = ReadScanFile(folder / "cloud.e57", {});
  EXPECT_EQ(read.scans[0].num_columns, 400);
  EXPECT_EQ(read.scans[0].num_rows, 120);
  EXPECT_THAT(read.notes, testing::ElementsAre(testing::HasSubstr("400 columns x 120 rows")));
  EXPECT_EQ(ReadScan(folder / "cloud.e57", {}).kind(), Scan::Kind::kGrid);
  E57Bytes other;
  const std::string one = StreamOf<float>({1, 2, 3});
  const uint64_t at = other.AddPoints({one, one, one});
  WriteBytes(folder / "other.e57", other.Finish(E57Xml(ScanXml(at, 3, SinglesXml()))));
  EXPECT_EQ(ReadScanFile(folder / "other.e57", {}).scans[0].kind(), Scan::Kind::kCloud);
}

// PCD says where the scanner stood, and so do the PLY files of roomtex.
TEST(CloudGrid, CloudsInPcdAndPlyFilesGetTheirGridBack) {
  BoxScanner scanner;
  scanner.pose = {Eigen::Quaterniond::Identity(), {1, 2, 3}};
  const Scan cloud = scanner.Cloud();
  TempFolder folder;
  const std::string count = std::to_string(cloud.points.size());
  std::string pcd = "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " +
                    count + "\nHEIGHT 1\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS " + count +
                    "\nDATA binary\n";
  std::string ply =
      "ply\nformat binary_little_endian 1.0\ncomment roomtex station 1 2 3\nelement vertex " +
      count + "\nproperty double x\nproperty double y\nproperty double z\nend_header\n";
  for (const Eigen::Vector3d& point : cloud.points) {
    for (std::string* text : {&pcd, &ply}) {
      for (int i = 0; i < 3; ++i) *text += Bytes(point[i]);
    }
  }
  WriteBytes(folder / "cloud.pcd", pcd);
  WriteBytes(folder / "cloud.ply", ply);
  for (const char* name : {"cloud.pcd", "cloud.ply"}) {
    const Scan grid = ReadScan(folder / name, {});
    EXPECT_EQ(grid.num_columns, 400) << name;
    EXPECT_EQ(grid.num_rows, 120) << name;
    EXPECT_EQ(grid.points.size() - static_cast<size_t>(grid.NumMissing()), cloud.points.size());
    ScanReaderOptions options;
    options.max_range = 0.5;
    EXPECT_INPUT_ERROR(ReadScan(folder / name, options), "holds no measured");
  }
  WriteBytes(folder / "three.ply",
             "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
             "property float z\nend_header\n1 2 3\nnan 5 6\n7 8 9\n");
  const Scan three = ReadScanFile(folder / "three.ply", {}).scans[0];
  EXPECT_EQ(three.kind(), Scan::Kind::kCloud);
  EXPECT_EQ(three.points.size(), 2u);
}

}  // namespace
}  // namespace roomtex
