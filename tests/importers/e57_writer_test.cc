#include "importers/e57_writer.h"

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/frames.h"
#include "importers/e57.h"
#include "importers/e57_document.h"
#include "importers/e57_images.h"
#include "importers/e57_points.h"
#include "importers/scan_reader.h"
#include "importers/scan_writer.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
using testing::HasSubstr;
using testing::SizeIs;

// A room around a station that leans: rows from the top, some samples missing.
Scan MadeRoom(int num_columns, int num_rows, const Rigid& pose) {
  Scan scan;
  scan.path = "made";
  scan.num_columns = num_columns;
  scan.num_rows = num_rows;
  scan.up = Eigen::Vector3d::UnitZ();
  scan.scan_from_station = pose;
  for (int row = 0; row < num_rows; ++row) {
    for (int column = 0; column < num_columns; ++column) {
      const double azimuth = 2 * kPi * column / num_columns;
      const double elevation = 1.2 - 2.0 * row / num_rows, range = 3 + std::sin(3 * azimuth);
      const bool missing = (row * 31 + column * 17) % 11 == 0;
      const Eigen::Vector3d point =
          range * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                  std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      scan.points.push_back(missing ? Scan::MissingPoint() : pose * point);
      scan.intensity.push_back(missing ? 0 : static_cast<float>((row * 7 + column) % 256));
    }
  }
  return scan;
}

class E57Written : public testing::Test {
 protected:
  std::string Path() const { return folder_ / "made.e57"; }
  static Rigid Pose() {
    return {Eigen::Quaterniond(0.9, 0.02, -0.01, 0.4).normalized(), {412345.25, -20, 3.5}};
  }
  TempFolder folder_;
};

TEST_F(E57Written, ARoundTripKeepsGridPoseAndPointsToTheMicrometre) {
  const Scan first = MadeRoom(200, 90, Pose()), second = MadeRoom(37, 21, Rigid());
  WriteE57({first, second}, Path());
  const std::vector<Scan> again = ReadE57(Path(), "", {}, nullptr);
  ASSERT_THAT(again, SizeIs(2));
  EXPECT_EQ(again[0].name, "scan 1");
  EXPECT_EQ(again[1].name, "scan 2");
  for (int s = 0; s < 2; ++s) {
    const Scan& was = s == 0 ? first : second;
    ASSERT_EQ(again[s].num_columns, was.num_columns);
    ASSERT_EQ(again[s].num_rows, was.num_rows);
    EXPECT_THAT(again[s].scan_from_station, IsNearRigid(was.scan_from_station, 1e-15, 1e-9));
    for (size_t i = 0; i < was.points.size(); ++i) {
      ASSERT_EQ(again[s].IsMissing(static_cast<int>(i)), was.IsMissing(static_cast<int>(i)));
      ASSERT_NEAR(again[s].intensity[i], was.intensity[i] / 255, 1e-7);
      if (was.IsMissing(static_cast<int>(i))) continue;
      ASSERT_THAT(again[s].points[i], IsNearMatrix(was.points[i], 1e-6));
    }
  }
  // What was read is written again as it is.
  const std::string bytes = ReadBytes(Path());
  WriteE57(again, folder_ / "again.e57");
  const std::vector<Scan> third = ReadE57(folder_ / "again.e57", "", {}, nullptr);
  for (size_t i = 0; i < first.points.size(); ++i) {
    if (first.IsMissing(static_cast<int>(i))) continue;
    ASSERT_THAT(third[0].points[i], IsNearMatrix(again[0].points[i], 1e-9));
  }
  WriteE57({first, second}, folder_ / "same.e57");
  EXPECT_EQ(ReadBytes(folder_ / "same.e57"), bytes);  // the same input, the same bytes
}

