#pragma once
// Views of rooms that are alike in one half of what they show.

#include <functional>

#include "tests/colmap_ext/simulated_views.h"

namespace roomtex {

// Photos (image_id) of different rooms have in common what `is_common` says; the rest looks
// different in each room, at the same places. Takes away the matches that there are not.
inline void ShowLookalikeRooms(const std::function<int(uint32_t image_id)>& room_of,
                               const std::function<bool(const Eigen::Vector3d& x)>& is_common,
                               SimulatedViews* views) {
  for (DatabasePair& pair : views->pairs) {
    if (room_of(pair.image_id1) == room_of(pair.image_id2)) continue;
    const std::vector<int>& points = views->point_of_keypoint.at(pair.image_id1);
    std::vector<Eigen::Vector2i> kept;
    for (const Eigen::Vector2i& match : pair.matches) {
      const int point = points[static_cast<size_t>(match.x())];
      if (is_common(views->points_in_scene[static_cast<size_t>(point)])) kept.push_back(match);
    }
    pair.matches = kept;
  }
}

}  // namespace roomtex
