// roomtex-texture as a user calls it, on a simulated capture with true poses.

#include <cmath>
#include <cstdio>
#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "core/photo.h"
#include "importers/e57_images.h"
#include "importers/e57_records.h"
#include "importers/scan_reader.h"
#include "importers/scan_record.h"
#include "importers/scan_writer.h"
#include "tests/support/ply_vertices.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/load_glb.h"
#include "texture/output/evidence.h"
#include "texture/sampling/blend.h"

namespace roomtex {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

json ReadJson(const std::string& path) { return json::parse(ReadBytes(path)); }

PlyVertices ReadPly(const std::string& path) { return ParsePlyVertices(ReadBytes(path), path); }

// Decibels between the coloured vertices and the truth, in sRGB, after one gain in linear light.
double Psnr(const PlyVertices& model, const PlyVertices& truth) {
  const auto& linear = LinearFromSrgbByte();
  double cross = 0, square = 0;
  for (size_t i = 0; i < model.points.size(); ++i) {
    if (model.views[i] == 0) continue;
    for (int k = 0; k < 3; ++k) {
      const double m = linear[model.colors[i][k]], t = linear[truth.colors[i][k]];
      cross += m * t;
      square += m * m;
    }
  }
  const double gain = cross / square;
  double error = 0;
  size_t count = 0;
  for (size_t i = 0; i < model.points.size(); ++i) {
    if (model.views[i] == 0) continue;
    for (int k = 0; k < 3; ++k) {
      const double m = SrgbFromLinear(std::min(1.0, gain * linear[model.colors[i][k]]));
      error += std::pow(m - truth.colors[i][k] / 255.0, 2);
      ++count;
    }
  }
  return -10 * std::log10(error / static_cast<double>(count));
}

class TextureCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    Progress progress(true);
    WriteCapture(SimulatedRoom(RoomOptions()), Capture(), &progress);
    result_ = Texture("textured");
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static SimulatedRoomOptions RoomOptions() {
    SimulatedRoomOptions options;
    options.random_seed = 5;
    options.num_photos = 12;
    options.photo_width = 1080;
    options.photo_height = 720;
    options.scan_columns = 500;
    options.scan_rows = 190;
    return options;
  }
  static std::string Capture() { return *folder_ / "capture"; }
  static CommandResult Texture(const std::string& output, const std::string& more = "",
                               const std::string& scan = "") {
    const bool scale_given = more.find("--Texture.scale") != std::string::npos;
    return RunCommandLine("roomtex-texture --quiet --input_path " + Capture() +
                          "/truth --image_path " + Capture() + "/photos --scan_path " +
                          (scan.empty() ? Capture() + "/scan.rtpi" : scan) + " --output_path " +
                          (*folder_ / output) + (scale_given ? " " : " --Texture.scale 1 ") + more);
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }
  // The true model with what roomtex-align would leave beside it.
  static std::string Aligned(const std::string& name, bool trusted,
                             const ScanReaderOptions& options = {}) {
    fs::copy(Capture() + "/truth", Path(name));
    const PlacedScans placed = ReadPlacedScans({Capture() + "/scan.rtpi"}, "", options);
    Json report;
    report["trusted"] = trusted;
    report["reason"] = trusted ? "" : "Too few points lie on the surface.";
    report["scans"] = ToJson(RecordScans(placed, options, Path(name)));
    WriteJson(Path(name + "/alignment.json"), report);
    return Path(name);
  }
  static CommandResult TextureAligned(const std::string& model, const std::string& more) {
    return RunCommandLine("roomtex-texture --quiet --Texture.scale 1 --input_path " + model +
                          " --image_path " + Capture() + "/photos --output_path " +
                          (*folder_ / "textured_aligned") + " " + more);
  }
  static Scan ReadCaptureScan() { return ReadScan(Capture() + "/scan.rtpi", {}); }

  static TempFolder* folder_;
  static CommandResult result_;
};

TempFolder* TextureCommand::folder_ = nullptr;
CommandResult TextureCommand::result_;