TEST_F(E57Written, ColoursStandBesideTheirPoints) {
  const Scan scan = MadeRoom(300, 40, Rigid());
  CellColors colors;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    colors.push_back(
        {static_cast<uint8_t>(i), static_cast<uint8_t>(i >> 8), static_cast<uint8_t>(3 * i)});
  }
  E57Writer writer(Path());
  writer.AddScan(scan, &colors);
  writer.Commit();
  const E57Pages pages(Path(), true);
  const E57Document document = ReadE57Document(pages);
  const E57Points& points = document.scans[0].points;
  ASSERT_TRUE(document.scans[0].color_limits[2].has_value());
  EXPECT_EQ(document.scans[0].color_limits[2]->maximum, 255);
  std::vector<int> wanted;
  for (const char* name : {"colorRed", "colorGreen", "colorBlue", "rowIndex", "columnIndex"}) {
    wanted.push_back(points.Find(name));
    ASSERT_GE(wanted.back(), 0) << name;
  }
  E57Records records(pages, points, wanted);
  int64_t total = 0, last = -1;
  while (const int64_t count = records.Next()) {
    for (int64_t i = 0; i < count; ++i) {
      const auto cell = static_cast<int64_t>(records.Values(3)[i]) * 300 +
                        static_cast<int64_t>(records.Values(4)[i]);
      ASSERT_GT(cell, last);  // in the order of the grid
      last = cell;
      for (size_t k = 0; k < 3; ++k) {
        ASSERT_EQ(records.Values(k)[i], colors[static_cast<size_t>(cell)][k]);
      }
    }
    total += count;
  }
  EXPECT_EQ(total, static_cast<int64_t>(scan.points.size()) - scan.NumMissing());
}

TEST_F(E57Written, PhotosComeBackWithCameraAndPose) {
  E57Writer writer(Path());
  Scan far = MadeRoom(20, 10, {Eigen::Quaterniond::Identity(), {100, 0, 0}});
  far.name = "far <&> ]]> \x01";
  writer.AddScan(far, nullptr);
  writer.AddScan(MadeRoom(20, 10, Rigid()), nullptr);
  Camera pinhole;
  pinhole.model = CameraModel::kPinhole;
  pinhole.width = 64, pinhole.height = 48;
  pinhole.params = {50, 51, 31, 25.5};
  Camera panorama;
  panorama.model = CameraModel::kEquirectangular;
  panorama.width = 64, panorama.height = 32;
  panorama.params = {64, 32};
  const Rigid pose{Eigen::Quaterniond(0.7, 0.3, -0.4, 0.5).normalized(), {1, -2, 3}};
  const auto png = [](int width, int height) {
    std::vector<uchar> bytes;
    cv::imencode(".png", cv::Mat(height, width, CV_8UC3, cv::Scalar(1, 2, 3)), bytes);
    return std::string(bytes.begin(), bytes.end());
  };
  writer.AddPhoto({"a.jpg", png(64, 48), pinhole, pose});
  writer.AddPhoto({"b.jpg", png(64, 32), panorama, pose});
  writer.Commit();
  const E57Pages pages(Path(), true);
  const E57Document document = ReadE57Document(pages);
  EXPECT_EQ(document.scans[0].name, "far <&> ]]_ ?");
  ASSERT_THAT(document.images, SizeIs(2));
  EXPECT_EQ(document.images[0].scan_guid, document.scans[1].guid);
  EXPECT_NE(document.images[0].guid, document.images[1].guid);
  EXPECT_NE(document.scans[0].guid, document.scans[1].guid);
  Progress quiet(true);
  const E57Photos photos = ExtractE57Images(Path(), folder_ / "photos", {}, &quiet);
  ASSERT_THAT(photos.posed, SizeIs(2));
  EXPECT_EQ(photos.posed[0].name, "a.png");
  for (int i = 0; i < 2; ++i) {
    EXPECT_THAT(photos.posed[i].cam_from_scan, IsNearRigid(pose, 1e-12, 1e-12));
    const Camera& was = i == 0 ? pinhole : panorama;
    EXPECT_EQ(photos.posed[i].camera.model, was.model);
    for (size_t k = 0; k < was.params.size(); ++k) {
      EXPECT_NEAR(photos.posed[i].camera.params[k], was.params[k], 1e-9);
    }
  }
}

