#include <algorithm>
#include <filesystem>

#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "core/frames.h"
#include "core/report.h"
#include "core/statistics.h"
#include "importers/content_hash.h"
#include "importers/scan_record.h"
#include "tests/align/case_folder.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::HasSubstr;

// Exit code and a part of the message on stderr.
void ExpectFailure(const CommandResult& result, int exit_code, const std::string& text) {
  EXPECT_EQ(result.exit_code, exit_code) << result.err;
  EXPECT_THAT(result.err, HasSubstr(text));
  EXPECT_EQ(result.out, "");
  // A sentence, and a pointer to the help for an option that does not exist.
  EXPECT_LE(std::count(result.err.begin(), result.err.end(), '\n'), 2) << result.err;
}

// The files are fine, but no alignment is to be believed: the report says why, and no model is
// written.
void ExpectContradiction(const CaseFolder& files, const CommandResult& result,
                         const std::string& text) {
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_EQ(report["trusted"], false);
  EXPECT_NE(report["reason"].get<std::string>().find(text), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(files.folder / "aligned/images.bin"));
}

TEST(AlignCommand, WritesTheAlignedModelTheReportAndTheSimilarity) {
  const SimulatedCase& one = MakeCase();
  const CaseFolder files(one);
  const CommandResult result = files.Align("--report_path " + (files.folder / "report.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  EXPECT_EQ(result.out, files.output_path + "\n");
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_EQ(report, Json::parse(ReadBytes(files.folder / "report.json")));
  EXPECT_EQ(report["command"], "roomtex-align");
  EXPECT_EQ(report["trusted"], true);
  EXPECT_EQ(report["picks"]["count"], 8);
  EXPECT_LT(report["picks"]["rms_px"], 4.0);
  EXPECT_GE(report["picks"]["max_px"], report["picks"]["rms_px"]);
  EXPECT_EQ(report["picks"]["per_pick"].size(), 8u);
  EXPECT_EQ(report["picks"]["per_pick"][0]["image_name"], one.picks[0].image_name);
  EXPECT_GT(report["scale"]["num_features"], 50);
  EXPECT_LT(report["scale"]["relative_mad"], 0.01);
  EXPECT_TRUE(report["planes"].is_array());
  EXPECT_LT(report["plane_rms_m"]["after"], report["plane_rms_m"]["before"]);
  EXPECT_LT(report["plane_rms_m"]["after"], 0.003);
  EXPECT_GT(report["plane_rms_m"]["num_points"], 1000);
  EXPECT_LT(report["reprojection_rms_px"]["after"],
            1.2 * report["reprojection_rms_px"]["before"].get<double>());
  EXPECT_EQ(report["plane_bundle"]["used"], true);
  EXPECT_EQ(report["plane_bundle"]["reason"], "");
  EXPECT_TRUE(report["plane_bundle"]["scan_bend"].is_null());
  ASSERT_GE(report["planes"].size(), 6u);
  int num_on_planes = 0;
  for (const Json& plane : report["planes"]) num_on_planes += plane["num_points"].get<int>();
  EXPECT_GT(num_on_planes, 800);
  EXPECT_TRUE(report["agreement"].is_null());

  const Similarity written = ReadSimilarity(files.folder / "aligned/scan_from_sparse.txt");
  EXPECT_NEAR(report["scan_from_sparse"]["scale"], written.scale, 1e-12);
  SparseModel expected = one.model;
  TransformModel(written, &expected);
  const SparseModel aligned = ReadSparseModel(files.folder / "aligned");
  ASSERT_EQ(aligned.images.size(), expected.images.size());
  ASSERT_EQ(aligned.points.size(), expected.points.size());
  // Adjusted by a little, tracks and keypoints kept.
  for (const auto& [id, image] : aligned.images) {
    EXPECT_EQ(image.name, expected.images.at(id).name);
    EXPECT_EQ(image.point3d_ids, expected.images.at(id).point3d_ids);
    EXPECT_THAT(image.cam_from_model,
                IsNearRigid(expected.images.at(id).cam_from_model, 2e-3, 5e-3));
  }
  SparseModel errors = aligned;
  UpdateReprojectionErrors(&errors);
  for (const auto& [id, point] : aligned.points) {
    EXPECT_EQ(point.track.size(), expected.points.at(id).track.size());
    EXPECT_NEAR(point.error, errors.points.at(id).error, 1e-9);
  }
  EXPECT_LT(WorstPoseErrors(*one.room, aligned, Similarity()).position, 0.003);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, written).position, 0.003);
}

