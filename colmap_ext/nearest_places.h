#pragma once
// The nearest of many places on a plane, without comparing each with all.

#include <array>
#include <vector>

namespace roomtex {

using Place = std::array<double, 2>;  // metres, finite

// The `count` nearest other places of every place, as positions in `places`: nearest first, equally
// near ones by their position. Costs n log n (a k-d tree; equal places count once).
std::vector<std::vector<int>> NearestPlaces(const std::vector<Place>& places, int count);

}  // namespace roomtex
