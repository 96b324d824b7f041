#pragma once
// Whether single photos show, window by window, what the others show at the same places of the
// scan. Keypoints of photos that were taken from far apart, along a wall or out of focus are not
// matched though all show the same; here the scan says where everything is to be seen, so that
// nothing has to be found again.

#include <cstdint>
#include <map>
#include <set>

#include "align/trust/perspective_views.h"
#include "align/trust/scan_view.h"

namespace roomtex {

// Of a photo: windows of the scan's surface where the other photos show some detail.
struct DetailAgreement {
  int num_windows = 0;
  int num_alike = 0;  // of these, where it shows the same: correlated by more than half

  double Share() const;  // NaN without windows
  // It shows what the others show, nearly everywhere.
  bool Agrees() const;
};

struct PhotoDetailOptions {
  int num_others = 48;      // photos that another is compared with, evenly taken from all
  int pixels_across = 400;  // of the views that are compared
};

// By image_id, of those in `asked` that are no panoramas and can be read. not_believed: photos that
// others are not compared with. Photos are read small, a few side by side, and kept as some 100 000
// cells each.
std::map<uint32_t, DetailAgreement> CompareDetail(
    const AlignedPhotos& aligned, const ScanViewer& viewer, const std::set<uint32_t>& asked,
    const std::set<uint32_t>& not_believed, const PhotoDetailOptions& options, int num_threads);

}  // namespace roomtex
