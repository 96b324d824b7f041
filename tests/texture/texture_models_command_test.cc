// What roomtex-texture writes besides the coloured grid: other formats, clouds, meshes, stations.

#include <cstdio>

#include <opencv2/imgcodecs.hpp>

#include "importers/e57_images.h"
#include "importers/e57_records.h"
#include "importers/scan_writer.h"
#include "tests/texture/load_glb.h"
#include "tests/texture/texture_command.h"

namespace roomtex {
namespace {

TEST_F(TextureCommand, GlbLoadsInAStandardReader) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const tinygltf::Model model = LoadGlb(Path("textured/model.glb"));
  ASSERT_EQ(model.images.size(), 1u);
  // The scan is a full turn: the first column stands again behind the last one, to close the seam.
  EXPECT_EQ(model.images[0].width, 501);
  EXPECT_EQ(model.images[0].height, 190);
  ASSERT_EQ(model.materials.size(), 1u);
  EXPECT_EQ(model.materials[0].extensions.count("KHR_materials_unlit"), 1u);
  ASSERT_EQ(model.scenes.at(model.defaultScene).nodes.size(), 1u);
  // RTPI is y up already: the root node turns nothing.
  const tinygltf::Node& root = model.nodes.at(model.scenes[model.defaultScene].nodes[0]);
  if (!root.rotation.empty()) {
    EXPECT_NEAR(std::abs(root.rotation.at(3)), 1.0, 1e-9);
  }
  const tinygltf::Primitive& primitive = model.meshes.at(0).primitives.at(0);
  const tinygltf::Accessor& positions = model.accessors.at(primitive.attributes.at("POSITION"));
  ASSERT_EQ(positions.minValues.size(), 3u);
  const Bounds bounds = FindBounds(ReadCaptureScan());
  // The positions lie about the node's place.
  ASSERT_EQ(root.children.size(), 1u);
  const std::vector<double>& place = model.nodes.at(root.children[0]).translation;
  ASSERT_EQ(place.size(), 3u);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(place[k] + positions.minValues[k], bounds.min[k], 1e-5);
    EXPECT_NEAR(place[k] + positions.maxValues[k], bounds.max[k], 1e-5);
  }
  EXPECT_EQ(primitive.attributes.count("TEXCOORD_0"), 1u);
}

TEST_F(TextureCommand, RootNodeTurnsAZUpScan) {
  Scan scan = ReadCaptureScan();
  for (Eigen::Vector3d& p : scan.points) p = Eigen::Vector3d(p.x(), -p.z(), p.y());
  scan.up = Eigen::Vector3d::UnitZ();
  scan.is_rtpi = false;
  WriteScan(scan, {}, Path("z_up.ptx"));
  // The photos' poses do not fit the turned scan, so the answer is not trusted; the file is
  // written.
  Texture("turned", "", Path("z_up.ptx"));
  const tinygltf::Model model = LoadGlb(Path("turned/model.glb"));
  const tinygltf::Node& root = model.nodes.at(model.scenes.at(model.defaultScene).nodes.at(0));
  ASSERT_EQ(root.rotation.size(), 4u);
  const Eigen::Quaterniond turn(root.rotation[3], root.rotation[0], root.rotation[1],
                                root.rotation[2]);
  EXPECT_LT((turn * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitY()).norm(), 1e-6);
  EXPECT_FALSE(fs::exists(Path("turned/model.rtpi")));
}

TEST_F(TextureCommand, ColouredRtpiHoldsTheSameScan) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const Scan before = ReadCaptureScan();
  const Scan after = ReadScan(Path("textured/model.rtpi"), {});
  EXPECT_NE(ReadBytes(Path("textured/model.rtpi")).find("# has_color: yes"), std::string::npos);
  ASSERT_EQ(after.points.size(), before.points.size());
  for (size_t i = 0; i < before.points.size(); ++i) {
    ASSERT_EQ(after.IsMissing(static_cast<int>(i)), before.IsMissing(static_cast<int>(i)));
    if (before.IsMissing(static_cast<int>(i))) continue;
    ASSERT_EQ(after.points[i], before.points[i]);
  }
}

