#pragma once
// Photos whose rows are read one after the other while a hand moves the camera. Frames: `room`,
// `cam`, `img`.

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "capture/simulation/simulated_room_options.h"
#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

// Where a photo is taken from, row by row: turned and moved evenly.
struct RowPoses {
  Rigid cam_from_room;  // when the middle of the photo is read
  // From the first row to the last one, in `cam`: rotation vector, metres. Zero = all at once.
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), shift = Eigen::Vector3d::Zero();

  // The row read at share s, from -1/2 to 1/2: RowShare().
  Rigid At(double row_share) const;
  // Where the photo shows a point, in the image or beyond it: the row that sees it while it is
  // read. None where the camera gives no position, or the motion is too fast to say.
  std::optional<Eigen::Vector2d> Project(const CameraProjection& camera,
                                         const Eigen::Vector3d& x_in_room) const;
};

// One per pose; random directions at the speeds of the options.
std::vector<RowPoses> MoveByHand(const SimulatedRoomOptions& options,
                                 const std::vector<Rigid>& cam_from_room);

}  // namespace roomtex
