#include "texture/view/view_model.h"

#include <cstring>
#include <fstream>
#include <random>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/json_text.h"
#include "core/output_file.h"
#include "tests/support/temp_folder.h"
#include "tests/texture/view/view_scene.h"
#include "texture/view/view_answers.h"
#include "texture/view/view_chunks.h"

namespace roomtex {
namespace {
using testing::ElementsAre;

// Largest distance from a vertex of the model's triangles to the nearest sample of the scan.
double FarthestFromScan(const ViewModel& model, const Scan& scan) {
  double farthest = 0;
  for (size_t t = 0; t < model.triangles.size(); t += 37) {
    double nearest = 1e9;
    const Eigen::Vector3d p = model.InScan(model.triangles[t][0]);
    for (const Eigen::Vector3d& sample : scan.points)
      nearest = std::min(nearest, (sample - p).norm());
    farthest = std::max(farthest, nearest);
  }
  return farthest;
}

TEST(ViewModel, GlbComesBackInTheScanFrame) {
  for (const Eigen::Vector3d& up : {Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, 0, 1)}) {
    const TempFolder folder;
    Scan scan = TwoWallsScan(60, 40);
    scan.up = up;
    WriteViewFolder(scan, folder.path());
    const ViewModel model = ReadViewModel(folder.path());
    EXPECT_LT(FarthestFromScan(model, scan), 1e-5);
    EXPECT_LT((model.up - up).norm(), 1e-9);
    EXPECT_EQ(model.triangles.size(), ColorForView(scan).triangles.size());
    ASSERT_EQ(model.images.size(), 1u);
    EXPECT_NEAR(model.images[0].width, 60, 1);  // the texture may go on beyond the last sample
    EXPECT_NEAR(model.images[0].height, 40, 1);
    for (const int page : model.page_of_triangle) ASSERT_EQ(page, 0);
  }
}

// A glTF of others: a wall of tiles, seen three times beside each other and once from -0.5 on.
TEST(ViewModel, ImagesAreRepeatedAsTheFileHasIt) {
  const TempFolder folder;
  std::vector<uchar> png;
  cv::imencode(".png", cv::Mat3b(4, 4), png);
  std::string bytes;
  const float numbers[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -0.5f, 3, -0.5f, 0, 0.5f};
  bytes.assign(reinterpret_cast<const char*>(numbers), sizeof numbers);
  bytes.append(png.begin(), png.end());
  Json scene = Json::parse(R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
      "nodes": [{"mesh": 0}], "materials": [{"pbrMetallicRoughness":
      {"baseColorTexture": {"index": 0}}}], "textures": [{"source": 0}],
      "images": [{"bufferView": 2, "mimeType": "image/png"}], "meshes": [{"primitives":
      [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
      "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
      {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}],
      "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 36},
      {"buffer": 0, "byteOffset": 36, "byteLength": 24}]})");
  scene["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", 60}, {"byteLength", png.size()}});
  scene["buffers"] = {{{"uri", "a.bin"}, {"byteLength", bytes.size()}}};
  WriteBytes(folder / "a.bin", bytes);
  const auto read = [&] {
    WriteBytes(folder / "a.gltf", scene.dump());
    return ReadViewModel(folder / "a.gltf");
  };
  const ViewModel model = read();
  EXPECT_THAT(model.images.at(0).wrap, ElementsAre(ViewImage::kRepeat, ViewImage::kRepeat));
  EXPECT_EQ(model.uv_low, Eigen::Vector2f(0, -1));
  EXPECT_EQ(model.uv_high, Eigen::Vector2f(3, 1));
  EXPECT_EQ(model.uv[1], Eigen::Vector2f(3, -0.5f));
  ViewContent content;
  content.model = model;
  const ViewAnswers answers(std::move(content), 1, [] { return false; });
  const Json told = answers.json().at("scene")({});
  EXPECT_EQ(told["uv"], Json::parse(R"({"low": [0, -1], "high": [3, 1]})"));
  EXPECT_EQ(told["pages"][0]["wrap"], Json({10497, 10497}));
  scene["samplers"] = {{{"wrapS", ViewImage::kMirror}, {"wrapT", ViewImage::kClamp}}};
  scene["textures"][0]["sampler"] = 0;
  EXPECT_THAT(read().images.at(0).wrap, ElementsAre(ViewImage::kMirror, ViewImage::kClamp));
  // Within its sides nothing of the other one shines through.
  float* const uv = reinterpret_cast<float*>(&bytes[36]);
  for (const int i : {1, 3}) uv[i] = 0;
  uv[2] = 1;
  WriteBytes(folder / "a.bin", bytes);
  const ViewModel inside = read();
  EXPECT_THAT(inside.images.at(0).wrap, ElementsAre(ViewImage::kClamp, ViewImage::kClamp));
  EXPECT_EQ(inside.uv_high, Eigen::Vector2f(1, 1));
}