TEST_F(TextureCommand, WritesTheFilesAndTheReportOfTheContract) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  EXPECT_EQ(result_.err, "");
  const json report = ReadJson(Path("textured/report.json"));
  const Scan scan = ReadCaptureScan();
  EXPECT_EQ(report["num_vertices"], scan.points.size() - scan.NumMissing());
  EXPECT_GT(report["coverage"], 0.5);
  EXPECT_GT(report["views_mean"], 1.0);
  EXPECT_EQ(report["exposure_gain"].size(), 12u);
  EXPECT_LT(report["disagreement"]["after"], report["disagreement"]["before"]);
  EXPECT_TRUE(report["trusted"]);
  const cv::Mat texture = cv::imread(Path("textured/texture.png"));
  EXPECT_EQ(texture.cols, 500);
  EXPECT_EQ(texture.rows, 190);
}

TEST_F(TextureCommand, VerticesAreTheMeasuredSamplesInGridOrder) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const PlyVertices model = ReadPly(Path("textured/model.ply"));
  const Scan scan = ReadCaptureScan();
  size_t vertex = 0;
  for (size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.IsMissing(static_cast<int>(i))) continue;
    ASSERT_LT(vertex, model.points.size());
    ASSERT_LT((model.points[vertex].cast<double>() - scan.points[i]).norm(), 1e-6);
    ++vertex;
  }
  EXPECT_EQ(vertex, model.points.size());
  size_t num_colored = 0;
  for (int views : model.views) num_colored += views > 0;
  EXPECT_EQ(ReadJson(Path("textured/report.json"))["num_colored"], num_colored);
}

TEST_F(TextureCommand, EvidenceIsThatOfTheVerticesAndOfTheReport) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const PlyVertices model = ReadPly(Path("textured/model.ply"));
  const Evidence evidence = ReadEvidence(Path("textured/evidence.ply"));
  ASSERT_EQ(evidence.points.size(), model.points.size());
  double sum = 0, num_pairs = 0;
  for (size_t i = 0; i < model.points.size(); ++i) {
    ASSERT_EQ(evidence.points[i].cast<float>(), model.points[i]);
    ASSERT_EQ(evidence.views[i], model.views[i]);
    if (model.views[i] < 2) continue;
    ASSERT_TRUE(std::isfinite(evidence.disagreement[i]));
    const int kept = std::min(model.views[i], BlendOptions().max_views);
    sum += evidence.disagreement[i] * kept * (kept - 1) / 2;
    num_pairs += kept * (kept - 1) / 2;
  }
  // The report looks at a part of the vertices.
  const double reported = ReadJson(Path("textured/report.json"))["disagreement"]["after"];
  EXPECT_NEAR(sum / num_pairs, reported, 0.05 * reported);
}

TEST_F(TextureCommand, APhotoThatShowsSomethingElseIsNamedAndGivesNoColour) {
  fs::copy(Capture() + "/photos", Path("foreign"));
  const auto overwrite = fs::copy_options::overwrite_existing;
  fs::copy_file(Path("foreign/photo_009.jpg"), Path("foreign/photo_003.jpg"), overwrite);
  const auto run = [](const std::string& output, const std::string& more) {
    return RunCommandLine("roomtex-texture --quiet --Texture.scale 1 --input_path " + Capture() +
                          "/truth --image_path " + Path("foreign") + " --scan_path " + Capture() +
                          "/scan.rtpi --output_path " + Path(output) + more);
  };
  const CommandResult result = run("without_foreign", "");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = ReadJson(Path("without_foreign/report.json"));
  ASSERT_EQ(report["photos_left_out"].size(), 1u);
  EXPECT_EQ(report["photos_left_out"][0]["name"], "photo_003.jpg");
  EXPECT_FALSE(report["exposure_gain"].contains("photo_003.jpg"));
  for (const auto& [name, photo] : report["photo_agreement"].items()) {
    EXPECT_GT(photo["correlation"], 0.9) << name;
  }
  ASSERT_EQ(report["photo_sharpness"].size(), report["photo_agreement"].size());
  for (const auto& [name, photo] : report["photo_sharpness"].items()) {
    EXPECT_GT(photo["sharpness"], 0.85) << name;
    EXPECT_EQ(photo["weight"], 1) << name;
    EXPECT_GT(photo["num_samples"], 0) << name;
  }
  const PlyVertices truth = ReadPly(Capture() + "/truth/true_colors.ply");
  ASSERT_EQ(run("with_foreign", " --Blend.min_agreement 0").exit_code, 0);
  EXPECT_GT(Psnr(ReadPly(Path("without_foreign/model.ply")), truth),
            Psnr(ReadPly(Path("with_foreign/model.ply")), truth) + 1);
  const CommandResult strict = run("strict", " --strict 1");
  EXPECT_EQ(strict.exit_code, 3);
  EXPECT_NE(strict.err.find("photo_003.jpg"), std::string::npos) << strict.err;
}

