#pragma once
// The report's `search`: where a start without clicks came from, what else fitted, and what speaks
// for it.

#include "align/automatic_alignment.h"
#include "align/found_photos.h"
#include "core/report.h"

namespace roomtex {

Json SearchToJson(const AutomaticAlignment& found);
// Of photos without a sparse model.
Json FoundPhotosToJson(const FoundPhotos& found);

}  // namespace roomtex
