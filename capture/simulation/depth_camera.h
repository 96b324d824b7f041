#pragma once
// A room scanned by a depth camera that is carried around, its pictures put together: coarse,
// noisier with the square of the range, with holes, without thin things, and bent by the drift of
// the camera's tracking. Frames: `room`, `station` (x right, y up, z backward).

#include <optional>
#include <utility>

#include <Eigen/Core>

#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_room_options.h"
#include "core/random_stream.h"
#include "core/similarity.h"

namespace roomtex {

class DepthCamera {
 public:
  DepthCamera(const SimulatedRoomOptions& options, const RoomScene& scene, int station,
              const Rigid& room_from_station);

  struct Echo {
    SceneHit hit;        // of what is shown: behind thin things the background
    double range = 0;    // as measured
    bool mixed = false;  // of the nearest and the farthest surface on an edge
  };
  // Along a ray of the room; nothing where the camera sees nothing.
  std::optional<Echo> Look(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                           double theta, double phi, RandomStream* random) const;
  // The ray of the true room, in `station`, that shows what the drift has brought onto the ray of
  // this direction: origin and direction.
  std::pair<Eigen::Vector3d, Eigen::Vector3d> Undrifted(double theta, double phi) const;

 private:
  using Vector6d = Eigen::Matrix<double, 6, 1>;
  // Between -1 and 1 for the most part, mean square 1 / 2; changes over `waves` per turn.
  double Field(int purpose, double theta, double phi, double waves) const;
  Vector6d DriftAt(double theta, double phi) const;  // shift, turn; metres, radians

  const SimulatedRoomOptions& options_;
  const RoomScene& scene_;
  uint64_t seed_;
  // The motion that takes the drifted surfaces back onto the room best: the scan's frame is where
  // they lie there.
  Vector6d mean_drift_ = Vector6d::Zero();
};

}  // namespace roomtex
