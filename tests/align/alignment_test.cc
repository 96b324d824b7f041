#include "align/alignment.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include <gmock/gmock.h>

#include "align/pick_findings.h"
#include "core/error.h"
#include "core/frames.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/matchers.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Similarity SomeSimilarity() {
  return {3.7, Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {12, -40, 5}};
}

TEST(Alignment, ExactPicksWithoutRefinementGiveTheTruth) {
  SimulatedCase one = MakeCase();
  const int photo = one.room->BestPhotoForPicks();
  const CameraProjection projection(one.room->camera());
  for (Pick& pick : one.picks) {
    pick.x_in_img = projection.ImgFromCam(one.room->CamFromScan(photo) * pick.x_in_scan).value();
  }
  AlignmentOptions options;
  options.plane_constrained = false;
  const Alignment alignment = AlignCase(one, options);
  EXPECT_THAT(alignment.reasons, IsEmpty());
  EXPECT_LT(alignment.start.pick_rms_px, 1e-4);
  // The pose is exact; the scale rests on hundreds of features with 0.7 pixels of noise.
  EXPECT_NEAR(alignment.scan_from_sparse.scale / one.room->ScanFromSparse().scale, 1, 5e-4);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse).position, 2e-3);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse).rotation, 1e-6);
}

TEST(Alignment, SixNoisyPicksAndTheSurfaceGiveMillimetres) {
  for (int seed = 0; seed < 4; ++seed) {
    const SimulatedCase& one = MakeCase(seed, 6);
    const Alignment& alignment = AlignedCase(seed, 6);
    EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
    EXPECT_TRUE(alignment.fit.refined);
    const PoseErrors from_picks =
        WorstPoseErrors(*one.room, one.model, alignment.start.scan_from_sparse);
    const PoseErrors refined = WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse);
    EXPECT_LT(from_picks.position, 0.06) << seed;
    EXPECT_LT(refined.position, 0.002) << seed;
    EXPECT_LT(refined.rotation, RadFromDeg(0.03)) << seed;
    EXPECT_LT(alignment.fit.surface.rms_after, alignment.fit.surface.rms_before);
  }
}

TEST(Alignment, DoesNotDependOnTheFrameOfTheSparseModel) {
  const SimulatedCase& one = MakeCase();
  const Alignment& before = AlignedCase();
  SimulatedCase moved = one;
  TransformModel(SomeSimilarity(), &moved.model);
  const Alignment after = AlignCase(moved);
  const Similarity back = after.scan_from_sparse * SomeSimilarity();
  EXPECT_NEAR(back.scale / before.scan_from_sparse.scale, 1, 1e-6);
  for (const auto& [id, image] : one.model.images) {
    EXPECT_THAT(
        CamFromScan(moved.model.images.at(id).cam_from_model, after.scan_from_sparse),
        IsNearRigid(CamFromScan(image.cam_from_model, before.scan_from_sparse), 1e-6, 1e-5));
  }
}

TEST(Alignment, MovesWithTheScan) {
  const SimulatedCase& one = MakeCase();
  const Alignment& before = AlignedCase();
  const Rigid moved_from_scan{Eigen::Quaterniond(0.9, 0.1, -0.4, 0.2).normalized(), {4, -2, 1}};
  SimulatedCase moved = one;
  for (Eigen::Vector3d& point : moved.scans[0].points) point = moved_from_scan * point;
  moved.scans[0].scan_from_station = moved_from_scan * moved.scans[0].scan_from_station;
  for (Pick& pick : moved.picks) pick.x_in_scan = moved_from_scan * pick.x_in_scan;
  const Alignment after = AlignCase(moved);
  EXPECT_THAT(after.reasons, IsEmpty()) << Reasons(after);
  // The patches are cut differently, so the refined answer agrees to a fraction of a millimetre
  // only.
  for (const auto& [id, image] : one.model.images) {
    const Rigid expected =
        CamFromScan(image.cam_from_model, before.scan_from_sparse) * moved_from_scan.Inverse();
    EXPECT_THAT(CamFromScan(image.cam_from_model, after.scan_from_sparse),
                IsNearRigid(expected, RadFromDeg(0.02), 1e-3));
  }
}

