#include "core/similarity.h"

#include <cmath>

#include "core/error.h"
#include "core/frames.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

const Eigen::Vector3d kPoint(0.3, -2.5, 7);

Rigid RigidA() { return {Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {1, -2, 3}}; }
Rigid RigidB() { return {Eigen::Quaterniond(-0.9, 0.1, 0.2, 0.4).normalized(), {-5, 0.5, 0.25}}; }
Similarity SimilarityA() { return {2.5, RigidA().rotation, {10, 20, -30}}; }
Similarity SimilarityB() { return {0.125, RigidB().rotation, {0.1, -0.2, 0.3}}; }

TEST(Rigid, ProductAppliesTheRightOneFirst) {
  EXPECT_THAT((RigidA() * RigidB()) * kPoint, IsNearMatrix(RigidA() * (RigidB() * kPoint), 1e-13));
}

TEST(Rigid, InverseUndoes) {
  EXPECT_THAT(RigidA().Inverse() * (RigidA() * kPoint), IsNearMatrix(kPoint, 1e-13));
  EXPECT_THAT(RigidA() * RigidA().Inverse(), IsNearRigid(Rigid(), 1e-7, 1e-13));
}

TEST(Rigid, MatrixDoesTheSame) {
  EXPECT_THAT(RigidA().Matrix() * kPoint.homogeneous(), IsNearMatrix(RigidA() * kPoint, 1e-13));
}

TEST(Rigid, TargetOriginGoesToZero) {
  EXPECT_THAT(RigidA() * RigidA().TargetOriginInSource(),
              IsNearMatrix(Eigen::Vector3d::Zero(), 1e-13));
}

TEST(Similarity, ProductAppliesTheRightOneFirst) {
  EXPECT_THAT((SimilarityA() * SimilarityB()) * kPoint,
              IsNearMatrix(SimilarityA() * (SimilarityB() * kPoint), 1e-12));
}

TEST(Similarity, InverseUndoes) {
  EXPECT_THAT(SimilarityA().Inverse() * (SimilarityA() * kPoint), IsNearMatrix(kPoint, 1e-13));
  EXPECT_THAT(SimilarityA() * (SimilarityA().Inverse() * kPoint), IsNearMatrix(kPoint, 1e-13));
}

TEST(Similarity, MatrixDoesTheSame) {
  EXPECT_THAT((SimilarityA().Matrix() * kPoint.homogeneous()).hnormalized(),
              IsNearMatrix(SimilarityA() * kPoint, 1e-12));
}

// The camera sees a moved point where it saw it before, at a distance in the new unit.
TEST(CamFromScan, SeesTheSameDirections) {
  const Rigid cam_from_scan = CamFromScan(RigidB(), SimilarityA());
  EXPECT_THAT(cam_from_scan * (SimilarityA() * kPoint),
              IsNearMatrix(SimilarityA().scale * (RigidB() * kPoint), 1e-12));
  EXPECT_NEAR(cam_from_scan.rotation.norm(), 1, 1e-15);
}

TEST(CamFromScan, AndScanFromSparseAreInverse) {
  const Rigid cam_from_scan = CamFromScan(RigidB(), SimilarityA());
  const Similarity again = ScanFromSparse(cam_from_scan, RigidB(), SimilarityA().scale);
  EXPECT_EQ(again.scale, SimilarityA().scale);
  EXPECT_NEAR(RotationAngle(again.rotation, SimilarityA().rotation), 0, 1e-7);
  EXPECT_THAT(again.translation, IsNearMatrix(SimilarityA().translation, 1e-13));
  EXPECT_THAT(CamFromScan(RigidB(), ScanFromSparse(RigidA(), RigidB(), 3.5)),
              IsNearRigid(RigidA(), 1e-7, 1e-13));
}

// Thesis 7.1.3: [R2 R1^T R | R2 R1^T (T - T1/s) + T2/s], s = sparse units per metre.
TEST(CamFromScan, IsTheFormulaOfTheThesis) {
  const Rigid clicked_from_scan = RigidA(), clicked_from_sparse = RigidB();
  const Rigid other_from_sparse{Eigen::Quaterniond(0.2, 0.3, -0.4, 0.8).normalized(), {3, 1, -4}};
  const double scale = 2.5;
  const Eigen::Matrix3d r = clicked_from_scan.rotation.toRotationMatrix();
  const Eigen::Matrix3d r1 = clicked_from_sparse.rotation.toRotationMatrix();
  const Eigen::Matrix3d r2 = other_from_sparse.rotation.toRotationMatrix();
  const double s = 1 / scale;
  Eigen::Matrix<double, 3, 4> expected;
  expected << r2 * r1.transpose() * r,
      r2 * r1.transpose() * (clicked_from_scan.translation - clicked_from_sparse.translation / s) +
          other_from_sparse.translation / s;
  const Similarity scan_from_sparse = ScanFromSparse(clicked_from_scan, clicked_from_sparse, scale);
  EXPECT_THAT(CamFromScan(other_from_sparse, scan_from_sparse).Matrix(),
              IsNearMatrix(expected, 1e-13));
}

