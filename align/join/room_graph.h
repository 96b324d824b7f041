#pragma once
// All rooms in as few frames as their links allow, and which of it to believe. Rooms are the nodes,
// links the edges of a pose graph (Grisetti et al. 2010, "A tutorial on graph-based SLAM"); loops
// over several rooms close, or one of their links is wrong.

#include <optional>
#include <string>
#include <vector>

#include "align/join/room_links.h"

namespace roomtex {

// Rooms one after the other, back to the first, and how far the way around misses it.
struct RoomLoop {
  std::vector<int> rooms;
  std::vector<int> links;  // between each room and the next, the last one closes the loop
  Misfit misfit;
};

struct LinkVerdict {
  bool trusted = true;
  std::string reason;            // a sentence, "" when trusted
  std::optional<Misfit> misfit;  // from the places of its rooms; none if nothing but it holds them
  std::optional<double> tilt;    // radians between the vertical of both, if their scans tell it
  std::vector<std::string> notes;  // sentences on single views that do not agree
};

struct RoomPlace {
  int frame = 0;          // the room in whose scan frame it stands, itself if nothing links it
  Rigid frame_from_room;  // both `room`
  // At most, amid the room's photos: standard deviations along and about an axis.
  double position_sigma = 0, rotation_sigma = 0;
  bool trusted = true;  // links that are trusted lead to its frame
};

struct RoomGraph {
  std::vector<RoomPlace> places;      // by room
  std::vector<LinkVerdict> verdicts;  // by link
  std::vector<RoomLoop> loops;        // the shortest one over each link that lies on any
};

// registered: the scans of all rooms lie in one frame as they are; links are only compared with
// that.
RoomGraph PlaceRooms(const std::vector<RoomRecord>& rooms, const std::vector<RoomLink>& links,
                     bool registered);

}  // namespace roomtex
