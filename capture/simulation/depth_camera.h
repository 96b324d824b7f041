#pragma once
// A room scanned by a depth camera that is carried around, its pictures put together: coarse,
// noisier with the square of the range, with holes, without thin things, and bent by the drift of
// the camera's tracking. Frames: `room`, `station` (x right, y up, z backward).

#include <optional>

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
    SceneHit hit;      // of what is shown: behind thin things the background
    double range = 0;  // as measured
  };
  // Along a ray of the room; nothing where the camera sees nothing.
  std::optional<Echo> Look(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                           double theta, double phi, RandomStream* random) const;
  // To where the drift has put a point that was measured in this direction.
  Eigen::Vector3d Drifted(const Eigen::Vector3d& x_in_station, double theta, double phi) const;

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