// The scene of roomtex-join: a room's file, whose bytes stay where they are.
TEST(ViewModel, JoinedRoomsComeFromTheirOwnFiles) {
  const TempFolder folder;
  const Scan scan = TwoWallsScan(60, 40);
  MakeFolder(folder / "my room");
  WriteViewFolder(scan, folder / "my room");
  const std::string glb = ReadBytes(folder / "my room/model.glb");
  uint32_t json_size = 0;
  std::memcpy(&json_size, &glb[12], 4);
  Json scene = Json::parse(glb.substr(20, json_size));
  scene["asset"]["generator"] = "roomtex-join";
  scene["buffers"] = {{{"uri", "../my%20room/model.glb"}, {"byteLength", glb.size()}}};
  for (Json& view : scene["bufferViews"]) {
    view["byteOffset"] = view.value("byteOffset", 0) + 20 + json_size + 8;
  }
  MakeFolder(folder / "joined");
  const auto write = [&] { WriteBytes(folder / "joined/site.gltf", scene.dump()); };
  write();
  const ViewModel model = ReadViewModel(folder / "joined");
  EXPECT_LT(FarthestFromScan(model, scan), 1e-5);
  EXPECT_EQ(model.triangles.size(), ColorForView(scan).triangles.size());
  ASSERT_EQ(model.images.size(), 1u);
  EXPECT_NEAR(model.images[0].width, 60, 1);
  WriteBytes(folder / "my room/model.glb", glb + "coloured anew");
  EXPECT_INPUT_ERROR(ReadViewModel(folder / "joined"), "Run roomtex-join again");
  for (const char* elsewhere : {"https://example.org/model.glb", "data:,"}) {
    scene["buffers"][0]["uri"] = elsewhere;
    write();
    EXPECT_INPUT_ERROR(ReadViewModel(folder / "joined"), "elsewhere than in files beside it");
  }
  scene["buffers"][0]["uri"] = "gone.glb";
  write();
  EXPECT_INPUT_ERROR(ReadViewModel(folder / "joined"), "gone.glb");
}

TEST(ViewModel, TheSupplementOfTheReportIsToldApartInItsChunksToo) {
  const TempFolder folder;
  const Scan scan = TwoWallsScan(60, 40);
  Scan supplement = TwoWallsScan(30, 20);
  for (Eigen::Vector3d& p : supplement.points) p.x() += 20;
  const std::vector<Scan> scans = {scan, supplement};
  const std::vector<ColoredScan> colored = {ColorForView(scan), ColorForView(supplement)};
  WriteColoredGlb(scans, colored, folder / "model.glb", {});
  WriteColoredPly(scans, colored, folder / "model.ply");
  for (const char* name : {"model.glb", "model.ply"}) {
    std::ofstream(folder / "report.json") << "{}";
    EXPECT_FALSE(ReadViewModel(folder / name).IsSupplement(1u << 30)) << name;
    std::ofstream(folder / "report.json")
        << R"({"supplement": {"first_vertex": 2400, "num_vertices": 600}})";
    const ViewModel model = ReadViewModel(folder / name);
    size_t num_supplement = 0;
    for (size_t t = 0; t < model.triangles.size(); ++t) {
      EXPECT_EQ(model.IsSupplement(t), model.InScan(model.triangles[t][0]).x() > 10) << name;
      num_supplement += model.IsSupplement(t);
    }
    EXPECT_EQ(num_supplement, colored[1].triangles.size()) << name;
    size_t in_chunks = 0;
    const ViewChunks chunks(model);
    for (const ViewChunk& chunk : chunks.chunks()) {
      EXPECT_EQ(chunk.is_supplement, model.origin.x() + chunk.low.x() > 10) << name;
      if (chunk.is_supplement) in_chunks += chunk.num_triangles;
    }
    EXPECT_EQ(in_chunks, num_supplement) << name;
  }
}

