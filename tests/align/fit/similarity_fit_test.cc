#include "align/fit/similarity_fit.h"

#include <random>

#include <gtest/gtest.h>

#include "align/fit/similarity_accuracy.h"
#include "align/fit/similarity_normal.h"
#include "align/trust/expected_error.h"
#include "core/frames.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/matchers.h"

namespace roomtex {
namespace {

// The truth, turned by `deg`, moved by `metres` and scaled by 1 + `growth`.
Similarity Disturbed(const Similarity& truth, double deg, double metres, double growth) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
  const Similarity off{1 + growth, Eigen::Quaterniond(Eigen::AngleAxisd(RadFromDeg(deg), axis)),
                       metres * Eigen::Vector3d(0.6, -0.3, 0.74).normalized()};
  return off * truth;
}

TEST(SimilarityFit, FindsTheSurfaceFromSeveralCentimetresAway) {
  const SimulatedCase& one = MakeCase();
  const ScanPatches surface(one.scans, ScanPatchOptions());
  const auto points = FindSurfacePoints(one.model, 3, 0.7);
  const std::vector<bool> used(one.picks.size(), true);
  for (const double size : {0.3, 1.0, -1.0}) {
    const Similarity start =
        Disturbed(one.room->ScanFromSparse(), 2 * size, 0.08 * size, 0.02 * size);
    const SimilarityFit fit = FitToSurface(one.model, points, surface, one.picks, used, 1.5, 0.4,
                                           start, SimilarityFitOptions());
    EXPECT_TRUE(fit.converged);
    EXPECT_LT(WorstPoseErrors(*one.room, one.model, fit.scan_from_sparse).position, 0.002) << size;
    EXPECT_GT(fit.rms_before, fit.rms_after);
    EXPECT_GT(fit.num_points, 1000);
  }
}

SimilarityFit FitDisturbed(const SimulatedRoom& room, const SparseModel& model,
                           const ScanPatches& surface) {
  return FitToSurface(model, FindSurfacePoints(model, 3, 0.7), surface, {}, {}, 1.5, 0.2,
                      Disturbed(room.ScanFromSparse(), 0.5, 0.03, 0.005), SimilarityFitOptions());
}

// A depth camera's noise grows with the square of the range: across the room no cube of 6 cm is
// flat.
TEST(SimilarityFit, FindsTheSurfaceOfANoisyScan) {
  SimulatedRoomOptions options = CaseOptions(1);
  options.depth_camera = true;
  options.depth_drift = 0;
  options.range_noise = 0.004;
  const SimulatedRoom room(options);
  const SparseModel model = room.MakeSparseModel(2000, 0.7);
  const std::vector<Scan> scans = {room.MakeScan(0)};
  const ScanPatches surface(scans, ScanPatchOptions());
  EXPECT_GT(surface.cell_size(), ScanPatchOptions().cell_size);
  const auto measured =
      static_cast<double>(std::count_if(scans[0].points.begin(), scans[0].points.end(),
                                        [](const Eigen::Vector3d& x) { return x.allFinite(); }));
  double in_patches = 0;
  for (const ScanPatch& patch : surface.patches()) in_patches += patch.num_samples;
  EXPECT_GT(in_patches, 0.4 * measured);
  const SimilarityFit fit = FitDisturbed(room, model, surface);
  ASSERT_TRUE(fit.converged);
  EXPECT_GT(fit.num_points, 400);
  EXPECT_LT(WorstPoseErrors(room, model, fit.scan_from_sparse).position, 0.03);
}

// Samples 5 cm apart on the walls.
TEST(SimilarityFit, FindsTheSurfaceOfACoarseScan) {
  SimulatedRoomOptions options = CaseOptions(1);
  options.scan_columns = 300;
  options.scan_rows = 150;
  const SimulatedRoom room(options);
  const SparseModel model = room.MakeSparseModel(2000, 0.7);
  const ScanPatches surface({room.MakeScan(0)}, ScanPatchOptions());
  EXPECT_GT(surface.cell_size(), ScanPatchOptions().cell_size);
  EXPECT_EQ(ScanPatches(MakeCase().scans, ScanPatchOptions()).cell_size(),
            ScanPatchOptions().cell_size);
  const SimilarityFit fit = FitDisturbed(room, model, surface);
  ASSERT_TRUE(fit.converged);
  EXPECT_GT(fit.num_points, 800);
  EXPECT_LT(WorstPoseErrors(room, model, fit.scan_from_sparse).position, 0.0015);
}

TEST(SimilarityFit, PicksHoldWhatOneWallLeavesOpen) {
  // Only one wall of the scan: the surface says nothing about sliding along it.
  const SimulatedCase& one = MakeCase();
  std::vector<Scan> wall = one.scans;
  const Rigid room_from_scan = one.room->ScanFromRoom().Inverse();
  for (Eigen::Vector3d& point : wall[0].points) {
    if (!(std::abs((room_from_scan * point).x()) < 0.02)) point = Scan::MissingPoint();
  }
  const ScanPatches surface(wall, ScanPatchOptions());
  const auto points = FindSurfacePoints(one.model, 3, 0.7);
  std::vector<Pick> picks = one.picks;
  for (int photo = 0; photo < 8; photo += 4) {
    for (const Pick& pick : PicksOfPhoto(*one.room, photo, 8)) picks.push_back(pick);
  }
  const std::vector<bool> used(picks.size(), true);
  const Similarity start = Disturbed(one.room->ScanFromSparse(), 0.5, 0.03, 0.005);
  const SimilarityFit fit = FitToSurface(one.model, points, surface, picks, used, 1.5, 0.2, start,
                                         SimilarityFitOptions());
  EXPECT_TRUE(fit.converged);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, fit.scan_from_sparse).position, 0.02);
}

