// roomtex-align without a sparse model, as a user runs it.

#include <filesystem>

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
