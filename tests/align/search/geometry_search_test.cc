#include "align/search/geometry_search.h"

#include <cmath>

#include <gmock/gmock.h>

#include "align/search/search_hint.h"
#include "align/search/translation_search.h"
#include "align/search/up_directions.h"
#include "core/random_stream.h"
#include "tests/align/simulated_alignment.h"

namespace roomtex {
namespace {

ScanVolume VolumeOf(const SimulatedCase& one) {
  return ScanVolume(one.scans, one.scans[0].up, ScanVolumeOptions());
}

// What a place is worth, cell by cell.
double WorthAt(const ScanVolume& volume, const std::vector<Eigen::Vector3d>& points,
               const Eigen::Vector3d& translation) {
  double sum = 0;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3i cell =
        ((point + translation - volume.origin()) / volume.cell_size()).array().floor().cast<int>();
    const Eigen::Vector3i& size = volume.size();
    const bool inside = (cell.array() >= 0).all() && (cell.array() < size.array()).all();
    sum += inside ? volume.worth()[(cell.z() * size.y() + cell.y()) * size.x() + cell.x()]
                  : volume.of_outside();
  }
  return sum / static_cast<double>(points.size());
}

TEST(ScanVolume, KnowsWhatTheScannerSawAndLookedThrough) {
  const SimulatedCase& one = MakeCase();
  const ScanVolume volume = VolumeOf(one);
  const Eigen::Quaterniond& level = volume.level_from_scan();
  int num_surface = 0, num_all = 0;
  for (size_t i = 0; i < one.scans[0].points.size(); i += 97) {
    const Eigen::Vector3d& x = one.scans[0].points[i];
    if (one.scans[0].IsMissing(static_cast<int>(i))) continue;
    ++num_all;
    num_surface += volume.StateAt(level * x) == ScanVolume::State::kSurface;
    const Eigen::Vector3d before = one.scans[0].Station() + 0.5 * (x - one.scans[0].Station());
    EXPECT_NE(volume.StateAt(level * before), ScanVolume::State::kUnknown);
  }
  EXPECT_GT(num_surface, 0.98 * num_all);
  EXPECT_EQ(volume.StateAt(Eigen::Vector3d(100, 0, 0)), ScanVolume::State::kUnknown);
}

TEST(TranslationSearch, FindsWhatTryingEveryPlaceFinds) {
  const ScanVolume volume = VolumeOf(MakeCase());
  const double cell = volume.cell_size();
  const Eigen::Vector3d low(-1.1, 0.3, 5.0);
  RandomStream random(3);
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3i reach(9, 7, 5);
  for (int i = 0; i < 12; ++i) {  // in the middles of cells, each its own
    points.push_back(
        low + cell * Eigen::Vector3d(i % 9 + 0.5, random.Index(7) + 0.5, random.Index(5) + 0.5));
  }
  const auto found = TranslationSearch(volume, reach).FindBest(points, low, 1, {});
  ASSERT_EQ(found.size(), 1u);
  double best = -1;
  for (int z = -reach.z(); z < volume.size().z(); ++z) {
    for (int y = -reach.y(); y < volume.size().y(); ++y) {
      for (int x = -reach.x(); x < volume.size().x(); ++x) {
        best = std::max(
            best, WorthAt(volume, points, volume.origin() - low + cell * Eigen::Vector3d(x, y, z)));
      }
    }
  }
  EXPECT_NEAR(found[0].score, best, 1e-4);
  EXPECT_NEAR(WorthAt(volume, points, found[0].translation), best, 1e-4);
}

TEST(TranslationSearch, LooksOnlyWhereItMay) {
  const ScanVolume volume = VolumeOf(MakeCase());
  const std::vector<Eigen::Vector3d> points = {{0.1, 0.1, 0.1}, {0.5, 0.1, 0.1}};
  const auto right_half = [](const Eigen::Vector3d& translation) { return translation.x() > 0.7; };
  for (const auto& place : TranslationSearch(volume, {4, 2, 2})
                               .FindBest(points, Eigen::Vector3d::Zero(), 4, right_half)) {
    EXPECT_GT(place.translation.x(), 0.7);
  }
}

double NearestStart(const std::vector<StartHypothesis>& found, const SimulatedCase& one) {
  const Similarity truth = one.room->ScanFromSparse();
  double nearest = 1e9;
  for (const StartHypothesis& start : found) {
    double worst = 0;
    for (const auto& [id, image] : one.model.images) {
      const Eigen::Vector3d centre = image.cam_from_model.TargetOriginInSource();
      worst = std::max(worst, (start.scan_from_sparse * centre - truth * centre).norm());
    }
    nearest = std::min(nearest, worst);
  }
  return nearest;
}

std::vector<StartHypothesis> Search(const SimulatedCase& one, const std::vector<HintRay>& hints,
                                    int num_threads) {
  const SearchCloud cloud = MakeSearchCloud(one.model, 0.7, 4000);
  return SearchByGeometry(cloud, FindModelUps(cloud).ups, VolumeOf(one), hints, {}, num_threads);
}

TEST(GeometrySearch, HasTheRightPlaceAmongItsStarts) {
  const SimulatedCase& one = MakeCase();
  const auto found = Search(one, {}, 2);
  EXPECT_LT(NearestStart(found, one), 0.5);
  for (size_t i = 1; i < found.size(); ++i) EXPECT_LE(found[i].score, found[i - 1].score);
}

TEST(GeometrySearch, IsTheSameForEveryNumberOfThreads) {
  const auto one = Search(MakeCase(), {}, 1), three = Search(MakeCase(), {}, 3);
  ASSERT_EQ(one.size(), three.size());
  for (size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].scan_from_sparse.Matrix(), three[i].scan_from_sparse.Matrix());
  }
}

