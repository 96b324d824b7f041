// The real kitchen (a neighbour of the checkout, never part of it) through the commands, as a user
// types them. Label `data`: says why it is skipped when the kitchen is not there.

#include <cmath>
#include <filesystem>
#include <map>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "align/start_appearance.h"
#include "align/trust/agreement.h"
#include "align/trust/appearance_matches.h"
#include "align/trust/appearance_search.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"
#include "core/frames.h"
#include "importers/scan_reader.h"
#include "tests/e2e/colmap_steps.h"
#include "tests/e2e/kitchen_subsets.h"
#include "tests/support/folders.h"
#include "tests/support/run_command.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using nlohmann::json;

const std::string kKitchen = DataFolder("kitchen");

json ReadJson(const std::string& path) { return json::parse(ReadBytes(path)); }

Eigen::Matrix4d ReadMatrix(const std::string& path) {
  std::ifstream stream(path);
  std::string line;
  Eigen::Matrix4d matrix;
  int row = 0;
  while (row < 4 && std::getline(stream, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream numbers(line);
    for (int column = 0; column < 4; ++column) numbers >> matrix(row, column);
    ++row;
  }
  return matrix;
}

// Camera centres of the recording, in the frame of the recording ("reference"), by image name.
std::map<std::string, Eigen::Vector3d> ReadReferenceCentres() {
  std::map<std::string, Eigen::Vector3d> centres;
  std::ifstream stream(std::string(kKitchen) + "/reference_poses.txt");
  std::string line;
  while (std::getline(stream, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    int image_id = 0, camera_id = 0;
    Eigen::Vector4d wxyz;
    Rigid cam_from_reference;
    std::string name;
    fields >> image_id >> wxyz[0] >> wxyz[1] >> wxyz[2] >> wxyz[3];
    for (int i = 0; i < 3; ++i) fields >> cam_from_reference.translation[i];
    fields >> camera_id >> name;
    cam_from_reference.rotation = QuaternionFromWxyz(wxyz).normalized();
    centres[name] = cam_from_reference.TargetOriginInSource();
  }
  return centres;
}

class Kitchen : public testing::Test {
 protected:
  // All tests look at one run of the whole chain.
  static void SetUpTestSuite() {
    if (!std::filesystem::exists(kKitchen)) return;
    folder_ = new TempFolder;
    const std::string images = std::string(kKitchen) + "/images";
    const std::string database = *folder_ / "database.db", pairs = *folder_ / "pairs.txt";
    ExtractFeatures(database, images,
                    "--ImageReader.single_camera 1 --ImageReader.camera_model SIMPLE_RADIAL "
                    "--ImageReader.camera_params 525.9,320,240,-0.025");
    pairs_ = RunCommandLine("roomtex-pairs --database_path " + database + " --output_path " +
                            pairs + " --report_path " + (*folder_ / "pairs.json"));
    Colmap("matches_importer", database,
           "--match_list_path " + pairs + " --match_type pairs --SiftMatching.use_gpu 0");
    mapper_ = RunCommandLine("roomtex-mapper --database_path " + (*folder_ / "database.db") +
                             " --image_path " + images + " --output_path " + (*folder_ / "sparse") +
                             " --report_path " + (*folder_ / "mapper.json"));
    align_ = RunCommandLine(AlignLine("counterclockwise", "aligned"));
    texture_ = RunCommandLine("roomtex-texture --input_path " + (*folder_ / "aligned") +
                              " --image_path " + images + " --scan_path " + kKitchen +
                              "/scan.rtpi --azimuth counterclockwise --output_path " +
                              (*folder_ / "textured"));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  void SetUp() override {
    if (folder_ == nullptr) GTEST_SKIP() << "no kitchen at " << kKitchen;
  }

  static std::string AlignLine(const std::string& azimuth, const std::string& output) {
    return "roomtex-align --input_path " + (*folder_ / "sparse/0") + " --scan_path " + kKitchen +
           "/scan.rtpi --azimuth " + azimuth + " --picks_path " + kKitchen +
           "/picks.csv --output_path " + (*folder_ / output) + " --image_path " + kKitchen +
           "/images --report_path " + (*folder_ / (output + ".json"));
  }

  static TempFolder* folder_;
  static CommandResult pairs_, mapper_, align_, texture_;
};

TempFolder* Kitchen::folder_ = nullptr;
CommandResult Kitchen::pairs_, Kitchen::mapper_, Kitchen::align_, Kitchen::texture_;

// Photos of one room see much of each other: a third of the pairs is all that need not be matched.
TEST_F(Kitchen, PairsLeaveOutOnlyWhatSeesNothingOfEachOther) {
  ASSERT_EQ(pairs_.exit_code, 0) << pairs_.err;
  const json report = ReadJson(*folder_ / "pairs.json");
  EXPECT_EQ(report["groups"].size(), 1u);
  EXPECT_EQ(report["isolated"].size(), 0u);
  EXPECT_GT(report["num_pairs"], 300);
  EXPECT_LT(report["num_pairs"], 530);
}

TEST_F(Kitchen, RegistersEveryPhoto) {
  ASSERT_EQ(mapper_.exit_code, 0) << mapper_.err;
  const json report = ReadJson(*folder_ / "mapper.json");
  EXPECT_EQ(report["num_images"], 36);
  EXPECT_EQ(report["num_reg_images"], 36);
  EXPECT_LT(report["mean_reprojection_error_px"], 0.8);
  EXPECT_EQ(ReadSparseModel(*folder_ / "sparse/0").images.size(), 36u);
}

// How a model of fewer matches stands against the model of all of them, after the best similarity.
struct ModelErrors {
  size_t num_images = 0;
  double worst_rotation_deg = 0;
  double worst_step_deg = 0;  // of the rotation from one photo to the next, in the order of names
  double worst_centre = 0;    // over the radius of the cameras
};
ModelErrors CompareModels(const SparseModel& model, const SparseModel& all) {
  ModelErrors errors;
  errors.num_images = model.images.size();
  Eigen::Matrix3Xd found(3, model.images.size()), expected(3, model.images.size());
  int column = 0;
  for (const auto& [image_id, image] : model.images) {
    found.col(column) = image.cam_from_model.TargetOriginInSource();
    expected.col(column++) = all.images.at(image_id).cam_from_model.TargetOriginInSource();
  }
  std::map<std::string, Rigid> error_by_name;  // truth_cam_from_cam, up to the frames of the models
  for (const auto& [image_id, image] : model.images) {
    error_by_name[image.name] =
        all.images.at(image_id).cam_from_model.Inverse() * image.cam_from_model;
  }
  for (auto next = error_by_name.begin(), last = next++; next != error_by_name.end();
       last = next++) {
    errors.worst_step_deg =
        std::max(errors.worst_step_deg,
                 DegFromRad(RotationAngle(last->second.rotation, next->second.rotation)));
  }
  const Similarity all_from_model = FitSimilarity(found, expected);
  const double radius =
      (expected.colwise() - expected.rowwise().mean()).colwise().norm().maxCoeff();
  for (const auto& [image_id, image] : model.images) {
    const Rigid pose = CamFromScan(image.cam_from_model, all_from_model);
    const Rigid& truth = all.images.at(image_id).cam_from_model;
    errors.worst_rotation_deg = std::max(errors.worst_rotation_deg,
                                         DegFromRad(RotationAngle(pose.rotation, truth.rotation)));
    errors.worst_centre =
        std::max(errors.worst_centre,
                 (pose.TargetOriginInSource() - truth.TargetOriginInSource()).norm() / radius);
  }
  return errors;
}

// The notice-board wall, the table, the cupboards: each alone is a plane with two solutions per
// pair. COLMAP 3.8's own mapper is 165 degrees wrong on the first of them.
TEST_F(Kitchen, EachOfItsLargePlanesAloneGivesTheSamePosesOrARefusal) {
  ASSERT_EQ(mapper_.exit_code, 0) << mapper_.err;
  const SparseModel all = ReadSparseModel(*folder_ / "sparse/0");
  const std::vector<ModelPlane> planes = LargestPlanes(all, 4);
  int num_trusted = 0;
  for (size_t k = 0; k < planes.size(); ++k) {
    SCOPED_TRACE("plane " + std::to_string(k) + " of " + std::to_string(planes[k].num_points) +
                 " points");
    const std::string name = *folder_ / ("plane" + std::to_string(k));
    const int num_images =
        WritePlanarSubset(*folder_ / "database.db", all, planes[k], name + ".db");
    const CommandResult result =
        RunCommandLine("roomtex-mapper --database_path " + name + ".db --image_path " + kKitchen +
                       "/images --output_path " + name + " --report_path " + name + ".json");
    if (result.exit_code == 4 || result.exit_code == 3) continue;
    ASSERT_EQ(result.exit_code, 0) << result.err;
    ++num_trusted;
    const ModelErrors errors = CompareModels(ReadSparseModel(name + "/0"), all);
    // As the matches of a run are, 6 to 9 of 35 photos have none with any that is registered.
    int num_unmatched = 0;
    const json report = ReadJson(name + ".json");
    for (const json& image : report["images"]) {
      num_unmatched +=
          image.value("reason", "") == "no registered photo shares 20 verified matches with it";
    }
    EXPECT_GE(errors.num_images, 0.75 * (num_images - num_unmatched));
    EXPECT_GE(errors.num_images, 0.5 * num_images);
    EXPECT_LT(errors.worst_rotation_deg, 3);
    // Of the photo with the fewest points of the plane: up to 0.06 from run to run, as the matches
    // differ. The plane's other solution has some photos on the other side of the others.
    EXPECT_LT(errors.worst_centre, 0.1);
  }
  EXPECT_GE(num_trusted, 3);
}

// COLMAP 3.8's own mapper registers none of these sixteen. Its verified matches differ from run to
// run (54 775 to 54 827 in three; colmap_steps.h says why). A chain is as strong as its weakest
// link: of four one may end early (seen: 9 of 16 photos). What is registered is right in every one.
TEST_F(Kitchen, AChainOfNeighboursWithFewCommonPointsIsRegisteredPhotoByPhoto) {
  ASSERT_EQ(mapper_.exit_code, 0) << mapper_.err;
  int num_whole = 0;
  for (int seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const std::string name = *folder_ / ("chain" + std::to_string(seed));
    ASSERT_EQ(WriteChainSubset(*folder_ / "database.db", 16, 40, seed, name + ".db"), 16);
    const CommandResult result =
        RunCommandLine("roomtex-mapper --database_path " + name + ".db --image_path " + kKitchen +
                       "/images --output_path " + name + " --report_path " + name + ".json");
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const ModelErrors errors =
        CompareModels(ReadSparseModel(name + "/0"), ReadSparseModel(*folder_ / "sparse/0"));
    num_whole += errors.num_images == 16;
    // Small errors of the steps add up along the chain.
    EXPECT_LT(errors.worst_step_deg, 1.0);
    EXPECT_LT(errors.worst_centre, 0.05);
    int num_chained = 0;
    const json report = ReadJson(name + ".json");
    for (const auto& image : report["images"]) num_chained += image["by"] == "chained";
    if (errors.num_images == 16) {
      EXPECT_GE(num_chained, 4);
    }
  }
  EXPECT_GE(num_whole, 3);
}

TEST_F(Kitchen, AlignsWithHurriedPicks) {
  ASSERT_EQ(align_.exit_code, 0) << align_.err;
  const json report = ReadJson(*folder_ / "aligned.json");
  EXPECT_TRUE(report["trusted"]);
  EXPECT_LT(report["picks"]["rms_px"], 8.0);
  EXPECT_EQ(report["picks"]["count"], 8);
}

// The scan was put together by a tracker that drifted. Photos put onto all of that drift have 2.5
// times the reprojection errors of the sparse model.
TEST_F(Kitchen, PhotosStillAgreeWithEachOtherOnTheDriftedScan) {
  ASSERT_EQ(align_.exit_code, 0) << align_.err;
  const json report = ReadJson(*folder_ / "aligned.json");
  EXPECT_LT(report["reprojection_rms_px"]["after"].get<double>(),
            2 * report["reprojection_rms_px"]["before"].get<double>());
  EXPECT_EQ(report["plane_bundle"]["scan_bend"]["followed"], 0.5);
}

// Metres, from where the recording has the cameras, in order. Its own poses are good to a few
// centimetres.
std::vector<double> DistancesFromRecording(const SparseModel& aligned) {
  const Eigen::Matrix4d reference_from_scan =
      ReadMatrix(std::string(kKitchen) + "/scan_to_world.txt");
  const auto references = ReadReferenceCentres();
  std::vector<double> distances;
  for (const auto& [id, image] : aligned.images) {
    const Eigen::Vector3d centre_in_reference =
        (reference_from_scan * image.cam_from_model.TargetOriginInSource().homogeneous()).head<3>();
    distances.push_back((centre_in_reference - references.at(image.name)).norm());
  }
  std::sort(distances.begin(), distances.end());
  return distances;
}

TEST_F(Kitchen, CamerasStandWhereTheRecordingSaysTheyStood) {
  ASSERT_EQ(align_.exit_code, 0) << align_.err;
  const std::vector<double> distances =
      DistancesFromRecording(ReadSparseModel(*folder_ / "aligned"));
  ASSERT_EQ(distances.size(), 36u);
  EXPECT_LT(distances[18], 0.10);
  EXPECT_LT(distances.back(), 0.25);
}

// The surface alone leaves the photos a few degrees off, too far for them to confirm it: they draw
// the model to its place. Of some models of COLMAP the mirror image of the room has nearly as much
// of the score (1.49 and 1.59 where 1.65 is asked), or another place has: then what photos and scan
// have in common decides, where rooms of one plan have 13 cells at most (docs/automatic.md).
TEST_F(Kitchen, IsFoundWithoutClicks) {
  const std::string output = *folder_ / "found";
  const CommandResult found =
      RunCommandLine("roomtex-align --input_path " + (*folder_ / "sparse/0") + " --scan_path " +
                     kKitchen + "/scan.rtpi --azimuth counterclockwise --image_path " + kKitchen +
                     "/images --output_path " + output + " --report_path " + output + ".json");
  const json search = ReadJson(output + ".json")["search"];
  EXPECT_EQ(found.exit_code, 0) << search << found.err;
  // 11 to 26 % of the corners, by the run of COLMAP.
  EXPECT_TRUE(search["best"]["photos"]["supports"]) << search["best"];
  EXPECT_GT(search["ratio"], 1.2);  // 1.33 to 1.74 by the matches
  if (!search["appearance"].is_null()) {
    EXPECT_GT(search["appearance"]["num_cells"], 40);
  }
  const std::vector<double> distances = DistancesFromRecording(ReadSparseModel(output));
  EXPECT_LT(distances[distances.size() / 2], 0.08);
}

// By what photos and scan have in common alone.
TEST_F(Kitchen, AppearanceAloneFindsThePlaceAndNotInTheMirrorImage) {
  ASSERT_EQ(align_.exit_code, 0) << align_.err;
  const SparseModel model = ReadSparseModel(*folder_ / "sparse/0");
  const SparseModel aligned = ReadSparseModel(*folder_ / "aligned");
  Eigen::Matrix3Xd from(3, 36), to(3, 36);
  Eigen::Index column = 0;
  for (const auto& [id, image] : model.images) {
    from.col(column) = image.cam_from_model.TargetOriginInSource();
    to.col(column++) = aligned.FindImage(image.name)->cam_from_model.TargetOriginInSource();
  }
  const Similarity by_picks = FitSimilarity(from, to);
  const SearchCloud cloud = MakeSearchCloud(model, 0.5, 1000);
  for (const char* azimuth : {"counterclockwise", "clockwise"}) {
    SCOPED_TRACE(azimuth);
    ScanReaderOptions reader;
    reader.azimuth = azimuth;
    const std::vector<Scan> scans = {ReadScan(std::string(kKitchen) + "/scan.rtpi", reader)};
    const FreeSpace free_space(scans, 300000);
    const ScanViewer viewer(scans, free_space);
    const AppearanceMatcher matcher(model, std::string(kKitchen) + "/images", viewer,
                                    AppearanceOptions(), -1);
    const std::vector<AppearancePlace> places =
        SearchByAppearance(matcher.Match(std::nullopt, scans[0].up), std::nullopt, scans[0].up,
                           AppearanceSearchOptions(), -1);
    const bool is_right = std::string(azimuth) == "counterclockwise";
    EXPECT_EQ(StandsOut(places, StartAppearanceOptions()), is_right);
    if (is_right && !places.empty()) {
      EXPECT_LT(DistanceBetween(cloud, places[0].scan_from_sparse, by_picks), 0.12);
    }
  }
}

// Blurred photos and drifting poses: far fewer corners fit than in a simulated room, but clearly
// more than by chance.
TEST_F(Kitchen, PhotosSupportTheAlignment) {
  ASSERT_EQ(align_.exit_code, 0) << align_.err;
  const json gradient = ReadJson(*folder_ / "aligned.json")["agreement"]["gradient_shift"];
  EXPECT_TRUE(gradient["supports"]) << gradient;
  EXPECT_FALSE(gradient["contradicts"]) << gradient;
  EXPECT_GT(gradient["share"], 0.06);
  // Some 500 patches elsewhere: 0.03 to 0.045, from one model of COLMAP to the next.
  EXPECT_GT(gradient["share"], 1.5 * gradient["chance"]["share"].get<double>());
}

TEST_F(Kitchen, PhotosContradictWrongAlignments) {
  ASSERT_EQ(align_.exit_code, 0) << align_.err;
  ScanReaderOptions reader;
  reader.azimuth = "counterclockwise";
  const std::vector<Scan> scans = {ReadScan(std::string(kKitchen) + "/scan.rtpi", reader)};
  const FreeSpace free_space(scans, 300000);
  const ScanViewer viewer(scans, free_space);
  int contradictions = 0;
  for (int k = 0; k < 6; ++k) {
    Similarity wrong;
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k % 3);
    if (k < 3) wrong.rotation = Eigen::AngleAxisd(RadFromDeg(k == 1 ? 3 : -3), axis);
    if (k >= 3) wrong.translation = 0.2 * axis;
    SparseModel model = ReadSparseModel(*folder_ / "aligned");
    TransformModel(wrong, &model);
    std::vector<std::string> warnings;
    const Agreement agreement = MeasureAgreement({model, std::string(kKitchen) + "/images"}, viewer,
                                                 AgreementOptions(), -1, &warnings);
    EXPECT_FALSE(agreement.gradient.supports) << k;
    contradictions += agreement.gradient.contradicts;
  }
  EXPECT_GE(contradictions, 4);
}

TEST_F(Kitchen, ScanReadWithTheWrongAzimuthIsNamedAMirror) {
  const CommandResult wrong = RunCommandLine(AlignLine("clockwise", "mirrored"));
  EXPECT_TRUE(wrong.exit_code == 3 || wrong.exit_code == 4) << wrong.exit_code;
  EXPECT_NE(wrong.err.find("--azimuth counterclockwise"), std::string::npos) << wrong.err;
}

TEST_F(Kitchen, ColoursFourFifthsOfWhatThePhotosSee) {
  ASSERT_EQ(texture_.exit_code, 0) << texture_.err;
  const json report = ReadJson(*folder_ / "textured/report.json");
  ScanReaderOptions options;
  options.azimuth = "counterclockwise";
  const Scan scan = ReadScan(std::string(kKitchen) + "/scan.rtpi", options);
  const SparseModel aligned = ReadSparseModel(*folder_ / "aligned");
  int num_in_frustum = 0;
  for (const Eigen::Vector3d& x_in_scan : scan.points) {
    if (!(x_in_scan.x() == x_in_scan.x())) continue;
    for (const auto& [id, image] : aligned.images) {
      static std::map<uint32_t, CameraProjection> projections;
      const auto projection =
          projections.try_emplace(image.camera_id, aligned.cameras.at(image.camera_id)).first;
      const auto x_in_img = projection->second.ImgFromCam(image.cam_from_model * x_in_scan);
      if (x_in_img && projection->second.InImage(*x_in_img)) {
        ++num_in_frustum;
        break;
      }
    }
  }
  EXPECT_EQ(report["num_vertices"], scan.points.size() - scan.NumMissing());
  EXPECT_GE(report["num_colored"].get<double>(), 0.8 * num_in_frustum);
}

}  // namespace
}  // namespace roomtex