// The same points without their grid; the second time without the station, too.
TEST_F(TextureCommand, ACloudIsColouredPointByPoint) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const PlyVertices truth = ReadPly(Capture() + "/truth/true_colors.ply");
  const double psnr_of_grid = Psnr(ReadPly(Path("textured/model.ply")), truth);
  Scan scan = ReadCaptureScan();
  scan.up = Eigen::Vector3d::UnitZ();  // about it the angles show no grid
  for (int i = 0; i < 2; ++i) {        // the second time the station has to be found
    WriteScan(scan, {}, Path("cloud.ply"));
    const std::string select = i == 0 ? "" : " --Blend.mode select";  // needs neighbours: no effect
    const CommandResult result = Texture("cloud", "--output_e57 1" + select, Path("cloud.ply"));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const std::string warnings = ReadJson(Path("cloud/report.json"))["warnings"].dump();
    EXPECT_EQ(warnings.find("--Blend.mode") != std::string::npos, i == 1) << warnings;
    const PlyVertices model = ReadPly(Path("cloud/model.ply"));
    ScanReaderOptions with_colors;
    with_colors.colors = true;
    const Scan e57 = ReadScan(Path("cloud/model.e57"), with_colors);
    EXPECT_EQ(e57.points.size() - static_cast<size_t>(e57.NumMissing()), model.points.size());
    EXPECT_EQ(e57.colors.size(), e57.points.size());
    ASSERT_EQ(model.points.size(), truth.points.size());
    EXPECT_GT(Psnr(model, truth), psnr_of_grid - 1.5);
    EXPECT_GT(ReadJson(Path("cloud/report.json"))["coverage"],
              0.95 * ReadJson(Path("textured/report.json"))["coverage"].get<double>());
    scan.scan_from_station.translation = {50, 0, 0};
  }
  EXPECT_FALSE(fs::exists(Path("cloud/texture.png")));
  const tinygltf::Model model = LoadGlb(Path("cloud/model.glb"));
  const tinygltf::Primitive& primitive = model.meshes.at(0).primitives.at(0);
  EXPECT_EQ(primitive.mode, TINYGLTF_MODE_POINTS);
  EXPECT_EQ(model.accessors.at(primitive.attributes.at("COLOR_0")).count, truth.points.size());
}