TEST(Alignment, DoesNotDependOnTheOrderOfThePicks) {
  SimulatedCase one = MakeCase();
  const Similarity before = AlignedCase().scan_from_sparse;
  std::reverse(one.picks.begin(), one.picks.end());
  const Similarity after = AlignCase(one).scan_from_sparse;
  EXPECT_THAT(after.Matrix(), IsNearMatrix(before.Matrix(), 1e-6));
}

TEST(Alignment, LeavesOutOneBadPickAndNamesItsLine) {
  SimulatedCase one = MakeCase();
  const Eigen::Vector2d middle(968, 644);
  one.picks[3].x_in_img += 70 * (middle - one.picks[3].x_in_img).normalized();
  const Alignment alignment = AlignCase(one);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  EXPECT_THAT(alignment.warnings, ElementsAre(HasSubstr("The pick on line 5")));
  EXPECT_FALSE(alignment.start.picks[3].used);
  EXPECT_GT(alignment.start.pick_max_px, 40);
  EXPECT_LT(alignment.start.pick_rms_px, 4);
}

// Five picks are fewer than are asked for, so the answer is not trusted; but it is there, and
// right.
TEST(Alignment, OfSixPicksOneFarOffIsNamedAndTheOthersGiveTheAnswer) {
  int num_named = 0;
  for (int bad = 0; bad < 6; ++bad) {
    SimulatedCase one = MakeCase(0, 6);
    const Eigen::Vector2d middle(968, 644);
    one.picks[bad].x_in_img += 60 * (middle - one.picks[bad].x_in_img).normalized();
    const Alignment alignment = AlignCase(one);
    EXPECT_NE(Reasons(alignment), "") << bad;
    if (alignment.start.picks[bad].used) continue;
    ++num_named;
    EXPECT_THAT(Reasons(alignment), HasSubstr("line " + std::to_string(bad + 2))) << bad;
    EXPECT_TRUE(alignment.adjusted()) << bad;
    EXPECT_LT(WorstPoseErrors(*one.room, alignment.adjustment.bundle.model, Similarity()).position,
              0.003)
        << bad;
  }
  EXPECT_GE(num_named, 5);
}

TEST(Alignment, APickThatIsOffIsNamedAlsoWhereThePosesDoNotSuffer) {
  SimulatedCase one = MakeCase(0, 6);
  for (Pick& pick : one.picks) pick.weight = 1;
  // Among six it bends the start to itself and is kept; the surface gives the right answer.
  one.picks[2].x_in_img += Eigen::Vector2d(15, 20);
  const Alignment alignment = AlignCase(one);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse).position, 0.003);
  std::string said = Reasons(alignment);
  for (const std::string& warning : alignment.warnings) said += warning + "\n";
  EXPECT_THAT(said, HasSubstr("The pick on line 4 "));
  EXPECT_THAT(said, testing::Not(HasSubstr("The pick on line 5 ")));
}

TEST(Alignment, APickThatIsSwitchedOffChangesNothing) {
  const SimulatedCase& one = MakeCase(0, 6);
  SimulatedCase more = one;
  Pick wrong = one.picks[2];
  wrong.x_in_img = Eigen::Vector2d(968, 644);
  wrong.x_in_scan += Eigen::Vector3d(3, 3, 3);
  wrong.weight = 0;
  more.picks.insert(more.picks.begin() + 1, wrong);
  const Alignment &expected = AlignedCase(0, 6), found = AlignCase(more);
  EXPECT_THAT(found.reasons, IsEmpty()) << Reasons(found);
  EXPECT_FALSE(found.start.picks[1].used);
  EXPECT_GT(found.start.picks[1].residual_px, 100);
  EXPECT_EQ(found.start.pick_max_px, expected.start.pick_max_px);
  EXPECT_THAT(found.scan_from_sparse.Matrix(),
              IsNearMatrix(expected.scan_from_sparse.Matrix(), 1e-9));
}

// A bad pick of low weight is not worth a word; the answer is nearer to the truth for it.
TEST(Alignment, AWeakPickHasLittleSay) {
  AlignmentOptions options;
  options.plane_constrained = false;
  options.picks.min_bad_pick_px = 1000;  // nothing is left out
  options.trust.max_pick_rms_px = 1000;
  SimulatedCase one = MakeCase(1, 8);
  one.picks[3].x_in_img += Eigen::Vector2d(15, 10);
  const double bad =
      WorstPoseErrors(*one.room, one.model, AlignCase(one, options).scan_from_sparse).position;
  one.picks[3].weight = 0.05;
  const double good =
      WorstPoseErrors(*one.room, one.model, AlignCase(one, options).scan_from_sparse).position;
  EXPECT_LT(good, 0.7 * bad);
}

