// scripts/render.sh as a user calls it, and the renderer under it.

#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#include "texture/render/mesh_renderer.h"

namespace roomtex {
namespace {

int RunScript(const std::string& arguments) {
  const std::string line = SourceFolder() + "/scripts/render.sh " + arguments + " >/dev/null 2>&1";
  const int status = std::system(line.c_str());
  return status < 0 ? -1 : status >> 8;
}

void MakeCapture(const std::string& folder, int num_photos, int photo_width, int num_columns) {
  SimulatedRoomOptions options;
  options.num_photos = num_photos;
  options.photo_width = photo_width;
  options.photo_height = photo_width * 2 / 3;
  options.scan_columns = num_columns;
  options.scan_rows = num_columns * 2 / 5;
  Progress quiet(true);
  WriteCapture(SimulatedRoom(options), folder, &quiet);
}

TEST(RenderScript, MakesPicturesOfACapture) {
  const TempFolder folder;
  MakeCapture(folder / "capture", 6, 420, 500);
  ASSERT_EQ(RunScript(folder / "capture" + " " + (folder / "pictures") +
                      " -- --num_photos 2 --num_ring 2 --width 240"),
            0);
  for (const char* name : {"photo_1", "photo_2", "ring_1", "ring_2", "above", "open_1", "open_2",
                           "contact_sheet", "textured/texture"}) {
    const cv::Mat picture = cv::imread(folder / ("pictures/" + std::string(name) + ".png"));
    ASSERT_FALSE(picture.empty()) << name;
    EXPECT_GE(picture.cols, 240) << name;
  }
  // The photo and the scan from there show the same, apart from exposure and what is not scanned.
  const cv::Mat both = cv::imread(folder / "pictures/photo_1.png", cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(both.cols, 480);
  std::vector<double> photo, scan;
  for (int y = 0; y < both.rows; ++y) {
    for (int x = 0; x < 240; ++x) {
      if (both.at<uint8_t>(y, x + 240) == 48) continue;  // no surface
      photo.push_back(both.at<uint8_t>(y, x));
      scan.push_back(both.at<uint8_t>(y, x + 240));
    }
  }
  ASSERT_GT(photo.size(), 10000u);
  const cv::Mat a = cv::Mat(photo) - cv::mean(cv::Mat(photo));
  const cv::Mat b = cv::Mat(scan) - cv::mean(cv::Mat(scan));
  EXPECT_GT(a.dot(b) / (cv::norm(a) * cv::norm(b)), 0.7);
}

TEST(RenderCommand, PrintsWhereThePictureIs) {
  const TempFolder folder;
  MakeCapture(folder / "capture", 2, 96, 120);
  WriteBytes(folder / "box.ply",
             "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
             "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
             "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
             "-3 -1 -3 200 0 0\n3 -1 -3 0 200 0\n0 -1 3 0 0 200\n0 2 0 200 200 200\n"
             "3 0 1 2\n3 0 1 3\n3 1 2 3\n3 0 2 3\n");
  const std::string line = "roomtex-render --quiet --ply_path " + (folder / "box.ply") +
                           " --input_path " + (folder / "capture/truth");
  const CommandResult one = RunCommandLine(line + " --output_path " + (folder / "one.png"));
  ASSERT_EQ(one.exit_code, 0) << one.err;
  EXPECT_EQ(one.out, folder / "one.png" + "\n");
  EXPECT_EQ(cv::imread(folder / "one.png").cols, 96);
  const CommandResult set =
      RunCommandLine(line + " --num_ring 1 --width 90 --folder_path " + (folder / "set"));
  ASSERT_EQ(set.exit_code, 0) << set.err;
  EXPECT_EQ(set.out, folder / "set/contact_sheet.png" + "\n");
}

TEST(RenderScript, SaysWhatIsMissing) {
  const TempFolder folder;
  EXPECT_EQ(RunScript(""), 2);
  EXPECT_EQ(RunScript(folder / "nowhere"), 3);
  EXPECT_EQ(RunScript(folder.path()), 2);  // nothing in it, nothing given
}

TEST(MeshRenderer, ShowsATriangleWhereItIs) {
  ColoredMesh mesh;
  mesh.points = {{-1, -1, -2}, {1, -1, -2}, {0, 1, -2}};
  mesh.colors.assign(3, {10, 200, 30});
  mesh.triangles = {{0, 1, 2}};
  Camera camera;
  camera.model = CameraModel::kSimplePinhole;
  camera.width = camera.height = 40;
  camera.params = {20, 20, 20};
  const Rigid pose = LookAt({0, 0, 0}, {0, 0, -1}, {0, 1, 0});
  EXPECT_NEAR((pose * Eigen::Vector3d(0.5, 0.25, -2) - Eigen::Vector3d(0.5, -0.25, 2)).norm(), 0,
              1e-12);
  RenderSettings settings;
  const MeshRenderer renderer(mesh);
  const cv::Mat picture = renderer.Render(camera, pose, settings);
  EXPECT_EQ(picture.at<cv::Vec3b>(20, 20), cv::Vec3b(30, 200, 10));
  EXPECT_EQ(picture.at<cv::Vec3b>(2, 2), settings.empty);
  // From behind it is looked through, if asked for.
  settings.front_only = true;
  const Rigid behind = LookAt({0, 0, -4}, {0, 0, -1}, {0, 1, 0});
  EXPECT_EQ(renderer.Render(camera, behind, settings).at<cv::Vec3b>(20, 20), settings.empty);
  EXPECT_EQ(renderer.Render(camera, pose, settings).at<cv::Vec3b>(20, 20), cv::Vec3b(30, 200, 10));
}

// A box of other colours before, behind, beside: a panorama shows all of it.
TEST(MeshRenderer, PanoramasLookAllAround) {
  ColoredMesh mesh;
  const auto add = [&](const Eigen::Vector3d& middle, const cv::Vec3b& rgb) {
    const Eigen::Vector3d up(0, 1, 0), side = middle.cross(up);
    const auto first = static_cast<int>(mesh.points.size());
    for (const Eigen::Vector3d& x :
         {Eigen::Vector3d(middle - side - up), Eigen::Vector3d(middle + side - up),
          Eigen::Vector3d(middle + up)}) {
      mesh.points.push_back(x);
      mesh.colors.emplace_back(rgb[0], rgb[1], rgb[2]);
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  };
  add({0, 0, -2}, {200, 0, 0});
  add({0, 0, 2}, {0, 200, 0});
  add({2, 0, 0}, {0, 0, 200});
  Camera camera;
  camera.model = CameraModel::kEquirectangular;
  camera.width = 80;
  camera.height = 40;
  camera.params = {80, 40};
  const Rigid pose = LookAt({0, 0, 0}, {0, 0, -1}, {0, 1, 0});
  const MeshRenderer renderer(mesh);
  const cv::Mat3b picture = renderer.Render(camera, pose, RenderSettings());
  EXPECT_EQ(picture(20, 40), cv::Vec3b(0, 0, 200));
  EXPECT_EQ(picture(20, 60), cv::Vec3b(200, 0, 0));
  EXPECT_EQ(picture(20, 1), cv::Vec3b(0, 200, 0));
  EXPECT_EQ(picture(20, 78), cv::Vec3b(0, 200, 0));
}

}  // namespace
}  // namespace roomtex
