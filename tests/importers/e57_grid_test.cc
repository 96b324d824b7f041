// E57: the grid of rows and columns.

#include <cmath>
#include <filesystem>
#include <limits>

#include "importers/scan_reader.h"
#include "tests/importers/e57_fixture.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// A scanner in the middle of a sphere: 12 columns of 5 rows from elevation +0.4 down to -0.4.
struct SphereScan {
  std::vector<uint64_t> rows, columns, returns;
  std::vector<float> xyz[3];

  static Eigen::Vector3d PointAt(int column, int row) {
    const double azimuth = 0.2 * column, elevation = 0.4 - 0.2 * row;
    return 5 * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                               std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  }
  void Add(int column, int row, uint64_t row_index, uint64_t column_index, uint64_t number = 0,
           double scale = 1) {
    for (int i = 0; i < 3; ++i) {
      xyz[i].push_back(static_cast<float>(scale * PointAt(column, row)[i]));
    }
    rows.push_back(row_index);
    columns.push_back(column_index);
    returns.push_back(number);
  }
  std::string File(const std::string& bounds = "", uint64_t most = 15) const {
    int bits = 1;
    while (most >> bits != 0) ++bits;
    E57Bytes file;
    const uint64_t offset =
        file.AddPoints({StreamOf(xyz[0]), StreamOf(xyz[1]), StreamOf(xyz[2]), BitStream(rows, bits),
                        BitStream(columns, bits), BitStream(returns, 2)});
    const auto highest = static_cast<int64_t>((uint64_t{1} << bits) - 1);
    return file.Finish(
        E57Xml(ScanXml(offset, rows.size(),
                       SinglesXml() + IntegerXml("rowIndex", 0, highest) +
                           IntegerXml("columnIndex", 0, highest) + IntegerXml("returnIndex", 0, 3),
                       bounds)));
  }
  static std::string Bounds(int last_row, int last_column) {
    return Element("indexBounds", "Structure",
                   Element("rowMaximum", "Integer", std::to_string(last_row)) +
                       Element("columnMaximum", "Integer", std::to_string(last_column)));
  }
};

TEST_F(E57, TheGridStandsUprightWhateverTheSenseOfItsIndices) {
  for (const bool upward : {false, true}) {
    for (const bool transposed : {false, true}) {
      SphereScan sphere;
      for (int column = 0; column < 12; ++column) {
        for (int row = 0; row < 5; ++row) {
          if (column == 3 && row == 1) continue;
          const uint64_t index = upward ? 4 - row : row;
          if (transposed) sphere.Add(column, row, column, index);
          if (!transposed) sphere.Add(column, row, index, column);
        }
      }
      const std::string bounds = transposed ? SphereScan::Bounds(11, 4) : SphereScan::Bounds(4, 11);
      const Scan scan = Read(sphere.File(bounds))[0];
      EXPECT_EQ(scan.kind(), Scan::Kind::kGrid);
      ASSERT_EQ(scan.num_columns, 12);
      ASSERT_EQ(scan.num_rows, 5);
      EXPECT_EQ(scan.NumMissing(), 1);
      EXPECT_TRUE(scan.IsMissing(scan.Index(3, 1)));
      EXPECT_EQ(scan.intensity[scan.Index(3, 1)], 0);
      for (int column = 4; column < 12; ++column) {
        for (int row = 0; row < 5; ++row) {
          ASSERT_THAT(scan.points[scan.Index(column, row)],
                      IsNearMatrix(SphereScan::PointAt(column, row), 1e-6));
        }
      }
    }
  }
}

// Older programs write no state; a point of a cloud may lie anywhere.
TEST_F(E57, APointInTheScannerIsMissingFromAGrid) {
  SphereScan sphere;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) {
      sphere.Add(column, row, row, column, 0, column == 4 && row == 2 ? 0.0 : 1.0);
    }
  }
  const Scan scan = Read(sphere.File())[0];
  EXPECT_EQ(scan.NumMissing(), 1);
  EXPECT_TRUE(scan.IsMissing(scan.Index(4, 2)));
  EXPECT_THAT(Read(Cloud({{0, 0, 0}, {1, 2, 3}}, ""))[0].points, SizeIs(2));
}

TEST_F(E57, OfTwoPointsInACellTheFirstReturnStays) {
  SphereScan sphere;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) {
      sphere.Add(column, row, row, column, 1, 2.0);  // behind the first return
      sphere.Add(column, row, row, column, 0);
      sphere.Add(column, row, row, column, 0, 3.0);
    }
  }
  const Scan scan = Read(sphere.File())[0];
  ASSERT_THAT(scan.points, SizeIs(60));
  for (const Eigen::Vector3d& point : scan.points) EXPECT_NEAR(point.norm(), 5, 1e-6);
}