TEST(Alignment, RefusesExchangedPicksWithTheirLines) {
  for (int other = 1; other < 6; ++other) {
    SimulatedCase one = MakeCase(1, 6);
    one.picks[0].x_in_img.swap(one.picks[other].x_in_img);
    EXPECT_INPUT_ERROR(AlignCase(one),
                       "line 2: this pick and the one on line " + std::to_string(other + 2));
  }
}

TEST(Alignment, NeverTrustsPicksOfAnotherPhoto) {
  const SimulatedCase& one = MakeCase();
  const int clicked = one.room->BestPhotoForPicks();
  for (int photo = 0; photo < one.room->NumPhotos(); ++photo) {
    if (photo == clicked) continue;
    SimulatedCase wrong = one;
    for (Pick& pick : wrong.picks) pick.image_name = one.room->PhotoName(photo);
    try {
      EXPECT_NE(Reasons(AlignCase(wrong)), "") << photo;
    } catch (const Contradiction&) {
      // Refused: fine as well.
    }
  }
}

TEST(Alignment, RecognisesAScanReadWithTheOtherAzimuthSense) {
  // Picked on the mirrored scan.
  SimulatedCase one = MakeCase();
  for (Eigen::Vector3d& point : one.scans[0].points) point.x() *= -1;
  SimulatedCase picked_on_it = one;
  for (Pick& pick : picked_on_it.picks) pick.x_in_scan.x() *= -1;
  EXPECT_INPUT_ERROR(AlignCase(picked_on_it), "--azimuth counterclockwise");
  // Picked on the right one.
  EXPECT_INPUT_ERROR(AlignCase(one), "--azimuth counterclockwise");
  one.azimuth = "counterclockwise";
  EXPECT_INPUT_ERROR(AlignCase(one), "--azimuth clockwise");
  // A PTX scan has no azimuth sense.
  one.scans[0].is_rtpi = false;
  EXPECT_INPUT_ERROR(AlignCase(one), "left-handed");
}

TEST(Alignment, NeverTrustsTheScanOfAnotherRoom) {
  SimulatedCase one = MakeCase(0);
  SimulatedRoomOptions options = one.room->options();
  options.random_seed = 77;
  options.width = 6.5;
  options.depth = 4.7;
  one.scans = {SimulatedRoom(options).MakeScan(0)};
  try {
    EXPECT_NE(Reasons(AlignCase(one)), "");
  } catch (const Contradiction&) {
  }
}

// The same walls, windows and doors, and clicks on nothing else: only what stands and hangs in the
// room tells that the scan is of another one.
TEST(Alignment, NeverTrustsTheScanOfARoomOfTheSameShape) {
  int num_tried = 0;
  for (const int seed : {0, 1, 2}) {
    SimulatedCase one = MakeCase(seed);
    one.scans = MakeCase(seed + 1).scans;
    const ScanPatches surface(one.scans, ScanPatchOptions());
    one.picks.clear();
    for (const Pick& pick : PicksOfPhoto(*one.room, one.room->BestPhotoForPicks(), 60)) {
      const auto nearest = surface.FindNearest(pick.x_in_scan, 0.2);
      if (!nearest || std::abs(nearest->distance) > 0.02 || one.picks.size() == 8) continue;
      one.picks.push_back(pick);
    }
    if (one.picks.size() < 6) continue;
    try {
      EXPECT_NE(Reasons(AlignCase(one)), "") << seed;
      ++num_tried;
    } catch (const Contradiction&) {
    }
  }
  EXPECT_GE(num_tried, 1);
}

TEST(Alignment, RefusesPicksInMillimetres) {
  SimulatedCase one = MakeCase();
  for (Pick& pick : one.picks) pick.x_in_scan *= 1000;
  EXPECT_INPUT_ERROR(AlignCase(one), "in metres");
}

