#include "colmap_ext/photo_groups.h"

#include <map>

#include "colmap_ext/view_graph.h"

namespace roomtex {

std::vector<std::set<uint32_t>> ConnectedPhotos(const MatchedImages& images,
                                                const std::set<uint32_t>& among, size_t fewest) {
  const std::vector<uint32_t> photos(among.begin(), among.end());
  std::map<uint32_t, int> place;
  for (const uint32_t id : photos) place.emplace(id, static_cast<int>(place.size()));
  DisjointSets sets(static_cast<int>(photos.size()));
  for (const DatabasePair& pair : images.pairs()) {
    const auto one = place.find(pair.image_id1), other = place.find(pair.image_id2);
    if (one != place.end() && other != place.end()) sets.Join(one->second, other->second);
  }
  std::vector<std::set<uint32_t>> groups;
  for (const std::vector<int>& group : sets.Groups()) {
    if (group.size() < fewest) continue;
    groups.emplace_back();
    for (const int i : group) groups.back().insert(photos[static_cast<size_t>(i)]);
  }
  return groups;
}

}  // namespace roomtex
