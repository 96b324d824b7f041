#pragma once
// A part of a sparse model: what COLMAP makes of photos that nothing connects to the others.

#include <algorithm>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

// Photos of which `is_in` is true, with the points that two of them see.
template <typename IsIn>
SparseModel PartOf(const SparseModel& model, const IsIn& is_in) {
  SparseModel part = model;
  for (const auto& [id, image] : model.images) {
    if (!is_in(id)) part.images.erase(id);
  }
  for (const auto& [id, point] : model.points) {
    SparsePoint& left = part.points.at(id);
    const auto is_gone = [&](const TrackElement& element) { return !is_in(element.image_id); };
    left.track.erase(std::remove_if(left.track.begin(), left.track.end(), is_gone),
                     left.track.end());
    if (left.track.size() >= 2) continue;
    for (const TrackElement& element : left.track) {
      part.images.at(element.image_id).point3d_ids[element.point2d_index] = kInvalidPoint3dId;
    }
    part.points.erase(id);
  }
  return part;
}

}  // namespace roomtex
