#pragma once
// Rooms small enough for quick tests.

#include "capture/simulation/simulated_room.h"

namespace roomtex {

inline SimulatedRoomOptions SmallRoom() {
  SimulatedRoomOptions options;
  options.random_seed = 3;
  options.num_photos = 10;
  options.photo_width = 480;
  options.photo_height = 320;
  options.scan_columns = 480;
  options.scan_rows = 240;
  return options;
}

}  // namespace roomtex
