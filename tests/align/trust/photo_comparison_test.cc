#include "align/trust/photo_comparison.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "align/trust/free_space.h"
#include "core/report.h"
#include "tests/align/case_folder.h"
#include "tests/align/photographed_room.h"

namespace roomtex {
namespace {

// A room without furniture is the same after half a turn, but for its wallpaper. Of its twelve
// photos half are put there, and show points of the others: by every residual they are right.
struct FoldedRoom : PhotographedRoom {
  FoldedRoom() : PhotographedRoom(Options(), 800, 0.5) {
    const Rigid scan_from_room = room.ScanFromRoom();
    Rigid half_turn;
    half_turn.rotation = Eigen::AngleAxisd(std::acos(-1.0), Eigen::Vector3d::UnitZ());
    half_turn.translation = Eigen::Vector3d(Options().width, Options().depth, 0);
    folded = Fold(scan_from_room * half_turn * scan_from_room.Inverse());
  }

  static SimulatedRoomOptions Options() {
    SimulatedRoomOptions options;
    options.furnished = false;
    options.num_photos = 12;
    options.photo_width = 480;
    options.photo_height = 320;
    options.field_of_view_deg = 75;
    options.scan_columns = 600;
    options.scan_rows = 300;
    return options;
  }

  // Not the half that the picks are in.
  bool IsMoved(const std::string& name) const {
    return (name >= room.PhotoName(6)) == (room.BestPhotoForPicks() < 6);
  }

  // turn: in the scan frame. The photos that are moved show the points of the others, as if one
  // pattern was thrown on opposite walls.
  SparseModel Fold(const Rigid& turn) const {
    SparseModel result = model;
    for (auto& [id, image] : result.images) {
      if (!IsMoved(image.name)) continue;
      image.cam_from_model = image.cam_from_model * turn.Inverse();
      image.points2d.clear();
      image.point3d_ids.clear();
    }
    for (auto point = result.points.begin(); point != result.points.end();) {
      std::vector<TrackElement>& track = point->second.track;
      track.erase(std::remove_if(track.begin(), track.end(),
                                 [&](const TrackElement& element) {
                                   return IsMoved(model.images.at(element.image_id).name);
                                 }),
                  track.end());
      if (track.size() >= 2) {
        ShowInMoved(point->first, &point->second, &result);
        ++point;
        continue;
      }
      for (const TrackElement& element : track) {
        result.images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
      }
      point = result.points.erase(point);
    }
    return result;
  }

  // Nothing hides anything in a room without furniture.
  void ShowInMoved(uint64_t point_id, SparsePoint* point, SparseModel* result) const {
    for (auto& [id, image] : result->images) {
      if (!IsMoved(image.name)) continue;
      const CameraProjection projection(result->cameras.at(image.camera_id));
      const Eigen::Vector3d x_in_cam = image.cam_from_model * point->x_in_model;
      if (!(x_in_cam.z() > 0)) continue;
      const auto x_in_img = projection.ImgFromCam(x_in_cam);
      if (!x_in_img || !projection.InImage(*x_in_img)) continue;
      point->track.push_back({id, static_cast<uint32_t>(image.points2d.size())});
      image.points2d.push_back(*x_in_img);
      image.point3d_ids.push_back(point_id);
    }
  }

  PhotoComparison Compare(const SparseModel& aligned, int num_threads = 2) const {
    const FreeSpace free_space(scans, 100000);
    return ComparePhotosOnScan({aligned, folder.path()}, ScanViewer(scans, free_space),
                               PhotoComparisonOptions(), num_threads);
  }

  SparseModel folded;  // in the scan frame
};

const FoldedRoom& Room() {
  static const FoldedRoom room;
  return room;
}

TEST(PhotoComparison, PhotosInTheirPlacesShowTheSame) {
  const PhotoComparison right = Room().Compare(Room().model);
  for (const PhotoAgreement& photo : right.Agreement()) {
    EXPECT_GT(photo.num_samples, 1000u);
    EXPECT_GT(photo.correlation, 0.9);
  }
  EXPECT_GT(right.Divided().num_samples, 5000u);
  EXPECT_LT(right.Divided().ShareOfAll(), 0.01);
  EXPECT_FALSE(right.Contradicts());
  EXPECT_TRUE(right.Agrees());
}

TEST(PhotoComparison, AFoldDividesThem) {
  const PhotoComparison wrong = Room().Compare(Room().folded);
  EXPECT_GT(wrong.Divided().ShareOfUnlike(), 0.3);
  EXPECT_TRUE(wrong.Contradicts());
  EXPECT_FALSE(wrong.Agrees());
}

TEST(PhotoComparison, DoesNotDependOnTheNumberOfThreads) {
  const PhotoComparison one = Room().Compare(Room().folded, 1),
                        four = Room().Compare(Room().folded, 4);
  EXPECT_EQ(one.Divided().num_divided, four.Divided().num_divided);
  EXPECT_EQ(one.Divided().num_unlike, four.Divided().num_unlike);
  EXPECT_EQ(one.Agreement()[3].correlation, four.Agreement()[3].correlation);
}

TEST(PhotoComparison, PhotosThatAreMissingSayNothing) {
  SparseModel elsewhere = Room().folded;
  for (auto& [id, image] : elsewhere.images) image.name = "none_" + image.name;
  const PhotoComparison none = Room().Compare(elsewhere);
  EXPECT_EQ(none.Divided().num_samples, 0u);
  EXPECT_FALSE(none.Contradicts());
  EXPECT_FALSE(none.Agrees());
}

// By picks and sparse points all is well; the photos know better.
TEST(AlignCommand, DoesNotTrustAFoldedModelThatItsPhotosShow) {
  SimulatedCase files_of_case;
  files_of_case.model = Room().folded;
  TransformModel(Room().room.ScanFromSparse().Inverse(), &files_of_case.model);
  files_of_case.scans = Room().scans;
  files_of_case.picks = PicksOfPhoto(Room().room, Room().room.BestPhotoForPicks(), 8);
  const CaseFolder files(files_of_case);
  const CommandResult blind = files.Align();
  EXPECT_EQ(blind.exit_code, 0) << blind.err;
  const CommandResult seeing = files.Align("--image_path " + Room().folder.path());
  EXPECT_EQ(seeing.exit_code, 4) << seeing.err;
  EXPECT_NE(seeing.err.find("Photos contradict each other where"), std::string::npos) << seeing.err;
  const Json report = Json::parse(ReadBytes(files.folder / "aligned.untrusted/alignment.json"));
  EXPECT_EQ(report["trusted"], false);
  EXPECT_GT(report["divided_photos"]["share_of_unlike"], 0.3);
}

}  // namespace
}  // namespace roomtex