TEST_F(TextureCommand, EvidenceIsLeftOutAsAsked) {
  ASSERT_EQ(Texture("bare", "--output_evidence 0").exit_code, 0);
  EXPECT_TRUE(fs::exists(Path("bare/model.ply")));
  EXPECT_FALSE(fs::exists(Path("bare/evidence.ply")));
}

TEST_F(TextureCommand, ColoursAreTheTrueOnes) {
  ASSERT_EQ(result_.exit_code, 0) << result_.err;
  const PlyVertices truth = ReadPly(Capture() + "/truth/true_colors.ply");
  const double psnr = Psnr(ReadPly(Path("textured/model.ply")), truth);
  EXPECT_GT(psnr, 24.5);  // 25.3 measured: a photo pixel is 4 mm wide, the texture has 1.5 mm
  // Exposures differ by up to an EV either way: without unification the colours are far off.
  ASSERT_EQ(Texture("plain", "--Exposure.mode none").exit_code, 0);
  EXPECT_GT(psnr, Psnr(ReadPly(Path("plain/model.ply")), truth) + 3);
  // EXIF alone, as in the thesis, does nearly as well as matching.
  ASSERT_EQ(Texture("exif", "--Exposure.mode exif").exit_code, 0);
  EXPECT_GT(Psnr(ReadPly(Path("exif/model.ply")), truth), psnr - 1.5);
}

TEST_F(TextureCommand, UnseenSamplesAreGreyOrBlackAsAsked) {
  ASSERT_EQ(Texture("black", "--Texture.unseen black").exit_code, 0);
  const PlyVertices grey = ReadPly(Path("textured/model.ply"));
  const PlyVertices black = ReadPly(Path("black/model.ply"));
  ASSERT_EQ(grey.points.size(), black.points.size());
  size_t num_unseen = 0;
  for (size_t i = 0; i < grey.points.size(); ++i) {
    ASSERT_EQ(grey.views[i], black.views[i]);
    if (grey.views[i] > 0) continue;
    ++num_unseen;
    ASSERT_EQ(black.colors[i].maxCoeff(), 0);
    ASSERT_EQ(grey.colors[i].minCoeff(), grey.colors[i].maxCoeff());
  }
  EXPECT_GT(num_unseen, 100u);
}

TEST_F(TextureCommand, GivesTheSameBytesOnOneThreadAndOnThree) {
  ASSERT_EQ(Texture("one", "--num_threads 1 --Mesh.max_triangles 9000").exit_code, 0);
  ASSERT_EQ(Texture("three", "--num_threads 3 --Mesh.max_triangles 9000").exit_code, 0);
  for (const char* name :
       {"model.ply", "model.glb", "model_web.glb", "texture.png", "model.rtpi"}) {
    EXPECT_EQ(ReadBytes(Path("one/") + name), ReadBytes(Path("three/") + name)) << name;
  }
}

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
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(positions.maxValues[k] - positions.minValues[k], bounds.max[k] - bounds.min[k],
                0.05);
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
    const CommandResult result = Texture("cloud", "--output_e57 1", Path("cloud.ply"));
    ASSERT_EQ(result.exit_code, 0) << result.err;
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

// The true colours between the samples: the same room, scanned more finely.
double TexturePsnr(const cv::Mat3b& texture, SimulatedRoomOptions room) {
  room.scan_columns = texture.cols;
  room.scan_rows = texture.rows;
  room.missing_samples = false;
  const std::vector<Eigen::Vector3f> truth = SimulatedRoom(room).TrueColors();
  const auto& linear = LinearFromSrgbByte();
  double cross = 0, square = 0, error = 0, count = 0;
  for (const bool measure : {false, true}) {
    for (size_t i = 0; i < truth.size(); ++i) {
      const cv::Vec3b& c =
          texture(static_cast<int>(i) / texture.cols, static_cast<int>(i) % texture.cols);
      if (c[0] + c[1] + c[2] == 0) continue;
      for (int k = 0; k < 3; ++k) {
        const double have = linear[c[2 - k]], want = truth[i][k];
        if (measure) {
          const double light = std::min(1.0, cross / square * have);
          error += std::pow(SrgbFromLinear(light) - SrgbFromLinear(want), 2);
          ++count;
        } else {
          cross += have * want;
          square += have * have;
        }
      }
    }
  }
  return -10 * std::log10(error / count);
}

