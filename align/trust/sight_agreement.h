#pragma once
// What the photos' rays say about a start: from each photo to the points it shows, the scan's
// surface must be where the point is. A ray that passes through a surface cannot have been; one
// that ends in the air shows something that is not there any more, or a wrong start.

#include <vector>

#include "align/search/search_cloud.h"
#include "align/trust/free_space.h"
#include "core/similarity.h"

namespace roomtex {

struct SightAgreement {
  int num_agreeing = 0;  // the surface that the ray meets is where the point is
  int num_short = 0;     // it ends in the air, before any surface
  int num_through = 0;   // it passes through a surface
  int num_unseen = 0;    // it meets nothing that the scanner saw
  // Cells of the room, a metre each, that points were judged in, and those where most agree: what
  // the shares are worth, since rays to one thing are right or wrong together.
  int num_places = 0;
  double place_share = 0;  // mean over the places of the share of rays that agree

  int NumJudged() const { return num_agreeing + num_short + num_through; }
  double Share() const;         // num_agreeing / NumJudged(); 0 without any
  double ThroughShare() const;  // num_through / NumJudged(); 0 without any
  // Share() of what could be judged, with half of what nobody saw counted as not agreeing: a start
  // must not win by lying outside of the scan.
  double Score() const;
};

// tolerance: metres, beside what is unknown of a point and 1 % of its distance.
SightAgreement CheckSights(const SearchCloud& cloud, const Similarity& scan_from_sparse,
                           const FreeSpace& free_space, double tolerance);

}  // namespace roomtex
