#pragma once
// Photos and scan of simulated rooms whose gradients are compared.

#include <map>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "align/trust/gradient_shift.h"
#include "capture/simulation/simulated_room.h"
#include "core/frames.h"

namespace roomtex {

// Photos and scan of a simulated room.
struct Exposed {
  explicit Exposed(SimulatedRoomOptions options) {
    options.num_photos = kNumPhotos;
    options.photo_width = 720;
    options.photo_height = 480;
    options.scan_columns = 1400;
    options.scan_rows = 700;
    room = std::make_unique<SimulatedRoom>(options);
    scans = {room->MakeScan(0)};
    free_space = std::make_unique<FreeSpace>(scans, 300000);
    viewer = std::make_unique<ScanViewer>(scans, *free_space);
    projection = std::make_unique<CameraProjection>(room->camera());
    lattice = std::make_unique<RayLattice>(*projection, 3.0 * kCell);
    for (int photo = 0; photo < room->NumPhotos(); ++photo) {
      photos.push_back(room->RenderPhoto(photo));
    }
  }

  // At the true poses after the scan frame was moved by `wrong`; the photos may be another room's.
  GradientAgreement Judge(const Similarity& wrong, const std::vector<cv::Mat>& pictures) const {
    GradientShifts shifts;
    for (int photo = 0; photo < room->NumPhotos(); ++photo) {
      const ScanView view = viewer->Look(*lattice, room->camera(),
                                         CamFromScan(room->CamFromScan(photo), wrong), kCell);
      shifts.Add(MeasureGradientShifts(view, pictures[photo], *projection, viewer->sample_angle(),
                                       GradientShiftOptions()));
    }
    return JudgeGradientShifts(shifts);
  }

  static constexpr int kNumPhotos = 4, kCell = 1;
  std::unique_ptr<SimulatedRoom> room;
  std::vector<Scan> scans;
  std::unique_ptr<FreeSpace> free_space;
  std::unique_ptr<ScanViewer> viewer;
  std::unique_ptr<CameraProjection> projection;
  std::unique_ptr<RayLattice> lattice;
  std::vector<cv::Mat> photos;
};

inline const Exposed& Room(int seed) {
  static std::map<int, std::unique_ptr<Exposed>> rooms;
  auto& room = rooms[seed];
  if (room == nullptr) {
    SimulatedRoomOptions options;
    options.random_seed = seed;
    room = std::make_unique<Exposed>(options);
  }
  return *room;
}

inline Similarity Turned(double degrees, const Eigen::Vector3d& axis) {
  Similarity turned;
  turned.rotation = Eigen::AngleAxisd(RadFromDeg(degrees), axis.normalized());
  return turned;
}
inline Similarity Moved(const Eigen::Vector3d& by) {
  Similarity moved;
  moved.translation = by;
  return moved;
}

// What is said of rooms of different kinds at the right alignment and at four wrong ones each.
struct RoomVerdicts {
  int supports = 0, false_contradictions = 0;  // at the right one
  int contradictions = 0, false_supports = 0;  // at the wrong ones
};
// kinds: 0 to 9.
inline RoomVerdicts JudgeRooms(const std::vector<int>& kinds) {
  RoomVerdicts verdicts;
  for (const int kind : kinds) {
    SimulatedRoomOptions options;
    options.random_seed = 100 + kind;
    options.shading = kind % 2 == 1;
    if (kind == 2) options.blur_px = 3;
    if (kind == 3) options.photo_noise = 8;
    if (kind == 4) options.furnished = false;
    if (kind == 5) options.bare_walls = true;
    if (kind == 6) options.camera_model = "OPENCV_FISHEYE";
    if (kind == 7) options.range_noise = 0.006;
    if (kind == 8) options.bend = 0.005;
    if (kind == 9) options.exposure_range_ev = 3;
    const Exposed one(options);
    const GradientAgreement right = one.Judge(Similarity(), one.photos);
    verdicts.false_contradictions += right.contradicts;
    verdicts.supports += right.supports;
    const auto judge_wrong = [&](const GradientAgreement& judged) {
      EXPECT_FALSE(judged.supports) << kind;
      verdicts.false_supports += judged.supports;
      verdicts.contradictions += judged.contradicts;
    };
    judge_wrong(one.Judge(Turned(3, {1, 2, 3}), one.photos));
    judge_wrong(one.Judge(Moved({0.15, -0.1, 0.09}), one.photos));
    judge_wrong(one.Judge(Turned(180, {0, 1, 0}), one.photos));
    // A similar room: same size, same cameras' range, other walls and furniture.
    judge_wrong(one.Judge(Similarity(), Room(0).photos));
  }
  return verdicts;
}

}  // namespace roomtex
