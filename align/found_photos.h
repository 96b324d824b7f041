#pragma once
// Where photos were taken that have neither a sparse model nor the picks for a pose: each alone, by
// what it shows of the scan's intensity (align/trust/photo_finder.h), and whether that is to be
// believed. A few picks, or a place that it shows, say which places are in question.

#include <functional>
#include <string>
#include <vector>

#include "align/clicks/photo_model.h"
#include "align/clicks/pick_view.h"
#include "align/clicks/picks.h"
#include "align/search/search_hint.h"
#include "align/surveyed_scans.h"
#include "align/trust/photo_finder.h"
#include "align/trust/trust.h"
#include "core/progress.h"

namespace roomtex {

struct FoundPhotoOptions {
  PhotoFinderOptions finder;
  // Places of the scan, in cells of 15 cm, that photo and scan have in common: at least so many,
  // and so many times those of the next best place. Larger = stricter. Counted: docs/automatic.md.
  int min_cells = 25;
  double min_ratio = 1.5;
  // Of the cells in which anything could be compared, the share that agrees: a room of the same
  // plan has some of the same furniture. Larger = stricter.
  double min_share = 0.4;
  // One standard deviation, as a share: a focal length that is less certain (nobody says it) is as
  // good as another one, with the photo taken from elsewhere.
  double max_focal_sigma = 0.01;
  // Features of one part of a scan are off together: errors are so many times what the residuals
  // say, and besides that so many metres and degrees. Measured: docs/automatic.md.
  double formal_times = 5;
  double scan_sigma = 0.02, scan_sigma_deg = 0.7;
};

struct PhotoEvidence {
  std::string image_name;
  int num_cells = 0, num_cells_second = 0;  // at the best place and at the next one
  double share = 0;                         // SeenPlace::share of the best place
  std::string problem;                      // why it has no pose, a clause; "" if it has one
};
struct FoundPhotos {
  std::vector<PhotoEvidence> photos;  // all that were asked, in the order of their ids
  int num_places = 0;                 // that were looked at
  // Of those that have a pose: what they have in common with the scan, and their poses.
  std::vector<Pick> picks;
  std::vector<PickView> views;
};
// What a user says of some of the photos.
struct PhotoHints {
  std::vector<Pick> picks;
  std::vector<NearHint> near;
};
// photos: those of image_path, asked in the order of their ids, until `enough` says so of what was
// found up to there. Photos that are not read (PhotoModel, UnfitPhotos::kTaken) are left out
// without a word.
FoundPhotos FindPhotos(const PhotoModel& photos, const SurveyedScans& surveyed,
                       const std::string& image_path, const PhotoHints& hints,
                       const FoundPhotoOptions& options, const TrustOptions& trust, int num_threads,
                       Progress* progress,
                       const std::function<bool(const FoundPhotos&)>& enough = {});

}  // namespace roomtex