TEST(GeometrySearch, AHintLeavesOnlyStartsThatAgree) {
  const SimulatedCase& one = MakeCase();
  const std::vector<HintRay> hints = FindHintRays(one.model, {one.picks[0]}, {});
  ASSERT_EQ(hints.size(), 1u);
  const auto found = Search(one, hints, 2);
  EXPECT_LT(NearestStart(found, one), 0.5);
  for (const StartHypothesis& start : found) {
    EXPECT_TRUE(Agrees(hints, start.scan_from_sparse, 0.7));
  }
}

TEST(SearchHint, APickAgreesWithTheTruthAndNotWithAnotherPlace) {
  const SimulatedCase& one = MakeCase();
  const auto hints = FindHintRays(one.model, one.picks, {});
  Similarity truth = one.room->ScanFromSparse();
  EXPECT_TRUE(Agrees(hints, truth, 0));
  truth.translation.x() += 1.5;
  EXPECT_FALSE(Agrees(hints, truth, 0));
}

// A corner of a fisheye's photo is seen far farther from the axis than atan(half diagonal / f).
TEST(SearchHint, AFisheyeShowsWhatIsNearlyBesideIt) {
  SparseModel model;
  Camera& camera = model.cameras[1];
  camera.camera_id = 1;
  camera.model = CameraModel::kOpenCvFisheye;
  camera.width = 1000;
  camera.height = 700;
  camera.params = {400, 400, 500, 350, 0, 0, 0, 0};
  model.images[1] = {1, 1, "a.jpg", Rigid(), {}, {}};
  const double corner = std::hypot(500, 350) / 400;  // radians: equidistant
  const auto at = [](double angle) -> Eigen::Vector3d {
    return Eigen::Vector3d(std::sin(angle), 0, std::cos(angle)) * 3;
  };
  const auto hints = FindHintRays(model, {}, {{"a.jpg", at(1.2)}});
  ASSERT_EQ(hints.size(), 1u);
  EXPECT_NEAR(hints[0].max_angle, corner, 1e-6);
  EXPECT_TRUE(Agrees(hints, Similarity(), 0));
}

}  // namespace
}  // namespace roomtex