TEST(Alignment, RefusesCollinearPicks) {
  SimulatedCase one = MakeCase();
  // Samples along one row of the scan where a wall is; where they are in the photo does not matter.
  const Scan& scan = one.scans[0];
  const Eigen::Vector3d a = one.picks[0].x_in_scan, b = one.picks[1].x_in_scan;
  for (size_t i = 0; i < one.picks.size(); ++i) one.picks[i].x_in_scan = a + 0.1 * i * (b - a);
  SimulatedCase on_line = one;
  for (Pick& pick : one.picks) on_line.scans[0].points.push_back(pick.x_in_scan);
  on_line.scans[0].organised = false;  // the points above need not lie on the grid
  on_line.scans[0].triangles = BuildScanMesh(scan, ScanMeshOptions());
  for (int i = 0; i < 8; ++i) {
    const int at = static_cast<int>(scan.points.size()) + i;
    on_line.scans[0].triangles.push_back({at, at, at});
  }
  EXPECT_INPUT_ERROR(AlignCase(on_line), "one straight line");
}

TEST(Alignment, PicksInSeveralPhotosAreBetterThanInOne) {
  double one_photo = 0, four_photos = 0;
  AlignmentOptions options;
  options.plane_constrained = false;
  for (int seed = 0; seed < 4; ++seed) {
    SimulatedCase one = MakeCase(seed, 6);
    one_photo +=
        WorstPoseErrors(*one.room, one.model, AlignCase(one, options).scan_from_sparse).position;
    const int clicked = one.room->BestPhotoForPicks();
    for (int step = 4; step <= 12; step += 4) {
      const int photo = (clicked + step) % one.room->NumPhotos();
      for (const Pick& pick : PicksOfPhoto(*one.room, photo, 6)) one.picks.push_back(pick);
    }
    const Alignment joint = AlignCase(one, options);
    EXPECT_THAT(joint.reasons, IsEmpty()) << Reasons(joint);
    EXPECT_LT(joint.start.pick_rms_px, 4);
    four_photos += WorstPoseErrors(*one.room, one.model, joint.scan_from_sparse).position;
  }
  EXPECT_LT(four_photos, 0.7 * one_photo);
  EXPECT_LT(four_photos / 4, 0.02);
}

TEST(Alignment, TakesSeveralScansAsOne) {
  SimulatedRoomOptions options = MakeCase().room->options();
  options.num_stations = 2;
  const SimulatedRoom room(options);
  SimulatedCase two = MakeCase();
  two.scans = {room.MakeScan(0), room.MakeScan(1)};
  const Alignment alignment = AlignCase(two);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  EXPECT_LT(WorstPoseErrors(*two.room, two.model, alignment.scan_from_sparse).position, 0.002);
  EXPECT_GT(alignment.placement.SurfaceShare(), 0.98);
}

TEST(Alignment, TakesAMeshWithoutAGrid) {
  SimulatedCase one = MakeCase();
  Scan& scan = one.scans[0];
  scan.triangles = BuildScanMesh(scan, ScanMeshOptions());
  scan.organised = false;
  scan.is_rtpi = false;
  scan.num_columns = static_cast<int>(scan.points.size());
  scan.num_rows = 1;
  const Alignment alignment = AlignCase(one);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse).position, 0.004);
}

TEST(Alignment, NamesABadPickInAPhotoWithFewPicks) {
  SimulatedCase one = MakeCase();
  const int photo = (one.room->BestPhotoForPicks() + 5) % one.room->NumPhotos();
  const std::vector<Pick> more = PicksOfPhoto(*one.room, photo, 3, 20);
  one.picks.insert(one.picks.end(), more.begin(), more.end());
  one.picks.back().x_in_img += Eigen::Vector2d(80, 0);
  const Alignment alignment = AlignCase(one);
  EXPECT_FALSE(alignment.start.picks.back().used);
  EXPECT_THAT(alignment.warnings, ElementsAre(HasSubstr("line 22")));
}

