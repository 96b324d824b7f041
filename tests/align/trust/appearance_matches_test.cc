#include "align/trust/appearance_matches.h"

#include <filesystem>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "align/start_search.h"
#include "align/trust/appearance_search.h"
#include "tests/align/simulated_alignment.h"
#include "tests/support/temp_folder.h"

namespace roomtex {
namespace {

// A room that a depth camera scanned, whose intensity is the brightness of its pictures, and ten
// photos.
struct ScannedByADepthCamera {
  explicit ScannedByADepthCamera(int seed) : one(MakeCase(Options(seed), 6)) {
    for (int photo = 0; photo < one.room->NumPhotos(); ++photo) {
      cv::imwrite(folder / one.room->PhotoName(photo), one.room->RenderPhoto(photo));
    }
  }
  static SimulatedRoomOptions Options(int seed) {
    SimulatedRoomOptions options = CaseOptions(seed);
    options.num_photos = 10;
    options.photo_width = 640;
    options.photo_height = 480;
    options.scan_columns = 800;
    options.scan_rows = 340;
    options.depth_camera = true;
    return options;
  }
  std::vector<AppearanceMatch> MatchWith(const std::vector<Scan>& scans, int num_threads) const {
    const SurveyedScans surveyed(scans);
    const Eigen::Vector3d up_in_sparse =
        one.room->ScanFromSparse().rotation.conjugate() * scans[0].up;
    return AppearanceMatcher(one.model, folder.path(), surveyed.viewer(), {}, num_threads)
        .Match(up_in_sparse, scans[0].up);
  }

  SimulatedCase one;
  TempFolder folder;
};

double ShareWithin(const std::vector<AppearanceMatch>& matches, const Similarity& truth,
                   double tolerance) {
  long num = 0;
  for (const AppearanceMatch& one : matches) {
    num += (truth * one.x_in_sparse - one.x_in_scan).norm() < tolerance;
  }
  return static_cast<double>(num) / static_cast<double>(std::max<size_t>(1, matches.size()));
}

TEST(AppearanceMatches, PhotosAndScanOfARoomGoTogetherAndThoseOfASimilarRoomDoNot) {
  const ScannedByADepthCamera room(3);
  const Similarity truth = room.one.room->ScanFromSparse();
  const Eigen::Vector3d up_in_scan = room.one.scans[0].up;
  const Eigen::Vector3d up_in_sparse = truth.rotation.conjugate() * up_in_scan;
  const std::vector<AppearanceMatch> matches = room.MatchWith(room.one.scans, 2);
  EXPECT_GT(ShareWithin(matches, truth, 0.07), 0.5);
  const std::vector<AppearancePlace> places =
      SearchByAppearance(matches, up_in_sparse, up_in_scan, {}, 2);
  ASSERT_FALSE(places.empty());
  EXPECT_GT(places[0].num_cells, 15);
  const SearchCloud cloud = MakeSearchCloud(room.one.model, 0.5, 500);
  EXPECT_LT(DistanceBetween(cloud, places[0].scan_from_sparse, truth), 0.05);

  SimulatedRoomOptions other = ScannedByADepthCamera::Options(3);
  other.random_seed += 100;
  const std::vector<AppearanceMatch> wrong = room.MatchWith({SimulatedRoom(other).MakeScan(0)}, 2);
  const std::vector<AppearancePlace> wrong_places =
      SearchByAppearance(wrong, up_in_sparse, up_in_scan, {}, 2);
  EXPECT_LT(wrong_places.empty() ? 0 : wrong_places[0].num_cells, 8);

  const std::vector<AppearanceMatch> again = room.MatchWith(room.one.scans, 1);
  ASSERT_EQ(again.size(), matches.size());
  for (size_t i = 0; i < again.size(); ++i) {
    EXPECT_EQ(again[i].x_in_sparse, matches[i].x_in_sparse);
    EXPECT_EQ(again[i].x_in_scan, matches[i].x_in_scan);
  }
}

}  // namespace
}  // namespace roomtex
