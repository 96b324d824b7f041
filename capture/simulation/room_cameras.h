#pragma once
// Where the cameras and the scanner stand in the simulated room, and how long the shutter is open.
// Frames: `room`, `cam`, `station` (simulated_room.h).

#include <vector>

#include "capture/simulation/room_scene.h"
#include "capture/simulation/simulated_room_options.h"
#include "core/camera_model.h"
#include "core/similarity.h"

namespace roomtex {

class ProjectedLight;

// camera_id 1. options.camera_model must be one of COLMAP's.
Camera MakeRoomCamera(const SimulatedRoomOptions& options);

// cam_from_room of every photo: an oval of cameras that look across the room, alternately low and
// high, clear of the furniture; then those of the second room and those taken on the way through
// the door, where there is one.
std::vector<Rigid> PlaceCameras(const SimulatedRoomOptions& options, const RoomScene& scene);

// room_from_station: y up, turned about it; the first is level, the others nearly.
std::vector<Rigid> PlaceStations(const SimulatedRoomOptions& options, const RoomScene& scene);

// Exposure of every photo in EV (thirds, 0 = nominal): random, but not so long that much of it
// burns out.
std::vector<double> ChooseExposures(const SimulatedRoomOptions& options, const RoomScene& scene,
                                    const Camera& camera, const std::vector<Rigid>& cam_from_room);

// The longest exposure (EV, thirds, -6 to 2) at which next to nothing burns out, room light and
// projected light together. projected may be null.
double MeterExposure(const RoomScene& scene, const ProjectedLight* projected, const Camera& camera,
                     const Rigid& cam_from_room);

}  // namespace roomtex
