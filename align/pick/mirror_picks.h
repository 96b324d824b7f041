#pragma once
// An RTPI scan read with the other sense of its azimuths is its own mirror image.

#include <string>
#include <vector>

#include "align/pick/pick_scene.h"
#include "align/pick/session_pick.h"

namespace roomtex {

// Why the scans of the scene cannot be read the other way round, a sentence; "" = they can.
std::string MirrorProblem(const PickScene& scene);

// The same samples once the RTPI scans are read with the other azimuth. Where more of the points
// lie on the mirror image than on the scan (they are of a file that was made with it), they stay.
std::vector<SessionPick> MirrorPicks(const PickScene& scene, std::vector<SessionPick> picks);

}  // namespace roomtex
