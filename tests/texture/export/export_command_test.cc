// roomtex-export as a user calls it; what it writes is read by an independent reader
// (reproject.py).

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "capture/simulation/capture_writer.h"
#include "capture/simulation/simulated_room.h"
#include "colmap_ext/sparse_model.h"
#include "core/option_fields.h"
#include "core/statistics.h"
#include "importers/scan_reader.h"
#include "importers/scan_writer.h"
#include "tests/support/option_check.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"
#include "texture/export/export_photos.h"

namespace roomtex {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

class ExportCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    SimulatedRoomOptions options;
    options.random_seed = 5;
    options.num_photos = 12;
    options.photo_width = 480;
    options.photo_height = 320;
    options.scan_columns = 700;
    options.scan_rows = 260;
    options.strangers = 0.2;
    Progress progress(true);
    WriteCapture(SimulatedRoom(options), Capture(), &progress);
    options.camera_model = "OPENCV_FISHEYE";
    options.field_of_view_deg = 150;
    options.num_photos = 4;
    WriteCapture(SimulatedRoom(options), Path("fisheye"), &progress);
    // A folder in a name is a folder of the output, too.
    SparseModel model = ReadSparseModel(Capture() + "/truth");
    fs::create_directory(Capture() + "/photos/west");
    fs::rename(Capture() + "/photos/photo_000.jpg", Capture() + "/photos/west/photo_000.jpg");
    for (auto& [id, image] : model.images) {
      if (image.name == "photo_000.jpg") image.name = "west/photo_000.jpg";
    }
    WriteSparseModel(model, Path("model"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }
  static std::string Capture() { return Path("capture"); }
  static CommandResult Export(const std::string& output, const std::string& more,
                              const std::string& model = "model") {
    return RunCommandLine("roomtex-export --quiet --input_path " + Path(model) + " --image_path " +
                          Capture() + "/photos --scan_path " + Capture() +
                          "/scan.rtpi --output_path " + Path(output) + " " + more);
  }
  struct Errors {
    double max_px, mean_px, num_px, median_m, num_m;
  };
  static Errors Reproject(const std::string& format, const std::string& output) {
    const CommandResult result =
        RunProgram("python3 " ROOMTEX_REPROJECT " " + format + " " + Path(output));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    Errors errors{};
    std::istringstream(result.out) >> errors.max_px >> errors.mean_px >> errors.num_px >>
        errors.median_m >> errors.num_m;
    return errors;
  }

  static TempFolder* folder_;
};

TempFolder* ExportCommand::folder_ = nullptr;

TEST_F(ExportCommand, WorkspaceOfColmapReprojects) {
  const CommandResult result = Export("workspace", "--max_points 5000");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Errors errors = Reproject("colmap", "workspace");
  EXPECT_LT(errors.max_px, 0.01);
  EXPECT_GT(errors.num_px, 4000);
  EXPECT_LT(errors.median_m, 0.002);
  EXPECT_GT(errors.num_m, 0.97 * errors.num_px);
  const json report = json::parse(ReadBytes(Path("workspace/report.json")));
  EXPECT_LE(report["num_points"], 5000);
  EXPECT_GT(report["num_points"], 2500);
  EXPECT_TRUE(fs::exists(Path("workspace/images/west/photo_000.jpg")));
  EXPECT_TRUE(fs::exists(Path("workspace/masks/west/photo_000.jpg.png")));
  // Written again it is replaced, at another size.
  ASSERT_EQ(Export("workspace", "--max_points 5000 --max_image_size 240 --masks 0").exit_code, 0);
  EXPECT_LT(Reproject("colmap", "workspace").max_px, 0.01);
  EXPECT_EQ(cv::imread(Path("workspace/images/photo_001.jpg")).cols, 240);
  EXPECT_FALSE(fs::exists(Path("workspace/masks")));
}

TEST_F(ExportCommand, WhatIsTransparentIsMaskedAndNoPointIsSeenThere) {
  fs::copy(Capture() + "/photos", Path("cut"), fs::copy_options::recursive);
  const cv::Mat photo = cv::imread(Path("cut/photo_001.jpg"));
  cv::Mat cut;
  cv::cvtColor(photo, cut, cv::COLOR_BGR2BGRA);
  cut.colRange(0, photo.cols / 2).setTo(cv::Scalar::all(0));
  std::vector<uchar> png;
  ASSERT_TRUE(cv::imencode(".png", cut, png));
  WriteBytes(Path("cut/photo_001.jpg"), std::string(png.begin(), png.end()));
  const CommandResult result =
      RunCommandLine("roomtex-export --quiet --input_path " + Path("model") + " --image_path " +
                     Path("cut") + " --scan_path " + Capture() +
                     "/scan.rtpi --max_points 5000 --output_path " + Path("cut_out"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const cv::Mat mask = cv::imread(Path("cut_out/masks/photo_001.jpg.png"), cv::IMREAD_GRAYSCALE);
  const int middle = mask.cols / 2;
  EXPECT_EQ(cv::countNonZero(mask.colRange(0, middle - 4)), 0);
  EXPECT_GT(cv::countNonZero(mask.colRange(middle + 4, mask.cols)), mask.rows * mask.cols / 4);
  for (const auto& [id, image] : ReadSparseModel(Path("cut_out/sparse")).images) {
    if (image.name != "photo_001.jpg") continue;
    EXPECT_GT(image.points2d.size(), 50u);
    for (const Eigen::Vector2d& at : image.points2d) EXPECT_GT(at.x(), middle - 4);
  }
}

TEST_F(ExportCommand, TransformsOfNerfstudioReproject) {
  const CommandResult result = Export("nerf", "--format nerfstudio --max_points 5000");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Errors errors = Reproject("nerfstudio", "nerf");
  EXPECT_LT(errors.median_m, 0.003);
  EXPECT_GT(errors.num_m, 1000);
}

TEST_F(ExportCommand, TakesTheColoursOfACloud) {
  Scan cloud = ReadScan(Capture() + "/scan.rtpi", {});
  cloud.organised = false;
  cloud.triangles.clear();
  WriteScan(cloud, {}, Path("cloud.ply"));
  const std::string input = " --quiet --input_path " + Path("model") + " --image_path " +
                            Capture() + "/photos --scan_path " + Path("cloud.ply");
  CommandResult result =
      RunCommandLine("roomtex-texture" + input + " --output_path " + Path("textured"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto export_to = [&](const std::string& output, const std::string& more) {
    return RunCommandLine("roomtex-export" + input + " --max_points 5000 --output_path " +
                          Path(output) + more);
  };
  result = export_to("of_cloud", "");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  result = export_to("with_colors", " --colors_path " + Path("textured/model.ply"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Errors errors = Reproject("colmap", "with_colors");
  EXPECT_LT(errors.max_px, 0.01);
  EXPECT_GT(errors.num_px, 4000);
  // As coloured here, but for detail that a piece of the surface is too coarse for.
  const SparseModel here = ReadSparseModel(Path("of_cloud/sparse")),
                    taken = ReadSparseModel(Path("with_colors/sparse"));
  std::vector<double> differences;
  for (const auto& [id, point] : taken.points) {
    const auto other =
        std::find_if(here.points.begin(), here.points.end(), [&, &point = point](const auto& p) {
          return (p.second.x_in_model - point.x_in_model).norm() < 1e-4;
        });
    if (other == here.points.end()) continue;
    double difference = 0;
    for (int k = 0; k < 3; ++k) {
      difference += std::abs(int{point.color[k]} - int{other->second.color[k]}) / 3.0;
    }
    differences.push_back(difference);
  }
  ASSERT_GT(differences.size(), 1000u);
  EXPECT_LT(Median(&differences), 6);
}

TEST_F(ExportCommand, DoubtsOfTheColoursAreThoseOfTheExport) {
  fs::copy(Path("model"), Path("doubtful"));
  WriteJson(Path("doubtful/alignment.json"),
            {{"trusted", false}, {"reason", "Too few points lie on the surface."}});
  // Many stations as well: their report lies one folder above.
  const std::string input = " --image_path " + Capture() + "/photos --scan_path " + Capture() +
                            "/scan.rtpi --Texture.scale 1 --output_web 0 --output_path " +
                            Path("doubtful_colors");
  ASSERT_EQ(
      RunCommandLine("roomtex-texture --quiet --input_path " + Path("doubtful") + input).exit_code,
      4);
  fs::create_directory(Path("doubtful_colors/station_0"));
  fs::copy(Path("doubtful_colors/model.ply"), Path("doubtful_colors/station_0/model.ply"));
  for (const char* name : {"model.ply", "station_0/model.ply"}) {
    const std::string more =
        "--max_points 500 --colors_path " + Path(std::string("doubtful_colors/") + name);
    const CommandResult result = Export("of_doubtful", more);
    EXPECT_EQ(result.exit_code, 4) << result.err;
    json report = json::parse(ReadBytes(Path("of_doubtful/report.json")));
    EXPECT_EQ(report["trusted"], false);
    EXPECT_NE(report["reason"].get<std::string>().find("Too few points lie on the surface"),
              std::string::npos);
    EXPECT_EQ(Export("of_doubtful", more + " --accept_untrusted 1").exit_code, 0);
    report = json::parse(ReadBytes(Path("of_doubtful/report.json")));
    EXPECT_NE(report["warnings"].dump().find("Too few points"), std::string::npos);
  }
  // Colours that somebody keeps elsewhere, without a report, are taken as they are.
  fs::copy(Path("doubtful_colors/model.ply"), Path("kept_colors.ply"));
  EXPECT_EQ(
      Export("of_kept", "--max_points 500 --colors_path " + Path("kept_colors.ply")).exit_code, 0);
}

TEST_F(ExportCommand, SaysWhyTheAlignmentWasRefused) {
  fs::create_directory(Path("refused"));
  WriteJson(Path("refused/alignment.json"),
            {{"trusted", false}, {"reason", "The picks lie on a line."}});
  const CommandResult result = Export("of_refused", "", "refused");
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_NE(result.err.find("refused to align: The picks lie on a line."), std::string::npos)
      << result.err;
}

TEST_F(ExportCommand, SomebodyWhoWalkedThroughAPhotoIsMasked) {
  ASSERT_EQ(Export("masked", "--format nerfstudio").exit_code, 0);
  const json report = json::parse(ReadBytes(Path("masked/report.json")));
  int with_somebody = 0;
  for (const json& image : report["images"]) with_somebody += image["moving"] > 0.05;
  EXPECT_GE(with_somebody, 1);
  EXPECT_LE(with_somebody, 4);
}

TEST_F(ExportCommand, FisheyesBecomePinholePictures) {
  const CommandResult result =
      RunCommandLine("roomtex-export --quiet --input_path " + Path("fisheye") +
                     "/truth --image_path " + Path("fisheye") + "/photos --scan_path " +
                     Path("fisheye") + "/scan.rtpi --output_path " + Path("pinholes"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Errors errors = Reproject("colmap", "pinholes");
  EXPECT_LT(errors.max_px, 0.01);
  EXPECT_LT(errors.median_m, 0.005);
}

TEST_F(ExportCommand, ScansAndPhotosBecomeOneE57) {
  EXPECT_EQ(Export("e57", "--format e57 --max_image_size 200").exit_code, 2);
  // What does not appear is not named.
  EXPECT_EQ(Export("e57", "--format e57 --report_path /sys/r.json").out, "");
  EXPECT_FALSE(fs::exists(Path("e57/scan.e57")));
  const CommandResult result = Export("e57", "--format e57");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.out, Path("e57") + "\n");
  const ScanFile file = ReadScanFile(Path("e57/scan.e57"), {});
  EXPECT_EQ(file.scans.at(0).num_columns, 700);
}

TEST_F(ExportCommand, RefusesWhatItMustNotTouch) {
  fs::create_directory(Path("precious"));
  WriteBytes(Path("precious/thesis.txt"), "years of work");
  const CommandResult refused = Export("precious", "");
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_NE(refused.err.find("did not write"), std::string::npos) << refused.err;
  EXPECT_TRUE(fs::exists(Path("precious/thesis.txt")));

  SparseModel model = ReadSparseModel(Path("model"));
  for (auto& [id, image] : model.images) {
    if (image.name == "photo_001.jpg") image.name = "../photos/photo_001.jpg";
  }
  WriteSparseModel(model, Path("climbing"));
  const CommandResult climbing = Export("climbed", "", "climbing");
  EXPECT_EQ(climbing.exit_code, 0) << climbing.err;
  const json report = json::parse(ReadBytes(Path("climbed/report.json")));
  ASSERT_EQ(report["photos_left_out"].size(), 1u);
  EXPECT_NE(report["photos_left_out"].dump().find("../photos/photo_001.jpg"), std::string::npos);
  EXPECT_FALSE(fs::exists(Path("climbed/photos")));
}

TEST_F(ExportCommand, ChecksItsOptions) {
  ExportOptions options;
  ScanReaderOptions reader;
  BlendOptions blend;
  ExpectChecksItsOptions("roomtex-export", "--input_path none --image_path none --output_path none",
                         {FieldsOf(&options), FieldsOf(&options.occlusion), FieldsOf(&reader),
                          FieldsOf(&blend).Only({"Blend.min_agreement"})});
}

// A trainer reads floats: 0.25 m apart in UTM.
TEST(NerfstudioModel, LiesAboutANearOriginWhereTheScanIsFar) {
  const TempFolder folder;
  const Eigen::Vector3d far(500000.125, 5200000.25, 400);
  ExportScene scene;
  for (int k = 0; k < 3; ++k) {
    scene.points.push_back({far + Eigen::Vector3d(0.001 * k, 2, 1), {1, 2, 3}});
  }
  ExportedPhoto photo;
  photo.name = "a.jpg";
  photo.camera.width = photo.camera.height = 10;
  photo.camera.params = {10, 10, 5, 5};
  photo.cam_from_scan.translation = -far;
  WriteNerfstudioModel(scene, {photo}, {0, 0, 1}, false, folder.path());
  const Json transforms = Json::parse(ReadBytes(folder / "transforms.json"));
  const auto translation = [](const Json& rows) {
    return Eigen::Vector3d(rows[0][3], rows[1][3], rows[2][3]);
  };
  const Eigen::Vector3d origin = translation(transforms["scan_from_world"]);
  const Eigen::Vector3d camera = translation(transforms["frames"][0]["transform_matrix"]);
  EXPECT_LT(camera.norm(), 10);
  EXPECT_LT((origin + camera - far).norm(), 1e-8);
  const std::string ply = ReadBytes(folder / "points3D.ply");
  const char* const first = ply.data() + ply.size() - 3 * 15;
  for (int k = 0; k < 3; ++k) {
    Eigen::Vector3f x;
    std::memcpy(x.data(), first + 15 * k, 12);
    EXPECT_LT((origin + x.cast<double>() - scene.points[k].x_in_scan).norm(), 1e-6) << k;
  }
}

}  // namespace
}  // namespace roomtex
