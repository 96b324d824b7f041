#pragma once
// What a reconstruction and a user would find in the photos of the simulated room: sparse points
// with tracks, and clicks. Frames: `room`, `cam`, `img`, `scan` (simulated_room.h).

#include <optional>
#include <vector>

#include "capture/simulation/rolling_shutter.h"
#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_room_options.h"
#include "capture/simulation/simulated_scan.h"
#include "colmap_ext/sparse_model.h"
#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

// What the photos look at; everything must outlive it.
struct RoomPhotos {
  const SimulatedRoomOptions& options;
  const RoomScene& scene;
  const CameraProjection& camera;  // as told
  const CameraProjection& zoomed_camera;
  const std::vector<RowPoses>& poses;

  const CameraProjection& CameraOf(int photo) const {
    return options.IsZoomed(photo) ? zoomed_camera : camera;
  }

  // Position of a surface point in a photo that really sees it: in the image, from the front,
  // unoccluded.
  std::optional<Eigen::Vector2d> See(int photo, const Eigen::Vector3d& x_in_room,
                                     const Eigen::Vector3d& normal_in_room) const;
};

// See SimulatedRoom::MakeSparseModel. image_id = photo + 1.
SparseModel MakeRoomSparseModel(const RoomPhotos& photos, const Similarity& sparse_from_room,
                                int num_points, double noise_px);

// Scan samples at corners of things that the photo sees, in `img` without click noise; in no
// special order.
struct PickCandidate {
  Eigen::Vector2d x_in_img;
  Eigen::Vector3d x_in_scan;  // as measured
  double depth = 0;           // in `cam`
};
std::vector<PickCandidate> FindPickCandidates(const RoomPhotos& photos, const RoomScanner& scanner,
                                              const Rigid& room_from_station, int photo);

// `count` of them, far from each other in the photo and in depth.
std::vector<PickCandidate> SpreadPicks(const std::vector<PickCandidate>& candidates, int count,
                                       double photo_diagonal);

}  // namespace roomtex
