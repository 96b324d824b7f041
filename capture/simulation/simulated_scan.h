#pragma once
// The scanner in the simulated room (thesis 5.1.1). Frames: `room`, `station` (x right, y up, z
// backward).

#include <vector>

#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_room_options.h"
#include "core/scan.h"

namespace roomtex {

// The grid of a station: theta increases with the column over the full turn, phi falls with the
// row.
struct ScanGrid {
  int num_columns = 0, num_rows = 0;
  static constexpr double kMinPhiDeg = -60, kMaxPhiDeg = 75;

  double Theta(int column) const;
  double Phi(int row) const;
  // Thesis 5.1.1: x = sin(theta) cos(phi), y = sin(phi), z = -cos(theta) cos(phi).
  static Eigen::Vector3d Direction(double theta, double phi);
  // Index of the sample whose direction is nearest to that of a point in `station`, -1 outside the
  // grid.
  int Nearest(const Eigen::Vector3d& x_in_station) const;
};

struct ScanSample {
  bool missing = true;
  SceneHit hit;                  // where the ray met the room, without noise
  Eigen::Vector3d x_in_station;  // as measured
  float intensity = 0;           // 1..4095
};

class RoomScanner {
 public:
  RoomScanner(const SimulatedRoomOptions& options, const RoomScene& scene, int station,
              const Rigid& room_from_station);

  const ScanGrid& grid() const { return grid_; }
  // index = row * num_columns + column. The same sample whenever it is asked for.
  ScanSample Measure(int index) const;

 private:
  const SimulatedRoomOptions& options_;
  const RoomScene& scene_;
  int station_;
  Rigid room_from_station_;
  ScanGrid grid_;
};

}  // namespace roomtex
