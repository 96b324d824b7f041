#pragma once
// The associated photos as two folders with the same names in both, for COLMAP and roomtex-texture.

#include <memory>
#include <string>
#include <vector>

#include "capture/association/associated_views.h"
#include "core/output_set.h"

namespace roomtex {

// Makes folder/patterned and folder/plain: per pair that is no spare a link named as the patterned
// photo in both, to the photo itself (a copy where the file system has no links), and
// folder/links.txt, the list of them. Whole or not at all. What an earlier run wrote is replaced;
// anything else in these folders is left alone and makes an InputError. To be committed by the
// caller.
std::shared_ptr<OutputSet> MakeLinks(const std::string& folder, const std::string& image_path,
                                     const std::vector<AssociatedPair>& pairs);
// So many links are in each of the two: the pairs that are no spares.
int NumLinks(const std::vector<AssociatedPair>& pairs);

}  // namespace roomtex