// Moved onto a scan of another shape, a model fits it however far both are from the room.
TEST(AlignCommand, WhatWasBentOntoTheScanIsNotJudgedByIt) {
  CaseFolder files(MakeCase());
  ASSERT_EQ(files.Align().exit_code, 0);
  files.input_path = files.output_path;
  files.output_path = files.folder / "again";
  EXPECT_EQ(files.Align().exit_code, 0);
  const std::string path = files.input_path + "/alignment.json";
  Json report = Json::parse(ReadBytes(path));
  ASSERT_LT(report["expected_error"]["disagreement_mm"].get<double>(), 10);
  report["expected_error"]["disagreement_mm"] = 35.2;
  WriteBytes(path, report.dump());
  const CommandResult result = files.Align();
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.err, HasSubstr("differed in shape by 35 mm"));
}

// Placed by the middle rows; what is written are the photos' own keypoints.
TEST(AlignCommand, ARollingShutterIsSaid) {
  RowMotions motions;
  const SimulatedCase one = WithRollingShutter(MakeCase(2, 6), 1, &motions);
  const CaseFolder files(one);
  const CommandResult result = files.Align();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_EQ(report["rolling_shutter"]["num_photos"], one.model.images.size());
  EXPECT_LT(report["rolling_shutter"]["cost_moving"],
            0.75 * report["rolling_shutter"]["cost_still"].get<double>());
  EXPECT_THAT(report["warnings"].dump(), HasSubstr("rolling shutter"));
  EXPECT_EQ(report["picks"]["per_pick"][0]["x"], one.picks[0].x_in_img.x());
  const SparseModel aligned = ReadSparseModel(files.folder / "aligned");
  std::vector<double> off, size;
  for (const Json& photo : report["images"]) {
    const SparseImage* const image = aligned.FindImage(photo["name"].get<std::string>());
    ASSERT_NE(image, nullptr);
    EXPECT_EQ(image->points2d, one.model.images.at(image->image_id).points2d);
    const Eigen::Vector3d turn(photo["row_turn_deg"][0], photo["row_turn_deg"][1],
                               photo["row_turn_deg"][2]);
    // The camera turns the other way than what it sees.
    const Eigen::Vector3d truth = -DegFromRad(1.0) * motions.at(image->image_id).turn;
    off.push_back((turn - truth).norm());
    size.push_back(truth.norm());
  }
  EXPECT_LT(Median(off), 0.25 * Median(size));
  EXPECT_LT(WorstPoseErrors(*one.room, aligned, Similarity()).position, 0.006);

  ASSERT_EQ(files.Align("--PlaneBA.rolling_shutter 0").exit_code, 0);
  const Json without = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_TRUE(without["rolling_shutter"].is_null());
  EXPECT_FALSE(without["images"][0].contains("row_turn_deg"));
}

// Points alone, in UTM: aligned as the grid is, and the answer is in UTM.
TEST(AlignCommand, ACloudFarFromItsOriginIsAlignedLikeTheGrid) {
  const SimulatedCase& one = MakeCase();
  CaseFolder files(one);
  const Eigen::Vector3d utm(412345.5, 5654321.25, 120);
  std::vector<Pick> picks = one.picks;
  for (Pick& pick : picks) pick.x_in_scan += utm;
  WritePicks(files.picks_path, picks);
  Scan cloud = one.scans[0];
  for (Eigen::Vector3d& point : cloud.points) point += utm;
  cloud.scan_from_station.translation.setZero();
  files.scan_path = files.folder / "cloud.ply";
  WriteScan(cloud, {}, files.scan_path);
  const CommandResult result = files.Align();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_GE(report["planes"].size(), 5u);
  EXPECT_NEAR(report["planes"][0]["point"][1].get<double>(), utm.y(), 10);
  EXPECT_NEAR(report["scan_from_sparse"]["translation"][0].get<double>(), utm.x(), 20);
  SparseModel aligned = ReadSparseModel(files.folder / "aligned");
  Similarity back;
  back.translation = -utm;
  TransformModel(back, &aligned);
  EXPECT_LT(WorstPoseErrors(*one.room, aligned, Similarity()).position, 0.004);
}

