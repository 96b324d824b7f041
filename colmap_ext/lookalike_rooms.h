#pragma once
// Photos of several rooms that are alike (the same wallpaper, the same furniture: hotels, offices)
// in one model: matching folds the rooms onto each other. What they have in common lies right; what
// they have not, the photos of one room find in each other and not in those of the other, though
// these ought to show it (expected_sightings.h).

#include <cstdint>
#include <set>
#include <vector>

#include "colmap_ext/expected_sightings.h"
#include "colmap_ext/sparse_model.h"

namespace roomtex {

struct LookalikeRooms {
  // Photos of each by image_id, the largest first; a single one where nothing speaks for more.
  std::vector<std::set<uint32_t>> rooms;
  // Of what photos ought to show they show so much: those of one room, those of two; medians over
  // pairs of the split that was the hardest to tell. NaN for a single room.
  double share_within = 0, share_between = 0;
};

// expected: of this model, for all of its photos. Rooms of fewer than four photos are not looked
// for.
LookalikeRooms FindLookalikeRooms(const SparseModel& model, const ExpectedSightings& expected);

}  // namespace roomtex
