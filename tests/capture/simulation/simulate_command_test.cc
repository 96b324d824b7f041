// roomtex-simulate as a user calls it, and the folder that it writes.

#include <filesystem>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "capture/simulation/capture_writer.h"
#include "colmap_ext/sparse_model.h"
#include "core/photo.h"
#include "core/report.h"
#include "importers/scan_reader.h"
#include "tests/capture/simulation/small_room.h"
#include "tests/support/matchers.h"
#include "tests/support/ply_vertices.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

constexpr char kSmall[] =
    " --num_photos 3 --photo_width 240 --photo_height 160 --scan_columns 240 --scan_rows 120 "
    "--shading 0 ";

std::vector<std::string> FilesBelow(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file())
      names.push_back(std::filesystem::relative(entry.path(), folder).string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

TEST(CaptureFolder, HoldsNothingOfAnEarlierCapture) {
  const TempFolder folder;
  const std::string line = "roomtex-simulate --quiet --output_path " + (folder / "capture") +
                           " --num_photos 1 --photo_width 120 --photo_height 80 "
                           "--scan_columns 120 --scan_rows 60 --shading 0 ";
  ASSERT_EQ(RunCommandLine(line + "--num_stations 3").exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "capture/scan_2.rtpi"));
  WriteBytes(folder / "capture/truth/associations.csv", "of an earlier capture");
  WriteBytes(folder / "capture/truth/pattern_1.png", "of an earlier capture");
  WriteBytes(folder / "capture/scan_mine.rtpi", "mine");
  ASSERT_EQ(RunCommandLine(line + "--num_stations 2").exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "capture/scan_1.rtpi"));
  EXPECT_FALSE(std::filesystem::exists(folder / "capture/scan_2.rtpi"));
  ASSERT_EQ(RunCommandLine(line).exit_code, 0);
  for (const char* name :
       {"scan_1.rtpi", "scan_poses.txt", "truth/associations.csv", "truth/pattern_1.png"}) {
    EXPECT_FALSE(std::filesystem::exists((folder / "capture/") + name)) << name;
  }
  EXPECT_EQ(ReadBytes(folder / "capture/scan_mine.rtpi"), "mine");
}

TEST(CaptureFolder, HoldsWhatTheRoomIs) {
  const TempFolder folder;
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 4;
  options.num_stations = 2;
  const SimulatedRoom room(options);
  Progress progress(true);
  const CaptureSummary summary = WriteCapture(room, folder / "capture", &progress);
  const std::string capture = folder / "capture";

  // Photos with EXIF.
  for (int photo = 0; photo < 4; ++photo) {
    const std::string path = capture + "/photos/" + room.PhotoName(photo);
    const ExposureData exposure = ReadExposureData(path);
    ASSERT_TRUE(exposure.exposure_time.has_value());
    EXPECT_NEAR(*exposure.exposure_time / room.ExposureTime(photo), 1, 1e-4);
    EXPECT_NEAR(exposure.f_number.value(), 8, 1e-6);
    EXPECT_NEAR(exposure.iso.value(), 400, 1e-6);
    EXPECT_NEAR(*exposure.RelativeExposure() /
                    *ReadExposureData(capture + "/photos/" + room.PhotoName(0)).RelativeExposure(),
                std::exp2(room.ExposureEv(photo) - room.ExposureEv(0)), 1e-3);
    const cv::Mat read = ReadPhoto(path), rendered = room.RenderPhoto(photo);
    EXPECT_LT(cv::norm(read, rendered, cv::NORM_L1) / static_cast<double>(3 * read.total()), 6);
  }

  // Scans read back with the defaults, at their places.
  const std::vector<Scan> scans = ReadScans({capture + "/scan.rtpi", capture + "/scan_1.rtpi"},
                                            capture + "/scan_poses.txt", ScanReaderOptions());
  ASSERT_EQ(scans.size(), 2u);
  std::vector<Eigen::Vector3d> measured;
  for (int station = 0; station < 2; ++station) {
    const Scan want = room.MakeScan(station);
    ASSERT_EQ(scans[station].num_columns, want.num_columns);
    ASSERT_EQ(scans[station].num_rows, want.num_rows);
    for (size_t i = 0; i < want.points.size(); ++i) {
      const int index = static_cast<int>(i);
      ASSERT_EQ(scans[station].IsMissing(index), want.IsMissing(index));
      if (want.IsMissing(index)) continue;
      ASSERT_LT((scans[station].points[i] - want.points[i]).norm(), 1e-5);
      ASSERT_EQ(scans[station].intensity[i], want.intensity[i]);
      measured.push_back(want.points[i]);
    }
  }
  EXPECT_EQ(summary.num_samples - summary.num_missing, measured.size());

  // Truth.
  const PlyVertices colors =
      ParsePlyVertices(ReadBytes(capture + "/truth/true_colors.ply"), "true_colors.ply");
  ASSERT_EQ(colors.points.size(), measured.size());
  for (size_t i = 0; i < measured.size(); i += 97) {
    EXPECT_THAT(colors.points[i].cast<double>().eval(), IsNearMatrix(measured[i], 1e-5));
  }
  const SparseModel truth = ReadSparseModel(capture + "/truth");
  ASSERT_EQ(truth.images.size(), 4u);
  for (int photo = 0; photo < 4; ++photo) {
    const SparseImage* const image = truth.FindImage(room.PhotoName(photo));
    ASSERT_NE(image, nullptr);
    EXPECT_THAT(image->cam_from_model, IsNearRigid(room.CamFromScan(photo), 1e-9, 1e-9));
  }
  EXPECT_EQ(truth.cameras.at(1).params, room.camera().params);
  const Similarity scan_from_room = ReadSimilarity(capture + "/truth/scan_from_room.txt");
  EXPECT_THAT((Rigid{scan_from_room.rotation, scan_from_room.translation}),
              IsNearRigid(room.ScanFromRoom(), 1e-9, 1e-9));
  EXPECT_NE(ReadBytes(capture + "/camera_options.txt").find("--ImageReader.camera_model OPENCV"),
            std::string::npos);
  EXPECT_EQ(summary.num_picks, 6);
  EXPECT_NE(ReadBytes(capture + "/picks.csv")
                .find("image_name,x,y,scan_x,scan_y,scan_z\n" + summary.picked_photo),
            std::string::npos);
}