TEST(AlignCommand, WithoutTheAdjustmentTheModelIsMovedByTheSimilarity) {
  const SimulatedCase& one = MakeCase();
  const CaseFolder files(one);
  const CommandResult result = files.Align("--plane_constrained 0");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  SparseModel expected = one.model;
  TransformModel(ReadSimilarity(files.folder / "aligned/scan_from_sparse.txt"), &expected);
  const SparseModel aligned = ReadSparseModel(files.folder / "aligned");
  ASSERT_EQ(aligned.points.size(), expected.points.size());
  for (const auto& [id, image] : aligned.images) {
    EXPECT_THAT(image.cam_from_model,
                IsNearRigid(expected.images.at(id).cam_from_model, 1e-7, 1e-9));
  }
  for (const auto& [id, point] : aligned.points) {
    EXPECT_THAT(point.x_in_model, IsNearMatrix(expected.points.at(id).x_in_model, 1e-9));
  }
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_NEAR(report["reprojection_rms_px"]["before"], report["reprojection_rms_px"]["after"],
              1e-6);
  EXPECT_TRUE(report["plane_bundle"].is_null());
  EXPECT_TRUE(report["plane_rms_m"]["before"].is_null());
  EXPECT_TRUE(report["plane_rms_m"]["after"].is_null());
  EXPECT_EQ(report["planes"].size(), 0u);
}

TEST(AlignCommand, AFixedClickedViewKeepsThePoseOfItsPicks) {
  const SimulatedCase& one = MakeCase();
  const CaseFolder files(one);
  const CommandResult result = files.Align("--PlaneBA.fix_clicked_view 1");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  ASSERT_EQ(report["plane_bundle"]["used"], true) << report["plane_bundle"]["reason"];
  const Json& from_picks = report["scan_from_sparse_from_picks"];
  Similarity similarity;
  similarity.scale = from_picks["scale"];
  for (int k = 0; k < 3; ++k) similarity.translation[k] = from_picks["translation"][k];
  similarity.rotation =
      Eigen::Quaterniond(from_picks["rotation_wxyz"][0], from_picks["rotation_wxyz"][1],
                         from_picks["rotation_wxyz"][2], from_picks["rotation_wxyz"][3]);
  const std::string name = report["picks"]["image_name"];
  const SparseModel aligned = ReadSparseModel(files.folder / "aligned");
  EXPECT_THAT(
      aligned.FindImage(name)->cam_from_model,
      IsNearRigid(CamFromScan(one.model.FindImage(name)->cam_from_model, similarity), 1e-7, 1e-9));
}

TEST(AlignCommand, ABentScanIsSaidAndThePhotosFollowIt) {
  SimulatedCase one = MakeCase();
  SimulatedRoomOptions options = one.room->options();
  options.bend = 0.01;
  const SimulatedRoom bent(options);
  one.scans = {bent.MakeScan()};
  one.scans[0].path = "room.rtpi";
  one.scans[0].is_rtpi = true;
  one.picks = PicksOfPhoto(bent, bent.BestPhotoForPicks(), 8);
  const CaseFolder files(one);
  const CommandResult result = files.Align();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  ASSERT_EQ(report["warnings"].size(), 1u);
  EXPECT_THAT(report["warnings"][0].get<std::string>(), HasSubstr("The scan is bent by"));
  EXPECT_GT(report["plane_bundle"]["scan_bend"]["rms_m"], 0.005);
  EXPECT_EQ(report["plane_bundle"]["scan_bend"]["followed"], 1);
  EXPECT_NEAR(report["plane_bundle"]["scan_bend"]["max_range_share"], 0.01, 0.002);
  // The similarity is that of the room, not of the bent walls.
  const Similarity written = ReadSimilarity(files.folder / "aligned/scan_from_sparse.txt");
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, written).position, 0.004);
  ASSERT_EQ(files.Align("--PlaneBA.bend 0").exit_code, 0);
  EXPECT_TRUE(
      Json::parse(ReadBytes(files.folder / "aligned/alignment.json"))["plane_bundle"]["scan_bend"]
          .is_null());
}

