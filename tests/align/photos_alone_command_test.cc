// roomtex-align without a sparse model, as a user runs it.

#include <filesystem>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/report.h"
#include "core/text.h"
#include "tests/align/case_folder.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

struct PhotosAlone {
  PhotosAlone() : files(MakeCase(0, 6)) {
    const SimulatedRoom& room = *MakeCase(0, 6).room;
    name = files_name();
    std::filesystem::create_directories(files.folder / "images");
    cv::imwrite(files.folder / ("images/" + name), room.RenderPhoto(room.BestPhotoForPicks()));
    const Camera& camera = room.camera();
    camera_options = std::string(" --camera_model ") + CameraModelName(camera.model);
    std::string params;
    for (const double param : camera.params) params += (params.empty() ? "" : ",") + Exact(param);
    camera_options += " --camera_params " + params;
  }
  static std::string files_name() { return MakeCase(0, 6).picks[0].image_name; }

  CommandResult Align(const std::string& more) const {
    return RunCommandLine("roomtex-align --quiet --image_path " + (files.folder / "images") +
                          " --scan_path " + files.scan_path + " --picks_path " + files.picks_path +
                          " --output_path " + files.output_path + more);
  }

  CaseFolder files;
  std::string name, camera_options;
};

TEST(PhotosAloneCommand, WritesAModelOfThePhotosAndAReportWithTheUsualKeys) {
  const PhotosAlone alone;
  std::filesystem::create_directories(alone.files.output_path);
  WriteBytes(alone.files.folder / "aligned/scan_from_sparse.txt", "of an earlier run");
  const CommandResult result = alone.Align(alone.camera_options);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel aligned = ReadSparseModel(alone.files.output_path);
  ASSERT_EQ(aligned.images.size(), 1u);
  EXPECT_EQ(aligned.points.size(), 6u);
  for (const auto& [id, point] : aligned.points) EXPECT_GT(point.color.cast<int>().sum(), 0);
  const SimulatedRoom& room = *MakeCase(0, 6).room;
  const double error = (aligned.FindImage(alone.name)->cam_from_model.TargetOriginInSource() -
                        room.CamFromScan(room.BestPhotoForPicks()).TargetOriginInSource())
                           .norm();
  const Json report = Json::parse(ReadBytes(alone.files.folder / "aligned/alignment.json"));
  EXPECT_EQ(report["trusted"], true);
  EXPECT_LT(1000 * error, 2 * report["expected_error"]["at_cameras_mm"].get<double>());
  for (const char* key : {"scan_from_sparse", "plane_bundle", "placement", "surface_geometry"}) {
    EXPECT_TRUE(report.at(key).is_null()) << key;
  }
  EXPECT_TRUE(report["scale"]["value"].is_null());
  EXPECT_EQ(report["picks"]["num_used"], 6);
  EXPECT_GT(report["picks"]["per_pick"][0]["leave_one_out_px"], 0);
  EXPECT_EQ(report["images"][0]["focal_length_from"], "params");
  EXPECT_EQ(report["agreement"]["gradient_shift"]["supports"], true);
  EXPECT_FALSE(std::filesystem::exists(alone.files.folder / "aligned/scan_from_sparse.txt"));
}

