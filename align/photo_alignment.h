#pragma once
// One to a few photos into the scan without a sparse model: each by its own picks, or by what it
// shows of the scan's intensity.

#include <map>
#include <string>
#include <vector>

#include "align/alignment.h"
#include "align/clicks/photo_model.h"
#include "align/found_photos.h"

namespace roomtex {

struct PhotoAlignment {
  // The photos that have a pose, their cameras as given or found, and the picks as points, in
  // `scan`: the answer.
  SparseModel model;
  // As much of it as there is: start.picks, picks' numbers, placement, photo_sigmas, expected_error
  // at the cameras, warnings, reasons. There is no similarity.
  Alignment alignment;
  struct Lens {
    FocalSource source = FocalSource::kGiven;
    double focal_sigma = 0;   // of the mean focal length, pixels; 0 = given
    double radial_sigma = 0;  // of the radial term; 0 = given or none
  };
  std::map<uint32_t, Lens> lenses;  // by image_id
  std::vector<std::string> notes;   // what was found of the lenses
};

// Photos by their picks, and those with too few by what was found of them. input.model:
// photos.model. Throws InputError for picks that fix no photo, Contradiction for picks that are
// exchanged, not on the scan, or show that the scan is mirrored.
PhotoAlignment AlignPhotos(const AlignmentInput& input, const PhotoModel& photos,
                           const FoundPhotos& found, const AlignmentOptions& options,
                           Progress* progress);

// input.model: photos.model, input.picks: found.picks.
PhotoAlignment AlignFoundPhotos(const AlignmentInput& input, const PhotoModel& photos,
                                const FoundPhotos& found, const TrustOptions& trust);

// Each point of the model takes the colour of a photo that sees it.
void ColorPoints(const std::string& image_path, SparseModel* model);

}  // namespace roomtex