TEST(CaptureFolder, LeavesExifOutWhenAsked) {
  const TempFolder folder;
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 1;
  options.exif = false;
  Progress progress(true);
  WriteCapture(SimulatedRoom(options), folder / "capture", &progress);
  EXPECT_FALSE(ReadExposureData(folder / "capture/photos/photo_000.jpg").exposure_time.has_value());
}

TEST(CaptureFolder, NotesTheFocalLengthWhenAsked) {
  const TempFolder folder;
  SimulatedRoomOptions options = SmallRoom();
  options.num_photos = 2;
  options.zoomed = 0.5;
  Progress progress(true);
  const SimulatedRoom room(options);
  WriteCapture(room, folder / "said_nothing", &progress);
  EXPECT_FALSE(ReadFocalLength(folder / "said_nothing/photos/photo_000.jpg").has_value());
  options.exif_lens = true;
  WriteCapture(SimulatedRoom(options), folder / "capture", &progress);
  for (int photo = 0; photo < 2; ++photo) {
    const auto noted = ReadFocalLength(folder / "capture/photos/" + room.PhotoName(photo));
    // A millimetre of film is 3 % of such lenses.
    EXPECT_NEAR(noted.value_or(0) / room.TrueCamera(photo).MeanFocalLength(), 1, 0.02);
  }
}

TEST(SimulateCommand, WritesTheSameBytesForTheSameSeed) {
  const TempFolder folder;
  const CommandResult first =
      RunCommandLine("roomtex-simulate --seed 5" + (kSmall + ("--output_path " + (folder / "a"))) +
                     " --report_path " + (folder / "report.json"));
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_EQ(first.out, (folder / "a") + "\n");
  const CommandResult second =
      RunCommandLine("roomtex-simulate --random_seed 5 --num_threads 1 --quiet" +
                     (kSmall + ("--output_path " + (folder / "b"))));
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_EQ(second.err, "");
  const auto files = FilesBelow(folder / "a");
  EXPECT_GE(files.size(), 13u);
  ASSERT_EQ(files, FilesBelow(folder / "b"));
  for (const std::string& name : files) {
    EXPECT_EQ(ReadBytes(folder / ("a/" + name)), ReadBytes(folder / ("b/" + name))) << name;
  }
  const Json report = Json::parse(ReadBytes(folder / "report.json"));
  EXPECT_EQ(report["command"], "roomtex-simulate");
  EXPECT_TRUE(report["trusted"]);
  EXPECT_EQ(report["num_photos"], 3);
  EXPECT_EQ(report["num_samples"], 240 * 120);
}

