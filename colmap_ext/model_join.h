#pragma once
// Sparse models in one frame as one.

#include <vector>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

// The first keeps its ids; of the others what is new gets free ones, where they are taken, and
// cameras with the same parameters are one. A photo (by name) that several hold is the first one's;
// points that only one other photo saw go with it.
SparseModel JoinModels(const std::vector<const SparseModel*>& models);

}  // namespace roomtex
