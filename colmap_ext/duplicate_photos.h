#pragma once
// Photos that show the same from the same place as another of the model: copies of a file, bursts
// and brackets from a tripod. They say nothing new of where a model lies, but would count as if.

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "colmap_ext/sparse_model.h"

namespace roomtex {

// The photo that stays, by the image_id of each that it speaks for: their common points lie at the
// same positions of both (90 % of them to a pixel of 1500 in a row), and half of the points of
// either are common. Of such photos that with the first name stays, and all of `kept`
// (names). Images of rigs have no duplicates.
std::map<uint32_t, uint32_t> FindDuplicates(const SparseModel& model,
                                            const std::set<std::string>& kept);

// Adds them to the model that was made of the input without them (WithoutPhotos), each as far from
// its photo as in the input; scale: of that model in units of the input.
void PutDuplicatesBack(const SparseModel& input, const std::map<uint32_t, uint32_t>& duplicates,
                       double scale, SparseModel* model);

}  // namespace roomtex
