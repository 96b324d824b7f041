#pragma once
// Corners of the scan's intensity where the photos show them (gradient_shift.h): what fixes each
// photo by itself, whatever sparse model and surface say of it.

#include <string>
#include <vector>

#include "align/trust/gradient_shift.h"
#include "align/trust/perspective_views.h"
#include "align/trust/scan_view.h"

namespace roomtex {

struct PhotoCorners {
  // Of photos that show many more corners shifted alike than by chance, these.
  std::vector<FittingCorner> corners;
  int num_photos = 0;  // with corners
};

// aligned: photos a few degrees from where they belong at most. They are read one by one (a few
// side by side), those that cannot be used are left out. max_photos: evenly taken from all, in the
// order of their names.
PhotoCorners FindPhotoCorners(const AlignedPhotos& aligned, const ScanViewer& viewer,
                              int max_photos, int num_threads);

}  // namespace roomtex
