#pragma once
// Photos that verified pairs connect.

#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

#include "colmap_ext/matched_images.h"

namespace roomtex {

// Groups of `among` (image_ids) that pairs between them connect, of at least `fewest` photos; the
// largest first, equal ones by their smallest image_id.
std::vector<std::set<uint32_t>> ConnectedPhotos(const MatchedImages& images,
                                                const std::set<uint32_t>& among, size_t fewest);

}  // namespace roomtex