TEST(AlignCommand, GivesTheSameForEveryNumberOfThreadsAndForATextModel) {
  CaseFolder files(MakeCase());
  WriteSparseModelText(MakeCase().model, files.folder / "text");
  ASSERT_EQ(files.Align("--num_threads 1").exit_code, 0);
  const std::string one_thread = ReadBytes(files.folder / "aligned/images.bin");
  const std::string similarity = ReadBytes(files.folder / "aligned/scan_from_sparse.txt");
  files.input_path = files.folder / "text";
  ASSERT_EQ(files.Align("--num_threads 4").exit_code, 0);
  EXPECT_EQ(ReadBytes(files.folder / "aligned/images.bin"), one_thread);
  EXPECT_EQ(ReadBytes(files.folder / "aligned/scan_from_sparse.txt"), similarity);
}

TEST(AlignCommand, WithoutPicksSaysWhatToDo) {
  const CaseFolder files(MakeCase());
  const CommandResult result =
      RunCommandLine("roomtex-align --input_path " + (files.folder / "sparse") + " --scan_path " +
                     (files.folder / "room.rtpi") + " --output_path " + (files.folder / "aligned"));
  ExpectFailure(result, 2, "--picks_path is missing");
}

TEST(AlignCommand, RefusesToOverwriteItsInput) {
  CaseFolder files(MakeCase());
  files.output_path = files.input_path;
  const std::string before = ReadBytes(files.folder / "sparse/images.bin");
  ExpectFailure(files.Align(), 2, "never overwritten");
  EXPECT_EQ(ReadBytes(files.folder / "sparse/images.bin"), before);
}

TEST(AlignCommand, RefusesOptionsThatMakeNoSense) {
  const CaseFolder files(MakeCase());
  ExpectFailure(files.Align("--Trust.max_scale_mad -1"), 2, "--Trust.max_scale_mad");
  ExpectFailure(files.Align("--Picks.min_gain 0.5"), 2, "--Picks.min_gain");
  ExpectFailure(files.Align("--PlaneBA.beta -1"), 2, "--PlaneBA.beta");
  ExpectFailure(files.Align("--PlaneBA.num_rounds 0"), 2, "--PlaneBA.num_rounds");
  ExpectFailure(files.Align("--no_such_option 1"), 2, "no_such_option");
}

TEST(AlignCommand, RefusesMissingInputs) {
  CaseFolder files(MakeCase());
  ExpectFailure(files.Align("--image_path /nonexistent"), 3, "/nonexistent");
  ExpectFailure(files.Align("--database_path /nonexistent.db"), 3, "/nonexistent.db");
  files.picks_path = "/nonexistent.csv";
  ExpectFailure(files.Align(), 3, "/nonexistent.csv");
  files.input_path = "/nonexistent";
  ExpectFailure(files.Align(), 3, "/nonexistent");
  EXPECT_FALSE(std::filesystem::exists(files.folder / "aligned"));
}

TEST(AlignCommand, RefusesFewerThanSixPicks) {
  SimulatedCase one = MakeCase();
  one.picks.resize(5);
  const CommandResult result = CaseFolder(one).Align();
  ExpectFailure(result, 3, "holds 5 picks");
  // What is enough for them.
  EXPECT_THAT(result.err, HasSubstr("or give --image_path"));
}

TEST(AlignCommand, RefusesAnImageNameThatIsNotInTheModel) {
  SimulatedCase one = MakeCase();
  const std::string right = one.picks[0].image_name;
  for (Pick& pick : one.picks) pick.image_name = "x" + right;
  ExpectFailure(CaseFolder(one).Align(), 3, "nearest name: " + right);
}

TEST(AlignCommand, RefusesAMirroredScanAndNamesTheOption) {
  const CaseFolder files(MakeCase());
  // The picks were made on the scan read clockwise. (Picks on the mirrored scan:
  // alignment_test.cc.)
  ExpectContradiction(files, files.Align("--azimuth counterclockwise"), "--azimuth clockwise");
  EXPECT_EQ(Json::parse(ReadBytes(files.folder / "aligned/alignment.json"))["mirrored"], "scan");
}

