// What is written and reported about the planes of a scan.

#include <array>
#include <cstring>
#include <map>
#include <set>

#include <gmock/gmock.h>

#include "align/surface/scan_planes_report.h"
#include "core/report.h"
#include "tests/align/case_folder.h"
#include "tests/align/trust/scanned_room.h"
#include "tests/support/matchers.h"
#include "tests/support/ply_vertices.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using Eigen::Vector3d;

TEST(ScanPlanesPly, ColoursEverySampleByItsPlane) {
  const ScannedRoom& room = FurnishedRoom();
  const TempFolder folder;
  WriteScanPlanes(folder / "planes.ply", room.scans, PlanesOfFurnishedRoom(), -1);
  const std::string bytes = ReadBytes(folder / "planes.ply");
  const PlyVertices vertices = ParsePlyVertices(bytes, "planes.ply");
  const Scan& scan = room.scans[0];
  ASSERT_EQ(vertices.points.size(), scan.points.size() - scan.NumMissing());
  EXPECT_THAT(bytes, testing::HasSubstr("property float nx"));
  EXPECT_THAT(bytes, testing::HasSubstr("property int plane\nend_header\n"));
  const char* vertex = bytes.data() + bytes.find("end_header\n") + 11;
  const Rigid room_from_scan = room.scan_from_room.Inverse();
  std::map<int, Eigen::Matrix<uint8_t, 3, 1>> color_of_plane;
  int num_on_plane = 0, num_on_floor = 0, num_wrong = 0;
  for (size_t i = 0; i < vertices.points.size(); ++i, vertex += 31) {
    int32_t plane;
    std::memcpy(&plane, vertex + 27, 4);
    ASSERT_LT(plane, static_cast<int>(PlanesOfFurnishedRoom().size()));
    const auto [at, is_new] = color_of_plane.try_emplace(plane, vertices.colors[i]);
    ASSERT_EQ(at->second, vertices.colors[i]);
    Eigen::Vector3f normal;
    std::memcpy(normal.data(), vertex + 15, 12);
    ASSERT_NEAR(normal.norm(), plane < 0 ? 0 : 1, 1e-6);
    num_on_plane += plane >= 0;
    const Vector3d x_in_room = room_from_scan * vertices.points[i].cast<double>();
    if (plane < 0 || std::abs(x_in_room.z()) > 0.002) continue;
    ++num_on_floor;
    num_wrong += normal.y() < 0.9;
  }
  EXPECT_EQ(color_of_plane.at(-1), (Eigen::Matrix<uint8_t, 3, 1>::Constant(128)));
  EXPECT_EQ(color_of_plane.size(), PlanesOfFurnishedRoom().size() + 1);
  std::set<std::array<uint8_t, 3>> distinct;
  for (const auto& [plane, color] : color_of_plane) distinct.insert({color[0], color[1], color[2]});
  EXPECT_EQ(distinct.size(), color_of_plane.size());
  EXPECT_GT(num_on_plane, 0.8 * static_cast<double>(vertices.points.size()));
  EXPECT_GT(num_on_floor, 10000);
  EXPECT_LT(num_wrong, 0.02 * num_on_floor);
}

TEST(ScanPlanesPly, KeepsMillimetresOfGeoreferencedScans) {
  Scan mesh;
  mesh.organised = false;
  mesh.num_rows = 1;
  mesh.points = {
      {500000.001, 4000000.002, 100.003}, {500002, 4000000, 100}, {500000, 4000002, 100}};
  mesh.num_columns = 3;
  mesh.triangles = {{0, 1, 2}};
  const std::vector<ScanPlane> planes = FindScanPlanes({mesh}, ScanPlaneOptions(), -1);
  ASSERT_EQ(planes.size(), 1u);
  EXPECT_NEAR(planes[0].area_m2, 2, 0.05);
  EXPECT_NEAR(std::abs(planes[0].normal.z()), 1, 1e-5);
  EXPECT_NEAR(planes[0].Distance(mesh.points[0]), 0, 1e-5);
  const TempFolder folder;
  WriteScanPlanes(folder / "planes.ply", {mesh}, planes, -1);
  const std::string bytes = ReadBytes(folder / "planes.ply");
  ASSERT_THAT(bytes, testing::HasSubstr("comment add 500001 4000001 100 for the scan frame\n"));
  const PlyVertices vertices = ParsePlyVertices(bytes, "planes.ply");
  const Vector3d x = vertices.points[0].cast<double>() + Vector3d(500001, 4000001, 100);
  EXPECT_THAT(x, IsNearMatrix(mesh.points[0], 1e-6));
}

TEST(ScanPlanesPly, RefusesAFolderThatDoesNotExist) {
  EXPECT_INPUT_ERROR(WriteScanPlanes("/nonexistent/planes.ply", {}, {}, -1), "cannot be written");
}

TEST(ScanPlanesReport, CountsTheSparsePointsOnAPlane) {
  ScanPlane plane;
  plane.normal = Vector3d::UnitZ();
  plane.u = Vector3d::UnitX();
  plane.v = Vector3d::UnitY();
  plane.rms = 0.002;
  plane.cell_size = 1;
  plane.covered.setOnes(1, 1);
  SparseModel model;
  const auto add = [&](const Vector3d& x) { model.points[model.points.size()].x_in_model = x; };
  add({0.5, 0.5, 0.005});
  add({0.5, 0.5, -0.0055});
  add({0.5, 0.5, 0.0065});
  add({5, 5, 0});
  EXPECT_EQ(CountPointsOnPlane(plane, model), 2);
  plane.rms = 0.1;  // 1 cm at most
  EXPECT_EQ(CountPointsOnPlane(plane, model), 3);
  const Json json = ScanPlanesToJson({plane}, model);
  EXPECT_EQ(json[0]["num_points"], 3);
  EXPECT_EQ(json[0]["normal"], (Json{0.0, 0.0, 1.0}));
}

TEST(ScanPlanesCommand, ReportsAndWritesThePlanes) {
  const CaseFolder files(MakeCase());
  const std::string ply = files.folder / "planes.ply";
  const CommandResult result = files.Align("--Plane.output_path " + ply);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  ASSERT_GT(report["planes"].size(), 10u);
  int num_points = 0;
  for (const Json& plane : report["planes"]) {
    for (const char* key : {"normal", "point", "area_m2", "num_samples", "num_points", "rms_m"}) {
      EXPECT_TRUE(plane.contains(key)) << key;
    }
    num_points += plane["num_points"].get<int>();
  }
  EXPECT_GT(report["planes"][0]["area_m2"], report["planes"][1]["area_m2"]);
  EXPECT_GT(num_points, 0.3 * static_cast<double>(MakeCase().model.points.size()));
  EXPECT_GT(ParsePlyVertices(ReadBytes(ply), ply).points.size(), 200000u);
  // Without the constraint planes are looked for only when they are to be written.
  ASSERT_EQ(files.Align("--plane_constrained 0 --Plane.min_area_m2 3 --Plane.output_path " + ply)
                .exit_code,
            0);
  const Json picked = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_EQ(picked["planes"].size(), 6u);
}

TEST(ScanPlanesCommand, RefusesOptionsThatMakeNoSense) {
  const CaseFolder files(MakeCase());
  const CommandResult result = files.Align("--Plane.max_distance -1");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, testing::HasSubstr("--Plane.max_distance must be positive"));
  EXPECT_EQ(files.Align("--Plane.output_path /nonexistent/planes.ply").exit_code, 3);
}

}  // namespace
}  // namespace roomtex