TEST_F(TextureCommand, ALargerScaleShowsTheRoomBetweenTheSamples) {
  ASSERT_EQ(Texture("coarse", "--Texture.unseen black").exit_code, 0);
  const CommandResult result = Texture("fine", "--Texture.scale 3 --Texture.unseen black");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const cv::Mat3b coarse = cv::imread(Path("coarse/texture.png"));
  const cv::Mat3b fine = cv::imread(Path("fine/texture.png"));
  ASSERT_EQ(fine.size(), cv::Size(1500, 570));
  EXPECT_EQ(ReadJson(Path("fine/report.json"))["texture_scale"], 3);
  cv::Mat3b enlarged;
  cv::resize(coarse, enlarged, fine.size(), 0, 0, cv::INTER_NEAREST);
  const double psnr = TexturePsnr(fine, RoomOptions());
  EXPECT_GT(psnr, 23.5);
  EXPECT_GT(psnr, TexturePsnr(enlarged, RoomOptions()) + 3);
  // The vertices are the same ones.
  EXPECT_EQ(ReadBytes(Path("fine/model.ply")), ReadBytes(Path("coarse/model.ply")));
}

TEST_F(TextureCommand, ChoosesTheScaleByThePhotosAndTheMemory) {
  // auto, or 0 where a number is wanted.
  ASSERT_EQ(Texture("auto", "--Texture.scale 0").exit_code, 0);
  const json report = ReadJson(Path("auto/report.json"));
  const int scale = report["texture_scale"];
  EXPECT_EQ(scale, std::min(4.0, std::ceil(report["pixels_per_sample"].get<double>())));
  EXPECT_GT(scale, 1);
  EXPECT_EQ(cv::imread(Path("auto/texture.png")).cols, 500 * scale);
}

// The bare walls of the room as a mesh of twelve triangles that look inwards.
std::string BoxOfRoom(const SimulatedRoom& room) {
  const SimulatedRoomOptions& o = room.options();
  std::ostringstream obj;
  obj << "# roomtex up 0 1 0\n";
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner(o.width * (i & 1), o.depth * (i >> 1 & 1), o.height * (i >> 2));
    obj << "v " << (room.ScanFromRoom() * corner).transpose() << "\n";
  }
  obj << "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\nf 1 1 2\n";
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
  options.scan_columns = 400;
  options.scan_rows = 152;
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
  const CommandResult one_by_one = texture({0, 1, 2}, "one_by_one", " --max_samples 100000");
  ASSERT_EQ(one_by_one.exit_code, 0) << one_by_one.err;
  ASSERT_EQ(texture({2, 0, 1}, "turned", " --max_samples 100000 --num_threads 1").exit_code, 0);
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
    // Of these scans the thinned ones have a sample every 12 cm at 4 m.
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

TEST_F(TextureCommand, DoesNotWriteOverTheScanItReads) {
  fs::create_directories(Path("own"));
  fs::copy_file(Capture() + "/scan.rtpi", Path("own/model.rtpi"));
  const CommandResult result = Texture("own", "", Path("own/model.rtpi"));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("inputs are never changed"), std::string::npos) << result.err;
  EXPECT_EQ(ReadBytes(Path("own/model.rtpi")), ReadBytes(Capture() + "/scan.rtpi"));
}

