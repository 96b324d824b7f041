// What the installed colmap makes of our files.

#include <gtest/gtest.h>

#include "tests/align/case_folder.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

TEST(InstalledColmap, ModelTransformerGivesTheSameModelFromOurSimilarity) {
  ASSERT_EQ(std::system("colmap help >/dev/null 2>&1"), 0) << "run scripts/setup.sh";
  const CaseFolder files(MakeCase());
  // The adjustment to the surface moves poses and points one by one: no similarity gives that.
  ASSERT_EQ(files.Align("--plane_constrained 0").exit_code, 0);
  MakeFolder(files.folder / "transformed");
  // COLMAP up to 3.8 reads a 4 x 4 matrix there, later ones the line with scale, quaternion,
  // translation.
  const bool reads_matrix = std::system("colmap help | grep -q 'COLMAP 3\\.[0-8] '") == 0;
  const std::string line = "QT_QPA_PLATFORM=offscreen colmap model_transformer --input_path " +
                           (files.folder / "sparse") + " --output_path " +
                           (files.folder / "transformed") + " --transform_path " +
                           (files.folder / (reads_matrix ? "aligned/scan_from_sparse_matrix.txt"
                                                         : "aligned/scan_from_sparse.txt")) +
                           " >/dev/null 2>&1";
  ASSERT_EQ(std::system(line.c_str()), 0);
  const SparseModel ours = ReadSparseModel(files.folder / "aligned");
  const SparseModel theirs = ReadSparseModel(files.folder / "transformed");
  ASSERT_EQ(ours.images.size(), theirs.images.size());
  ASSERT_EQ(ours.points.size(), theirs.points.size());
  for (const auto& [id, image] : ours.images) {
    EXPECT_THAT(theirs.images.at(id).cam_from_model, IsNearRigid(image.cam_from_model, 1e-6, 1e-6));
  }
  for (const auto& [id, point] : ours.points) {
    EXPECT_THAT(theirs.points.at(id).x_in_model, IsNearMatrix(point.x_in_model, 1e-6));
  }
}

}  // namespace
}  // namespace roomtex