TEST_F(E57, IndicesDecideWhereTheBoundsAreWrong) {
  SphereScan sphere;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) sphere.Add(column, row, row + 2, column + 1);
  }
  const Scan inside = Read(sphere.File(SphereScan::Bounds(9, 14)))[0];
  EXPECT_EQ(inside.num_rows, 10);
  EXPECT_EQ(inside.num_columns, 15);
  EXPECT_THAT(inside.points[inside.Index(3, 4)], IsNearMatrix(SphereScan::PointAt(2, 2), 1e-6));
  EXPECT_THAT(notes_, IsEmpty());
  const Scan beyond = Read(sphere.File(SphereScan::Bounds(4, 11)))[0];
  EXPECT_EQ(beyond.num_rows, 5);
  EXPECT_EQ(beyond.num_columns, 12);
  EXPECT_THAT(notes_, testing::ElementsAre(HasSubstr("beyond its indexBounds of 12 columns x 5")));
  const Scan huge = Read(sphere.File(SphereScan::Bounds(2000000000, 2000000000)))[0];
  EXPECT_EQ(huge.num_rows, 5);
}

TEST_F(E57, RowsAndColumnsThatAThinnedScanLostAreLeftOut) {
  SphereScan thinned, scattered;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) {
      thinned.Add(column, row, 1000 * row, 1000 * column);
      scattered.Add(column, row, 997 * (5 * column + row), 991 * (60 - 5 * column - row));
    }
  }
  const Scan scan = Read(thinned.File("", 60000))[0];
  ASSERT_EQ(scan.num_rows, 5);
  ASSERT_EQ(scan.num_columns, 12);
  EXPECT_THAT(scan.points[scan.Index(7, 3)], IsNearMatrix(SphereScan::PointAt(7, 3), 1e-6));
  EXPECT_THAT(notes_, testing::ElementsAre(HasSubstr("without a point are left out")));
  // 60 points in 60 rows and 60 columns are a grid: not one that says much, but a small one.
  EXPECT_EQ(Read(scattered.File("", 60000))[0].num_rows, 60);
}

TEST_F(E57, MemoryFollowsThePointsNotTheirIndices) {
  SphereScan sphere;
  for (int i = 0; i < 300; ++i) sphere.Add(i % 12, i % 5, 3000000 * i, 2000000 * i);
  const Scan scan = Read(sphere.File("", 900000000))[0];
  EXPECT_EQ(scan.kind(), Scan::Kind::kCloud);
  EXPECT_THAT(scan.points, SizeIs(300));
  EXPECT_THAT(notes_, testing::ElementsAre(HasSubstr("is read as a cloud")));
}

TEST_F(E57, IndicesMayBeFloatsAndNoNumbers) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = HUGE_VALF;
  const auto read = [&](const std::vector<float>& rows) {
    E57Bytes file;
    const std::string x = StreamOf<float>({1, 2, 3, 4});
    const uint64_t offset =
        file.AddPoints({x, x, x, StreamOf(rows), StreamOf<float>({0, 1, 0, 1})});
    return Read(file.Finish(
        E57Xml(ScanXml(offset, 4,
                       SinglesXml() + Element("rowIndex", "Float", "", "precision=\"single\"") +
                           Element("columnIndex", "Float", "", "precision=\"single\"")))));
  };
  EXPECT_EQ(read({0, 0, 1, 1})[0].NumMissing(), 0);
  EXPECT_EQ(read({0, 0, 1, nan})[0].NumMissing(), 1);
  EXPECT_EQ(read({0, -inf, 1, inf})[0].NumMissing(), 2);
  EXPECT_EQ(read({nan, nan, nan, nan})[0].kind(), Scan::Kind::kCloud);
}

TEST_F(E57, ReadersOfScansTakeTheGridAndThePose) {
  SphereScan sphere;
  for (int column = 0; column < 12; ++column) {
    for (int row = 0; row < 5; ++row) sphere.Add(column, row, row, column);
  }
  const std::string path = folder_ / "a.rtpi";  // the content counts
  WriteBytes(path, sphere.File());
  EXPECT_EQ(ReadScanFile(path, {}).format, "E57");
  EXPECT_THAT(ReadScan(path + "#1", {}).points, SizeIs(60));
  EXPECT_INPUT_ERROR(ReadScan(path + "#2", {}), "has no scan \"2\"");
  EXPECT_INPUT_ERROR(ReadScan(folder_ / "none.e57#1", {}), "does not exist");
  std::filesystem::copy_file(path, folder_ / "b.e57");
  EXPECT_THAT(ReadScans({path, folder_ / "b.e57"}, "", {}), SizeIs(2));  // poses are their own
  WriteBytes(folder_ / "c#1.ptx",
             "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
             "0 0 0 1\n1 2 3 0.5\n");
  EXPECT_EQ(ReadScanFile(folder_ / "c#1.ptx", {}).format, "PTX");
  EXPECT_INPUT_ERROR(ReadScan(folder_ / "c#1.ptx#1", {}), "is no E57");
}

}  // namespace
}  // namespace roomtex