TEST(PhotosAloneCommand, PlacesPhotosWithoutPicksAndNamesThoseThatItCannot) {
  const TempFolder folder;
  const std::string room = folder / "room", output = folder / "aligned";
  ASSERT_EQ(
      RunCommandLine("roomtex-simulate --quiet --random_seed 171 --num_photos 2 --photo_width 640 "
                     "--photo_height 480 --scan_columns 1600 --scan_rows 600 --output_path " +
                     room)
          .exit_code,
      0);
  const SparseModel truth = ReadSparseModel(room + "/truth");
  const Camera& camera = truth.cameras.begin()->second;
  std::string params;
  for (const double param : camera.params) params += (params.empty() ? "" : ",") + Exact(param);
  cv::Mat3b stranger(camera.height, camera.width);
  cv::randu(stranger, 0, 255);
  cv::imwrite(room + "/photos/stranger.png", stranger);
  const std::string command = "roomtex-align --quiet --image_path " + room +
                              "/photos --scan_path " + room + "/scan.rtpi --camera_model " +
                              CameraModelName(camera.model) + " --camera_params " + params +
                              " --output_path " + output;
  const CommandResult result = RunCommandLine(command);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel aligned = ReadSparseModel(output);
  ASSERT_EQ(aligned.images.size(), 2u);
  const Json report = Json::parse(ReadBytes(output + "/alignment.json"));
  for (const auto& [id, image] : aligned.images) {
    const double off = (image.cam_from_model.TargetOriginInSource() -
                        truth.FindImage(image.name)->cam_from_model.TargetOriginInSource())
                           .norm();
    EXPECT_LT(1000 * off, 2 * report["expected_error"]["at_cameras_mm"].get<double>());
  }
  EXPECT_THAT(report["warnings"].dump(),
              HasSubstr("stranger.png is left out: it shows too little"));
  EXPECT_EQ(report["search"]["method"], "appearance of each photo");
  ASSERT_EQ(report["search"]["photos"].size(), 3u);
  EXPECT_EQ(report["search"]["photos"][0]["placed"], true);
  EXPECT_GE(report["search"]["photos"][0]["num_cells"], 25);
  EXPECT_EQ(report["search"]["photos"][2]["placed"], false);
  EXPECT_EQ(report["images"][0]["focal_length_from"], "params");
  EXPECT_EQ(report["agreement"]["gradient_shift"]["contradicts"], false);

  // Six picks in one photo, one in the other, which says of the places that it may be at which is
  // meant.
  const std::vector<Pick> picks = ReadPicks(room + "/picks.csv");
  ASSERT_EQ(picks.size(), 6u);
  const SparseImage* other = nullptr;
  for (const auto& [id, image] : truth.images) {
    if (image.name != picks[0].image_name) other = &image;
  }
  const CameraProjection projection(camera);
  const auto line = [&](const Eigen::Vector2d& x, const Eigen::Vector3d& x_in_scan) {
    return fmt::format("{},{},{},{},{},{}\n", other->name, x.x(), x.y(), x_in_scan.x(),
                       x_in_scan.y(), x_in_scan.z());
  };
  std::string one_more, wrong;
  for (const Pick& pick : picks) {
    const Eigen::Vector3d x_in_cam = other->cam_from_model * pick.x_in_scan;
    const auto x = projection.ImgFromCam(x_in_cam);
    if (x_in_cam.z() < 0.5 || !x || x->minCoeff() < 0 || x->x() > camera.width ||
        x->y() > camera.height) {
      continue;
    }
    one_more = line(*x, pick.x_in_scan);
    wrong = line(Eigen::Vector2d(camera.width, camera.height) - *x, pick.x_in_scan);
  }
  ASSERT_NE(one_more, "");
  const std::string some = folder / "some";
  const auto with_picks = [&](const std::string& text) {
    WriteBytes(folder / "some.csv", text);
    std::filesystem::remove_all(some);
    const std::string to_some = command.substr(0, command.rfind(' ')) + " " + some;
    const CommandResult placed = RunCommandLine(to_some + " --picks_path " + (folder / "some.csv"));
    return std::make_pair(placed, Json::parse(ReadBytes(some + "/alignment.json")));
  };
  const auto [mixed, mixed_report] = with_picks(ReadBytes(room + "/picks.csv") + one_more);
  ASSERT_EQ(mixed.exit_code, 0) << mixed.err;
  const SparseModel both = ReadSparseModel(some);
  ASSERT_EQ(both.images.size(), 2u);
  EXPECT_EQ(mixed_report["picks"]["num_used"], 6);
  EXPECT_EQ(mixed_report["search"]["photos"].size(), 1u);
  const double off = (both.FindImage(other->name)->cam_from_model.TargetOriginInSource() -
                      other->cam_from_model.TargetOriginInSource())
                         .norm();
  for (const Json& image : mixed_report["images"]) {
    if (image["name"] != other->name) continue;
    EXPECT_LT(1000 * off, 2 * image["position_sigma_mm"].get<double>());
  }
  const auto [wronged, wronged_report] = with_picks(ReadBytes(room + "/picks.csv") + wrong);
  ASSERT_EQ(wronged.exit_code, 0) << wronged.err;
  EXPECT_EQ(ReadSparseModel(some).images.size(), 1u);
  EXPECT_THAT(wronged_report["warnings"].dump(),
              HasSubstr("what is said of it agrees with none of the places it may be at"));

  // The trusted result stays.
  for (const auto& [id, image] : truth.images)
    std::filesystem::remove(room + "/photos/" + image.name);
  const CommandResult none = RunCommandLine(command);
  EXPECT_EQ(none.exit_code, 4);
  EXPECT_THAT(none.err, HasSubstr("None of the photos could be placed"));
  EXPECT_THAT(none.err, HasSubstr("roomtex-pick"));
  EXPECT_EQ(ReadSparseModel(output).images.size(), 2u);
  const CommandResult nobody = RunCommandLine(command + " --near nobody.png,1,1,1");
  EXPECT_EQ(nobody.exit_code, 3);
  EXPECT_THAT(nobody.err, HasSubstr("not among those of --image_path (nearest name: "));
}

TEST(PhotosAloneCommand, SaysInASentenceWhatIsMissing) {
  const PhotosAlone alone;
  const auto expect = [](const CommandResult& result, int exit_code, const std::string& text) {
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    EXPECT_THAT(result.err, HasSubstr(text));
  };
  expect(alone.Align(""), 3, "nothing says its focal length, and 6 picks do not tell it");
  expect(alone.Align(" --camera_params 900,300,200,0"), 3, "far from its middle");
  expect(alone.files.Align("--camera_params 900,300,200,0"), 2, "photos without a sparse model");
  expect(RunCommandLine("roomtex-align --scan_path " + alone.files.scan_path + " --picks_path " +
                        alone.files.picks_path + " --output_path " + alone.files.output_path),
         2, "--input_path is missing");
  std::filesystem::rename(alone.files.folder / ("images/" + alone.name),
                          alone.files.folder / "images/other.jpg");
  expect(alone.Align(alone.camera_options), 3, "line 2: the photo " + alone.name + " is not in");
}

}  // namespace
}  // namespace roomtex