TEST(ViewModel, KeepsMillimetresFarFromTheOrigin) {
  const TempFolder folder;
  Scan scan = TwoWallsScan(40, 30);
  for (Eigen::Vector3d& p : scan.points) p += Eigen::Vector3d(512345.678, 5412345.678, 321.5);
  WriteViewFolder(scan, folder.path());
  EXPECT_LT(FarthestFromScan(ReadViewModel(folder / "model.glb"), scan), 1e-4);
  EXPECT_LT(FarthestFromScan(ReadViewModel(folder / "model.ply"), scan), 1e-4);
}

TEST(ViewModel, PlyComesBackWithItsColours) {
  const TempFolder folder;
  const Scan scan = TwoWallsScan(60, 40);
  WriteViewFolder(scan, folder.path());
  const ViewModel model = ReadViewModel(folder / "model.ply");
  ASSERT_EQ(model.points.size(), 2400u);
  EXPECT_LT((model.InScan(61) - scan.points[61]).norm(), 1e-5);
  EXPECT_EQ(model.colors[61][0], 1);
  EXPECT_EQ(model.colors[61][1], 1);
  EXPECT_EQ(model.colors[61][2], 77);
  EXPECT_EQ(model.page_of_triangle[0], -1);
}

// Its points keep their order and colours, one disc each, and lie amid them.
TEST(ViewModel, ACloudIsShownAsDiscs) {
  const TempFolder folder;
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 2500\nproperty double x\nproperty double y\n"
      "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "end_header\n";
  for (int i = 0; i < 2500; ++i) {
    text += std::to_string(500000 + 0.01 * (i % 50)) + " " + std::to_string(0.01 * (i / 50)) +
            " 0 " + std::to_string(i % 256) + " 7 9\n";
  }
  WriteBytes(folder / "model.ply", text);
  const ViewModel model = ReadViewModel(folder.path());
  EXPECT_TRUE(model.is_cloud);
  ASSERT_EQ(model.triangles.size(), 2500u);
  ASSERT_EQ(model.points.size(), 7500u);
  for (size_t i = 0; i < 2500; i += 99) {
    const Eigen::Vector3d place(500000 + 0.01 * (i % 50), 0.01 * (i / 50), 0);
    EXPECT_LT((model.InScan(3 * i) - place).norm(), 0.02);
    EXPECT_EQ(model.colors[3 * i + 2][0], i % 256);
  }
  // In its chunks each point of a disc shows the point of the cloud.
  const ViewChunks chunks(model);
  ASSERT_EQ(chunks.chunks().size(), 1u);
  for (const Eigen::Vector3f& shown : chunks.Shown(0)) {
    const Eigen::Vector3d p =
        100 * (model.origin + shown.cast<double>() - Eigen::Vector3d(5e5, 0, 0));
    EXPECT_LT((p - p.array().round().matrix()).norm(), 1e-2);
  }
}

TEST(ViewModel, NormalsLookAtTheScannerInSpiteOfNoise) {
  TwoWalls scene;
  scene.board_half = 0;
  Scan scan = scene.MakeScan(300, 300);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.004);
  for (Eigen::Vector3d& p : scan.points) p *= 1 + noise(random) / p.norm();
  const TempFolder folder;
  WriteViewFolder(scan, folder.path());
  const ViewModel model = ReadViewModel(folder.path());
  // The wall's front looks along +z: from nearly behind it nothing of it is to be seen.
  const Eigen::Vector3d from_behind = Eigen::Vector3d(0.96, 0, 0.28).normalized();
  int num_single = 0, num_smooth = 0;
  for (size_t t = 0; t < model.triangles.size(); ++t) {
    const Triangle& corners = model.triangles[t];
    const Eigen::Vector3f& a = model.points[corners[0]];
    const Eigen::Vector3f normal =
        (model.points[corners[1]] - a).cross(model.points[corners[2]] - a);
    num_single += normal.cast<double>().dot(from_behind) < 0;
    // What the page hides (surface.js).
    const Eigen::Vector3f sum =
        model.normals[corners[0]] + model.normals[corners[1]] + model.normals[corners[2]];
    num_smooth += sum.normalized().dot(from_behind.cast<float>()) < 0.05f;
  }
  EXPECT_EQ(num_smooth, 0);
  EXPECT_GT(num_single, 100);  // or the test says nothing
}

