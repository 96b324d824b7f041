#pragma once
// What single photos say of the starts: each is placed in the scan by itself (found_photos.h),
// without the sparse model. Where several of them stand to each other as they do in the model, the
// model is there, and neither geometry nor corners had a part in it.

#include "align/alignment_input.h"
#include "align/found_photos.h"
#include "align/start_search.h"
#include "core/progress.h"

namespace roomtex {

struct PlacedPhotoOptions {
  // Photos that are asked one after the other until they are enough, all of them over all of the
  // model, and the first ones, too; if none of these has a place, no more are asked.
  int num_first = 8, num_all = 24;
  // So many must agree, and at most this share of them may be placed elsewhere. Larger = stricter;
  // larger = more tolerant.
  int min_agreeing = 3;
  double max_share_elsewhere = 0.34;
  // Metres and degrees between where a photo is placed and where the others have it, that still
  // agree. Larger = more tolerant.
  double same_place = 0.3, same_turn_deg = 4;
  FoundPhotoOptions photo;

  // Where the model is asked for, a photo with little to say is passed over: of the 29 photos of
  // kitchen and desk that are placed all but one have 5 cells and more.
  PlacedPhotoOptions() { photo.finder.min_cells_of_views = 5; }
};

// Whether the photos that agree are enough, and show more than one object.
bool StandsOut(const PlacedPhotoEvidence& evidence, const PlacedPhotoOptions& options);

// Fills StartSearch::placed_photos, unless it is known already, and adds a start where they agree
// (AddStartThatLooksAlike). Does nothing without photos.
void AskPhotosAlone(const AlignmentInput& input, const AlignmentOptions& options,
                    const PlacedPhotoOptions& placed, Progress* progress, StartSearch* search);

}  // namespace roomtex