// A vault, a cave: hardly two patches face the same way.
TEST(SurfaceWeights, AllOfARoundSurfaceCounts) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto on_vault = [&] {
    const Eigen::Vector3d x(normal(random), normal(random), normal(random));
    return Eigen::Vector3d(x.normalized().cwiseProduct(Eigen::Vector3d(3, 2.5, 2)));
  };
  Scan scan;
  scan.organised = false;
  for (int i = 0; i < 300000; ++i) scan.points.push_back(on_vault());
  scan.intensity.assign(scan.points.size(), 0.0f);
  const ScanPatches surface({scan}, ScanPatchOptions());
  std::vector<SurfacePoint> points(6000);
  for (SurfacePoint& point : points) {
    point.x_in_sparse = on_vault();
    point.covariance = 1e-6 * Eigen::Matrix3d::Identity();
    point.to_cameras = -point.x_in_sparse.normalized();
  }
  const auto matches = FindMatches(points, surface, Similarity(), 0.05, 0.05);
  ASSERT_GT(matches.size(), 5000u);
  const SurfaceWeights weights(matches, surface);
  size_t num_counted = 0;
  for (size_t i = 0; i < matches.size(); ++i) num_counted += weights.Counts(i);
  EXPECT_GT(num_counted, 0.8 * static_cast<double>(matches.size()));
}

// Also where the points' own noise leaves the median of a cell as open.
TEST(SurfaceWeights, KnowHowFarSurfacesAreOffAsAWhole) {
  const ScanPatches surface(MakeCase().scans, ScanPatchOptions());
  std::vector<SurfaceMatch> matches;
  std::vector<Eigen::Vector3d> places, normals;
  for (size_t i = 0; i < surface.patches().size(); i += 5) {
    matches.push_back({0, static_cast<int>(i)});
    places.push_back(surface.patches()[i].point);
    normals.push_back(surface.patches()[i].normal);
  }
  const SurfaceCells cells(places, normals);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const double off : {0.002, 0.004}) {
    std::vector<double> off_of_cell(cells.NumCells());
    for (double& cell : off_of_cell) cell = off * normal(random);
    for (size_t i = 0; i < matches.size(); ++i) {
      // 2 mm of the median of a cell, whatever its number of points.
      const double noise = 0.002 * std::sqrt(cells.NumPoints(cells.Cell(i)) / (kPi / 2));
      matches[i].sigma = std::hypot(noise, kSurfaceNoise);
      matches[i].distance = off_of_cell[cells.Cell(i)] + noise * normal(random);
    }
    EXPECT_NEAR(SurfaceWeights(matches, surface).CommonSigma(), off, 0.25 * off);
  }
}

TEST(SimilarityFit, GivesUpWhereThereIsNoSurface) {
  const SimulatedCase& one = MakeCase();
  const ScanPatches surface(one.scans, ScanPatchOptions());
  const auto points = FindSurfacePoints(one.model, 3, 0.7);
  const std::vector<bool> used(one.picks.size(), true);
  Similarity start = one.room->ScanFromSparse();
  start.translation += Eigen::Vector3d(100, 0, 0);
  EXPECT_FALSE(FitToSurface(one.model, points, surface, one.picks, used, 1.5, 0.2, start,
                            SimilarityFitOptions())
                   .converged);
}

