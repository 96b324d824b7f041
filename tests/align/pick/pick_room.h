#pragma once
// A simulated room as files, opened as roomtex-pick opens it, with clicks of known truth. Made once
// per process.

#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "align/pick/pick_scene.h"
#include "align/pick/session_pick.h"
#include "capture/simulation/simulated_room.h"
#include "core/scan_mesh.h"
#include "importers/scan_writer.h"
#include "tests/support/temp_folder.h"

namespace roomtex {

class PickRoom {
 public:
  PickRoom() : room_(Options()) {
    std::filesystem::create_directories(folder_ / "images");
    for (int photo : {clicked_photo(), other_photo()}) {  // the others are missing
      cv::imwrite(photo_path(photo), room_.RenderPhoto(photo));
    }
    WriteSparseModel(room_.MakeSparseModel(1500, 0.0), folder_ / "sparse");
    WriteScan(room_.MakeScan(0), {}, folder_ / "room.rtpi");
    Progress progress(true);
    scene_ = std::make_unique<PickScene>(input(), &progress);
    scene_->Prepare();
    scene_->WaitForEdges([] { return false; });
  }

  PickSceneInput input() const {
    PickSceneInput input;
    input.input_paths = {folder_ / "sparse"};
    input.image_path = folder_ / "images";
    input.scan_paths = {folder_ / "room.rtpi"};
    return input;
  }
  const PickScene& scene() const { return *scene_; }
  const SimulatedRoom& room() const { return room_; }
  const ScanPlaces& places() const { return scene_->places(0); }
  const TempFolder& folder() const { return folder_; }
  int clicked_photo() const { return 2; }
  int other_photo() const { return 3; }
  std::string photo_path(int photo) const { return folder_ / "images/" + room_.PhotoName(photo); }

  // Exact clicks in a photo that sees these places of the scan.
  std::vector<SessionPick> Picks(int photo, int count) const {
    std::vector<SessionPick> picks;
    for (const SimulatedPick& simulated : room_.MakePicks(photo, count)) {
      const Eigen::Vector2d place = places().PlaceOf(simulated.x_in_scan).value();
      const ScanPlaces::Found found = places().PointAt(place);
      const Eigen::Vector3d x_in_scan =
          found.reason == ScanPlaces::Reason::kNone ? found.x_in_scan : simulated.x_in_scan;
      SessionPick pick;
      pick.image_name = room_.PhotoName(photo);
      pick.x_in_scan = x_in_scan;
      pick.x_in_img = Project(photo, x_in_scan);
      pick.spot = ScanSpot{0, place};
      picks.push_back(pick);
    }
    return picks;
  }
  // The same on smooth surface, away from edges, all over the photo.
  std::vector<SessionPick> SmoothPicks(int photo, size_t count) const {
    const Eigen::Vector3d centre = room_.CamFromScan(photo).TargetOriginInSource();
    const CameraProjection projection(room_.camera());
    std::vector<SessionPick> picks;
    for (int k = 1; picks.size() < count && k < 20000; ++k) {
      const Eigen::Vector2d place(places().width() * std::fmod(0.754877666 * k, 1.0),
                                  places().height() * std::fmod(0.569840291 * k, 1.0));
      bool smooth = true;
      for (int side = 0; side < 9 && smooth; ++side) {
        const Eigen::Vector2d near = place + 6 * Eigen::Vector2d(side % 3 - 1, side / 3 - 1);
        smooth = places().PointAt(near).reason == ScanPlaces::Reason::kNone;
      }
      const Eigen::Vector3d x_in_scan = places().PointAt(place).x_in_scan;
      const auto x_in_img = projection.ImgFromCam(room_.CamFromScan(photo) * x_in_scan);
      if (!smooth || !x_in_img || !projection.InImage(*x_in_img)) continue;
      if (scene_->rays()->IsHidden(centre, x_in_scan)) continue;
      SessionPick pick;
      pick.image_name = room_.PhotoName(photo);
      pick.x_in_scan = x_in_scan;
      pick.x_in_img = x_in_img;
      pick.spot = ScanSpot{0, place};
      picks.push_back(pick);
    }
    return picks;
  }
  Eigen::Vector2d Project(int photo, const Eigen::Vector3d& x_in_scan) const {
    return CameraProjection(room_.camera())
        .ImgFromCam(room_.CamFromScan(photo) * x_in_scan)
        .value();
  }

 private:
  static SimulatedRoomOptions Options() {
    SimulatedRoomOptions options;
    options.num_photos = 8;
    options.photo_width = 968;
    options.photo_height = 644;
    options.scan_columns = 1000;
    options.scan_rows = 500;
    options.range_noise = 0;
    options.click_noise_px = 0;
    options.photo_noise = 0;
    options.exposure_range_ev = 0;
    return options;
  }

  TempFolder folder_;
  SimulatedRoom room_;
  std::unique_ptr<PickScene> scene_;
};

inline const PickRoom& ThePickRoom() {
  static const PickRoom room;
  return room;
}

}  // namespace roomtex