TEST(Alignment, ChoosesTheRightSolutionOfCoplanarPicks) {
  // All picks on one wall: the reflected pose, if there is one, does not agree with the sparse
  // points.
  const SimulatedCase& one = MakeCase();
  int tried = 0;
  for (int photo = 0; photo < one.room->NumPhotos(); ++photo) {
    SimulatedCase flat = one;
    flat.picks.clear();
    const CameraProjection projection(one.room->camera());
    const Rigid cam_from_scan = one.room->CamFromScan(photo);
    // Scan samples of the wall most of which the photo sees: those whose room x is nearly 0.
    const Rigid room_from_scan = one.room->ScanFromRoom().Inverse();
    std::mt19937 random(photo);
    for (int attempt = 0; attempt < 200000 && flat.picks.size() < 7; ++attempt) {
      const Eigen::Vector3d p = one.scans[0].points[random() % one.scans[0].points.size()];
      if (!(std::abs((room_from_scan * p).x()) < 0.01)) continue;
      const auto x = projection.ImgFromCam(cam_from_scan * p);
      if (!x || !projection.InImage(*x)) continue;
      flat.picks.push_back({one.room->PhotoName(photo), *x, p, attempt + 2});
    }
    Eigen::Matrix2Xd places(2, flat.picks.size());
    for (size_t i = 0; i < flat.picks.size(); ++i) places.col(i) = flat.picks[i].x_in_img;
    if (flat.picks.size() < 7) continue;
    const Eigen::Vector2d size = places.rowwise().maxCoeff() - places.rowwise().minCoeff();
    if (size.minCoeff() < 500) continue;
    ++tried;
    AlignmentOptions options;
    options.plane_constrained = false;
    const Alignment alignment = AlignCase(flat, options);
    // The picks are exact except for the 2 mm of range noise.
    EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.scan_from_sparse).position, 0.1)
        << photo;
  }
  EXPECT_GE(tried, 2);
}

// The truth, off by a few centimetres, half a degree and a percent.
Similarity NearTheTruth(const SimulatedCase& one) {
  Similarity off;
  off.scale = 1.01;
  off.rotation = Eigen::AngleAxisd(RadFromDeg(0.5), Eigen::Vector3d(1, 2, -2).normalized());
  off.translation = {0.03, -0.02, 0.02};
  return off * one.room->ScanFromSparse();
}

TEST(Alignment, ASimilarityIsEnoughToStartFrom) {
  SimulatedCase one = MakeCase();
  one.picks.clear();
  const Alignment alignment = AlignCaseFrom(NearTheTruth(one), 0.05, one);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  EXPECT_THAT(alignment.warnings, IsEmpty());
  EXPECT_TRUE(alignment.fit.surface.converged);
  ASSERT_TRUE(alignment.adjusted());
  EXPECT_LT(WorstPoseErrors(*one.room, one.model, alignment.fit.scan_from_sparse).position, 0.003);
  EXPECT_LT(WorstPoseErrors(*one.room, alignment.adjustment.bundle.model, Similarity()).position,
            0.003);
  EXPECT_GT(alignment.placement.SurfaceShare(), 0.98);
  EXPECT_LT(alignment.expected_error.at_cameras, 0.01);
  EXPECT_EQ(alignment.photo_sigmas.size(), one.model.images.size());
  // Nothing is said of picks.
  EXPECT_THAT(alignment.start.picks, IsEmpty());
  EXPECT_THAT(alignment.refined_pick_px, IsEmpty());
  EXPECT_TRUE(std::isnan(alignment.start.pick_rms_px));
  EXPECT_TRUE(std::isnan(alignment.start.pick_max_px));
  EXPECT_TRUE(std::isnan(alignment.refined_pick_rms_px));
  EXPECT_EQ(alignment.start.image_name, "");
  EXPECT_EQ(alignment.start.scale.num_features, 0);
}

TEST(Alignment, WithoutPicksTheAnswerDoesNotDependOnWhereTheScanLies) {
  SimulatedCase one = MakeCase();
  one.picks.clear();
  AlignmentOptions options;
  options.plane_constrained = false;  // the fit itself is asked
  const Similarity start = NearTheTruth(one);
  const Similarity before = AlignCaseFrom(start, 0.05, one, options).fit.surface.scan_from_sparse;
  // A whole number of all cells, so that the same samples make a patch.
  const Similarity moved_from_scan{1, Eigen::Quaterniond::Identity(), {600000, 4999998, 300}};
  for (Eigen::Vector3d& point : one.scans[0].points) point = moved_from_scan * point;
  one.scans[0].scan_from_station.translation += moved_from_scan.translation;
  const Alignment after = AlignCaseFrom(moved_from_scan * start, 0.05, one, options);
  ASSERT_TRUE(after.fit.surface.converged);
  const Similarity back = moved_from_scan.Inverse() * after.fit.surface.scan_from_sparse;
  for (const auto& [id, image] : one.model.images) {
    EXPECT_THAT(CamFromScan(image.cam_from_model, back),
                IsNearRigid(CamFromScan(image.cam_from_model, before), RadFromDeg(0.001), 2e-5));
  }
}