TEST(SimilarityFit, ExactPicksInSeveralPhotosGiveTheTruth) {
  const SimulatedCase& one = MakeCase();
  const CameraProjection projection(one.room->camera());
  std::vector<Pick> picks;
  for (int photo = 0; photo < one.room->NumPhotos(); photo += 5) {
    for (Pick pick : PicksOfPhoto(*one.room, photo, 4)) {
      pick.x_in_img = projection.ImgFromCam(one.room->CamFromScan(photo) * pick.x_in_scan).value();
      picks.push_back(pick);
    }
  }
  const Similarity truth = one.room->ScanFromSparse();
  EXPECT_LT(PickErrors(one.model, picks, truth).cwiseAbs().maxCoeff(), 1e-6);
  SimilarityFitOptions options;
  options.num_steps = 200;
  const SimilarityFit fit = FitToPicks(one.model, picks, std::vector<bool>(picks.size(), true), 1.0,
                                       Disturbed(truth, 1, 0.05, 0.01), options);
  EXPECT_TRUE(fit.converged);
  // The start's scale (1 % off) is believed to 5 %, so a trace of it stays.
  EXPECT_NEAR(fit.scan_from_sparse.scale / truth.scale, 1, 2e-4);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, fit.scan_from_sparse).position, 1e-3);
}

TEST(SimilarityFit, KnowsWhatItIsWorthOnFewPoints) {
  // Every subset of some two hundred points, all over the room: most half metres have one or two.
  const SimulatedCase& one = MakeCase();
  const ScanPatches surface(one.scans, ScanPatchOptions());
  const auto points = FindSurfacePoints(one.model, 3, 0.7);
  const size_t num_subsets = points.size() / 200;
  ASSERT_GE(num_subsets, 5U);
  size_t num_covered = 0;
  for (size_t subset = 0; subset < num_subsets; ++subset) {
    std::vector<SurfacePoint> few;
    for (size_t i = subset; i < points.size(); i += num_subsets) few.push_back(points[i]);
    const SimilarityFit fit = FitToSurface(one.model, few, surface, {}, {}, 1.5, 0.2,
                                           Disturbed(one.room->ScanFromSparse(), 0.3, 0.02, 0.005),
                                           SimilarityFitOptions());
    ASSERT_TRUE(fit.converged) << subset;
    const double off =
        (fit.scan_from_sparse.translation - one.room->ScanFromSparse().translation).norm();
    const double said = PositionSigmaAt(fit, fit.scan_from_sparse.translation);
    EXPECT_LT(said, 0.02) << subset;
    num_covered += off < 2 * said;
  }
  EXPECT_GE(10 * num_covered, 9 * num_subsets);
}

TEST(SurfacePoints, CovarianceIsThatOfTriangulation) {
  // Two cameras 1 m apart look at a point 4 m ahead: depth sigma = sqrt(2) * sigma_px * z^2 / (f *
  // b) / ...; here the normal matrix is inverted by hand: J^T J for both views.
  SparseModel model;
  const double f = 1000;
  model.cameras[1] = {1, CameraModel::kSimplePinhole, 2000, 2000, {f, 1000, 1000}};
  for (uint32_t id : {1u, 2u}) {
    SparseImage image;
    image.image_id = id;
    image.camera_id = 1;
    image.cam_from_model.translation = {id == 1 ? 0.5 : -0.5, 0, 0};
    image.points2d = {{id == 1 ? 1125.0 : 875.0, 1000.0}};
    image.point3d_ids = {1};
    model.images[id] = image;
  }
  model.points[1].x_in_model = {0, 0, 4};
  model.points[1].track = {{1, 0}, {2, 0}};
  const auto points = FindSurfacePoints(model, 2, 2.0);
  ASSERT_EQ(points.size(), 1u);
  // x: 2 (f/z)^2; y the same; z: 2 (f x / z^2)^2 with x = 0.5.
  const Eigen::Vector3d expected(4.0 / (2 * 250.0 * 250), 4.0 / (2 * 250.0 * 250),
                                 4.0 / (2 * std::pow(f * 0.5 / 16, 2)));
  EXPECT_THAT(points[0].covariance, IsNearMatrix(Eigen::Matrix3d(expected.asDiagonal()), 1e-12));
  EXPECT_THAT(points[0].to_cameras,
              IsNearMatrix(Eigen::Vector3d(0, 0, -4 / std::sqrt(16.25)), 1e-12));
  EXPECT_TRUE(FindSurfacePoints(model, 3, 2.0).empty());
}

}  // namespace
}  // namespace roomtex
