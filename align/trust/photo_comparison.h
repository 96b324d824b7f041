#pragma once
// Photos against photos, at the samples of the scan that they see from where they were aligned:
// what neither picks nor sparse points can tell (core/photo_agreement.h). The scan's intensity says
// the same where it shows anything; a bare room has none.

#include <string>

#include "align/trust/perspective_views.h"
#include "align/trust/scan_view.h"
#include "core/photo_agreement.h"

namespace roomtex {

struct PhotoComparisonOptions {
  int num_photos = 48;      // evenly taken from all, in the order of their names
  int num_samples = 40000;  // of the scans, evenly taken
  // Of the views that are compared: coarse, so that poses that are some centimetres off still show
  // the same.
  int pixels_across = 200;
};

// Photos are read one by one (a few side by side), small; those that cannot be used are left out.
PhotoComparison ComparePhotosOnScan(const AlignedPhotos& aligned, const ScanViewer& viewer,
                                    const PhotoComparisonOptions& options, int num_threads);

}  // namespace roomtex