TEST(AlignCommand, FindsTheReadingOfAScanByThePicks) {
  const CaseFolder files(MakeCase());
  ScanWriterOptions options;
  options.counterclockwise = true;
  WriteScan(MakeCase().scans[0], {}, files.scan_path, options);
  // As files are that do not say it.
  std::string bytes = ReadBytes(files.scan_path);
  const std::string told = "# azimuth: counterclockwise";
  ASSERT_NE(bytes.find(told), std::string::npos);
  WriteBytes(files.scan_path,
             bytes.replace(bytes.find(told), told.size(), "# azimuth: nobody has told."));
  const CommandResult result = files.Align();
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_THAT(report["warnings"].dump(), HasSubstr("is read counterclockwise (--azimuth auto)"));
  EXPECT_EQ(report["scans"][0]["azimuth"], "counterclockwise");
  EXPECT_LT(
      WorstPoseErrors(*MakeCase().room, ReadSparseModel(files.folder / "aligned"), Similarity())
          .position,
      0.003);
  // What is said wins.
  EXPECT_EQ(files.Align("--azimuth counterclockwise").exit_code, 0);
}

// A copy of a photo in the model, with all its keypoints.
void AddCopy(uint32_t of, const std::string& name, SparseModel* model) {
  SparseImage copy = model->images.at(of);
  copy.image_id = model->images.rbegin()->first + 1;
  copy.name = name;
  for (uint32_t k = 0; k < copy.point3d_ids.size(); ++k) {
    if (copy.point3d_ids[k] == kInvalidPoint3dId) continue;
    model->points.at(copy.point3d_ids[k]).track.push_back({copy.image_id, k});
  }
  model->images[copy.image_id] = copy;
}

TEST(AlignCommand, CopiesOfAPhotoCountOnce) {
  const CaseFolder single(MakeCase());
  SimulatedCase one = MakeCase();
  for (const char* name : {"photo_copy_1.jpg", "photo_copy_2.jpg", "photo_copy_3.jpg"}) {
    AddCopy(5, name, &one.model);
  }
  const CaseFolder copied(one);
  ASSERT_EQ(single.Align().exit_code, 0);
  ASSERT_EQ(copied.Align().exit_code, 0);
  const SparseModel expected = ReadSparseModel(single.folder / "aligned");
  const SparseModel found = ReadSparseModel(copied.folder / "aligned");
  ASSERT_EQ(found.images.size(), 19u);
  for (const auto& [id, image] : found.images) {
    const Rigid& pose = expected.images.at(id <= 16 ? id : 5).cam_from_model;
    EXPECT_LT((image.cam_from_model.translation - pose.translation).norm(), 1e-9) << image.name;
    EXPECT_LT(RotationAngle(image.cam_from_model.rotation, pose.rotation), 1e-9) << image.name;
  }
  const Json report = Json::parse(ReadBytes(copied.folder / "aligned/alignment.json"));
  for (const Json& image : report["images"]) {
    const bool is_copy = image["name"].get<std::string>().find("copy") != std::string::npos;
    EXPECT_EQ(image["duplicate_of"], is_copy ? Json("photo_004.jpg") : Json(nullptr));
  }
  EXPECT_EQ(report["expected_error"]["at_far_corner_mm"],
            Json::parse(ReadBytes(single.folder /
                                  "aligned/alignment.json"))["expected_error"]["at_far_corner_mm"]);
}

// Two thirds of it show something else: another room with the same wall on its left.
TEST(AlignCommand, NamesAPhotoThatAgreesWithNobody) {
  SimulatedCase one = MakeCase();
  SparseImage& image = one.model.images.at(9);
  for (auto& [id, point] : one.model.points) {
    const auto is_other = [&](const TrackElement& element) {
      return element.image_id == 9 &&
             image.points2d[element.point2d_index].x() > 0.3 * one.room->camera().width;
    };
    const auto gone = std::find_if(point.track.begin(), point.track.end(), is_other);
    if (gone == point.track.end() || point.track.size() < 3) continue;
    image.point3d_ids[gone->point2d_index] = kInvalidPoint3dId;
    point.track.erase(gone);
  }
  const CaseFolder files(one);
  ASSERT_EQ(files.Align().exit_code, 0);
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  int num_doubtful = 0;
  for (const Json& photo : report["images"]) {
    num_doubtful += photo["doubt"].is_string();
    EXPECT_EQ(photo["doubt"].is_string(), photo["name"] == "photo_008.jpg") << photo;
  }
  EXPECT_EQ(num_doubtful, 1);
  EXPECT_NE(report["warnings"].dump().find("photo_008.jpg is doubtful"), std::string::npos);
  // What is built on it knows.
  const AlignmentRecord record = ReadAlignmentRecord(files.folder / "aligned");
  ASSERT_EQ(record.doubtful_photos.size(), 1u);
  EXPECT_NE(record.doubtful_photos.at("photo_008.jpg").find("ought to show"), std::string::npos);
}