TEST(FitSimilarity, FindsTheOneThatMadeThePoints) {
  for (const int count : {3, 4, 50}) {
    Eigen::Matrix3Xd source(3, count), target(3, count);
    for (int i = 0; i < count; ++i) {
      source.col(i) << std::sin(3.0 * i), std::cos(5.0 * i), std::sin(7.0 * i + 1);
      target.col(i) = SimilarityA() * Eigen::Vector3d(source.col(i));
    }
    const Similarity found = FitSimilarity(source, target);
    EXPECT_NEAR(found.scale, SimilarityA().scale, 1e-12);
    EXPECT_NEAR(RotationAngle(found.rotation, SimilarityA().rotation), 0, 1e-7);
    EXPECT_THAT(found.translation, IsNearMatrix(SimilarityA().translation, 1e-12));
  }
}

TEST(FitSimilarity, NeverMirrors) {
  Eigen::Matrix3Xd source(3, 4), target(3, 4);
  source << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
  target = source;
  target.row(2) *= -1;
  const Similarity found = FitSimilarity(source, target);
  EXPECT_GT(found.scale, 0);
  EXPECT_NEAR(found.rotation.norm(), 1, 1e-12);
}

TEST(RotationAngle, IsTheAngleBetween) {
  for (const double angle : {0.0, 1e-9, 0.1, 1.5, 3.0, kPi}) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 2) / 3));
    EXPECT_NEAR(RotationAngle(turn * RigidA().rotation, RigidA().rotation), angle, 2e-8);
  }
  const Eigen::Quaterniond q = RigidA().rotation;
  EXPECT_NEAR(RotationAngle(q, Eigen::Quaterniond(-q.coeffs())), 0, 1e-7);
}

TEST(SimilarityFile, GoesRoundInBothLayouts) {
  const TempFolder folder;
  const std::string path = folder / "scan_from_sparse.txt";
  WriteSimilarity(path, SimilarityA());
  const Similarity exact = ReadSimilarity(path);
  EXPECT_EQ(exact.scale, SimilarityA().scale);
  EXPECT_THAT(exact.rotation.coeffs(), IsNearMatrix(SimilarityA().rotation.coeffs(), 1e-15));
  EXPECT_EQ(exact.translation, SimilarityA().translation);
  const std::string text = ReadBytes(path);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_EQ(text.substr(0, 4), "2.5 ");

  WriteSimilarityMatrix(path, SimilarityA());
  const Similarity from_matrix = ReadSimilarity(path);
  EXPECT_NEAR(from_matrix.scale, SimilarityA().scale, 1e-14);
  EXPECT_NEAR(RotationAngle(from_matrix.rotation, SimilarityA().rotation), 0, 1e-7);
  EXPECT_EQ(from_matrix.translation, SimilarityA().translation);
}

TEST(SimilarityFile, MistakesAreRefused) {
  const TempFolder folder;
  const std::string path = folder / "transform.txt";
  EXPECT_INPUT_ERROR(ReadSimilarity(path), "does not exist");
  EXPECT_INPUT_ERROR(ReadSimilarity(folder.path()), "is a folder");
  const std::pair<const char*, const char*> cases[] = {
      {"", "eight numbers"},
      {"1 1 0 0 0 0 0", "eight numbers"},
      {"1 1 0 0 0 0 0 0 9", "eight numbers"},
      {"0 1 0 0 0 0 0 0", "zero or negative"},
      {"-1 1 0 0 0 0 0 0", "zero or negative"},
      {"1 0 0 0 0 0 0 0", "zero or negative"},
      {"1 1 0 0 0 0 0 nan", "\"nan\" is not a finite number"},
      {"1 1 0 0 0 0 0 1e999", "\"1e999\" is not a finite number"},
      {"1 1 0 0 0 0 0 0x10", "\"0x10\" is not a finite number"},
      {"1 1 0 0 0 0 0 x", "\"x\" is not a finite number"},
      {"1 0 0 0 0 1 0 0 0 0 -1 0 0 0 0 1", "not a similarity"},
      {"1 0 0 0 0 1 0 0 0 0 2 0 0 0 0 1", "not a similarity"},
      {"1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1", "not a similarity"},
      {"0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 1", "not a similarity"},
  };
  for (const auto& [text, finding] : cases) {
    WriteBytes(path, text);
    EXPECT_INPUT_ERROR(ReadSimilarity(path), finding);
  }
}

}  // namespace
}  // namespace roomtex
