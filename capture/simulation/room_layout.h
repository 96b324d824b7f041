#pragma once
// Which pieces of furniture a simulated room has, and where they stand. Frame: `room`.

#include <vector>

#include "capture/simulation/simulated_room_options.h"
#include "core/frames.h"

namespace roomtex {

enum class Piece { kTable, kSofa, kShelf, kSideboard, kFloorLamp, kPlant, kParcels };

struct PlacedPiece {
  Piece piece;
  // Room from piece. A table (its chairs about it) and what is round have their origin in the
  // middle, parcels at a corner; the others look along +y, with it at the foot of their back, in
  // the middle.
  Rigid at;
};

// As in all rooms of that size, or drawn by options.layout_seed: kinds, numbers and places, along
// the walls or free, none in another or before the door, nothing high before the window. What finds
// no place in a small room is left out.
std::vector<PlacedPiece> LayOut(const SimulatedRoomOptions& options);

}  // namespace roomtex