// RTPI: x right, y up, z backward. In an E57 z is up.
TEST_F(E57Written, ScansWithAnotherUpAxisAreTurned) {
  const Scan upright = MadeRoom(60, 30, Pose());
  const Eigen::Quaterniond scan_from_file(
      Eigen::AngleAxisd(-kPi / 2, Eigen::Vector3d::UnitX()));  // z becomes y
  const Rigid turned{scan_from_file, Eigen::Vector3d::Zero()};
  Scan scan = upright;
  scan.up = Eigen::Vector3d::UnitY();
  scan.scan_from_station = turned * Pose() * turned.Inverse();
  for (Eigen::Vector3d& point : scan.points) point = scan_from_file * point;
  Camera camera;
  camera.width = 64, camera.height = 48;
  camera.params = {50, 50, 32, 24};
  const Rigid cam_from_file{Eigen::Quaterniond(0.7, 0.3, -0.4, 0.5).normalized(), {1, -2, 3}};
  E57Writer writer(Path());
  writer.AddScan(scan, nullptr);
  writer.AddPhoto({"a", "no picture", camera, cam_from_file * turned.Inverse()});
  writer.Commit();
  const Scan again = ReadScan(Path(), {});
  ASSERT_EQ(again.num_rows, 30);
  EXPECT_THAT(again.scan_from_station, IsNearRigid(Pose(), 1e-12, 1e-9));
  for (size_t i = 0; i < upright.points.size(); ++i) {
    ASSERT_EQ(again.IsMissing(static_cast<int>(i)), upright.IsMissing(static_cast<int>(i)));
    if (upright.IsMissing(static_cast<int>(i))) continue;
    ASSERT_THAT(again.points[i], IsNearMatrix(upright.points[i], 1e-6));
  }
  const E57Document document = ReadE57Document(E57Pages(Path(), true));
  EXPECT_THAT(*document.images[0].file_from_camera,
              IsNearRigid(cam_from_file.Inverse() *
                              Rigid{Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()},
                          1e-12, 1e-9));
}

// Some programs (Rhino 8, FARO SCENE) do not read files with an index packet, or wrong pages.
TEST_F(E57Written, TheFileIsAsOtherReadersWantIt) {
  WriteE57({MadeRoom(100, 80, Pose())}, Path());
  const std::string bytes = ReadBytes(Path());
  ASSERT_EQ(bytes.size() % 1024, 0u);
  EXPECT_EQ(LittleEndian<uint64_t>(&bytes[16]), bytes.size());
  EXPECT_EQ(LittleEndian<uint64_t>(&bytes[40]), 1024u);
  EXPECT_EQ(bytes[48], 1);
  EXPECT_EQ(LittleEndian<uint64_t>(&bytes[64]), 80u);  // the data, right behind the header
  EXPECT_EQ(LittleEndian<uint64_t>(&bytes[72]), 0u);   // no index
  for (const char* part : {"<indexBounds", "<rowMaximum type=\"Integer\">79<", "<intensityLimits",
                           "<cartesianBounds", "<codecs", "<images2D"}) {
    EXPECT_THAT(bytes, HasSubstr(part));
  }
}

TEST_F(E57Written, OtherFormatsBecomeE57AndBack) {
  const Scan scan = MadeRoom(30, 20, Rigid());
  WriteScan(scan, {}, Path());
  EXPECT_EQ(ReadScanFile(Path(), {}).format, "E57");
  const Scan again = ReadScan(Path(), {});
  WriteScan(again, {}, folder_ / "room.ptx");
  const Scan ptx = ReadScan(folder_ / "room.ptx", {});
  for (size_t i = 0; i < scan.points.size(); ++i) {
    ASSERT_EQ(ptx.IsMissing(static_cast<int>(i)), scan.IsMissing(static_cast<int>(i)));
    if (scan.IsMissing(static_cast<int>(i))) continue;
    ASSERT_THAT(ptx.points[i], IsNearMatrix(scan.points[i], 2e-6));
  }
  Scan mesh = scan;
  mesh.organised = false;
  mesh.triangles = {{0, 1, 30}};
  EXPECT_INPUT_ERROR(WriteScan(mesh, {}, Path()), "without a grid");
}

}  // namespace
}  // namespace roomtex