TEST_F(TextureCommand, DebugPicturesAddUpToTheResult) {
  const CommandResult result =
      Texture("plain_blend", "--Blend.detail 0 --Texture.unseen black --debug_path '" +
                                 Path("what was seen") + "'");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string folder = Path("what was seen/");
  const std::string legend = ReadBytes(folder + "README.txt");
  const auto& linear = LinearFromSrgbByte();
  cv::Mat3f sum(190, 500, cv::Vec3f(0, 0, 0));
  for (int photo = 0; photo < 12; ++photo) {
    char stem[64];
    std::snprintf(stem, sizeof stem, "%03d_photo_%03d", photo, photo);
    EXPECT_NE(legend.find(stem), std::string::npos);
    const cv::Mat depth = cv::imread(folder + stem + "_depth_mm.png", cv::IMREAD_UNCHANGED);
    ASSERT_EQ(depth.type(), CV_16U);
    double farthest;
    cv::minMaxLoc(depth, nullptr, &farthest);
    EXPECT_TRUE(farthest > 1500 && farthest < 7000) << farthest;  // the room is 5 by 4 metres
    EXPECT_EQ(cv::imread(folder + stem + "_boundary.jpg").size(), depth.size());
    EXPECT_EQ(cv::imread(folder + stem + "_depth.jpg").size(), depth.size());
    const cv::Mat3b part = cv::imread(folder + stem + "_contribution.png");
    const cv::Mat3b sight = cv::imread(folder + stem + "_sight.png");
    ASSERT_EQ(part.size(), sum.size());
    ASSERT_EQ(sight.size(), sum.size());
    for (int i = 0; i < 500 * 190; ++i) {
      const cv::Vec3b c = part(i / 500, i % 500), seen = sight(i / 500, i % 500);
      for (int k = 0; k < 3; ++k) sum(i / 500, i % 500)[k] += linear[c[k]];
      // What is hidden, turned away or outside the photo gives nothing.
      if (seen[0] == seen[1] && seen[1] == seen[2]) {
        ASSERT_EQ(c, cv::Vec3b(0, 0, 0));
      }
    }
  }
  const cv::Mat3b blend = cv::imread(Path("plain_blend/texture.png"));
  double error = 0;
  for (int i = 0; i < 500 * 190; ++i) {
    for (int k = 0; k < 3; ++k) {
      error += std::abs(sum(i / 500, i % 500)[k] - linear[blend(i / 500, i % 500)[k]]);
    }
  }
  EXPECT_LT(error / (3 * 500 * 190), 0.003);  // twelve times half a grey level
  for (const char* name : {"significance.png", "num_photos.png", "disagreement.png"}) {
    EXPECT_EQ(cv::imread(folder + name).size(), sum.size()) << name;
  }
}

// A patterned and a plain photo of each pose: colour comes from the plain ones only.
TEST_F(TextureCommand, ColoursComeFromThePlainTwins) {
  fs::create_directories(Path("pairs"));
  std::ofstream associations(Path("associations.csv"));
  associations << "patterned_image,plain_image,offset_px,brightness_ratio\n";
  for (const auto& entry : fs::directory_iterator(Capture() + "/photos")) {
    const std::string name = entry.path().filename().string();
    cv::Mat green(720, 1080, CV_8UC3, cv::Scalar(0, 255, 0));
    cv::imwrite(Path("pairs/") + name, green);
    fs::copy_file(entry.path(), Path("pairs/plain_") + name);
    associations << name << ",plain_" << name << ",0.1,1.5\n";
  }
  associations.close();
  const CommandResult result = RunCommandLine(
      "roomtex-texture --quiet --input_path " + Capture() + "/truth --image_path " + Path("pairs") +
      " --scan_path " + Capture() + "/scan.rtpi --associations_path " + Path("associations.csv") +
      " --output_path " + Path("twins"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadPly(Path("twins/model.ply")).colors, ReadPly(Path("textured/model.ply")).colors);
}

TEST_F(TextureCommand, UnalignedModelIsNotTrusted) {
  SparseModel model = ReadSparseModel(Capture() + "/truth");
  TransformModel({0.4, Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5), {30, 40, 50}}, &model);
  WriteSparseModel(model, Path("unaligned"));
  const CommandResult result = RunCommandLine(
      "roomtex-texture --quiet --input_path " + Path("unaligned") + " --image_path " + Capture() +
      "/photos --scan_path " + Capture() + "/scan.rtpi --output_path " + Path("nowhere"));
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_NE(result.err.find("roomtex-align"), std::string::npos) << result.err;
  EXPECT_FALSE(ReadJson(Path("nowhere/report.json"))["trusted"]);
}