TEST(SimulateCommand, TruthAgainstItselfIsPerfect) {
  const TempFolder folder;
  ASSERT_EQ(
      RunCommandLine("roomtex-simulate" + (kSmall + ("--output_path " + (folder / "a")))).exit_code,
      0);
  const CommandResult result =
      RunCommandLine("roomtex-evaluate --truth_path " + (folder / "a/truth") + " --input_path " +
                     (folder / "a/truth") + " --ply_path " + (folder / "a/truth/true_colors.ply"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json answer = Json::parse(result.out);
  EXPECT_EQ(answer["poses"]["num_registered"], 3);
  EXPECT_LT(answer["poses"]["position_max_mm"].get<double>(), 1e-9);
  EXPECT_EQ(answer["color"]["share_wrong"].get<double>(), 0);
  EXPECT_EQ(answer["color"]["gain"].get<double>(), 1);
}

// tone: options of the photos' tone.
void ExpectMeanOfPhotosNearTheTruth(const std::string& tone) {
  const TempFolder folder;
  ASSERT_EQ(RunCommandLine("roomtex-simulate --reachable 1 --num_photos 6 --photo_width 480 "
                           "--photo_height 320 --scan_columns 480 --scan_rows 240 " +
                           tone + " --output_path " + (folder / "a"))
                .exit_code,
            0);
  const CommandResult result = RunCommandLine(
      "roomtex-evaluate --truth_path " + (folder / "a/truth") + " --scan_path " +
      (folder / "a/scan.rtpi") + " --ply_path " + (folder / "a/truth/reachable.ply"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json answer = Json::parse(result.out);
  const Json& points = answer["color"];
  const Json& cells = answer["color_of_cells"];
  EXPECT_EQ(points["coverage_of_seen"].get<double>(), 1);
  EXPECT_EQ(points["colored_but_unseen"].get<double>(), 0);
  EXPECT_GT(points["coverage"].get<double>(), 0.3);
  EXPECT_NEAR(points["gain"].get<double>(), 1, 0.02);
  EXPECT_LT(points["low_frequency_error"].get<double>(), 0.02);
  EXPECT_GT(points["edge_share"].get<double>(), 0.02);
  // Photos of few pixels see about the mean over a sample's cell.
  EXPECT_GT(cells["psnr_db"].get<double>(), points["psnr_db"].get<double>());
  EXPECT_GT(cells["psnr_db"].get<double>(), 26);
}

TEST(SimulateCommand, MeanOfPhotosWithTrueVisibilityIsNearTheTruth) {
  ExpectMeanOfPhotosNearTheTruth("");
}

TEST(SimulateCommand, MeanOfPhotosWithTrueToneIsNearTheTruth) {
  ExpectMeanOfPhotosNearTheTruth("--response film --vignetting 0.4 --white_balance_ev 0.2");
}

TEST(SimulateCommand, WritesPatternedAndPlainPhotosAsAPhotographerTakesThem) {
  const TempFolder folder;
  const std::string capture = folder / "capture";
  const CommandResult result = RunCommandLine(
      "roomtex-simulate --projectors 2 --projector_width 640 --projector_height 360" +
      (kSmall + ("--output_path " + capture)) + " --report_path " + (folder / "report.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const SparseModel truth = ReadSparseModel(capture + "/truth");
  ASSERT_EQ(truth.images.size(), 6u);
  std::string pairs = "patterned_image,plain_image\n", last_time;
  for (int photo = 0; photo < 6; photo += 2) {
    const std::string names[2] = {"IMG_000" + std::to_string(photo + 1) + ".jpg",
                                  "IMG_000" + std::to_string(photo + 2) + ".jpg"};
    pairs += names[0] + "," + names[1] + "\n";
    double times[2];
    for (int k = 0; k < 2; ++k) {
      const ExposureData exposure = ReadExposureData(capture + "/photos/" + names[k]);
      EXPECT_LT(last_time, exposure.date_time);
      last_time = exposure.date_time;
      times[k] = exposure.exposure_time.value();
    }
    EXPECT_LT(times[0], times[1]);
    EXPECT_THAT(truth.FindImage(names[0])->cam_from_model,
                IsNearRigid(truth.FindImage(names[1])->cam_from_model, 0, 0));
    // More contrast in the light of the projectors.
    const auto contrast = [&](const std::string& name) {
      cv::Scalar mean, deviation;
      cv::meanStdDev(ReadPhoto(capture + "/photos/" + name), mean, deviation);
      return deviation[1] / mean[1];
    };
    EXPECT_GT(contrast(names[0]), 0.12);
  }
  EXPECT_EQ(ReadBytes(capture + "/truth/associations.csv"), pairs);
  for (const int projector : {1, 2}) {
    const cv::Mat pattern =
        ReadPhoto(capture + "/truth/pattern_" + std::to_string(projector) + ".png");
    EXPECT_EQ(pattern.size(), cv::Size(640, 360));
  }
  EXPECT_NE(ReadBytes(capture + "/truth/projectors.txt").find("pattern_2.png 640 360 "),
            std::string::npos);
  EXPECT_NE(ReadBytes(capture + "/README.txt").find("roomtex-associate"), std::string::npos);
  const Json report = Json::parse(ReadBytes(folder / "report.json"));
  EXPECT_EQ(report["num_photos"], 6);
  EXPECT_EQ(report["num_projectors"], 2);
}

TEST(SimulateCommand, MixesInPhotosOfASimilarRoomWithoutTruth) {
  const TempFolder folder;
  const std::string out = " --quiet --output_path " + (folder / "capture") + kSmall;
  ASSERT_EQ(RunCommandLine("roomtex-simulate" + out + " --similar_room 2").exit_code, 0);
  const SparseModel truth = ReadSparseModel(folder / "capture/truth");
  const std::vector<std::string> photos = FilesBelow(folder / "capture/photos");
  EXPECT_EQ(photos.size(), truth.images.size() + 2);
  std::string last_time;  // taken one after the other, those of the other room last
  for (const std::string& photo : photos) {
    const std::string time = ReadExposureData(folder / ("capture/photos/" + photo)).date_time;
    EXPECT_LT(last_time, time) << photo;
    last_time = time;
  }
}

TEST(SimulateCommand, TheTruthHasACameraOfItsOwnForZoomedPhotos) {
  const TempFolder folder;
  const std::string out = " --quiet --output_path " + (folder / "capture") + kSmall;
  ASSERT_EQ(RunCommandLine("roomtex-simulate" + out + " --zoomed 0.34").exit_code, 0);
  const SparseModel truth = ReadSparseModel(folder / "capture/truth");
  ASSERT_EQ(truth.cameras.size(), 2u);
  int num_zoomed = 0;
  for (const auto& [id, image] : truth.images) num_zoomed += image.camera_id == 2;
  EXPECT_EQ(num_zoomed, 1);
  EXPECT_NEAR(truth.cameras.at(2).params[0] / truth.cameras.at(1).params[0], 1.3, 1e-12);
  const std::string told = ReadBytes(folder / "capture/cameras.txt");
  EXPECT_EQ(told.find("\n2 "), std::string::npos) << "nobody tells";
}

TEST(SimulateCommand, WritesASecondRoomWithPicksOfItsOwn) {
  const TempFolder folder;
  const std::string capture = folder / "capture";
  const std::string out = " --quiet --output_path " + capture + kSmall;
  ASSERT_EQ(RunCommandLine("roomtex-simulate" + out + " --second_room 1").exit_code, 0);
  const SparseModel truth = ReadSparseModel(capture + "/truth");
  EXPECT_EQ(truth.images.size() % 2, 0u);  // as many in each room, and twelve between them
  EXPECT_GT(truth.images.size(), 12u);
  for (const char* file : {"scan_1.rtpi", "scan_poses.txt", "second_room_picks.csv"}) {
    EXPECT_TRUE(std::filesystem::exists(capture + "/" + file)) << file;
  }
  EXPECT_NE(ReadBytes(capture + "/picks.csv"), ReadBytes(capture + "/second_room_picks.csv"));
  EXPECT_NE(ReadBytes(capture + "/README.txt").find("scan_1.rtpi on of the second room"),
            std::string::npos);
  EXPECT_EQ(RunCommandLine("roomtex-simulate" + out + " --second_room 1 --projectors 1").exit_code,
            2);
}

TEST(SimulateCommand, SaysWhatIsWrong) {
  const TempFolder folder;
  const auto expect = [&](const std::string& arguments, int exit_code, const std::string& text) {
    const CommandResult result = RunCommandLine("roomtex-simulate " + arguments);
    EXPECT_EQ(result.exit_code, exit_code) << arguments;
    EXPECT_NE(result.err.find(text), std::string::npos) << arguments << "\n" << result.err;
    EXPECT_EQ(result.out, "");
  };
  const std::string out = " --output_path " + (folder / "x") + " ";
  expect("", 2, "output_path");
  expect(out + "--num_photos 0 --camera_model OPENVC", 2, "num_photos");
  expect(out + "--num_photos 0 --camera_model OPENVC", 2, "OPENVC");
  expect(out + "--num_photos three", 2, "three");
  expect(out + "--seed -2", 2, "--seed must be -1");
  expect(out + "--projectors 9", 2, "projectors must be 0 to 8");
  expect(out + "--projectors 1 --projector_focus 0", 2, "projector_focus");
  expect(out + "--bare perhaps", 2, "bare");
  expect(out + "--photo_size 12", 2, "photo_size");
  EXPECT_FALSE(std::filesystem::exists(folder / "x"));
  WriteBytes(folder / "file", "not a folder");
  expect("--output_path " + (folder / "file") + kSmall, 3, "file");
  EXPECT_EQ(ReadBytes(folder / "file"), "not a folder");
  std::filesystem::create_directories(folder / "old/photos");
  WriteBytes(folder / "old/photos/photo_007.jpg", "an older capture");
  expect("--output_path " + (folder / "old") + kSmall, 3, "photo_007.jpg");
}

}  // namespace
}  // namespace roomtex