// No point has three observations.
TEST(Alignment, AModelOfTwoPhotosIsPlaced) {
  SimulatedCase one = MakeCase();
  const uint32_t picked = one.model.FindImage(one.picks[0].image_name)->image_id;
  std::map<uint32_t, int> shared;  // by the other photo
  for (const auto& [id, point] : one.model.points) {
    std::set<uint32_t> seen;
    for (const TrackElement& element : point.track) seen.insert(element.image_id);
    if (seen.count(picked) == 0) continue;
    for (const uint32_t other : seen) shared[other] += other != picked;
  }
  const uint32_t other =
      std::max_element(shared.begin(), shared.end(), [](const auto& a, const auto& b) {
        return a.second < b.second;
      })->first;
  std::set<uint32_t> others;
  for (const auto& [id, image] : one.model.images) {
    if (id != picked && id != other) others.insert(id);
  }
  one.model = WithoutPhotos(one.model, others);
  const Alignment alignment = AlignCase(one);
  EXPECT_GT(alignment.fit.points.size(), 50u);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  for (int photo = 0; photo < one.room->NumPhotos(); ++photo) {
    const SparseImage* image =
        alignment.adjustment.bundle.model.FindImage(one.room->PhotoName(photo));
    if (image == nullptr) continue;
    EXPECT_THAT(image->cam_from_model,
                IsNearRigid(one.room->CamFromScan(photo), RadFromDeg(0.3), 0.01));
  }
}

TEST(Alignment, WithoutPicksAndRefinementTheStartIsTheAnswer) {
  SimulatedCase one = MakeCase();
  one.picks.clear();
  AlignmentOptions options;
  options.plane_constrained = false;
  const Similarity start = one.room->ScanFromSparse();
  const Alignment alignment = AlignCaseFrom(start, 0.01, one, options);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  EXPECT_EQ(alignment.scan_from_sparse.translation, start.translation);
  EXPECT_FALSE(std::isfinite(alignment.expected_error.at_cameras));  // nobody knows
}

TEST(Alignment, NeverTrustsAWrongStart) {
  SimulatedCase one = MakeCase();
  one.picks.clear();
  for (int k = 0; k < 4; ++k) {
    Similarity off;
    off.rotation = Eigen::AngleAxisd(1 + 0.6 * k, one.scans[0].up.normalized());
    off.translation = {0.8, -0.3 * k, 0};
    const Alignment alignment = AlignCaseFrom(off * one.room->ScanFromSparse(), 0.2, one);
    EXPECT_NE(Reasons(alignment), "") << k;
    EXPECT_FALSE(alignment.adjusted()) << k;
  }
}

// Two picks fix no pose, but they hold what the surface leaves open.
TEST(Alignment, AStartTakesTheFewPicksThereAre) {
  SimulatedCase one = MakeCase(0, 6);
  one.picks.resize(2);
  one.picks[1].weight = 0;
  const Alignment alignment = AlignCaseFrom(NearTheTruth(one), 0.05, one);
  EXPECT_THAT(alignment.reasons, IsEmpty()) << Reasons(alignment);
  EXPECT_THAT(alignment.start.UsedPicks(), ElementsAre(true, false));
  EXPECT_GT(alignment.start.pick_rms_px, 5);
  EXPECT_LT(alignment.refined_pick_rms_px, 5);
}

TEST(Alignment, FewFeaturesAreNotTrusted) {
  SimulatedCase one = MakeCase();
  SparseImage& image = one.model.images.at(one.model.FindImage(one.picks[0].image_name)->image_id);
  int kept = 0;
  for (size_t i = 0; i < image.point3d_ids.size(); ++i) {
    if (image.point3d_ids[i] == kInvalidPoint3dId || kept++ < 8) continue;
    image.point3d_ids[i] = kInvalidPoint3dId;
  }
  EXPECT_THAT(Reasons(AlignCase(one)), HasSubstr("features of"));
}

}  // namespace
}  // namespace roomtex
