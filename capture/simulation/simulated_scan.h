#pragma once
// The scanner in the simulated room (thesis 5.1.1). Frames: `room`, `station` (x right, y up, z
// backward).

#include <vector>

#include "capture/simulation/depth_camera.h"
#include "capture/simulation/room_scene.h"
#include "capture/simulation/scan_grid.h"
#include "capture/simulation/simulated_room_options.h"
#include "core/scan.h"

namespace roomtex {

struct ScanSample {
  bool missing = true;
  bool floats = false;           // between surfaces, where nobody would click
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
  ScanSample MeasureByDepthCamera(double theta, double phi, RandomStream* random) const;

  const SimulatedRoomOptions& options_;
  const RoomScene& scene_;
  int station_;
  Rigid room_from_station_;
  ScanGrid grid_;
  DepthCamera depth_camera_;
};

}  // namespace roomtex
