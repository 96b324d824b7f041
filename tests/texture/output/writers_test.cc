#include <cstring>
#include <filesystem>
#include <map>
#include <sstream>
#include <utility>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "importers/obj.h"
#include "importers/ply.h"
#include "tests/support/ply_vertices.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/load_glb.h"
#include "tests/texture/sampling/two_walls.h"
#include "texture/output/decimate_parts.h"
#include "texture/output/textured_parts.h"
#include "texture/output/write_glb.h"
#include "texture/output/write_obj.h"
#include "texture/output/write_ply.h"
#include "texture/output/write_texture.h"
#include "texture/output/write_web_glb.h"
#include "texture/render/mesh_renderer.h"
#include "texture/texels/gutters.h"

namespace roomtex {
namespace {

// A scan whose colours tell their grid cell: red = column, green = row.
ColoredScan ColorByCell(const Scan& scan) {
  ColoredScan colored;
  colored.triangles = BuildScanMesh(scan, ScanMeshOptions());
  colored.samples.num_columns = scan.num_columns;
  colored.samples.num_rows = scan.num_rows;
  for (int row = 0; row < scan.num_rows; ++row) {
    for (int column = 0; column < scan.num_columns; ++column) {
      colored.samples.rgb.push_back(
          {static_cast<uint8_t>(column), static_cast<uint8_t>(row), uint8_t{77}});
      colored.samples.views.push_back(static_cast<uint8_t>(1 + column % 3));
    }
  }
  return colored;
}

// A mesh without a texture: its colours stand at its vertices.
std::pair<Scan, ColoredScan> OneTriangle() {
  Scan mesh;
  mesh.organised = false;
  mesh.num_columns = 3;
  mesh.num_rows = 1;
  mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.up = Eigen::Vector3d::UnitZ();
  ColoredScan colored;
  colored.triangles = {{0, 1, 2}};
  colored.samples = {3, 1, {{255, 0, 51}, {0, 0, 0}, {1, 1, 1}}, {1, 1, 1}};
  return {mesh, colored};
}

Scan WallWithHole() {
  TwoWalls scene;
  scene.board_half = 0;
  Scan scan = scene.MakeScan(60, 40);
  scan.points[scan.Index(10, 10)] = Scan::MissingPoint();
  return scan;
}

template <typename T>
const T* Data(const tinygltf::Model& model, int accessor) {
  const tinygltf::BufferView& view = model.bufferViews[model.accessors[accessor].bufferView];
  return reinterpret_cast<const T*>(model.buffers[view.buffer].data.data() + view.byteOffset);
}

TEST(WriteColoredPly, ConcatenatesScansInGridOrder) {
  const TempFolder folder;
  const Scan scan = WallWithHole();
  const ColoredScan colored = ColorByCell(scan);
  WriteColoredPly({scan, scan}, {colored, colored}, folder / "two.ply");
  const std::string bytes = ReadBytes(folder / "two.ply");
  const PlyVertices ply = ParsePlyVertices(bytes, "two.ply");
  ASSERT_EQ(ply.points.size(), 2u * (60 * 40 - 1));
  EXPECT_EQ(ply.colors[59].x(), 59);  // last of the first row
  const size_t second = 60 * 40 - 1;
  EXPECT_EQ(ply.points[second], ply.points[0]);
  EXPECT_EQ(ply.colors[second + 61].y(), 1);
  EXPECT_EQ(ply.views[second + 61], 2);
  EXPECT_NE(bytes.find("element face " + std::to_string(2 * colored.triangles.size())),
            std::string::npos);
  const size_t header = bytes.find("end_header\n") + 11;
  EXPECT_EQ(bytes.size(), header + ply.points.size() * 16 + 2 * colored.triangles.size() * 13);
}

TEST(WriteColoredPly, KeepsTheUpAxisForTheReader) {
  const TempFolder folder;
  Scan scan = WallWithHole();
  scan.up = Eigen::Vector3d(0, 0.6, 0.8);
  scan.scan_from_station.translation = Eigen::Vector3d(0.1, 0.2, 0.3);
  WriteColoredPly({scan}, {ColorByCell(scan)}, folder / "m.ply");
  const Scan again = ReadPly(folder / "m.ply", {});
  EXPECT_LT((again.up - scan.up).norm(), 1e-12);
  EXPECT_LT((again.Station() - scan.Station()).norm(), 1e-12);
}

TEST(WriteColoredPly, KeepsMillimetresOfGeoreferencedScans) {
  const TempFolder folder;
  Scan scan = WallWithHole();
  for (Eigen::Vector3d& p : scan.points) p += Eigen::Vector3d(500000, 5000000, 0);
  WriteColoredPly({scan}, {ColorByCell(scan)}, folder / "far.ply");
  const std::string bytes = ReadBytes(folder / "far.ply");
  ASSERT_NE(bytes.find("property double x"), std::string::npos);
  double x;
  std::memcpy(&x, bytes.data() + bytes.find("end_header\n") + 11, sizeof x);
  EXPECT_NEAR(x, scan.points[0].x(), 1e-9);
}

// Every vertex must find the colour of its own cell in the texture at its own coordinates.
void ExpectColorsAtVertices(const tinygltf::Model& model, const Scan& scan, size_t num_triangles) {
  size_t num_corners = 0;
  for (const tinygltf::Primitive& primitive : model.meshes.at(0).primitives) {
    const tinygltf::Material& material = model.materials.at(primitive.material);
    EXPECT_EQ(material.extensions.count("KHR_materials_unlit"), 1u);
    const tinygltf::Image& image = model.images.at(
        model.textures.at(material.pbrMetallicRoughness.baseColorTexture.index).source);
    const tinygltf::Accessor& positions = model.accessors.at(primitive.attributes.at("POSITION"));
    const float* xyz = Data<float>(model, primitive.attributes.at("POSITION"));
    const float* uv = Data<float>(model, primitive.attributes.at("TEXCOORD_0"));
    const uint32_t* corners = Data<uint32_t>(model, primitive.indices);
    const tinygltf::Accessor& indices = model.accessors.at(primitive.indices);
    EXPECT_EQ(indices.componentType, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT);
    for (size_t i = 0; i < indices.count; ++i) ASSERT_LT(corners[i], positions.count);
    num_corners += indices.count;
    const tinygltf::Node& node = model.nodes.at(1);
    const Eigen::Vector3d centre(node.translation[0], node.translation[1], node.translation[2]);
    for (size_t v = 0; v < positions.count; ++v) {
      for (int k = 0; k < 3; ++k) {
        EXPECT_GE(xyz[3 * v + k], positions.minValues[k]);
        EXPECT_LE(xyz[3 * v + k], positions.maxValues[k]);
      }
      const int x = static_cast<int>(uv[2 * v] * static_cast<float>(image.width));
      const int y = static_cast<int>(uv[2 * v + 1] * static_cast<float>(image.height));
      ASSERT_TRUE(x >= 0 && y >= 0 && x < image.width && y < image.height);
      const unsigned char* texel = &image.image[(y * image.width + x) * image.component];
      const Eigen::Vector3d point =
          centre + Eigen::Vector3d(xyz[3 * v], xyz[3 * v + 1], xyz[3 * v + 2]);
      ASSERT_LT((point - scan.points[scan.Index(texel[0], texel[1])]).norm(), 1e-5);
    }
  }
  EXPECT_EQ(num_corners, 3 * num_triangles);
}

TEST(WriteColoredGlb, VerticesFindTheirColorsInTheTexture) {
  const TempFolder folder;
  Scan scan = WallWithHole();
  const ColoredScan colored = ColorByCell(scan);
  WriteColoredGlb({scan}, {colored}, folder / "m.glb");
  const tinygltf::Model model = LoadGlb(folder / "m.glb");
  EXPECT_EQ(model.images.size(), 1u);
  ExpectColorsAtVertices(model, scan, colored.triangles.size());
}

TEST(WriteColoredGlb, SplitsLargeGridsIntoTexturesThatShareTheirBorders) {
  const TempFolder folder;
  Scan scan = WallWithHole();
  const ColoredScan colored = ColorByCell(scan);
  GlbOptions options;
  options.max_texture_size = 25;
  WriteColoredGlb({scan}, {colored}, folder / "m.glb", options);
  const tinygltf::Model model = LoadGlb(folder / "m.glb");
  EXPECT_EQ(model.images.size(), 6u);  // 59 quads of 24: 3 across; 39 of 24: 2 down
  for (const tinygltf::Image& image : model.images) {
    EXPECT_LE(image.width, 25);
    EXPECT_LE(image.height, 25);
  }
  ExpectColorsAtVertices(model, scan, colored.triangles.size());
}

// The triangles over a missing sample are two rows high, and one of them lies over each cut.
TEST(TexturedParts, TrianglesOverHolesFitWhereverACutIs) {
  TwoWalls scene;
  scene.board_half = 0;
  const Scan scan = scene.MakeScan(60, 40);
  ColoredScan colored = ColorByCell(scan);
  colored.triangles.clear();
  for (int row = 1; row + 1 < scan.num_rows; ++row) {
    const int column = 5 + row % 3;
    colored.triangles.push_back(
        {scan.Index(column, row - 1), scan.Index(column - 1, row), scan.Index(column, row + 1)});
  }
  for (const int max_size : {2, 3, 5, 8, 25}) {
    size_t num_corners = 0;
    for (const TexturedPart& part : MakeTexturedParts(scan, colored, max_size)) {
      num_corners += part.corners.size();
      for (size_t v = 0; v < part.vertices.size(); ++v) {
        EXPECT_NEAR(part.uv[v].y() * part.height,
                    part.vertices[v] / scan.num_columns - part.first_row + 0.5, 1e-4);
        EXPECT_LT(part.uv[v].y(), 1) << max_size;
      }
    }
    EXPECT_EQ(num_corners, 3 * colored.triangles.size());
  }
}

// A wall of 400 x 150 samples whose colours tell their cell; every cell as 2 x 2 texels.
struct LargeWall {
  Scan scan;
  ColoredScan colored;
  static Rgb ColorOf(int column, int row) {
    return {static_cast<uint8_t>(column % 200), static_cast<uint8_t>(row),
            static_cast<uint8_t>(100 + column / 200)};
  }
  LargeWall() {
    TwoWalls scene;
    scene.board_half = 0;
    scan = scene.MakeScan(400, 150);
    scan.points[scan.Index(130, 70)] = Scan::MissingPoint();
    colored.triangles = BuildScanMesh(scan, ScanMeshOptions());
    colored.texture.num_columns = 800;
    colored.texture.num_rows = 300;
    for (int row = 0; row < 300; ++row) {
      for (int column = 0; column < 800; ++column) {
        colored.texture.rgb.push_back(ColorOf(column / 2, row / 2));
      }
    }
  }
};

TEST(TexturedParts, NeighboursOverlapInStepsOfSixteenTexels) {
  const LargeWall wall;
  const std::vector<TexturedPart> parts = MakeTexturedParts(wall.scan, wall.colored, 256);
  EXPECT_EQ(parts.size(), 10u);  // 96 or fewer quads each: 5 across, 2 down
  size_t num_corners = 0;
  for (const TexturedPart& part : parts) {
    num_corners += part.corners.size();
    EXPECT_LE(part.width, 256);
    EXPECT_LE(part.height, 256);
    for (const int length : {part.width, part.height, part.first_column, part.first_row}) {
      EXPECT_EQ(length % 16, 0);
    }
    const cv::Mat3b image = PartImage(wall.scan, wall.colored, part);
    ASSERT_EQ(image.size(), cv::Size(part.width, part.height));
    for (size_t v = 0; v < part.vertices.size(); ++v) {
      const int column = part.vertices[v] % 400, row = part.vertices[v] / 400;
      // A sample's centre lies on the corner that its four texels share.
      const auto x = static_cast<int>(std::lround(part.uv[v].x() * part.width));
      const auto y = static_cast<int>(std::lround(part.uv[v].y() * part.height));
      const Rgb want = LargeWall::ColorOf(column, row);
      // Sixteen samples around it are there for filters, as far as the grid reaches.
      for (const int far : {-1, 0, -30, 30}) {
        const int ix = x + far, iy = y + far;
        ASSERT_TRUE(ix >= 0 && iy >= 0 && ix < part.width && iy < part.height) << far;
        const cv::Vec3b have = image(iy, ix);
        if (far == 0 || far == -1) {
          ASSERT_EQ(have, cv::Vec3b(want[2], want[1], want[0]));
        } else if (row > 16 && row < 132) {
          ASSERT_NEAR(have[1], row + far / 2, 1);  // 1: at the hole
        }
      }
    }
  }
  EXPECT_EQ(num_corners, 3 * wall.colored.triangles.size());
}

TEST(TexturedParts, HolesArePaintedLikeTheirNeighbours) {
  const LargeWall wall;
  for (const TexturedPart& part : MakeTexturedParts(wall.scan, wall.colored, 4096)) {
    EXPECT_EQ(part.width, 802);  // room for the first column to stand again behind the last
    const cv::Mat3b image = PartImage(wall.scan, wall.colored, part);
    for (int y = 140; y < 142; ++y) {
      for (int x = 260; x < 262; ++x) {
        EXPECT_NEAR(image(y, x)[2], 130, 1);
        EXPECT_NEAR(image(y, x)[1], 70, 1);
      }
    }
  }
}

double AreaOf(const Scan& scan, const std::vector<TexturedPart>& parts) {
  double area = 0;
  for (const TexturedPart& part : parts) {
    for (size_t i = 0; i < part.corners.size(); i += 3) {
      const auto at = [&](size_t k) { return scan.points[part.vertices[part.corners[i + k]]]; };
      area += 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
    }
  }
  return area;
}

// A flat wall with a hole, cut into ten images: wherever a gap opened or triangles overlapped, its
// area would be another one.
TEST(DecimateParts, LeavesAsManyAsWantedWithoutGapsAndColoursInPlace) {
  const LargeWall wall;
  std::vector<std::vector<TexturedPart>> parts = MakeMeshParts({wall.scan}, {wall.colored}, 256);
  const double area = AreaOf(wall.scan, parts[0]);
  ASSERT_GT(CountTriangles(parts), 100000u);
  DecimateParts({wall.scan}, 5000, 2, &parts);
  EXPECT_LE(CountTriangles(parts), 5000u);
  EXPECT_GT(CountTriangles(parts), 3000u);
  EXPECT_EQ(parts[0].size(), 10u);
  EXPECT_NEAR(AreaOf(wall.scan, parts[0]), area, 1e-4 * area);
  for (const TexturedPart& part : parts[0]) {
    const cv::Mat3b image = PartImage(wall.scan, wall.colored, part);
    for (size_t v = 0; v < part.vertices.size(); ++v) {
      const Rgb want = LargeWall::ColorOf(part.vertices[v] % 400, part.vertices[v] / 400);
      const auto x = static_cast<int>(std::lround(part.uv[v].x() * part.width));
      const auto y = static_cast<int>(std::lround(part.uv[v].y() * part.height));
      ASSERT_EQ(image(y, x), cv::Vec3b(want[2], want[1], want[0]));
    }
  }
}

TEST(DecimateParts, ASmallMeshBesideALargeScanStaysAsItIs) {
  const LargeWall wall;
  const auto& [mesh, colored] = OneTriangle();
  std::vector<std::vector<TexturedPart>> parts =
      MakeMeshParts({wall.scan, mesh}, {wall.colored, colored}, 256);
  DecimateParts({wall.scan, mesh}, 5000, 2, &parts);
  EXPECT_LE(CountTriangles(parts), 5000u);
  EXPECT_GT(CountTriangles(parts), 3000u);
  EXPECT_EQ(CountTriangles({parts[1]}), 1u);
}

TEST(WriteWebGlb, ThePictureIsThatOfTheWholeMesh) {
  const TempFolder folder;
  Scan scan = WallWithHole();
  for (Eigen::Vector3d& p : scan.points) p += Eigen::Vector3d(500000, 5000000, 100);
  const ColoredScan colored = ColorByCell(scan);
  WriteColoredGlb({scan}, {colored}, folder / "full.glb");
  const ColoredMesh full = ReadTexturedMesh(folder / "full.glb");
  for (const char* compression : {"meshopt", "none"}) {
    WebOptions options;
    options.compression = compression;
    WriteWebGlb({scan}, {colored}, MakeMeshParts({scan}, {colored}, 4096), folder / "web.glb",
                options);
    const ColoredMesh web = ReadTexturedMesh(folder / "web.glb");
    ASSERT_EQ(web.points.size(), full.points.size());
    ASSERT_EQ(web.triangles.size(), full.triangles.size());
    ASSERT_EQ(web.textures.size(), 1u);
    EXPECT_EQ(web.textures[0].size(), full.textures[0].size());
    // By their texture coordinates, as the order is another one.
    std::map<std::pair<int, int>, Eigen::Vector3d> place_of;
    const auto cell = [](const Eigen::Vector2f& uv) {
      return std::pair{static_cast<int>(uv.x() * 61), static_cast<int>(uv.y() * 40)};
    };
    for (size_t i = 0; i < full.points.size(); ++i) place_of[cell(full.uv[i])] = full.points[i];
    for (size_t i = 0; i < web.points.size(); ++i) {
      ASSERT_LT((web.points[i] - place_of.at(cell(web.uv[i]))).norm(), 1e-3);
    }
  }
}

TEST(WriteWebGlb, ABrokenViewIsRefused) {
  const TempFolder folder;
  const Scan scan = WallWithHole();
  const ColoredScan colored = ColorByCell(scan);
  WriteWebGlb({scan}, {colored}, MakeMeshParts({scan}, {colored}, 4096), folder / "web.glb");
  std::string bytes = ReadBytes(folder / "web.glb");
  bytes.replace(bytes.find("\"count\":"), 10, "\"count\":9e9");
  WriteBytes(folder / "huge.glb", bytes);
  EXPECT_THROW(ReadTexturedMesh(folder / "huge.glb"), InputError);
}

TEST(WriteColoredPly, WritesNormalsTowardsTheScanner) {
  const TempFolder folder;
  const Scan scan = WallWithHole();
  const ColoredScan colored = ColorByCell(scan);
  WriteColoredPly({scan}, {colored}, folder / "n.ply", true);
  const std::string bytes = ReadBytes(folder / "n.ply");
  const size_t header = bytes.find("end_header\n") + 11;
  EXPECT_NE(bytes.find("property uchar views\nproperty float nx\n"), std::string::npos);
  ASSERT_EQ(bytes.size(), header + 28 * (scan.points.size() - 1) + 13 * colored.triangles.size());
  Eigen::Vector3f normal;
  std::memcpy(normal.data(), bytes.data() + header + 16, sizeof normal);
  EXPECT_NEAR(normal.norm(), 1, 1e-5);
  const Eigen::Vector3d to_scanner = scan.Station() - scan.points[0];
  EXPECT_GT(normal.cast<double>().dot(to_scanner), 0);
}

TEST(WriteColoredGlb, KeepsMillimetresOfGeoreferencedScans) {
  const TempFolder folder;
  Scan scan = WallWithHole();
  for (Eigen::Vector3d& p : scan.points) p += Eigen::Vector3d(500000, 5000000, 100);
  scan.scan_from_station.translation = Eigen::Vector3d(500000, 5000000, 100);
  const ColoredScan colored = ColorByCell(scan);
  WriteColoredGlb({scan}, {colored}, folder / "m.glb");
  ExpectColorsAtVertices(LoadGlb(folder / "m.glb"), scan, colored.triangles.size());
}

TEST(WriteColoredGlb, ScanWithoutTrianglesIsStillAFile) {
  const TempFolder folder;
  Scan scan;
  scan.num_columns = scan.num_rows = 1;
  scan.points = {Eigen::Vector3d(1, 2, 3)};
  scan.intensity = {0};
  WriteColoredGlb({scan}, {ColorByCell(scan)}, folder / "m.glb");
  EXPECT_TRUE(LoadGlb(folder / "m.glb").meshes.empty());
}

// Every corner of every face must find the colour of its own cell in the image of its material.
TEST(WriteColoredObj, CornersFindTheirColorsAndTheMeshIsTheSame) {
  const TempFolder folder;
  std::filesystem::create_directories(folder / "with spaces");
  const LargeWall wall;
  WriteColoredObj({wall.scan}, {wall.colored}, MakeMeshParts({wall.scan}, {wall.colored}, 512),
                  false, [&](const std::string& name) { return folder / ("with spaces/" + name); });
  const std::string obj = ReadBytes(folder / "with spaces/model.obj");
  EXPECT_NE(obj.find("the up axis stays the scan's"), std::string::npos);
  std::map<std::string, cv::Mat3b> images;  // by material
  std::istringstream mtl(ReadBytes(folder / "with spaces/model.mtl"));
  std::string word, material;
  while (mtl >> word) {
    if (word == "newmtl") mtl >> material;
    if (word != "map_Kd") continue;
    mtl >> word;
    images[material] = cv::imread(folder / ("with spaces/" + word));
  }
  EXPECT_EQ(images.size(), 2u);
  std::vector<int> cell_of;  // measured samples in grid order
  for (int i = 0; i < static_cast<int>(wall.scan.points.size()); ++i) {
    if (!wall.scan.IsMissing(i)) cell_of.push_back(i);
  }
  std::vector<Eigen::Vector2d> uv;
  std::istringstream lines(obj);
  std::string line;
  size_t num_faces = 0;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    words >> word;
    if (word == "usemtl") words >> material;
    if (word == "vt") {
      Eigen::Vector2d at;
      words >> at[0] >> at[1];
      uv.push_back(at);
    }
    if (word != "f") continue;
    ++num_faces;
    const cv::Mat3b& image = images.at(material);
    for (int k = 0; k < 3; ++k) {
      size_t vertex, number;
      char slash;
      words >> vertex >> slash >> number;
      const Eigen::Vector2d at = uv.at(number - 1);
      const auto x = static_cast<int>(std::lround(at.x() * image.cols));
      const auto y = static_cast<int>(std::lround((1 - at.y()) * image.rows));
      const int cell = cell_of.at(vertex - 1);
      const Rgb want = LargeWall::ColorOf(cell % 400, cell / 400);
      ASSERT_EQ(image(y, x), cv::Vec3b(want[2], want[1], want[0])) << line;
    }
  }
  EXPECT_EQ(num_faces, wall.colored.triangles.size());
  const Scan again = ReadObj(folder / "with spaces/model.obj", {});
  EXPECT_EQ(again.up, wall.scan.up);
  ASSERT_EQ(again.points.size(), cell_of.size());
  for (size_t i = 0; i < cell_of.size(); ++i) {
    ASSERT_LT((again.points[i] - wall.scan.points[cell_of[i]]).norm(), 2e-6);
  }
}

TEST(WriteColoredObj, MeshesWithoutATextureHaveTheirColorsAtTheVertices) {
  const TempFolder folder;
  const auto& [mesh, colored] = OneTriangle();
  WriteColoredObj({mesh, mesh}, {colored, colored},
                  MakeMeshParts({mesh, mesh}, {colored, colored}, 4096), false,
                  [&](const std::string& name) { return folder / name; });
  const std::string obj = ReadBytes(folder / "model.obj");
  EXPECT_NE(obj.find("v 0.000000 0.000000 0.000000 1.0000 0.0000 0.2000\n"), std::string::npos);
  EXPECT_NE(obj.find("f 1 2 3\n"), std::string::npos);
  EXPECT_NE(obj.find("f 4 5 6\n"), std::string::npos);  // the second scan
  EXPECT_EQ(obj.find("usemtl model"), std::string::npos);
}

TEST(WriteColoredObj, AMeshBehindATexturedScanDoesNotTakeItsMaterial) {
  const TempFolder folder;
  const LargeWall wall;
  const auto& [mesh, colored] = OneTriangle();
  Scan cloud = mesh;
  ColoredScan points = colored;
  points.triangles.clear();
  const std::vector<Scan> scans = {wall.scan, mesh, cloud};
  const std::vector<ColoredScan> all = {wall.colored, colored, points};
  WriteColoredObj(scans, all, MakeMeshParts(scans, all, 512), false,
                  [&](const std::string& name) { return folder / name; });
  const std::string obj = ReadBytes(folder / "model.obj");
  const size_t second = obj.find("o scan_1\n"), third = obj.find("o scan_2\n");
  ASSERT_TRUE(second != std::string::npos && third != std::string::npos);
  const std::string of_mesh = obj.substr(second, third - second);
  EXPECT_NE(of_mesh.find("usemtl vertex_colors\nf "), std::string::npos) << of_mesh;
  EXPECT_NE(ReadBytes(folder / "model.mtl").find("newmtl vertex_colors\n"), std::string::npos);
  // A cloud has its points.
  EXPECT_NE(obj.find("v 1.000000 0.000000 0.000000 0.0000 0.0000 0.0000\n", third),
            std::string::npos);
}

TEST(PaintGutters, TakesTheNearestKnownColor) {
  cv::Mat3b picture(5, 9, cv::Vec3b(0, 0, 0));
  cv::Mat1b known(5, 9, uint8_t{0});
  picture(2, 2) = {1, 2, 3};
  picture(2, 6) = {7, 8, 9};
  known(2, 2) = known(2, 6) = 1;
  cv::Mat image = picture;
  PaintGutters(known, 2, &image);
  EXPECT_EQ(image.at<cv::Vec3b>(2, 3), cv::Vec3b(1, 2, 3));
  EXPECT_EQ(image.at<cv::Vec3b>(1, 7), cv::Vec3b(7, 8, 9));
  EXPECT_EQ(image.at<cv::Vec3b>(2, 6), cv::Vec3b(7, 8, 9));
  EXPECT_EQ(image.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 0, 0));  // out of reach
}

TEST(WritePng, RefusesAFolderThatIsNotThere) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(WritePng(cv::Mat3b(2, 2), folder / "none/x.png"), "cannot be written");
}

}  // namespace
}  // namespace roomtex
