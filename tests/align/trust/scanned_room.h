#pragma once
// A simulated room and its scan, for tests of the planes.

#include <vector>

#include "align/surface/scan_planes.h"
#include "capture/simulation/simulated_room.h"

namespace roomtex {

inline SimulatedRoomOptions RoomOptions(int seed) {
  SimulatedRoomOptions options;
  options.random_seed = seed;
  options.num_photos = 1;
  options.photo_width = options.photo_height = 64;
  options.scan_columns = 1200;
  options.scan_rows = 600;
  return options;
}

struct ScannedRoom {
  explicit ScannedRoom(const SimulatedRoomOptions& given) : options(given) {
    const SimulatedRoom room(options);
    scan_from_room = room.ScanFromRoom();
    for (int i = 0; i < options.num_stations; ++i) scans.push_back(room.MakeScan(i));
  }
  SimulatedRoomOptions options;
  Rigid scan_from_room;
  std::vector<Scan> scans;
};

inline const ScannedRoom& FurnishedRoom() {
  static const ScannedRoom room(RoomOptions(0));
  return room;
}
inline const std::vector<ScanPlane>& PlanesOfFurnishedRoom() {
  static const std::vector<ScanPlane> planes =
      FindScanPlanes(FurnishedRoom().scans, ScanPlaneOptions(), -1);
  return planes;
}

}  // namespace roomtex