TEST(AlignCommand, RemembersItsScans) {
  const CaseFolder files(MakeCase());
  ASSERT_EQ(files.Align("--max_range 30").exit_code, 0);
  const Json scans = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"))["scans"];
  ASSERT_EQ(scans.size(), 1u);
  EXPECT_EQ(scans[0]["path"], files.scan_path);
  EXPECT_EQ(scans[0]["relative_path"], "../room.rtpi");
  EXPECT_EQ(scans[0]["content_hash"], HashOfFile(files.scan_path));
  EXPECT_EQ(scans[0]["azimuth"], "clockwise");
  EXPECT_EQ(scans[0]["max_range"], 30);
}

TEST(AlignCommand, NamesPhotosThatItLeavesOutAndStopsIfStrict) {
  const CaseFolder files(MakeCase());
  std::filesystem::create_directories(files.folder / "photos");
  const std::string photos = "--image_path " + (files.folder / "photos");
  ExpectFailure(files.Align(photos + " --strict 1"), 3,
                "16 photos cannot be used. There is no photo");
  EXPECT_FALSE(std::filesystem::exists(files.folder / "aligned"));
  ASSERT_EQ(files.Align(photos).exit_code, 0);
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_EQ(report["photos_left_out"].size(), 16u);
  EXPECT_EQ(report["photos_left_out"][0]["name"], "photo_000.jpg");
}

std::vector<std::string> NamesIn(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    names.push_back(entry.path().filename().string());
  }
  return names;
}

TEST(AlignCommand, KeepsATrustedResultWhenTheNewOneIsNot) {
  SimulatedCase one = MakeCase();
  const CaseFolder files(one);
  ASSERT_EQ(files.Align().exit_code, 0);
  const std::string trusted = ReadBytes(files.folder / "aligned/alignment.json");
  const std::string images = ReadBytes(files.folder / "aligned/images.bin");
  one.picks[2].x_in_img.swap(one.picks[5].x_in_img);  // refused: no model
  WritePicks(files.picks_path, one.picks);
  const CommandResult refused = files.Align();
  EXPECT_EQ(refused.exit_code, 4);
  EXPECT_EQ(refused.out, files.output_path + ".untrusted\n");
  EXPECT_THAT(ReadBytes(files.folder / "aligned.untrusted/alignment.json"),
              HasSubstr("is kept; this one is in"));
  EXPECT_FALSE(std::filesystem::exists(files.folder / "aligned.untrusted/images.bin"));
  one.picks = MakeCase().picks;
  for (Pick& pick : one.picks) pick.x_in_img.x() += pick.x_in_img.x() < 900 ? 40 : -40;
  WritePicks(files.picks_path, one.picks);
  EXPECT_EQ(files.Align("--plane_constrained 0").exit_code, 4);
  EXPECT_TRUE(std::filesystem::exists(files.folder / "aligned.untrusted/images.bin"));
  // Refused once more: what was not trusted either does not stay beside the report of another.
  one.picks = MakeCase().picks;
  one.picks[2].x_in_img.swap(one.picks[5].x_in_img);
  WritePicks(files.picks_path, one.picks);
  EXPECT_EQ(files.Align().exit_code, 4);
  EXPECT_THAT(NamesIn(files.folder / "aligned.untrusted"), testing::ElementsAre("alignment.json"));
  EXPECT_EQ(ReadBytes(files.folder / "aligned/alignment.json"), trusted);
  EXPECT_EQ(ReadBytes(files.folder / "aligned/images.bin"), images);
  // Trusted again: nobody shall take what lies beside it for newer.
  WritePicks(files.picks_path, MakeCase().picks);
  EXPECT_EQ(files.Align().exit_code, 0);
  EXPECT_THAT(ReadBytes(files.folder / "aligned/alignment.json"),
              HasSubstr("aligned.untrusted is of an earlier run, which was not to be trusted"));
}

