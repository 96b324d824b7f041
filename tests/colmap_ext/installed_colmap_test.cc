// Our files against the installed COLMAP: what we write it reads, what it writes we read.

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include <gmock/gmock.h>

#include "colmap_ext/database.h"
#include "colmap_ext/sparse_model.h"
#include "tests/colmap_ext/sparse_model_maker.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {
namespace fs = std::filesystem;

// Runs colmap and gives what it printed; the test fails when colmap does.
std::string RunColmap(const std::string& arguments) {
  const TempFolder folder;
  const std::string line =
      "QT_QPA_PLATFORM=offscreen colmap " + arguments + " >" + (folder / "out") + " 2>&1";
  const int status = std::system(line.c_str());
  const std::string out = ReadBytes(folder / "out");
  EXPECT_EQ(status, 0) << line << "\n" << out;
  return out;
}

// COLMAP normalises quaternions once more, so rotations may differ in the last bit; the rest is
// exact.
void ExpectSameAfterColmap(const SparseModel& expected, SparseModel model) {
  ASSERT_EQ(model.images.size(), expected.images.size());
  for (auto& [id, image] : model.images) {
    const Rigid& pose = expected.images.at(id).cam_from_model;
    EXPECT_THAT(image.cam_from_model.rotation.coeffs(),
                IsNearMatrix(pose.rotation.coeffs(), 1e-15));
    image.cam_from_model.rotation = pose.rotation;
  }
  ExpectSameModel(model, expected);
}

TEST(InstalledColmap, TurnsOurBinaryModelIntoTheSameText) {
  const TempFolder folder;
  const SparseModel model = MakeSparseModel();
  WriteSparseModel(model, folder / "bin");
  fs::create_directory(folder / "txt");
  RunColmap("model_converter --input_path " + (folder / "bin") + " --output_path " +
            (folder / "txt") + " --output_type TXT");
  ExpectSameAfterColmap(model, ReadSparseModel(folder / "txt"));
}

TEST(InstalledColmap, TurnsOurTextModelIntoTheSameBinary) {
  const TempFolder folder;
  SparseModel model = MakeSparseModel();
  model.images.at(43).name = "no_spaces.jpg";  // COLMAP 3.8 reads names in text files up to a space
  WriteSparseModelText(model, folder / "txt");
  fs::create_directory(folder / "bin");
  RunColmap("model_converter --input_path " + (folder / "txt") + " --output_path " +
            (folder / "bin") + " --output_type BIN");
  ExpectSameAfterColmap(model, ReadSparseModel(folder / "bin"));
}

TEST(InstalledColmap, AnalysesOurModelAsWeDo) {
  const TempFolder folder;
  SparseModel model = MakeSparseModel();
  model.points.begin()->second.x_in_model.x() += 0.3;
  const ReprojectionErrors errors = UpdateReprojectionErrors(&model);
  WriteSparseModel(model, folder / "bin");
  const std::string out = RunColmap("model_analyzer --path " + (folder / "bin"));
  EXPECT_THAT(out, testing::HasSubstr("Points: 25"));
  EXPECT_THAT(out, testing::HasSubstr("Observations: 75"));
  const std::string label = "Mean reprojection error: ";
  const size_t at = out.find(label);
  ASSERT_NE(at, std::string::npos) << out;
  // COLMAP takes the mean over points; here all points have equally many observations.
  EXPECT_NEAR(std::atof(out.c_str() + at + label.size()), errors.mean_px, 1e-5);
}

TEST(InstalledColmap, MovesAModelAsWeDo) {
  const TempFolder folder;
  SparseModel model = MakeSparseModel();
  const Similarity similarity{
      2.5, Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {10, 20, 30}};
  WriteSparseModel(model, folder / "bin");
  int major = 0, minor = 0;
  const std::string help = RunColmap("help");
  ASSERT_EQ(std::sscanf(help.c_str(), "COLMAP %d.%d", &major, &minor), 2) << help;
  if (major == 3 && minor <= 8) {
    WriteSimilarityMatrix(folder / "scan_from_sparse.txt", similarity);
  } else {
    WriteSimilarity(folder / "scan_from_sparse.txt", similarity);
  }
  fs::create_directory(folder / "moved");
  RunColmap("model_transformer --input_path " + (folder / "bin") + " --output_path " +
            (folder / "moved") + " --transform_path " + (folder / "scan_from_sparse.txt"));
  TransformModel(similarity, &model);
  const SparseModel moved = ReadSparseModel(folder / "moved");
  for (const auto& [id, image] : model.images) {
    EXPECT_THAT(moved.images.at(id).cam_from_model, IsNearRigid(image.cam_from_model, 1e-7, 1e-10));
  }
  for (const auto& [id, point] : model.points) {
    EXPECT_THAT(moved.points.at(id).x_in_model, IsNearMatrix(point.x_in_model, 1e-10));
  }
}

TEST(InstalledColmap, DatabaseItMakesIsReadAndStaysAsItIs) {
  const TempFolder folder;
  const std::string path = folder / "database.db";
  RunColmap("database_creator --database_path " + path);
  const std::string bytes = ReadBytes(path);
  const Database database(path);
  EXPECT_TRUE(database.ReadCameras().empty());
  EXPECT_TRUE(database.ReadImages().empty());
  EXPECT_TRUE(database.CountKeypoints().empty());
  EXPECT_TRUE(database.ReadPairs(0).empty());
  EXPECT_EQ(ReadBytes(path), bytes);
}

}  // namespace
}  // namespace roomtex