TEST_F(TextureCommand, MeshWithoutAGridGetsVertexColoursOnly) {
  const Scan scan = ReadCaptureScan();
  WriteScan(scan, BuildScanMesh(scan, ScanMeshOptions()), Path("room.ply"));
  const CommandResult result = Texture("mesh", "", Path("room.ply"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_FALSE(fs::exists(Path("mesh/texture.png")));
  EXPECT_FALSE(fs::exists(Path("mesh/model.rtpi")));
  const PlyVertices mesh = ReadPly(Path("mesh/model.ply"));
  EXPECT_EQ(mesh.points.size(), scan.points.size() - scan.NumMissing());
  EXPECT_GT(Psnr(mesh, ReadPly(Capture() + "/truth/true_colors.ply")), 23.0);
  const tinygltf::Model model = LoadGlb(Path("mesh/model.glb"));
  EXPECT_EQ(model.meshes.at(0).primitives.at(0).attributes.count("COLOR_0"), 1u);

  // Decimated, its colours are in a texture, as fine as the photos.
  const CommandResult fewer =
      Texture("fewer", "--Texture.scale auto --Mesh.max_triangles 3000 --Mesh.compression none",
              Path("room.ply"));
  ASSERT_EQ(fewer.exit_code, 0) << fewer.err;
  EXPECT_EQ(ReadPly(Path("fewer/model.ply")).points.size(), mesh.points.size());
  const tinygltf::Model web = LoadGlb(Path("fewer/model_web.glb"));
  ASSERT_FALSE(web.images.empty());
  size_t num_texels = 0, num_triangles = 0;
  for (const tinygltf::Image& image : web.images) {
    num_texels += static_cast<size_t>(image.width) * static_cast<size_t>(image.height);
  }
  for (const tinygltf::Primitive& part : web.meshes.at(0).primitives) {
    EXPECT_EQ(part.attributes.count("TEXCOORD_0"), 1u);
    num_triangles += web.accessors.at(static_cast<size_t>(part.indices)).count / 3;
  }
  EXPECT_GT(num_texels, mesh.points.size());
  EXPECT_LT(num_triangles, 10000u);
}

// The bare walls of the room as a mesh of twelve triangles that look outwards, as CAD models do.
std::string BoxOfRoom(const SimulatedRoom& room) {
  const SimulatedRoomOptions& o = room.options();
  std::ostringstream obj;
  obj << "# roomtex up 0 1 0\n";
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner(o.width * (i & 1), o.depth * (i >> 1 & 1), o.height * (i >> 2));
    obj << "v " << (room.ScanFromRoom() * corner).transpose() << "\n";
  }
  obj << "f 3 4 2 1\nf 6 8 7 5\nf 2 6 5 1\nf 7 8 4 3\nf 5 7 3 1\nf 4 8 6 2\nf 1 1 2\n";
  return obj.str();
}

TEST_F(TextureCommand, AMeshOfFewTrianglesGetsAnAtlasFromThePhotos) {
  SimulatedRoomOptions bare = RoomOptions();
  bare.furnished = false;
  bare.num_photos = 8;
  Progress progress(true);
  const SimulatedRoom room(bare);
  WriteCapture(room, Path("bare"), &progress);
  WriteBytes(Path("box.obj"), BoxOfRoom(room));
  const CommandResult result = RunCommandLine(
      "roomtex-texture --quiet --input_path " + Path("bare/truth") + " --image_path " +
      Path("bare/photos") + " --scan_path " + Path("box.obj") + " --Texture.texel_mm 8 " +
      "--output_obj 1 --output_path '" + Path("box of the room") + "'");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = ReadJson(Path("box of the room/report.json"));
  ASSERT_EQ(report["atlas"].size(), 1u);
  EXPECT_THAT(report["warnings"].dump(), testing::HasSubstr("12 of 12 triangles turn their back"));
  EXPECT_EQ(report["atlas"][0]["num_charts"], 6);
  EXPECT_NEAR(report["atlas"][0]["texel_mm"], 8, 1e-9);
  EXPECT_GT(report["atlas"][0]["coverage"], 0.5);
  const tinygltf::Model model = LoadGlb(Path("box of the room/model.glb"));
  ASSERT_EQ(model.meshes.at(0).primitives.size(), model.images.size());
  for (const tinygltf::Image& image : model.images) EXPECT_LE(image.width, 4096);
  for (const std::string& name : report["files"].get<std::vector<std::string>>()) {
    EXPECT_TRUE(fs::exists(Path("box of the room/") + name)) << name;
  }
  EXPECT_TRUE(fs::exists(Path("box of the room/model_0.png")));
  EXPECT_FALSE(fs::exists(Path("box of the room/texture.png")));
  // The photos of one wall disagree little: exposures were found without vertices to speak of.
  EXPECT_LT(report["disagreement"]["after"], 0.4 * report["disagreement"]["before"].get<double>());
}

TEST_F(TextureCommand, SeveralScansShareOneSolutionAndOneModel) {
  SimulatedRoomOptions options = RoomOptions();
  options.num_stations = 2;
  options.scan_columns = 300;
  options.scan_rows = 114;
  options.num_photos = 8;
  Progress progress(true);
  const SimulatedRoom room(options);
  WriteCapture(room, Path("two"), &progress);
  const CommandResult result = RunCommandLine(
      "roomtex-texture --quiet --input_path " + Path("two/truth") + " --image_path " +
      Path("two/photos") + " --scan_path " + Path("two/scan.rtpi") + " --scan_path " +
      Path("two/scan_1.rtpi") + " --scan_poses " + Path("two/scan_poses.txt") +
      " --Texture.scale 2 --output_path " + Path("merged"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = ReadJson(Path("merged/report.json"));
  const Scan first = room.MakeScan(0), second = room.MakeScan(1);
  const size_t in_first = first.points.size() - first.NumMissing();
  const PlyVertices model = ReadPly(Path("merged/model.ply"));
  EXPECT_EQ(model.points.size(), in_first + second.points.size() - second.NumMissing());
  EXPECT_EQ(report["num_vertices"], model.points.size());
  EXPECT_EQ(report["exposure_gain"].size(), 8u);
  for (const char* name : {"texture.png", "texture_1.png"}) {
    EXPECT_EQ(cv::imread(Path("merged/") + name).size(), cv::Size(600, 228)) << name;
  }
  EXPECT_TRUE(fs::exists(Path("merged/model_1.rtpi")));
  // A node per scan below the one that turns the up axis.
  const tinygltf::Model glb = LoadGlb(Path("merged/model.glb"));
  EXPECT_EQ(glb.meshes.size(), 2u);
  EXPECT_EQ(glb.nodes.at(glb.scenes.at(0).nodes.at(0)).children.size(), 2u);
  // Both scans have the true colours with the same gain.
  const std::vector<Eigen::Vector3f> truth[2] = {room.TrueColors(0), room.TrueColors(1)};
  const auto& linear = LinearFromSrgbByte();
  double gain[2];
  size_t vertex = 0;
  for (int s = 0; s < 2; ++s) {
    double cross = 0, square = 0;
    const Scan& scan = s == 0 ? first : second;
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      if (model.views[vertex] > 0) {
        for (int k = 0; k < 3; ++k) {
          const double have = linear[model.colors[vertex][k]];
          cross += have * truth[s][i][k];
          square += have * have;
        }
      }
      ++vertex;
    }
    gain[s] = cross / square;
  }
  EXPECT_NEAR(gain[0] / gain[1], 1, 0.01);
}

// More samples than may be held: station by station in full, in the light that was found on all of
// them thinned out. Judged against what they give when all are held, and against the truth.
TEST_F(TextureCommand, TakesManyStationsOneByOne) {
  SimulatedRoomOptions options = RoomOptions();
  options.num_stations = 3;
  options.num_photos = 8;
  options.photo_width = 720;
  options.photo_height = 480;
  options.scan_columns = 600;
  options.scan_rows = 228;
  Progress progress(true);
  const SimulatedRoom room(options);
  WriteCapture(room, Path("site"), &progress);
  const auto texture = [&](std::vector<int> order, const std::string& output,
                           const std::string& more) {
    std::string scans;
    for (const int k : order) {
      scans +=
          " --scan_path " + Path("site/scan" + (k == 0 ? "" : "_" + std::to_string(k)) + ".rtpi");
    }
    return RunCommandLine("roomtex-texture --quiet --input_path " + Path("site/truth") +
                          " --image_path " + Path("site/photos") + scans + " --scan_poses " +
                          Path("site/scan_poses.txt") +
                          " --Texture.scale 2 --output_web 0 --output_path " + Path(output) + more);
  };
  ASSERT_EQ(texture({0, 1, 2}, "at_once", "").exit_code, 0);
  const CommandResult one_by_one = texture({0, 1, 2}, "one_by_one", " --max_samples 225000");
  ASSERT_EQ(one_by_one.exit_code, 0) << one_by_one.err;
  ASSERT_EQ(texture({2, 0, 1}, "turned", " --max_samples 225000 --num_threads 1").exit_code, 0);
  const json report = ReadJson(Path("one_by_one/report.json"));
  EXPECT_EQ(report["sample_stride"], 2);
  ASSERT_EQ(report["stations"].size(), 3u);
  // All of the first run, cut into its scans.
  const PlyVertices all = ReadPly(Path("at_once/model.ply"));
  size_t first = 0, num_overview = 0;
  for (int k = 0; k < 3; ++k) {
    const std::string folder = "one_by_one/station_" + std::to_string(k);
    const PlyVertices station = ReadPly(Path(folder + "/model.ply"));
    const size_t count = station.points.size();
    EXPECT_EQ(report["stations"][k]["num_vertices"], count);
    EXPECT_EQ(report["stations"][k]["texture_scale"], 2);
    PlyVertices truth = station, held = station;
    size_t vertex = 0, num_same_sight = 0;
    const Scan scan = room.MakeScan(k);
    const std::vector<Eigen::Vector3f> colors = room.TrueColors(k);
    for (size_t i = 0; i < scan.points.size(); ++i) {
      if (scan.IsMissing(static_cast<int>(i))) continue;
      ASSERT_LT(first + vertex, all.points.size());
      ASSERT_EQ(station.points[vertex], all.points[first + vertex]);
      for (int c = 0; c < 3; ++c) {
        truth.colors[vertex][c] =
            static_cast<uint8_t>(std::lround(255 * SrgbFromLinear(colors[i][c])));
      }
      held.colors[vertex] = all.colors[first + vertex];
      held.views[vertex] = all.views[first + vertex];
      num_same_sight += (station.views[vertex] > 0) == (held.views[vertex] > 0);
      ++vertex;
    }
    ASSERT_EQ(vertex, count);
    first += count;
    RecordProperty("psnr_one_by_one_" + std::to_string(k), std::to_string(Psnr(station, truth)));
    RecordProperty("psnr_at_once_" + std::to_string(k), std::to_string(Psnr(held, truth)));
    // Of these scans the thinned ones have a sample every 8 cm at 4 m.
    EXPECT_GT(Psnr(station, truth), Psnr(held, truth) - 0.5);
    EXPECT_GT(static_cast<double>(num_same_sight) / static_cast<double>(count), 0.93);
    // The same bytes, whatever its number.
    const std::string turned = "turned/station_" + std::to_string((k + 1) % 3);
    for (const char* name :
         {"model.ply", "model.glb", "texture.png", "evidence.ply", "model.rtpi"}) {
      EXPECT_TRUE(ReadBytes(Path(folder + "/" + name)) == ReadBytes(Path(turned + "/" + name)))
          << name << " " << k;
    }
    num_overview += count;
  }
  EXPECT_EQ(first, all.points.size());
  // The folder itself shows the thinned scans.
  const size_t vertices = ReadPly(Path("one_by_one/model.ply")).points.size();
  EXPECT_EQ(report["num_vertices"], vertices);
  EXPECT_NEAR(static_cast<double>(vertices), static_cast<double>(num_overview) / 4,
              0.01 * static_cast<double>(num_overview));
  EXPECT_FALSE(fs::exists(Path("one_by_one/model.rtpi")));
}

TEST_F(TextureCommand, WritesObjFilesBesideTheOthers) {
  const CommandResult result = Texture("obj", "--output_obj 1 --Texture.image_format jpeg");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Scan mesh = ReadScan(Path("obj/model.obj"), {});
  const PlyVertices ply = ReadPly(Path("obj/model.ply"));
  EXPECT_LE(mesh.points.size(), ply.points.size());  // those of triangles
  EXPECT_GT(mesh.points.size(), 0.95 * ply.points.size());
  EXPECT_EQ(mesh.up, Eigen::Vector3d::UnitY());
  EXPECT_EQ(cv::imread(Path("obj/model_0.jpg")).cols, 501);
  EXPECT_EQ(LoadGlb(Path("obj/model.glb")).images.at(0).mimeType, "image/jpeg");
}

// RTPI has y up, an E57 z: what was (x, y, z) is (x, -z, y).
TEST_F(TextureCommand, WritesAnE57ThatGivesTheSameColoursAgain) {
  ASSERT_EQ(Texture("e57", "--E57.images 1").exit_code, 0);
  const PlyVertices direct = ReadPly(Path("e57/model.ply"));
  const Scan scan = ReadScan(Path("e57/model.e57"), {});
  ASSERT_EQ(scan.num_columns, 500);
  ASSERT_EQ(scan.num_rows, 190);
  const E57Pages pages(Path("e57/model.e57"), true);
  const E57Document document = ReadE57Document(pages);
  std::vector<int> rgb;
  for (const char* name : {"colorRed", "colorGreen", "colorBlue"}) {
    rgb.push_back(document.scans[0].points.Find(name));
  }
  E57Records records(pages, document.scans[0].points, rgb);
  size_t vertex = 0;
  while (const int64_t count = records.Next()) {
    for (int64_t i = 0; i < count; ++i, ++vertex) {
      for (size_t k = 0; k < 3; ++k) {
        ASSERT_EQ(records.Values(k)[i], direct.colors[vertex][static_cast<int>(k)]);
      }
    }
  }
  ASSERT_EQ(vertex, direct.points.size());
  vertex = 0;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    const auto& was = direct.points[vertex++];
    ASSERT_NEAR(scan.points[i].x(), was.x(), 2e-6);
    ASSERT_NEAR(scan.points[i].y(), -was.z(), 2e-6);
    ASSERT_NEAR(scan.points[i].z(), was.y(), 2e-6);
  }
  // Its own photos, and no reconstruction, colour it again.
  Progress quiet(true);
  const E57Photos photos = ExtractE57Images(Path("e57/model.e57"), Path("e57_photos"), {}, &quiet);
  EXPECT_EQ(photos.posed.size(), 12u);
  const CommandResult result = RunCommandLine(
      "roomtex-texture --quiet --Texture.scale 1 --input_path " + Path("e57_photos/sparse") +
      " --image_path " + Path("e57_photos") + " --scan_path " + Path("e57/model.e57#1") +
      " --Exposure.mode match --output_path " + Path("e57_again"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const PlyVertices again = ReadPly(Path("e57_again/model.ply"));
  ASSERT_EQ(again.points.size(), direct.points.size());
  double squares = 0;
  size_t num_seen = 0, num_alike = 0;
  for (size_t v = 0; v < again.points.size(); ++v) {
    num_alike += (again.views[v] > 0) == (direct.views[v] > 0);
    if (again.views[v] == 0 || direct.views[v] == 0) continue;
    ++num_seen;
    for (int k = 0; k < 3; ++k) {
      const double difference = int{again.colors[v][k]} - int{direct.colors[v][k]};
      squares += difference * difference;
    }
  }
  EXPECT_GT(num_alike, 0.98 * again.points.size());
  EXPECT_LT(std::sqrt(squares / (3.0 * static_cast<double>(num_seen))), 12);
}

}  // namespace
}  // namespace roomtex