TEST(AlignCommand, TakesPicksWithCommentsBehindThem) {
  const CaseFolder files(MakeCase());
  std::string commented;
  for (const char c : ReadBytes(files.picks_path)) {
    commented += c == '\n' ? " # left, by hand\n" : std::string(1, c);
  }
  WriteBytes(files.picks_path, commented);
  const CommandResult result = files.Align();
  EXPECT_EQ(result.exit_code, 0) << result.err;
}

TEST(AlignCommand, SaysWhichColmapReadsPanoramas) {
  SimulatedRoomOptions options = CaseOptions(0);
  options.camera_model = "EQUIRECTANGULAR";
  options.photo_width = 2048;
  options.photo_height = 1024;
  const SimulatedCase one = MakeCase(options, 6);
  const CaseFolder files(one);
  const auto warnings = [&files](const std::string& name) {
    return Json::parse(ReadBytes(files.folder / name + "/alignment.json"))["warnings"].dump();
  };
  // A COLMAP that maps panoramas made this model.
  ASSERT_EQ(files.Align().exit_code, 0);
  EXPECT_THAT(warnings("aligned"), testing::Not(HasSubstr("EQUIRECTANGULAR")));
  // None made this one.
  MakeFolder(files.folder / "photos");
  cv::imwrite(files.folder / "photos/" + one.picks[0].image_name,
              cv::Mat(options.photo_height, options.photo_width, CV_8UC1, cv::Scalar(90)));
  const CommandResult alone = RunCommandLine(
      "roomtex-align --quiet --image_path " + (files.folder / "photos") +
      " --camera_model EQUIRECTANGULAR --camera_params 2048,1024 --scan_path " + files.scan_path +
      " --picks_path " + files.picks_path + " --output_path " + (files.folder / "alone"));
  ASSERT_TRUE(alone.exit_code == 0 || alone.exit_code == 4) << alone.err;
  EXPECT_THAT(warnings("alone"), HasSubstr("which COLMAP reads from 4.1 on"));
}

TEST(AlignCommand, RefusesExchangedPicks) {
  SimulatedCase one = MakeCase();
  one.picks[2].x_in_img.swap(one.picks[5].x_in_img);
  const CaseFolder files(one);
  ExpectContradiction(files, files.Align(), "line 4: this pick and the one on line 7");
}

TEST(AlignCommand, WritesAReportButExitsWithFourForPicksOfAnotherPhoto) {
  SimulatedCase one = MakeCase();
  const std::string right = one.picks[0].image_name;
  for (Pick& pick : one.picks)
    pick.image_name = right == "photo_001.jpg" ? "photo_002.jpg" : "photo_001.jpg";
  const CaseFolder files(one);
  const CommandResult result = files.Align();
  EXPECT_EQ(result.exit_code, 4) << result.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned/alignment.json"));
  EXPECT_EQ(report["trusted"], false);
  EXPECT_NE(report["reason"], "");
}

TEST(AlignCommand, RefusesAPicksFileWithTheLineOfTheMistake) {
  const CaseFolder files(MakeCase());
  std::string text = ReadBytes(files.folder / "picks.csv");
  text.insert(text.find('\n', text.find('\n') + 1) + 1, "photo_000.jpg,nan,1,2,3,4\n");
  WriteBytes(files.folder / "picks.csv", text);
  ExpectFailure(files.Align(), 3, "line 3: x is \"nan\"");
}

TEST(AlignCommand, RefusesAScanThatIsNone) {
  CaseFolder files(MakeCase());
  files.scan_path = files.picks_path;
  ExpectFailure(files.Align(), 3, "picks.csv");
}

TEST(AlignCommand, HelpStartsWithAnExampleAndNamesEveryOption) {
  const CommandResult result = RunCommandLine("roomtex-align --help");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.out.rfind("Example:\n  roomtex-align --input_path", 0), 0u);
  for (const char* option : {"--picks_path", "--azimuth", "--plane_constrained", "--scan_poses",
                             "--image_path", "--database_path", "--Trust.max_pick_rms_px"}) {
    EXPECT_THAT(result.out, HasSubstr(option));
  }
}

}  // namespace
}  // namespace roomtex