TEST_F(TextureCommand, BadInputGetsASentence) {
  const std::string photos = Capture() + "/photos", scan = Capture() + "/scan.rtpi";
  const auto expect = [](const std::string& line, int exit_code, const std::string& text) {
    const CommandResult result = RunCommandLine("roomtex-texture --quiet " + line);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
  };
  const std::string model = " --input_path " + Capture() + "/truth";
  const std::string rest = " --output_path " + Path("bad");
  expect(model + " --image_path " + Path("none") + " --scan_path " + scan + rest, 3, "none");
  expect(model + " --image_path " + photos + " --scan_path " + photos + rest, 3, "is a folder");
  expect(model + " --image_path " + photos + " --scan_path " + photos + "/photo_000.jpg" + rest, 3,
         "is a JPEG photo");
  expect(" --input_path " + photos + " --image_path " + photos + " --scan_path " + scan + rest, 3,
         "no COLMAP model");
  expect(model + " --image_path " + photos + rest, 2, "--scan_path is required");
  const std::string all = model + " --image_path " + photos + " --scan_path " + scan;
  expect(all + " --output_path " + scan, 2, "inputs are never changed");
  expect(all + rest + " --Texture.scale -1", 2, "Texture.scale must be 1 to 16");
  expect(all + rest + " --Texture.scale fine", 2, "Texture.scale");
  expect(all + rest + " --Texture.max_memory_mb 1", 2, "Texture.max_memory_mb");
  expect(all + rest + " --Occlusion.depth_tolerance 2", 2, "Occlusion.depth_tolerance");
  expect(all + rest + " --Exposure.mode guess", 2, "exif, match or none");
  expect(all + rest + " --associations_path " + Path("none.csv"), 3, "does not exist");
  expect(all + rest + " --database_path " + scan, 3, "SQLite");
}

TEST_F(TextureCommand, AnAlignedModelNeedsNoScanAndReadsItAsItWasAligned) {
  const std::string model = Aligned("aligned", true);
  const CommandResult result = TextureAligned(model, "");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadBytes(Path("textured_aligned/model.ply")), ReadBytes(Path("textured/model.ply")));
  const CommandResult other = TextureAligned(model, "--azimuth counterclockwise");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_NE(other.err.find("--azimuth counterclockwise contradicts the alignment"),
            std::string::npos)
      << other.err;
  const CommandResult mesh =
      TextureAligned(model, "--scan_path " + Capture() + "/truth/true_colors.ply");
  EXPECT_EQ(mesh.exit_code, 3);
  EXPECT_NE(mesh.err.find("is another scan"), std::string::npos) << mesh.err;
}

TEST_F(TextureCommand, DoubtsOfTheAlignmentAreThoseOfTheColours) {
  const std::string model = Aligned("doubtful", false);
  const CommandResult result = TextureAligned(model, "");
  EXPECT_EQ(result.exit_code, 4) << result.err;
  const json report = ReadJson(Path("textured_aligned/report.json"));
  EXPECT_EQ(report["trusted"], false);
  EXPECT_NE(report["reason"].get<std::string>().find("Too few points lie on the surface"),
            std::string::npos);
  EXPECT_EQ(TextureAligned(model, "--accept_untrusted 1").exit_code, 0);
  EXPECT_EQ(ReadJson(Path("textured_aligned/report.json"))["warnings"].size(), 1u);
}

// One photo is gone, one ends before its picture does; the others colour.
TEST_F(TextureCommand, LeavesOutPhotosThatCannotBeUsed) {
  const std::string photos = Path("some_photos");
  fs::copy(Capture() + "/photos", photos);
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(photos)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  fs::remove(photos + "/" + names[2]);
  const std::string bytes = ReadBytes(photos + "/" + names[5]);
  WriteBytes(photos + "/" + names[5], bytes.substr(0, bytes.size() / 2));
  const auto run = [&](const std::string& more) {
    return RunCommandLine("roomtex-texture --quiet --Texture.scale 1 --input_path " + Capture() +
                          "/truth --image_path " + photos + " --scan_path " + Capture() +
                          "/scan.rtpi --output_path " + Path("some") + more);
  };
  const CommandResult strict = run(" --strict 1");
  EXPECT_EQ(strict.exit_code, 3);
  EXPECT_NE(strict.err.find(names[2]), std::string::npos) << strict.err;
  EXPECT_FALSE(fs::exists(Path("some/model.ply")));
  const CommandResult result = run("");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json report = ReadJson(Path("some/report.json"));
  ASSERT_EQ(report["photos_left_out"].size(), 2u);
  EXPECT_EQ(report["photos_left_out"][0]["name"], names[2]);
  EXPECT_EQ(report["photos_left_out"][1]["name"], names[5]);
  EXPECT_EQ(report["num_photos"], 10);
  EXPECT_EQ(ReadJson(Path("textured/report.json"))["photos_left_out"].size(), 0u);
}

}  // namespace
}  // namespace roomtex