TEST(ViewModel, TellsTheSizeOfImages) {
  const cv::Mat image(37, 53, CV_8UC3, cv::Scalar(1, 2, 3));
  for (const char* extension : {".png", ".jpg"}) {
    std::vector<unsigned char> bytes;
    cv::imencode(extension, image, bytes);
    const auto [width, height] = EncodedImageSize({bytes.begin(), bytes.end()});
    EXPECT_EQ(width, 53);
    EXPECT_EQ(height, 37);
    for (size_t size = 0; size < 20; ++size) {
      EncodedImageSize({bytes.begin(), bytes.begin() + static_cast<long>(size)});
    }
  }
  EXPECT_EQ(EncodedImageSize("GIF89a, which is neither")[0], 0);
}

TEST(ViewModel, RefusesWhatIsNotThere) {
  const TempFolder folder;
  EXPECT_INPUT_ERROR(ReadViewModel(folder / "nowhere"), "does not exist");
  EXPECT_INPUT_ERROR(ReadViewModel(folder.path()), "neither model.glb nor model.ply");
  WriteBytes(folder / "notes.txt", "hello");
  EXPECT_INPUT_ERROR(ReadViewModel(folder / "notes.txt"), "neither a folder nor");
  WriteBytes(folder / "model.glb", "hello");
  EXPECT_INPUT_ERROR(ReadViewModel(folder.path()), "is no binary glTF");
}

class DamagedGlb : public testing::Test {
 protected:
  void SetUp() override {
    WriteViewFolder(TwoWallsScan(30, 20), folder_.path());
    bytes_ = ReadBytes(folder_ / "model.glb");
  }
  // The file with a piece of its JSON replaced by one of the same length.
  std::string With(const std::string& from, std::string to) const {
    std::string bytes = bytes_;
    const size_t at = bytes.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    to.resize(from.size(), ' ');
    return bytes.replace(at, from.size(), to);
  }
  ViewModel Read(const std::string& bytes) const {
    WriteBytes(folder_ / "damaged.glb", bytes);
    return ReadViewModel(folder_ / "damaged.glb");
  }
  const TempFolder folder_;
  std::string bytes_;
};

TEST_F(DamagedGlb, IsRefusedWhereverItIsCutOff) {
  for (size_t size = 0; size < bytes_.size(); size += 1 + size / 7) {
    EXPECT_THROW(Read(bytes_.substr(0, size)), InputError) << size;
  }
}

TEST_F(DamagedGlb, NeverCrashesOnFlippedBytes) {
  std::mt19937 random(7);
  const size_t json_end =
      20 + static_cast<uint8_t>(bytes_[12]) + 256 * static_cast<uint8_t>(bytes_[13]);
  int num_refused = 0;
  for (int i = 0; i < 600; ++i) {
    std::string bytes = bytes_;
    bytes[random() % json_end] = static_cast<char>(random());
    try {
      const ViewModel model = Read(bytes);
      for (const Triangle& t : model.triangles) {
        for (const int corner : t) ASSERT_LT(static_cast<size_t>(corner), model.points.size());
      }
    } catch (const InputError&) {
      ++num_refused;
    }
  }
  EXPECT_GT(num_refused, 100);
}

TEST_F(DamagedGlb, SaysWhatIsWrong) {
  EXPECT_INPUT_ERROR(Read(With("\"bufferViews\":[{", "\"bufferViewX\":[{")), "\"bufferViews\"");
  EXPECT_INPUT_ERROR(Read(With("\"componentType\":5126", "\"componentType\":5120")), "of a type");
  EXPECT_INPUT_ERROR(Read(With("KHR_materials_unlit\"]", "KHR_materials_unlit\" ")), "JSON");
}

TEST_F(DamagedGlb, RefusesAFaceThatNamesNoVertex) {
  std::string bytes = bytes_;
  for (size_t i = bytes.size() - 40; i < bytes.size(); ++i) bytes[i] = '\x7f';  // indices come last
  EXPECT_INPUT_ERROR(Read(bytes), "names vertex");
}

}  // namespace
}  // namespace roomtex
