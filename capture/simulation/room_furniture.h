#pragma once
// Walls, floor, ceiling and what stands and hangs in the simulated room. Frame: `room`
// (simulated_room.h).

#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_room_options.h"

namespace roomtex {

// Adds everything that the options ask for; the scene is not yet finished.
void FurnishRoom(const SimulatedRoomOptions& options, RoomScene* scene);

}  // namespace roomtex
